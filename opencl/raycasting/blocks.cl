// VDI to image, ray by ray as in raycasting/raycast.cl, but in vectors that are written out: a work-item follows a block of 4 x 4 rays.
//
// In each turn of one loop every ray of the block makes a guess, composites a supersegment or leaves its list, as there. What
// a compiler makes of that kernel for a CPU takes longer: it takes structures apart and puts them together by shuffles, keeps
// masks and registers in memory around branches, and gathers.
//
// -D SKIP_EMPTY         as in raycasting/raycast.cl: the picture is the same to the last bit
// -D SEGMENTS (2)       write what the rays cross, as there; multi_vdi/merge_blocks.cl or multi_vdi/merge.cl merges it
// -D PARALLEL, SHIFTED, CROPPED, COMPENSATED (1)    as there; OFFSET_T is int, and supersegments are not packed
#define LANES 16
#include "raycasting/lists.cl"
#include "raycasting/packet_cropping.cl"
#include "raycasting/packet_light.cl"
#include "lib/transpose.cl"
#include "raycasting/segment_rows.cl"
#include "raycasting/slabs_ahead.cl"
#pragma OPENCL FP_CONTRACT OFF

#define BLOCK 4 // rays along each edge
#define BLOCKS_PER_COLUMN (COLUMN_ITEMS / LANES)

// Words of 64 bits, in two halves.
typedef struct {
    uint16 low, high;
} Words;

// Words on their way from memory to vectors: as doubles, where there are any, they take an instruction less.
#ifdef cl_khr_fp64
typedef double Word;
typedef double8 Words8;
#else
typedef ulong Word;
typedef ulong8 Words8;
#endif

// One load each, as gathers are slow where these kernels run. Words come in an order from which two shuffles within 128 bits
// make the halves of all.
inline Words words_at(__global const ulong *words, Ints places)
{
    const Places in_memory = {places};
    const volatile int *at = in_memory.each;
    __global const Word *of = (__global const Word *)words;
    const Reals p = as_float16((Words8)(of[at[0]], of[at[1]], of[at[4]], of[at[5]], of[at[8]], of[at[9]], of[at[12]], of[at[13]]));
    const Reals q = as_float16((Words8)(of[at[2]], of[at[3]], of[at[6]], of[at[7]], of[at[10]], of[at[11]], of[at[14]], of[at[15]]));
    Words halves;
    halves.low = as_uint16(((Reals)(p.even, q.even)).JOINED);
    halves.high = as_uint16(((Reals)(p.odd, q.odd)).JOINED);
    return halves;
}

// The media of entries: red, green, blue, extinction. Pairs of words, which compilers shuffle less than vectors of four floats.
inline Quads media_at(__global const ulong *media, Ints entries)
{
    const Places in_memory = {entries};
    const volatile int *at = in_memory.each;
    __global const ulong2 *of = (__global const ulong2 *)media;
    Quads rows;
    for (int n = 0; n < 4; ++n)
        rows.of[n] = as_float16((ulong8)(of[at[n]], of[at[n + 4]], of[at[n + 8]], of[at[n + 12]]));
    return transposed(rows);
}

// One axis of V_O's window.
typedef struct {
    Reals along, deep;
    Reals zero, inverse; // of crossings, see there
    Reals middle, border; // half of the lists, and from a list's index to its border ahead
    Ints step;            // 1 or -1
    int lists;
} Axis;

inline Axis axis_of(Reals along, Reals deep, int lists)
{
    Axis axis;
    axis.along = along;
    axis.deep = deep;
    // By a component that does not change, borders are crossed at infinity
    axis.zero = select((Reals)(-INFINITY), deep, along != 0.0f);
    axis.inverse = select((Reals)(1.0f), 1.0f / along, along != 0.0f);
    axis.middle = 0.5f * (float)lists;
    axis.border = select((Reals)(0.0f), (Reals)(1.0f), along > 0.0f) - axis.middle;
    axis.step = select((Ints)(-1), (Ints)(1), along > 0.0f);
    axis.lists = lists;
    return axis;
}

// Where the rays leave the lists of an index: from the border's number, never accumulated.
inline Reals crossings(const Axis *axis, Ints index)
{
    return ((convert_float16(index) + axis->border) - axis->zero) * axis->inverse;
}

// What the rays have come to.
typedef struct {
    Ints i, j; // lists
    Reals r;
    Reals depth; // in their sense, see raycasting/lists.cl
    Ints guess, low, high, missed; // of the search, see raycasting/lists.cl; the answer is `high` at most
    Ints goes; // rays that have not ended
} Progress;

#ifdef SKIP_EMPTY
inline Ints tile_edges(const Axis *axis, Ints index)
{
    return select(index & ~(TILE - 1), index | (TILE - 1), axis->along > 0.0f);
}

// The index of the list that stepping from `index` would have reached at r_until; see raycasting/raycast.cl.
inline Ints index_reached(const Axis *axis, Ints index, Ints edge, Reals r_until)
{
    Ints reached = convert_int16(floor(fma(r_until, axis->along, axis->deep) + axis->middle));
    const Ints behind = edge + axis->step;
    reached = clamp(reached, min(index, behind), max(index, behind));
    const Ints too_far = reached != index && crossings(axis, reached - axis->step) > r_until;
    const Ints farther = !too_far && crossings(axis, reached) <= r_until;
    reached += select((Ints)(0), axis->step, farther) - select((Ints)(0), axis->step, too_far);
    return select(index, reached, axis->along != 0.0f);
}

// Pass by what is empty for the rays that look.
inline void pass_by(Progress *now, Ints looks, const Axis *u, const Axis *v, Reals r_end, Reals along_depth, Reals deep_depth,
                    Reals inverse_depth, float sense, bool away, __global const ulong *masks, int tiles_wide,
                    float first_depth, float slabs_per_depth, float depth_origin)
{
    while (ANY(looks)) {
        const Ints tile = (now->j >> TILE_SHIFT) * tiles_wide + (now->i >> TILE_SHIFT);
        const Words mask = words_at(masks, select((Ints)(0), tile, looks));
        const Reals offsets = depth_offset(sense * now->depth, depth_origin);
        const Ints slab = convert_int16(clamp((offsets - first_depth) * slabs_per_depth, 0.0f, (float)(SLABS - 1)));
        Ints nothing;
        const Ints nearest = nearest_slabs(mask.low, mask.high, slab, away, &nothing);
        const Ints passes = looks && (nothing || nearest != slab);
        looks = 0;
        if (!ANY(passes))
            break;
        const Ints edge_i = tile_edges(u, now->i);
        const Ints edge_j = tile_edges(v, now->j);
        const Reals faces = first_depth + convert_float16(away ? nearest : nearest + 1) / slabs_per_depth;
        const Reals r_face = (sense * depth_coordinate(faces, depth_origin) - deep_depth) * inverse_depth;
        Reals r_until = fmin(crossings(u, edge_i), crossings(v, edge_j));
        r_until = select(r_until, fmin(r_until, r_face), !nothing && along_depth != 0.0f);
        const Ints i = index_reached(u, now->i, edge_i, r_until);
        const Ints j = index_reached(v, now->j, edge_j, r_until);
        Reals r = now->r;
        r = select(r, fmax(r, crossings(u, i - u->step)), i != now->i);
        r = select(r, fmax(r, crossings(v, j - v->step)), j != now->j);
        const Ints moves = passes && (i != now->i || j != now->j);
        now->r = select(now->r, r, moves);
        now->depth = select(now->depth, fma(r, along_depth, deep_depth), moves);
        now->low = select(now->low, (Ints)(0), moves);
        now->high = select(now->high, (Ints)(INT_MAX), moves);
        now->missed = select(now->missed, (Ints)(0), moves);
        const Ints ends = r_until >= r_end || i < 0 || i >= u->lists || j < 0 || j >= v->lists;
        looks = passes && !ends && ((i ^ now->i) | (j ^ now->j)) >> TILE_SHIFT != 0;
        now->i = select(now->i, i, passes);
        now->j = select(now->j, j, passes);
        now->goes = now->goes && !(passes && ends);
    }
}
#endif

// What comes of the rays.
typedef struct {
#ifdef CROPPED
    KeptOfRays kept;
#endif
#ifdef SEGMENTS
    __global float *rows; // see raycasting/segment_rows.cl
    int capacity;
    Ints slots;           // behind the last segments
    Reals reached;        // t, so that rounding puts no segment before the end of another
    Reals absorbed;       // optical depth
    Reals t_deep;         // t where r is 0
    Reals t_scale;        // t per unit of r, but for the division by w(r) in perspective
    float depth_shift;    // this VDI's reference depth less the frame's
#else
    Seen seen;
#endif
} Outcome;

#ifdef SEGMENTS
#define ARE_DONE(outcome, cutoff) ((outcome)->absorbed > (cutoff))

// As ray_depth, from the frame's reference depth.
inline Reals ray_depths(const Outcome *outcome, const Packet *packet, Reals r)
{
#ifdef PARALLEL
    return fma(r, outcome->t_scale, outcome->t_deep) + outcome->depth_shift;
#else
    return outcome->t_deep + r * outcome->t_scale / fma(r, packet->w_along, packet->w_deep) + outcome->depth_shift;
#endif
}

// Write what the rays that are chosen cross of a medium, from `from` to `to`.
inline void write_segments(Outcome *outcome, const Packet *packet, Reals from, Reals to, Reals red, Reals green, Reals blue,
                           Reals extinction, Ints chosen)
{
    const Reals optical_depth = fmin(extinction * lengths_crossed(packet, from, to), MAX_OPTICAL_DEPTH);
    chosen = chosen && from < to && optical_depth > 0.0f;
    Segments segments = {HIGHER_OF(ray_depths(outcome, packet, from), outcome->reached), 0.0f, optical_depth, red, green, blue};
    segments.to = HIGHER_OF(ray_depths(outcome, packet, to), segments.from);
    store_segments(outcome->rows, outcome->slots, outcome->capacity, &segments);
    outcome->reached = select(outcome->reached, segments.to, chosen);
    outcome->absorbed += select((Reals)(0.0f), optical_depth, chosen);
    outcome->slots -= chosen;
}
#else
#define ARE_DONE(outcome, cutoff) ((outcome)->seen.transmittance < (cutoff))
#endif

// The rays that are chosen cross a medium between depths `near` and `far` on their way from r to r_next.
inline void cross_medium(Outcome *outcome, const Packet *packet, Reals near, Reals far, Reals r, Reals r_next, Reals depth,
                         Reals next_depth, Reals deep_depth, Reals inverse_depth, Reals red, Reals green, Reals blue,
                         Reals extinction, Ints chosen)
{
    Reals from, to;
    clip_to_faces(&from, &to, near, far, r, r_next, depth, next_depth, deep_depth, inverse_depth);
#ifdef CROPPED
    Reals lengths = 0.0f;
    for (int n = 0; n < MOST_KEPT && ANY(chosen && outcome->kept.counts > n); ++n) {
        const Reals kept_from = fmax(from, outcome->kept.from[n]);
        const Reals kept_to = fmin(to, outcome->kept.to[n]);
#ifdef SEGMENTS
        write_segments(outcome, packet, kept_from, kept_to, red, green, blue, extinction, chosen);
#else
        lengths += select((Reals)(0.0f), lengths_crossed(packet, kept_from, kept_to), kept_from < kept_to);
#endif
    }
#elif defined(SEGMENTS)
    write_segments(outcome, packet, from, to, red, green, blue, extinction, chosen);
#else
    const Reals lengths = lengths_crossed(packet, from, to);
#endif
#ifndef SEGMENTS
    composite_medium(&outcome->seen, extinction * lengths, red, green, blue, chosen);
#endif
}

// Where the rays enter and leave the n-th supersegment of their lists, in their sense; for rays that `ask`.
inline void faces_met(Reals *near, Reals *far, __global const ulong *faces, Ints first, Ints count, Ints n, Ints ask, bool away)
{
    const Ints entries = first + ((away ? n : count - 1 - n) << 2 * LIST_TILE_SHIFT);
    const Words face = words_at(faces, select((Ints)(0), entries, ask));
    *near = away ? as_float16(face.low) : -as_float16(face.high);
    *far = away ? as_float16(face.high) : -as_float16(face.low);
}

// Follow the rays that are `going`, of which all go away or come back.
__attribute__((always_inline))
inline void follow(Outcome *outcome, const Packet *packet, const Axis *u, const Axis *v, Ints going, bool away,
                   __global const ulong *headers, __global const ulong *list_faces, __global const ulong *media,
                   int lists_wide, float depth_origin, float cutoff, __global const ulong *masks,
                   float first_depth, float slabs_per_depth)
{
    const float sense = away ? 1.0f : -1.0f;
    const Reals along_depth = sense * packet->along_z;
    const Reals deep_depth = sense * packet->deep_z;
    const Reals inverse_depth = select((Reals)(0.0f), 1.0f / along_depth, packet->along_z != 0.0f);
    const Reals r_end = packet->r_begin + 1.0f;
    const int tiles_of_lists = (lists_wide + LIST_TILE - 1) >> LIST_TILE_SHIFT;
    Progress now;
    now.i = clamp(convert_int16(floor(packet->start_u + u->middle)), 0, u->lists - 1);
    now.j = clamp(convert_int16(floor(packet->start_v + v->middle)), 0, v->lists - 1);
    now.r = packet->r_begin;
    now.depth = sense * packet->start_z;
    now.guess = now.low = now.missed = 0;
    now.high = INT_MAX;
    now.goes = going;
#ifdef SKIP_EMPTY
    Ints fresh = fabs(u->along) + fabs(v->along) > FEW_LISTS; // rays in a tile that they have not looked at
#endif
    for (int turn = 0; ANY(now.goes); ++turn) {
#ifdef SKIP_EMPTY
        if (turn % TURNS_PER_TEST == 0 && ANY(fresh && now.goes)) {
            pass_by(&now, fresh && now.goes, u, v, r_end, along_depth, deep_depth, inverse_depth, sense, away, masks,
                    (lists_wide + TILE - 1) >> TILE_SHIFT, first_depth, slabs_per_depth, depth_origin);
            fresh = 0;
        }
#endif
        const Ints tile = (now.j >> LIST_TILE_SHIFT) * tiles_of_lists + (now.i >> LIST_TILE_SHIFT);
        const Words header = words_at(headers, select((Ints)(0), tile, now.goes));
        const Ints place = (now.j & (LIST_TILE - 1)) << LIST_TILE_SHIFT | (now.i & (LIST_TILE - 1));
        const Ints first = as_int16(header.low) + place;
        const Ints count = as_int16(header.high >> (FIRST_BITS - 32));

        // Search, as in raycasting/lists.cl; what is halved after some wrong guesses is halved once in each turn
        const Ints n = min(now.guess, count);
        const Ints there = now.goes && n < count;
        Reals near = INFINITY, far = INFINITY;
        if (ANY(there)) {
            faces_met(&near, &far, list_faces, first, count, n, there, away);
            near = select((Reals)(INFINITY), near, there);
            far = select((Reals)(INFINITY), far, there);
        }
        const Ints passed = far <= now.depth;
        // Loaded in every turn, as a processor cannot foresee whether any ray asks
        const Ints asks = now.goes && near > now.depth && n > now.low;
        Reals near_before, far_before;
        faces_met(&near_before, &far_before, list_faces, first, count, n - 1, asks, away);
        const Ints beyond = asks && far_before > now.depth;
        const Ints found = now.goes && !passed && !beyond;

        // They cross their lists from now.r to r_next
        const Reals r_u = crossings(u, now.i);
        const Reals r_v = crossings(v, now.j);
        const Reals r_next = HIGHER_OF(now.r, LOWER_OF(r_end, LOWER_OF(r_u, r_v)));
        const Reals next_depth = fma(r_next, along_depth, deep_depth);
        const Ints meets = found && near <= next_depth;
        if (ANY(meets)) {
            const Ints entries = first + ((away ? n : count - 1 - n) << 2 * LIST_TILE_SHIFT);
            const Quads medium = media_at(media, select((Ints)(0), entries, there));
            cross_medium(outcome, packet, near, far, now.r, r_next, now.depth, next_depth, deep_depth, inverse_depth,
                         medium.of[0], medium.of[1], medium.of[2], medium.of[3], meets);
        }
        const Ints ends_here = meets && far <= next_depth; // behind it comes the next one
        const Ints leaves = found && !ends_here;
        now.low = select(now.low, n + 1, passed || ends_here);
        now.high = select(now.high, n - 1, beyond);
        now.missed -= passed || beyond;
        const Ints halves = (passed || beyond) && now.missed >= CLOSE_GUESSES;
        now.guess = select(select(n, n - 1, beyond), n + 1, passed || ends_here);
        now.guess = select(now.guess, (now.low + min(now.high, count)) >> 1, halves);
        now.low = select(now.low, (Ints)(0), leaves);
        now.high = select(now.high, (Ints)(INT_MAX), leaves);
        now.missed = select(now.missed, (Ints)(0), leaves);
        now.r = select(now.r, r_next, leaves);
        now.depth = select(now.depth, next_depth, leaves);
        const Ints in_u = r_u <= r_v;
        const Ints i = now.i + select((Ints)(0), u->step, leaves && in_u);
        const Ints j = now.j + select((Ints)(0), v->step, leaves && !in_u);
        const Ints done = ARE_DONE(outcome, cutoff);
        now.goes = now.goes && !(leaves && (r_next >= r_end || done || i < 0 || i >= u->lists || j < 0 || j >= v->lists));
#ifdef SKIP_EMPTY
        fresh = fresh || ((i ^ now.i) | (j ^ now.j)) >> TILE_SHIFT != 0;
#endif
        now.i = i;
        now.j = j;
    }
}

// The indices of the lists at r.
inline Ints indices_at(const Axis *axis, Reals r, int shift)
{
    const Ints indices = convert_int16(floor(fma(r, axis->along, axis->deep) + axis->middle));
    return clamp(indices + shift, 0, axis->lists - 1);
}

// Bring the lists (i, j) of rays that are chosen close; each list of a tile brings its share.
inline void prefetch_lists(Ints i, Ints j, Ints chosen, __global const ulong *headers, SUPERSEGMENTS_PARAMETERS int lists_wide)
{
    int columns[LANES], rows[LANES], wanted[LANES];
    vstore16(i, 0, columns);
    vstore16(j, 0, rows);
    vstore16(chosen, 0, wanted);
    for (int k = 0; k < LANES; ++k) {
        if (wanted[k]) {
            const List list = LIST_AT(columns[k], rows[k]);
            PREFETCH(list, columns[k], rows[k]);
        }
    }
}

#ifdef SEGMENTS
// The rays' streams begin behind those before them.
inline void begin_segments(Outcome *outcome, const Packet *packet, Reals t0, Reals t1, float depth_shift)
{
    outcome->reached = -INFINITY;
    outcome->absorbed = 0.0f;
    outcome->depth_shift = depth_shift;
    outcome->t_deep = select(t0, t1, packet->away);
    outcome->t_scale = t1 - t0;
#ifndef PARALLEL
    const Reals other_end = select((Reals)(1.0f), (Reals)(-1.0f), packet->away);
    outcome->t_scale *= fma(other_end, packet->w_along, packet->w_deep);
#endif
}

// Which of a block's rays, which meet the VDI's bounds, would so, too, `margin` pixels to each side.
inline Ints surely_covered(__global const float *forms, Reals a, Reals b, float margin, Ints present)
{
    if (margin == 0.0f)
        return present;
    // The bounds' image is convex: mostly the block's corners speak for all
    Reals t0, t1;
    const Reals corners_a = select((Reals)(a.s0 - margin), (Reals)(a.sf + margin), (NUMBERS & 1) != 0);
    const Reals corners_b = select((Reals)(b.s0 - margin), (Reals)(b.sf + margin), (NUMBERS & 2) != 0);
    if (!ANY(!clip_packet(forms, BOX_PLANES, corners_a, corners_b, (Reals)(INFINITY), (Ints)(-1), &t0, &t1)))
        return present;
    Ints inside = present;
    for (int corner = 0; corner < 4; ++corner)
        inside = clip_packet(forms, BOX_PLANES, a + (corner & 1 ? margin : -margin), b + (corner & 2 ? margin : -margin),
                             (Reals)(INFINITY), inside, &t0, &t1);
    return inside;
}
#endif

__attribute__((vec_type_hint(float16)))
__kernel void raycast_blocks(
    __global const ulong *headers,      // of the tiles of lists, see raycasting/supersegments.cl
    SUPERSEGMENTS_PARAMETERS            // see raycasting/supersegments.cl
    int lists_wide, int lists_high,     // window of V_O
    float depth_origin,                 // world units
    __global const float *forms,        // list coordinates, model direction, then `planes` to clip to
    int planes,
    int width, int height,              // window of V_N
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    float cutoff,                       // the ray ends where less transmittance than this is left; SEGMENTS: behind this much
                                        // optical depth
    __global const ulong *masks,        // occupied slabs of each tile of lists, if SKIP_EMPTY
    float first_depth,                  // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth,
    CROPPING_PARAMETER                  // regions that are kept
#ifdef SEGMENTS
    __global const int2 *cells,         // this and the rest as in raycasting/raycast.cl
    int first_cell,
    int stream,
    int rays,
    float depth_shift,
    float margin,
    int capacity,
    __global float *pool,
    __global int *ends,
    __global uchar *contributes,
    __global float *dark)
#else
    int4 part,                          // of the window, see lib/rays.cl
    __global float4 *image)             // premultiplied RGBA, top row first
#endif
{
    const int item = (int)get_global_id(0);
#ifdef SEGMENTS
    const int first_ray = item * LANES;
    const int2 corner = cell_pixel(cells + first_cell, first_ray);
#else
    const int column = item / BLOCKS_PER_COLUMN;
    const int2 corner = part_pixel(column, (item - column * BLOCKS_PER_COLUMN) * LANES, part);
#endif
    const Ints x = corner.x + (NUMBERS & (BLOCK - 1));
    const Ints y = corner.y + (NUMBERS / BLOCK);
    const Ints in_window = x < width && y < height;
    if (!ANY(in_window))
        return;
    const Pixels pixels = pixels_at(x, y, in_window, width, height);
    Reals t_end = has_opaque_depth ? ends_at(&pixels, opaque_depth) : (Reals)(INFINITY);
#ifdef SEGMENTS
    const Reals dark_before = stream > 0 ? vload16(0, dark + first_ray) : (Reals)(INFINITY);
    t_end = select(t_end, fmin(t_end, DARK_FROM(dark_before, depth_shift)), dark_before < INFINITY);
#endif
    const Reals a = convert_float16(x) + 0.5f - 0.5f * (float)width;
    const Reals b = convert_float16(y) + 0.5f - 0.5f * (float)height;
    const Packet packet = begin_packet(forms, planes, a, b, t_end, in_window, depth_origin);
    Ints present = packet.present;
    Outcome outcome;
#if defined(SEGMENTS) || defined(CROPPED)
    Reals t0, t1;
    clip_packet(forms, planes, a, b, t_end, in_window, &t0, &t1);
#endif
#ifdef CROPPED
    outcome.kept = kept_of_rays(&packet, forms, planes, a, b, t0, t1, regions);
    present = present && outcome.kept.counts > 0;
#endif
#ifdef SEGMENTS
    const Ints first_slots = stream > 0 ? vload16(0, ends + (stream - 1) * rays + first_ray) : (Ints)(0);
    outcome.rows = POOL_OF(pool, first_ray, capacity);
    outcome.capacity = capacity;
    outcome.slots = first_slots;
    begin_segments(&outcome, &packet, t0, t1, depth_shift);
#else
    outcome.seen = nothing_seen();
#endif
    const Axis u = axis_of(packet.along_u, packet.deep_u, lists_wide);
    const Axis v = axis_of(packet.along_v, packet.deep_v, lists_high);
    const Ints crosses_few = present && fabs(packet.along_u) + fabs(packet.along_v) < LISTS_TO_PREFETCH;
    if (ANY(crosses_few)) {
        // Those of the next column of blocks: they come while this one's are walked through
        const int shift = BLOCK * lists_high / height;
        const Ints first_i = indices_at(&u, packet.r_begin, shift), first_j = indices_at(&v, packet.r_begin, 0);
        const Ints last_i = indices_at(&u, packet.r_begin + 1.0f, shift);
        const Ints last_j = indices_at(&v, packet.r_begin + 1.0f, 0);
        prefetch_lists(first_i, first_j, crosses_few, headers, SUPERSEGMENTS_ARGUMENTS lists_wide);
        prefetch_lists(last_i, last_j, crosses_few && (first_i != last_i || first_j != last_j), headers,
                       SUPERSEGMENTS_ARGUMENTS lists_wide);
    }
    const Ints away = present && packet.away;
    const Ints back = present && !packet.away;
    if (ANY(away))
        follow(&outcome, &packet, &u, &v, away, true, headers, SUPERSEGMENTS_ARGUMENTS lists_wide, depth_origin, cutoff, masks,
               first_depth, slabs_per_depth);
    if (ANY(back))
        follow(&outcome, &packet, &u, &v, back, false, headers, SUPERSEGMENTS_ARGUMENTS lists_wide, depth_origin, cutoff, masks,
               first_depth, slabs_per_depth);
#ifdef SEGMENTS
    vstore16(outcome.slots, 0, ends + stream * rays + first_ray);
    const Ints done = ARE_DONE(&outcome, cutoff);
    vstore16(select(dark_before, fmin(dark_before, outcome.reached), done), 0, dark + first_ray);
    const Ints meets = outcome.slots > first_slots;
    const Ints covered = ANY(meets) ? surely_covered(forms, a, b, margin, meets) : (Ints)(0);
    vstore16(convert_uchar16(-meets - covered), 0, contributes + stream * rays + first_ray);
#else
    write_pixels(image, &pixels, &outcome.seen);
#endif
}
