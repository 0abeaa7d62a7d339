// VDI to image from any view: the paper's raycaster (section 3).
//
// A ray steps from list to list (Amanatides and Woo), finds the first supersegment of each by the index found in the last
// one, and composites, front to back, the length that it crosses of each (docs/conventions.md, "Lengths", "A supersegment is a
// homogeneous medium"). All that is one loop, each turn of which makes a guess, composites a supersegment or leaves a list, or
// the last two: the lanes of a vector need not wait for the one that searches longest or meets most.
//
// -D LANES              1   a work-item follows a ray
//                       16  it follows a block of 4 x 4: what a compiler makes of the other form for a CPU takes longer, as it
//                           takes structures apart, keeps masks and registers in memory around branches, and gathers. For
//                           supersegments that are not packed, OFFSET_T int, neither DOUBLE_FLOAT_RAYS, FIRST_HIT nor ONE_LIST
// -D OFFSET_T           type of an offset into the supersegments: int or long
// -D PARALLEL, SHIFTED  the depth coordinate, see lib/list_space.cl
// -D DOUBLE_FLOAT_RAYS        see lib/list_space.cl
// -D COMPENSATED        see lib/compositing.cl
// -D PACKED             the form of the supersegments, see raycasting/supersegments.cl
// -D CROPPED            only some regions are drawn, see lib/cropping.cl
// -D SKIP_EMPTY         pass by what the occupancy grid says is empty; the picture is the same to the last bit
// -D ONE_LIST           the view is V_O: each ray stays in a list, whose supersegments a loop of its own composites
// -D SEGMENTS           write what each ray crosses into a pool (raycasting/segments.cl), to be merged with other VDIs by
//                       multi_vdi/merge.cl, in place of compositing it; for a band of rays
// -D FIRST_HIT          in place of a picture, where each ray enters the first supersegment that reaches an opacity
#include "raycasting/lists.cl"
#include "raycasting/stepping.cl"
#include "raycasting/pixels.cl"
#include "raycasting/frame.cl"
#include "raycasting/segments.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

// What comes of the rays.
typedef struct {
#if defined(SEGMENTS)
    __global float *rows; // see raycasting/segments.cl
    int capacity;         // slots of a ray
    Int slots;            // behind the last segments
    Real reached;         // t, so that rounding puts no segment before the end of another
    Real absorbed;        // optical depth
    float depth_shift;    // this VDI's reference depth less the frame's
#elif defined(FIRST_HIT)
    float met;            // optical depth
    float r;
    bool hit;
    float least_optical_depth;
    int accumulated;
#else
    Seen seen;
#endif
    float cutoff;
} Outcome;

#if defined(SEGMENTS)
#define ARE_DONE(outcome) ((outcome)->absorbed > (outcome)->cutoff)
#elif defined(FIRST_HIT)
#define ARE_DONE(outcome) (outcome)->hit
#else
#define ARE_DONE(outcome) ((outcome)->seen.sums.w < (outcome)->cutoff)
#endif

#ifdef SEGMENTS
// Write what the rays that are chosen cross of a medium, from `from` to `to`.
inline void write_segments(Outcome *outcome, const ListRays *rays, Real from, Real to, Real4 medium, Int chosen, float depth_origin)
{
    Segments segments;
    segments.color = medium;
    segments.optical_depth = fmin(medium.w * length_crossed(rays, from, to, DEPTHS), MAX_OPTICAL_DEPTH);
    chosen = chosen && from < to && segments.optical_depth > 0.0f;
    segments.from = HIGHER_OF(ray_time(rays, from, DEPTHS) + outcome->depth_shift, outcome->reached);
    segments.to = HIGHER_OF(ray_time(rays, to, DEPTHS) + outcome->depth_shift, segments.from);
    store_segments(outcome->rows, outcome->slots, outcome->capacity, &segments, chosen);
    outcome->reached = SELECT(outcome->reached, segments.to, chosen);
    outcome->absorbed += SELECT((Real)(0.0f), segments.optical_depth, chosen);
    outcome->slots += COUNT(chosen);
}
#endif

// The rays that are chosen cross a medium between r = from and r = to.
inline void cross_medium(Outcome *outcome, const ListRays *rays, Real from, Real to, Real4 medium, Int chosen, float depth_origin)
{
#ifdef CROPPED
    Real length = 0.0f;
    for (int n = 0; n < MOST_KEPT; ++n) { // not to an end of each ray's own, see lib/cropping.cl
#if LANES > 1
        if (!ANY(chosen && rays->kept.count > n))
            break;
#endif
        Real kept_from = from, kept_to = to;
        cut_to_part(&rays->kept, n, &kept_from, &kept_to);
#ifdef SEGMENTS
        write_segments(outcome, rays, kept_from, kept_to, medium, chosen, depth_origin);
#else
        length += SELECT((Real)(0.0f), length_crossed(rays, kept_from, kept_to, DEPTHS), kept_from < kept_to);
#endif
    }
#elif defined(SEGMENTS)
    write_segments(outcome, rays, from, to, medium, chosen, depth_origin);
#else
    const Real length = length_crossed(rays, from, to, DEPTHS);
#endif
#if defined(FIRST_HIT)
    const float optical_depth = medium.w * length;
    outcome->met = outcome->accumulated ? outcome->met + optical_depth : optical_depth;
    outcome->hit = outcome->met > 0.0f && outcome->met >= outcome->least_optical_depth;
    outcome->r = from;
#ifdef CROPPED
    for (int n = MOST_KEPT - 1; n >= 0; --n) // where it is first in what is kept
        outcome->r = from < rays->kept.to[n] ? fmax(from, rays->kept.from[n]) : outcome->r;
#endif
#elif !defined(SEGMENTS)
    composite_medium(&outcome->seen, medium.w * length, medium, chosen);
#endif
}

// How far the rays have come.
typedef struct {
    Int i, j; // lists
    Real r;
    Real depth; // in their sense
    Search search;
    Int goes; // rays that have not ended
} Progress;

#ifdef SKIP_EMPTY
// Pass by stacks, and parts of stacks, whose slabs ahead are empty, for the rays that look. Written with selects, and in a loop
// of its own, so that the lanes of a vector meet again behind it.
inline void pass_by(Progress *now, Int looks, const ListRays *rays, const Axis *u, const Axis *v, const Sense *sense,
                    const Grid *grid, float depth_origin)
{
    while (ANY(looks)) {
        const Int stack = (now->j >> STACK_SHIFT) * grid->stacks_wide + (now->i >> STACK_SHIFT);
#if LANES == 1
        const ulong mask = grid->masks[stack];
        const uint low = (uint)mask, high = (uint)(mask >> HALF_SLABS);
#else
        const Words mask = words_at(grid->masks, SELECT((Int)(0), stack, looks));
        const Uint low = mask.low, high = mask.high;
#endif
        Int nearest, nothing;
        const Int passes = look_ahead(&nearest, &nothing, low, high, sense, now->depth, looks, grid, DEPTHS);
        if (!ANY(passes))
            break;
        const Int edge_i = stack_edge(u, now->i);
        const Int edge_j = stack_edge(v, now->j);
        const Real r_border = fmin(crossings(u, edge_i), crossings(v, edge_j));
        const Real r_until = empty_until(r_border, nearest, nothing, sense, grid, DEPTHS);
        const Int i = index_reached(u, now->i, edge_i, r_until);
        const Int j = index_reached(v, now->j, edge_j, r_until);
        const Int moves = passes && (i != now->i || j != now->j);
        const Real r = r_entered(v, r_entered(u, now->r, now->i, i), now->j, j);
        now->r = SELECT(now->r, r, moves);
        now->depth = SELECT(now->depth, depth_at(sense, r), moves);
        search_again(&now->search, moves);
        const Int ends = r_until >= rays->r_begin + 1.0f || i < 0 || i >= u->lists || j < 0 || j >= v->lists;
        looks = passes && !ends && ((i ^ now->i) | (j ^ now->j)) >> STACK_SHIFT != 0;
        now->i = SELECT(now->i, i, passes);
        now->j = SELECT(now->j, j, passes);
        now->goes = now->goes && !(passes && ends);
    }
}
#endif

// Follow the rays that are `going`, of which all go away or come back.
__attribute__((always_inline))
inline void follow(Outcome *outcome, const ListRays *rays, const Axis *u, const Axis *v, Int going, bool away,
                   __global const HEADER_T *headers, SUPERSEGMENTS_PARAMETERS int lists_wide, float depth_origin,
                   __global const ulong *masks, float first_depth, float slabs_per_depth)
{
    const Sense sense = sense_of(rays, away);
    const Real r_end = rays->r_begin + 1.0f;
    Progress now;
    now.i = list_index(u, rays->start.x, 0);
    now.j = list_index(v, rays->start.y, 0);
    now.r = rays->r_begin;
    now.depth = sense.sign * rays->start.z;
    now.search = begin_search((Int)(0));
    now.goes = going;
#ifdef SKIP_EMPTY
    const Grid grid = {masks, STACKS_ALONG(lists_wide), first_depth, slabs_per_depth};
    Int fresh = fabs(u->along) + fabs(v->along) > FEW_LISTS; // rays in a stack that they have not looked at
#endif
    for (int turn = 0; ANY(now.goes); ++turn) {
#ifdef SKIP_EMPTY
        if (turn % TURNS_PER_LOOK == 0 && ANY(fresh && now.goes)) {
            pass_by(&now, fresh && now.goes, rays, u, v, &sense, &grid, depth_origin);
            fresh = 0;
            if (!ANY(now.goes))
                break;
        }
#endif
        const List list = LISTS_AT(now.i, now.j, now.goes);
        Faces face;
        const Int found = search_on(&now.search, &list, SUPERSEGMENTS_ARGUMENTS now.depth, now.goes, away, &face);

        // They cross their lists from now.r to r_next
        const Real r_u = crossings(u, now.i);
        const Real r_v = crossings(v, now.j);
        const Real r_next = HIGHER_OF(now.r, LOWER_OF(r_end, LOWER_OF(r_u, r_v)));
        const Real next_depth = depth_at(&sense, r_next);
        Int meets = found && face.near <= next_depth;
        Int stays = 0; // in their lists, behind what they have met
#ifdef ONE_LIST
        while (meets) {
#else
        if (ANY(meets)) {
#endif
            // Also of those that meet theirs in another turn: it is close then
            const Int there = now.goes && now.search.n < list.count;
            const Real4 medium = medium_met(&list, SUPERSEGMENTS_ARGUMENTS now.search.n, there, away);
            Real from, to;
            clip_to_faces(&from, &to, &sense, face.near, face.far, now.r, r_next, now.depth, next_depth);
            cross_medium(outcome, rays, from, to, medium, meets, depth_origin);
            stays = meets && face.far <= next_depth;
#ifdef FIRST_HIT
            stays = stays && !outcome->hit;
#endif
#ifdef ONE_LIST
            // All rays stay in their lists, and come to the next one in step
            stays = stays && !ARE_DONE(outcome);
            meets = stays && now.search.n + 1 < list.count;
            if (meets) {
                ++now.search.n;
                face = faces_met(&list, SUPERSEGMENTS_ARGUMENTS now.search.n, meets, away);
                meets = face.near <= next_depth;
                stays = meets;
            }
#endif
        }
        const Int leaves = found && !stays;
        guess_again(&now.search, &list, stays);
        search_again(&now.search, leaves);
        now.r = SELECT(now.r, r_next, leaves);
        now.depth = SELECT(now.depth, next_depth, leaves);
        const Int in_u = r_u <= r_v;
        const Int i = now.i + SELECT((Int)(0), u->step, leaves && in_u);
        const Int j = now.j + SELECT((Int)(0), v->step, leaves && !in_u);
        const Int ends = r_next >= r_end || ARE_DONE(outcome) || i < 0 || i >= u->lists || j < 0 || j >= v->lists;
        now.goes = now.goes && !(leaves && ends);
#ifdef SKIP_EMPTY
        fresh = fresh || ((i ^ now.i) | (j ^ now.j)) >> STACK_SHIFT != 0;
#endif
        now.i = i;
        now.j = j;
    }
}

// Bring the lists close that rays begin and end in, of those that are present and cross few: those in between are others' ends.
inline void prefetch_ends(const ListRays *rays, const Axis *u, const Axis *v, __global const HEADER_T *headers,
                          SUPERSEGMENTS_PARAMETERS int lists_wide, int shift)
{
    const Int crosses_few = rays->present && fabs(u->along) + fabs(v->along) < LISTS_TO_PREFETCH;
    if (!ANY(crosses_few))
        return;
    const Int first_i = list_index(u, rays->start.x, shift), first_j = list_index(v, rays->start.y, 0);
    const Real r_end = rays->r_begin + 1.0f;
    const Int last_i = list_index(u, fma(r_end, u->along, u->deep), shift);
    const Int last_j = list_index(v, fma(r_end, v->along, v->deep), 0);
    int columns[2][LANES], rows[2][LANES], wanted[2][LANES];
    STORE_LANES(first_i, 0, columns[0]);
    STORE_LANES(first_j, 0, rows[0]);
    STORE_LANES(crosses_few, 0, wanted[0]);
    STORE_LANES(last_i, 0, columns[1]);
    STORE_LANES(last_j, 0, rows[1]);
    STORE_LANES(crosses_few && (first_i != last_i || first_j != last_j), 0, wanted[1]);
    for (int end = 0; end < 2; ++end) {
        for (int k = 0; k < LANES; ++k) {
            if (wanted[end][k])
                prefetch_list(headers, SUPERSEGMENTS_ARGUMENTS columns[end][k], rows[end][k], lists_wide);
        }
    }
}

#ifdef SEGMENTS
// Which of the rays that meet the VDI would meet its bounds, too, `margin` pixels to each side.
inline Int surely_covered(__global const float *forms, Real a, Real b, float margin, Int meet)
{
    __global const float *const bounds = forms + PLANE_FORMS * FORM_SIZE;
    Real t0 = -INFINITY, t1 = INFINITY;
    if (margin == 0.0f)
        return meet;
#if LANES > 1
    // The bounds' image is convex: mostly the block's corners speak for all
    const Real corners_a = SELECT((Real)(a.s0 - margin), (Real)(a.sf + margin), (LANE_NUMBERS & 1) != 0);
    const Real corners_b = SELECT((Real)(b.s0 - margin), (Real)(b.sf + margin), (LANE_NUMBERS & 2) != 0);
    if (ALL(clip_to_planes(bounds, BOX_PLANES, corners_a, corners_b, &t0, &t1)))
        return meet;
#endif
    for (int corner = 0; corner < 4; ++corner) {
        t0 = -INFINITY;
        t1 = INFINITY;
        meet = clip_to_planes(bounds, BOX_PLANES, a + (corner & 1 ? margin : -margin), b + (corner & 2 ? margin : -margin),
                              &t0, &t1) && meet;
    }
    return meet;
}
#endif

#if LANES > 1
#define raycast raycast_blocks
#endif
KERNEL_OF_LANES void raycast(
    FRAME_PARAMETERS                    // SEGMENTS: `cutoff` is the optical depth behind which rays end
    CROPPING_PARAMETER                  // regions that are kept
#if defined(SEGMENTS)
    __global const int2 *cells,         // see lib/rays.cl
    int first_cell,                     // the band's
    int stream,                         // of this VDI
    int band_rays,                      // how many
    float depth_shift,                  // this VDI's reference depth less the frame's
    float margin,                       // pixels; see `contributes`
    int capacity,                       // slots of a ray
    __global float *pool,               // see raycasting/segments.cl
    __global int *ends,                 // (streams, rays): slot behind each stream's last, beyond the capacity if it was full
    __global uchar *contributes,        // (streams, rays): 1 if a ray meets the VDI, 2 if its neighbours at `margin` pixels
                                        // meet its bounds, too
    __global float *dark)               // (rays): t where light has ended in one of the VDIs so far, or infinity
#elif defined(FIRST_HIT)
    int4 part,                          // of the window, see lib/rays.cl
    float least_optical_depth,          // a hit has some, and at least this much: by itself, or with all before it
    int accumulated,                    // whether what is before it counts
    __global float *image)              // t of the first hit, infinite where there is none, top row first
#else
    int4 part,                          // of the window, see lib/rays.cl
    __global float4 *image)             // premultiplied RGBA, top row first
#endif
{
    const int first_ray = (int)get_global_id(0) * LANES;
#ifdef SEGMENTS
    const int2 corner = cell_pixel(cells + first_cell, first_ray);
#else
    // By what a work-group has in common, so that it divides once
    const int item = (int)get_local_id(0) * LANES;
    const int2 corner = part_pixel((first_ray - item) / COLUMN_ITEMS, item, part);
#endif
    const Int x = corner.x + (LANE_NUMBERS & (BLOCK - 1));
    const Int y = corner.y + (LANE_NUMBERS / BLOCK);
    const Int in_window = x < width && y < height;
    if (!ANY(in_window))
        return;
    const Pixels pixels = pixels_at(x, y, in_window, width, height);
    Real t_end = has_opaque_depth ? ends_at(&pixels, opaque_depth) : (Real)(INFINITY);
    Outcome outcome;
    outcome.cutoff = cutoff;
#if defined(SEGMENTS)
    const Real dark_before = stream > 0 ? LOAD_LANES(0, dark + first_ray) : (Real)(INFINITY);
    t_end = SELECT(t_end, fmin(t_end, DARK_FROM(dark_before, depth_shift)), dark_before < INFINITY);
    const Int first_slots = stream > 0 ? LOAD_LANES(0, ends + (stream - 1) * band_rays + first_ray) : (Int)(0);
    outcome.rows = POOL_OF(pool, first_ray, capacity);
    outcome.capacity = capacity;
    outcome.slots = first_slots;
    outcome.reached = -INFINITY;
    outcome.absorbed = 0.0f;
    outcome.depth_shift = depth_shift;
#elif defined(FIRST_HIT)
    outcome.met = outcome.r = 0.0f;
    outcome.hit = false;
    outcome.least_optical_depth = least_optical_depth;
    outcome.accumulated = accumulated;
#else
    outcome.seen = nothing_seen();
#endif
    const Real a = offsets_from_middle(x, width);
    const Real b = offsets_from_middle(y, height);
    const ListRays rays = begin_rays(forms, planes, CROPPING_ARGUMENT a, b, t_end, in_window, depth_origin);
    if (ANY(rays.present)) {
        const Axis u = axis_of(rays.along.x, rays.deep.x, lists_wide);
        const Axis v = axis_of(rays.along.y, rays.deep.y, lists_high);
#if LANES == 1 && !defined(ONE_LIST)
        prefetch_ends(&rays, &u, &v, headers, SUPERSEGMENTS_ARGUMENTS lists_wide, 0);
#else
        // Those of the next column of blocks: they come while this one's are walked through
        prefetch_ends(&rays, &u, &v, headers, SUPERSEGMENTS_ARGUMENTS lists_wide, BLOCK * lists_high / height);
#endif
#define FOLLOW(going, away)                                                                                               \
    follow(&outcome, &rays, &u, &v, going, away, headers, SUPERSEGMENTS_ARGUMENTS lists_wide, depth_origin, masks, first_depth, \
           slabs_per_depth)
#if LANES == 1
        FOLLOW(rays.present, rays.away);
#else
        const Int away = rays.present && rays.away;
        const Int back = rays.present && !rays.away;
        if (ANY(away))
            FOLLOW(away, true);
        if (ANY(back))
            FOLLOW(back, false);
#endif
    }
#if defined(SEGMENTS)
    STORE_LANES(outcome.slots, 0, ends + stream * band_rays + first_ray);
    STORE_LANES(SELECT(dark_before, fmin(dark_before, outcome.reached), ARE_DONE(&outcome)), 0, dark + first_ray);
    const Int meets = outcome.slots > first_slots;
    const Int covered = ANY(meets) ? surely_covered(forms, a, b, margin, meets) : (Int)(0);
    STORE_LANES(TO_UCHAR(COUNT(meets) + COUNT(covered)), 0, contributes + stream * band_rays + first_ray);
#elif defined(FIRST_HIT)
    float passed_by = rays.scale * (outcome.r - rays.r_begin);
#ifndef PARALLEL
    passed_by /= reciprocal_depth(rays.start.z, DEPTHS_OF(&rays)) * reciprocal_depth_at(&rays, outcome.r, DEPTHS_OF(&rays));
#endif
    image[pixels.places[0]] = outcome.hit ? rays.t_begin + passed_by / model_speed(forms, a, b) : INFINITY;
#else
    write_pixels(image, &pixels, composited(&outcome.seen));
#endif
}
