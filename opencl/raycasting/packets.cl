// The picture of raycasting/raycast.cl from a view that is turned far from V_O, a packet of sixteen
// rays in a work-item (docs/decisions/packets.md).
//
// A packet's rays cross the same lists, if not at the same depth. The work-item sweeps over the
// lists along one axis of V_O's window, p, from where its first ray begins: in each column of
// lists, list by list along the other axis, q, all rays that cross the list go on through it
// together, while rays that are ahead wait. So each list and each supersegment is loaded once for
// the packet. What a ray does is the same as in raycasting/walk.cl, whatever the others do.
//
// What the occupancy grid says is empty is passed by where there are masks; the picture is the
// same.
#define LANES 16
#define CROPPED 0
#include "lib/transpose.cl"
typedef int Steps;
typedef float Border;
#include "raycasting/ray.cl"
#include "raycasting/stepping.cl"
#include "raycasting/supersegments.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

#define NOWHERE INT_MAX

// The least of those that are chosen, NOWHERE if none is.
inline int least_of(Int x, Int chosen) { return least_lane(select((Int)(NOWHERE), x, chosen)); }

// A packet's pixels lie along the image of the line that its rays share in V_O's window: an
// epipolar line. Rays of one plane through both eyes cross the same lists, one after another.
// `epipole` is where V_N sees V_O's eye: homogeneous pixel offsets along the strips' width, across
// it, and their denominator. A strip is LANES pixels wide; its packets are numbered by where they
// meet that of its edges that is farther from the epipole, from before the window on. Lines draw
// together towards the epipole: a pixel may be in two packets or more, whose numbers follow one
// another, and is in one at least.
inline Int across_strip(int first, int number, int along_size, int across_size, float4 epipole)
{
    const float first_offset = (float)first + 0.5f - 0.5f * (float)along_size;
    const float to_first = epipole.x - first_offset * epipole.z;
    const float to_last = epipole.x - (first_offset + (float)(LANES - 1)) * epipole.z;
    const bool last_is_farther = fabs(to_last) > fabs(to_first);
    const float farther = last_is_farther ? to_last : to_first;
    const float nearer = last_is_farther ? to_first : to_last;
    float slope = 0.0f;
    if (farther * nearer > 0.0f && fabs(nearer) > (float)LANES * fabs(epipole.z)) {
        // By a product: what is rounded must still not grow, or a pixel would be left out
        const float offset = (float)number + 0.5f - 0.5f * (float)across_size;
        slope = clamp((epipole.y - offset * epipole.z) * (1.0f / farther), -STEEPEST, STEEPEST);
    }
    return number + convert_int16_rte(
                        slope * convert_float16(LANE_NUMBERS - (last_is_farther ? LANES - 1 : 0)));
}

// Of u's and v's, that of p and that of q; and of p's and q's, those of u and v
#define FIRST_OF(of_u, of_v) (sweep_v ? (of_v) : (of_u))
#define SECOND_OF(of_u, of_v) (sweep_v ? (of_u) : (of_v))

// How far the rays have come.
typedef struct {
    Int p, q; // places of their lists; p is NOWHERE if they have ended
    Real r;
    Real depth; // in their sense, see raycasting/first_supersegment.cl
} Progress;

// The supersegment that each ray has met last and that is not composited yet: that takes as long
// for one ray as for all, and few of them are in the same supersegment at a time.
typedef struct {
    Int waits; // rays that have one
    Real near, far, r,
        r_next; // its faces in their sense, and from where to where they cross the list
    Real4 medium;
} Met;

// Composite what waits.
inline void composite_met(Seen *seen, Met *met, const ListRay *rays, const Sense *sense)
{
    Real from, to;
    clip_to_faces(&from, &to, sense, met->near, met->far, met->r, met->r_next,
                  depth_at(sense, met->r), depth_at(sense, met->r_next));
    composite_medium(seen, met->medium.w * length_between(rays, from, to), met->medium, met->waits);
    met->waits = 0;
}

// Where rays enter (.x) and leave (.y) the n-th supersegment that they come to.
#define FACE_MET(n) face_in_sense(lists, list, INDEX_MET(list, n, away), away, depths)

// Follow the rays that are `going`, which step the same way, through all lists that they cross.
__attribute__((always_inline)) inline void sweep(Seen *seen, const ListRay *rays, const Axis *p,
                                                 const Axis *q, Int going, Int first_p, Int first_q,
                                                 bool away, const Lists *lists, bool sweep_v)
{
    const Sense sense = sense_of(rays->along.z, rays->deep.z, away);
    const Depths depths = rays->depths;
    const Real r_end = rays->r_begin + 1.0f;
    Met met;
    met.waits = 0;
    met.near = met.far = met.r = met.r_next = met.medium.x = met.medium.y = met.medium.z =
        met.medium.w = 0.0f;
    Progress now;
    now.p = select((Int)(NOWHERE), first_p * p->step, going);
    now.q = first_q * q->step;
    now.r = rays->r_begin;
    now.depth = sense.sign * rays->start.z;
    int n = 0;             // the supersegment that the last list was left at
    Int new_stack = going; // lanes in a stack that they have not looked at
    for (int place_p = least_lane(now.p); place_p != NOWHERE; place_p = least_lane(now.p)) {
        const int P = place_p * p->step;
        Int column = now.p == place_p;
        const Int looks = column && new_stack;
        if (lists->masks && ANY(looks)) {
            new_stack = new_stack && !looks;
            Int next_p = P, next_q = now.q * q->step, goes_on = looks;
            skip_empty_cells(&next_p, &next_q, &now.r, &now.depth, &goes_on, looks, p, q, &sense,
                             lists, r_end, depths);
            now.p = select(now.p, select((Int)(NOWHERE), next_p * p->step, goes_on), looks);
            now.q = select(now.q, next_q * q->step, looks);
            column = now.p == place_p;
        }
        const Real r_p = CROSSINGS(p, (Real)(P));
        // By the columns before: where a ray goes does not wait for what it sees in this one
        const Int dark = seen->sums.w < lists->frame.cutoff;
        if (!ANY(column))
            continue;
        for (int place_q = least_of(now.q, column);; ++place_q) {
            const Int here = column && now.q == place_q;
            if (!ANY(here))
                continue;
            // They cross list (P, Q) from now.r to r_next
            const int Q = place_q * q->step;
            const Real r_q = CROSSINGS(q, (Real)(Q));
            const Real r_next = HIGHER_OF(now.r, LOWER_OF(r_end, LOWER_OF(r_p, r_q)));
            const Real next_depth = depth_at(&sense, r_next);

            const List list = list_at(lists, FIRST_OF(P, Q), SECOND_OF(P, Q));
            n = min(n, list.count);
            while (n > 0 && ANY(here && FACE_MET(n - 1).y > now.depth))
                --n;
            for (int k = n; k < list.count; ++k) {
                const float near = FACE_MET(k).x;
                const Int come_to = here && near <= next_depth;
                if (!ANY(come_to))
                    break;
                const float far = FACE_MET(k).y;
                const Int meet = come_to && far > now.depth;
                if (!ANY(meet)) {
                    n = k + 1;
                    continue;
                }
                if (ANY(meet && met.waits))
                    composite_met(seen, &met, rays, &sense);
                const float4 medium = medium_of(lists, list, INDEX_MET(list, k, away));
                met.near = select(met.near, (Real)(near), meet);
                met.far = select(met.far, (Real)(far), meet);
                met.r = select(met.r, now.r, meet);
                met.r_next = select(met.r_next, r_next, meet);
                met.medium.x = select(met.medium.x, (Real)(medium.x), meet);
                met.medium.y = select(met.medium.y, (Real)(medium.y), meet);
                met.medium.z = select(met.medium.z, (Real)(medium.z), meet);
                met.medium.w = select(met.medium.w, (Real)(medium.w), meet);
                met.waits = met.waits || meet;
            }
            const Int steps_p = here && r_p <= r_q;
            const Int steps_q = here && !(r_p <= r_q);
            Int ends = here && (r_next >= r_end || dark);
            ends = ends || (P + p->step < 0 || P + p->step >= p->lists ? steps_p : (Int)(0));
            ends = ends || (Q + q->step < 0 || Q + q->step >= q->lists ? steps_q : (Int)(0));
            now.r = select(now.r, r_next, here);
            now.depth = select(now.depth, next_depth, here);
            now.p = select(select(now.p, (Int)(place_p + 1), steps_p), (Int)(NOWHERE), ends);
            now.q = select(now.q, (Int)(place_q + 1), steps_q);
            column = now.p == place_p;
            const bool goes_on = ANY(column); // here, where it is one instruction, as the
                                              // comparison has just made a mask
            if (((P + p->step) ^ P) >> STACK_SHIFT)
                new_stack = new_stack || steps_p;
            if (((Q + q->step) ^ Q) >> STACK_SHIFT)
                new_stack = new_stack || steps_q;
            if (!goes_on)
                break;
        }
    }
    composite_met(seen, &met, rays, &sense);
}

KERNEL_OF_LANES void raycast_packets(
    VDI_PARAMETERS,
    float4 epipole, // see across_strip
    int sweep_v,    // whether p is v, not u
    int upright,    // whether packets stand on end in the window of V_N
    int4 part,      // of the window: first strip, how many, number of each strip's first packet
    __global float4 *image)
{
    const int along_size = upright ? frame.height : frame.width,
              across_size = upright ? frame.width : frame.height;
    // Strips lie side by side in blocks of LANES packets, so that what is close in the window is
    // close in time
    const int item = (int)get_global_id(0);
    const int block = item / LANES;
    const int first = (part.x + block % part.y) * LANES;
    const int number = part.z + block / part.y * LANES + item % LANES;
    const Int along = first + LANE_NUMBERS;
    const Int across = across_strip(first, number, along_size, across_size, epipole);
    // A pixel of two packets is the former's: how it is rounded depends on what the packet's other
    // rays meet
    const Int is_own = across != across_strip(first, number - 1, along_size, across_size, epipole);
    const Int in_window = is_own && along < along_size && across >= 0 && across < across_size;
    if (!ANY(in_window))
        return;
    const Int x = upright ? across : along, y = upright ? along : across;
    const Int pixels = places_in_picture(x, y, in_window, frame.width, frame.height);
    ListRay rays;
    begin_ray(&rays, forms, &frame, offsets_from_middle(x, frame.width),
              offsets_from_middle(y, frame.height), opaque_ends(pixels, opaque_depth), in_window);
    const Lists lists = LISTS_OF_PARAMETERS;
    Seen seen = nothing_seen();
    Axis p = axis_of(FIRST_OF(rays.along.x, rays.along.y), FIRST_OF(rays.deep.x, rays.deep.y),
                     FIRST_OF(frame.lists_wide, frame.lists_high),
                     FIRST_OF(1, STACKS_ALONG(frame.lists_wide)));
    Axis q = axis_of(SECOND_OF(rays.along.x, rays.along.y), SECOND_OF(rays.deep.x, rays.deep.y),
                     SECOND_OF(frame.lists_wide, frame.lists_high),
                     SECOND_OF(1, STACKS_ALONG(frame.lists_wide)));
    const Int first_p = list_index(&p, FIRST_OF(rays.start.x, rays.start.y), 0);
    const Int first_q = list_index(&q, SECOND_OF(rays.start.x, rays.start.y), 0);
    // Rays that step the same way go on together: nearly always, all
    const Int ways = (rays.away & 1) | ((p.along > 0.0f) & 2) | ((q.along > 0.0f) & 4);
    for (Int waiting = rays.present; ANY(waiting);) {
        const int way = least_of(ways, waiting);
        const Int going = waiting && ways == way;
        waiting = waiting && !going;
        take_step(&p, (way & 2) != 0);
        take_step(&q, (way & 4) != 0);
        if (way & 1)
            sweep(&seen, &rays, &p, &q, going, first_p, first_q, true, &lists, sweep_v);
        else
            sweep(&seen, &rays, &p, &q, going, first_p, first_q, false, &lists, sweep_v);
    }
    store_fours(image, pixels, composited(&seen));
}
