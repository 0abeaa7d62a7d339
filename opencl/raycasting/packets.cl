// VDI to image from a view that is turned far from V_O: what raycasting/raycast.cl does, for packets of rays (raycasting/packet.cl).
//
// A packet's rays cross the same lists, if not at the same depth. The work-item sweeps over the lists along one axis of V_O's
// window, p, from where its first ray begins: in each column of lists, list by list along the other axis, q, all rays that
// cross the list go on through it together, while rays that are ahead wait. So each list and each supersegment is loaded
// once for the packet. What a ray does is the same as in raycasting/raycast.cl, whatever the others do.
//
// -D SWEEP_V            p is v, not u
// -D UPRIGHT            packets stand on end in the window of V_N
// -D SKIP_EMPTY         as in raycasting/raycast.cl: the picture is the same to the last bit
// -D OFFSET_T, PARALLEL, SHIFTED, PACKED, COMPENSATED (1)    as there
#define LANES 16
#include "raycasting/lists.cl"
#include "raycasting/packet_light.cl"
#include "raycasting/slabs_ahead.cl"
#pragma OPENCL FP_CONTRACT OFF


// Of u's and v's, that of p and that of q; and of p's and q's, those of u and v
#ifdef SWEEP_V
#define FIRST_OF(of_u, of_v) (of_v)
#define SECOND_OF(of_u, of_v) (of_u)
#else
#define FIRST_OF(of_u, of_v) (of_u)
#define SECOND_OF(of_u, of_v) (of_v)
#endif

// One axis of V_O's window. A place along it is the index of a list times `step`: it grows along the rays.
typedef struct {
    Reals start, along, deep;
    Reals zero, inverse; // of crossings, see there
    int lists;
    int step;            // 1 or -1: all lanes that go on together have the same
    float middle, border; // half of the lists, and from a list's index to its border ahead
} Axis;

inline Axis axis_of(Reals start, Reals along, Reals deep, int lists)
{
    Axis axis;
    axis.start = start;
    axis.along = along;
    axis.deep = deep;
    // By a component that does not change, borders are crossed at infinity
    axis.zero = select((Reals)(-INFINITY), deep, along != 0.0f);
    axis.inverse = select((Reals)(1.0f), 1.0f / along, along != 0.0f);
    axis.lists = lists;
    axis.middle = 0.5f * (float)lists;
    return axis;
}

inline void take_step(Axis *axis, bool upwards)
{
    axis->step = upwards ? 1 : -1;
    axis->border = (upwards ? 1.0f : 0.0f) - axis->middle;
}

// Where the rays leave the lists of an index: from the border's number, never accumulated.
inline Reals crossings(const Axis *axis, Reals index)
{
    return ((index + axis->border) - axis->zero) * axis->inverse;
}

inline Reals crossings_of(const Axis *axis, Ints index)
{
    return crossings(axis, convert_float16(index));
}

// How far the rays have come.
typedef struct {
    Ints p, q; // places of their lists; p is NOWHERE if they have ended
    Reals r;
    Reals depth; // in their sense, see raycasting/lists.cl
} Progress;

#ifdef SKIP_EMPTY
// The index of the list that stepping from `index` would have reached at r_until; see raycasting/raycast.cl.
inline Ints index_reached(const Axis *axis, Ints index, int edge, Reals r_until)
{
    Ints reached = convert_int16(floor(fma(r_until, axis->along, axis->deep) + axis->middle));
    reached = axis->step > 0 ? clamp(reached, index, (Ints)(edge + 1)) : clamp(reached, (Ints)(edge - 1), index);
    const Ints too_far = reached != index && crossings_of(axis, reached - axis->step) > r_until;
    const Ints farther = !too_far && crossings_of(axis, reached) <= r_until;
    reached += select((Ints)(0), (Ints)(axis->step), farther) - select((Ints)(0), (Ints)(axis->step), too_far);
    return select(index, reached, axis->along != 0.0f);
}

inline int tile_edge(const Axis *axis, int tile)
{
    return axis->step > 0 ? tile << TILE_SHIFT | (TILE - 1) : tile << TILE_SHIFT;
}

// Pass by what is empty for the lanes that look, which are in column P; a lane that comes to another tile is `fresh` there.
inline void pass_by(Progress *now, Ints *fresh, Ints looks, int P, const Packet *packet, const Axis *p, const Axis *q,
                    Reals inverse_depth, float sense, bool away, __global const ulong *masks, int tiles_wide, float first_depth,
                    float slabs_per_depth, float depth_origin)
{
    const int tile_p = P >> TILE_SHIFT;
    const Reals along_depth = sense * packet->along_z;
    const Reals deep_depth = sense * packet->deep_z;
    while (ANY(looks)) {
        // Those in one tile; there is seldom a second one
        const int tile_q = least_of(now->q, looks) * q->step >> TILE_SHIFT;
        const Ints index_q = now->q * q->step;
        const Ints here = looks && index_q >> TILE_SHIFT == tile_q;
        looks = looks && !here;
        const ulong mask = masks[SECOND_OF(tile_p, tile_q) * tiles_wide + FIRST_OF(tile_p, tile_q)];
        const Reals offsets = depth_offset(sense * now->depth, depth_origin);
        const Ints slab = convert_int16(clamp((offsets - first_depth) * slabs_per_depth, 0.0f, (float)(SLABS - 1)));
        Ints nothing;
        const Ints nearest = nearest_slabs((uint16)((uint)mask), (uint16)((uint)(mask >> HALF_SLABS)), slab, away, &nothing);
        const Ints passes = here && (nothing || nearest != slab);
        if (!ANY(passes))
            continue;
        const int edge_p = tile_edge(p, tile_p);
        const int edge_q = tile_edge(q, tile_q);
        const Reals faces = first_depth + convert_float16(away ? nearest : nearest + 1) / slabs_per_depth;
        const Reals r_face = (sense * depth_coordinate(faces, depth_origin) - deep_depth) * inverse_depth;
        Reals r_until = LOWER_OF(crossings(p, (Reals)(edge_p)), crossings(q, (Reals)(edge_q)));
        r_until = select(r_until, LOWER_OF(r_until, r_face), !nothing && along_depth != 0.0f);
        const Ints next_p = index_reached(p, (Ints)(P), edge_p, r_until);
        const Ints next_q = index_reached(q, index_q, edge_q, r_until);
        Reals r = now->r;
        r = select(r, HIGHER_OF(r, crossings_of(p, next_p - p->step)), next_p != P);
        r = select(r, HIGHER_OF(r, crossings_of(q, next_q - q->step)), next_q != index_q);
        const Ints moves = passes && (next_p != P || next_q != index_q);
        now->r = select(now->r, r, moves);
        now->depth = select(now->depth, fma(r, along_depth, deep_depth), moves);
        const Ints ends = r_until >= packet->r_begin + 1.0f || next_p < 0 || next_p >= p->lists || next_q < 0 ||
                          next_q >= q->lists;
        now->q = select(now->q, next_q * q->step, passes);
        now->p = select(now->p, select(next_p * p->step, (Ints)(NOWHERE), ends), passes);
        const Ints enters = passes && !ends && ((next_p ^ P) | (next_q ^ index_q)) >> TILE_SHIFT != 0;
        looks = looks || (enters && next_p == P);
        *fresh = *fresh || (enters && next_p != P);
    }
}
#endif

// The supersegment that each ray has met last and that is not composited yet: that takes as long for one ray as for all, and
// few of them are in the same supersegment at a time.
typedef struct {
    Ints waits; // rays that have one
    Reals near, far, r, r_next; // its faces in their sense, and from where to where they cross the list
    Reals red, green, blue, extinction;
} Met;

// Composite what waits.
inline void composite_met(Seen *seen, Met *met, const Packet *packet, Reals along_depth, Reals deep_depth, Reals inverse_depth)
{
    const Reals depth = fma(met->r, along_depth, deep_depth);
    const Reals next_depth = fma(met->r_next, along_depth, deep_depth);
    const Reals length_crossed = lengths_between(packet, met->near, met->far, met->r, met->r_next, depth, next_depth,
                                                 deep_depth, inverse_depth);
    composite_medium(seen, met->extinction * length_crossed, met->red, met->green, met->blue, met->waits);
    met->waits = 0;
}

// Follow the rays that are `going`, which step the same way, through all lists that they cross.
__attribute__((always_inline))
inline void sweep(Seen *seen, const Packet *packet, const Axis *p, const Axis *q, Ints going, Ints first_p, Ints first_q,
                  bool away, __global const HEADER_T *headers, SUPERSEGMENTS_PARAMETERS int lists_wide, float depth_origin,
                  float transmittance_cutoff, __global const ulong *masks, float first_depth, float slabs_per_depth)
{
    const float sense = away ? 1.0f : -1.0f;
    const Reals along_depth = sense * packet->along_z;
    const Reals deep_depth = sense * packet->deep_z;
    const Reals inverse_depth = select((Reals)(0.0f), 1.0f / along_depth, packet->along_z != 0.0f);
    const Reals r_end = packet->r_begin + 1.0f;
    Met met;
    met.waits = 0;
    met.near = met.far = met.r = met.r_next = met.red = met.green = met.blue = met.extinction = 0.0f;
    Progress now;
    now.p = select((Ints)(NOWHERE), first_p * p->step, going);
    now.q = first_q * q->step;
    now.r = packet->r_begin;
    now.depth = sense * packet->start_z;
    int n = 0; // the supersegment that the last list was left at
#ifdef SKIP_EMPTY
    Ints fresh = going; // lanes in a tile that they have not looked at
#endif
    for (int place_p = least(now.p); place_p != NOWHERE; place_p = least(now.p)) {
        const int P = place_p * p->step;
        Ints column = now.p == place_p;
#ifdef SKIP_EMPTY
        const Ints looks = column && fresh;
        if (ANY(looks)) {
            fresh = fresh && !looks;
            pass_by(&now, &fresh, looks, P, packet, p, q, inverse_depth, sense, away, masks,
                    (lists_wide + TILE - 1) >> TILE_SHIFT, first_depth, slabs_per_depth, depth_origin);
            column = now.p == place_p;
        }
#endif
        const Reals r_p = crossings(p, (Reals)(P));
        // By the columns before: where a ray goes does not wait for what it sees in this one
        const Ints dark = seen->transmittance < transmittance_cutoff;
        if (!ANY(column))
            continue;
        for (int place_q = least_of(now.q, column);; ++place_q) {
            const Ints here = column && now.q == place_q;
            if (!ANY(here))
                continue;
            // They cross list (P, Q) from now.r to r_next
            const int Q = place_q * q->step;
            const Reals r_q = crossings(q, (Reals)(Q));
            const Reals r_next = HIGHER_OF(now.r, LOWER_OF(r_end, LOWER_OF(r_p, r_q)));
            const Reals next_depth = fma(r_next, along_depth, deep_depth);

            const List list = LIST_AT(FIRST_OF(P, Q), SECOND_OF(P, Q));
            n = min(n, list.count);
            while (n > 0 && ANY(here && far_face(list, SUPERSEGMENTS_ARGUMENTS n - 1, away) > now.depth))
                --n;
            for (int k = n; k < list.count; ++k) {
                const float near = near_face(list, SUPERSEGMENTS_ARGUMENTS k, away);
                const Ints come_to = here && near <= next_depth;
                if (!ANY(come_to))
                    break;
                const float far = far_face(list, SUPERSEGMENTS_ARGUMENTS k, away);
                const Ints meet = come_to && far > now.depth;
                if (!ANY(meet)) {
                    n = k + 1;
                    continue;
                }
                if (ANY(meet && met.waits))
                    composite_met(seen, &met, packet, along_depth, deep_depth, inverse_depth);
                const float4 medium = MEDIUM(list, away ? k : list.count - 1 - k);
                met.near = select(met.near, (Reals)(near), meet);
                met.far = select(met.far, (Reals)(far), meet);
                met.r = select(met.r, now.r, meet);
                met.r_next = select(met.r_next, r_next, meet);
                met.red = select(met.red, (Reals)(medium.x), meet);
                met.green = select(met.green, (Reals)(medium.y), meet);
                met.blue = select(met.blue, (Reals)(medium.z), meet);
                met.extinction = select(met.extinction, (Reals)(medium.w), meet);
                met.waits = met.waits || meet;
            }
            const Ints steps_p = here && r_p <= r_q;
            const Ints steps_q = here && !(r_p <= r_q);
            Ints ends = here && (r_next >= r_end || dark);
            ends = ends || (P + p->step < 0 || P + p->step >= p->lists ? steps_p : (Ints)(0));
            ends = ends || (Q + q->step < 0 || Q + q->step >= q->lists ? steps_q : (Ints)(0));
            now.r = select(now.r, r_next, here);
            now.depth = select(now.depth, next_depth, here);
            now.p = select(select(now.p, (Ints)(place_p + 1), steps_p), (Ints)(NOWHERE), ends);
            now.q = select(now.q, (Ints)(place_q + 1), steps_q);
            column = now.p == place_p;
            const bool goes_on = ANY(column); // here, where it is one instruction, as the comparison has just made a mask
#ifdef SKIP_EMPTY
            if (((P + p->step) ^ P) >> TILE_SHIFT)
                fresh = fresh || steps_p;
            if (((Q + q->step) ^ Q) >> TILE_SHIFT)
                fresh = fresh || steps_q;
#endif
            if (!goes_on)
                break;
        }
    }
    composite_met(seen, &met, packet, along_depth, deep_depth, inverse_depth);
}

__attribute__((vec_type_hint(float16)))
__kernel void raycast_packets(
    __global const HEADER_T *headers,   // of the tiles of lists, see raycasting/supersegments.cl
    SUPERSEGMENTS_PARAMETERS            // see raycasting/supersegments.cl
    int lists_wide, int lists_high,     // window of V_O
    float depth_origin,                 // world units
    __global const float *forms,        // list coordinates, model direction, then `planes` to clip to
    int planes,
    int width, int height,              // window of V_N
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    float transmittance_cutoff,         // the ray ends where less than this is left
    __global const ulong *masks,        // occupied slabs of each tile of lists, if SKIP_EMPTY
    float first_depth,                  // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth,
    float4 epipole,                     // see raycasting/packet.cl
    int4 part,                          // of the window: first strip, how many, number of each strip's first packet
    __global float4 *image)             // premultiplied RGBA, top row first
{
#ifdef UPRIGHT
    const int along_size = height, across_size = width;
#else
    const int along_size = width, across_size = height;
#endif
    // Strips lie side by side in blocks of LANES packets, so that what is close in the window is close in time
    const int item = (int)get_global_id(0);
    const int block = item / LANES;
    const int first = (part.x + block % part.y) * LANES;
    const int number = part.z + block / part.y * LANES + item % LANES;
    const Ints along = first + NUMBERS;
    const Ints across = across_strip(first, number, along_size, across_size, epipole);
    // A pixel of two packets is the former's: how it is rounded depends on what the packet's other rays meet
    const Ints is_own = across != across_strip(first, number - 1, along_size, across_size, epipole);
    const Ints in_window = is_own && along < along_size && across >= 0 && across < across_size;
    if (!ANY(in_window))
        return;
#ifdef UPRIGHT
    const Ints x = across, y = along;
#else
    const Ints x = along, y = across;
#endif
    const Pixels pixels = pixels_at(x, y, in_window, width, height);
    const Reals t_end = has_opaque_depth ? ends_at(&pixels, opaque_depth) : (Reals)(INFINITY);
    const Reals a = convert_float16(x) + 0.5f - 0.5f * (float)width;
    const Reals b = convert_float16(y) + 0.5f - 0.5f * (float)height;
    const Packet packet = begin_packet(forms, planes, a, b, t_end, in_window, depth_origin);

    Seen seen = nothing_seen();
    Axis p = axis_of(FIRST_OF(packet.start_u, packet.start_v), FIRST_OF(packet.along_u, packet.along_v),
                     FIRST_OF(packet.deep_u, packet.deep_v), FIRST_OF(lists_wide, lists_high));
    Axis q = axis_of(SECOND_OF(packet.start_u, packet.start_v), SECOND_OF(packet.along_u, packet.along_v),
                     SECOND_OF(packet.deep_u, packet.deep_v), SECOND_OF(lists_wide, lists_high));
    const Ints first_p = clamp(convert_int16(floor(p.start + p.middle)), 0, p.lists - 1);
    const Ints first_q = clamp(convert_int16(floor(q.start + q.middle)), 0, q.lists - 1);
    // Rays that step the same way go on together: nearly always, all
    const Ints ways = (packet.away & 1) | ((p.along > 0.0f) & 2) | ((q.along > 0.0f) & 4);
    for (Ints waiting = packet.present; ANY(waiting);) {
        const int way = least_of(ways, waiting);
        const Ints going = waiting && ways == way;
        waiting = waiting && !going;
        const bool away = way & 1;
        take_step(&p, way & 2);
        take_step(&q, way & 4);
        if (away)
            sweep(&seen, &packet, &p, &q, going, first_p, first_q, true, headers,
                  SUPERSEGMENTS_ARGUMENTS lists_wide, depth_origin, transmittance_cutoff, masks, first_depth,
                  slabs_per_depth);
        else
            sweep(&seen, &packet, &p, &q, going, first_p, first_q, false, headers,
                  SUPERSEGMENTS_ARGUMENTS lists_wide, depth_origin, transmittance_cutoff, masks, first_depth,
                  slabs_per_depth);
    }
    write_pixels(image, &pixels, &seen);
}
