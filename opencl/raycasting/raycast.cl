// VDI to image from any view: the paper's raycaster (section 3).
//
// A ray steps from list to list (Amanatides and Woo), finds the first supersegment of each by the index found in the last
// one, and composites, front to back, the length that it crosses of each (DESIGN section 3 "Lengths", "A supersegment is a
// homogeneous medium"). All that is one loop, each turn of which makes a guess, composites a supersegment or leaves a list, or
// the last two: the lanes of a vector need not wait for the one that searches longest or meets most.
//
// -D OFFSET_T           type of an offset into the supersegments: int or long
// -D PARALLEL, SHIFTED  the depth coordinate, see lib/list_space.cl
// -D FAR_ENTRIES        see lib/list_space.cl
// -D COMPENSATED        see lib/compositing.cl
// -D PACKED             the form of the supersegments, see raycasting/supersegments.cl
// -D CROPPED            only some regions are drawn, see lib/cropping.cl
// -D SKIP_EMPTY         pass by what the occupancy grid says is empty; the picture is the same to the last bit
// -D ONE_LIST           the view is V_O: each ray stays in a list, whose supersegments a loop of its own composites
// -D SEGMENTS           write what each ray crosses into a pool (raycasting/segments.cl), to be merged with other VDIs by
//                       multi_vdi/merge.cl or multi_vdi/merge_blocks.cl, in place of compositing it; for a band of rays
// -D FIRST_HIT          in place of a picture, where each ray enters the first supersegment that reaches an opacity
#include "raycasting/list_ray.cl"
#include "raycasting/lists.cl"
#include "lib/classification.cl"
#include "raycasting/tiles.cl"
#include "lib/compositing.cl"
#include "raycasting/segments.cl"
#pragma OPENCL FP_CONTRACT OFF

// As fmin and fmax for what is never NaN: one instruction each
#define LOWER(x, y) ((x) < (y) ? (x) : (y))
#define HIGHER(x, y) ((x) > (y) ? (x) : (y))

// The list that holds a coordinate in lists, or the nearest one.
inline int list_index(float coordinate, int lists)
{
    return clamp((int)floor(coordinate), 0, lists - 1);
}

__kernel void raycast(
    __global const HEADER_T *headers,   // of the tiles of lists, see raycasting/supersegments.cl
    SUPERSEGMENTS_PARAMETERS            // see raycasting/supersegments.cl
    int lists_wide, int lists_high,     // window of V_O
    float depth_origin,                 // world units
    __global const float *forms,        // list coordinates, model direction, then `planes` to clip to
    int planes,
    int width, int height,              // window of V_N
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
#ifdef SEGMENTS
    float optical_depth_cutoff,         // the ray ends behind this much
#else
    float transmittance_cutoff,         // the ray ends where less than this is left
#endif
    __global const ulong *masks,        // occupied slabs of each tile of lists, if SKIP_EMPTY
    float first_depth,                  // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth,
    CROPPING_PARAMETER                  // regions that are kept
#if defined(SEGMENTS)
    __global const int2 *cells,         // see lib/rays.cl
    int first_cell,                     // the band's
    int stream,                         // of this VDI
    int rays,                           // in the band
    float depth_shift,                  // this VDI's reference depth less the frame's
    float margin,                       // pixels; see `contributes`
    int capacity,                       // slots of a ray
    __global float *pool,               // see raycasting/segments.cl
    __global int *ends,                 // (streams, rays): slot behind each stream's last, beyond the capacity if it was full
    __global uchar *contributes,        // (streams, rays): 1 if a ray meets the VDI, 2 if its neighbours at `margin` pixels
                                        // meet its bounds, too
    __global float *dark)               // (rays): t where light has ended in one of the VDIs so far, or infinity
#define RAY_IS_DONE (absorbed > optical_depth_cutoff)
#elif defined(FIRST_HIT)
    int4 part,                          // of the window, see lib/rays.cl
    float least_optical_depth,          // a hit has some, and at least this much: by itself, or with all before it
    int accumulated,                    // whether what is before it counts
    __global float *image)              // t of the first hit, infinite where there is none, top row first
#define NOTHING INFINITY
#define RAY_IS_DONE hit
#else
    int4 part,                          // of the window, see lib/rays.cl
    __global float4 *image)             // premultiplied RGBA, top row first
#define NOTHING (float4)(0.0f)
#define RAY_IS_DONE (transmittance < transmittance_cutoff)
#endif
{
#ifdef SEGMENTS
    const int band_ray = (int)get_global_id(0);
    const int2 pixel = cell_pixel(cells + first_cell, band_ray);
#else
    // By what a work-group has in common, so that it divides once
    const int item = (int)get_local_id(0);
    const int2 pixel = part_pixel(((int)get_global_id(0) - item) / COLUMN_ITEMS, item, part);
#endif
    if (pixel.x >= width || pixel.y >= height)
        return;
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)pixel.y + 0.5f - 0.5f * (float)height;
    const size_t place = (size_t)(height - 1 - pixel.y) * width + pixel.x;
#ifdef SEGMENTS
    const int first_slot = stream > 0 ? ends[(stream - 1) * rays + band_ray] : 0;
    int slot = first_slot;
    float t_reached = -INFINITY; // so that rounding puts no segment before the end of another
    float absorbed = 0.0f;       // optical depth
    ends[stream * rays + band_ray] = slot;
    contributes[stream * rays + band_ray] = 0;
    const float dark_before = stream > 0 ? dark[band_ray] : INFINITY;
    dark[band_ray] = dark_before;
#endif

    ListRay ray;
    float t_end = has_opaque_depth ? opaque_depth[place] : INFINITY;
#ifdef SEGMENTS
    if (dark_before < INFINITY)
        t_end = fmin(t_end, DARK_FROM(dark_before, depth_shift));
#endif
    if (!begin_list_ray(&ray, forms, planes, CROPPING_ARGUMENT a, b, t_end, depth_origin)) {
#ifndef SEGMENTS
        image[place] = NOTHING;
#endif
        return;
    }
    const float3 start = ray.start;
    const float3 deep = ray.deep;
    // What changes by less than a normal number does not change: its reciprocal is not finite
    const float3 along = (float3)(fabs(ray.along.x) < FLT_MIN ? 0.0f : ray.along.x,
                                  fabs(ray.along.y) < FLT_MIN ? 0.0f : ray.along.y, ray.along.z);
    const bool away = ray.away;
    const float r_begin = ray.r_begin;
    const float r_end = r_begin + 1.0f;

    const float half_wide = 0.5f * (float)lists_wide;
    const float half_high = 0.5f * (float)lists_high;
    int i = list_index(start.x + half_wide, lists_wide);
    int j = list_index(start.y + half_high, lists_high);
    const float lists_crossed = fabs(along.x) + fabs(along.y);
#ifdef ONE_LIST
    // The list four pixels to the right: the next column of blocks comes to it while this one's lists are walked through
    const int next_i = min(i + 4 * lists_high / height, lists_wide - 1);
    PREFETCH(LIST_AT(next_i, j), next_i, j);
#else
    if (lists_crossed < LISTS_TO_PREFETCH) {
        // The lists that it begins and ends in: those in between are others' ends
        const int last_column = list_index(fma(r_end, along.x, deep.x) + half_wide, lists_wide);
        const int last_row = list_index(fma(r_end, along.y, deep.y) + half_high, lists_high);
        PREFETCH(LIST_AT(i, j), i, j);
        if (last_column != i || last_row != j) {
            PREFETCH(LIST_AT(last_column, last_row), last_column, last_row);
        }
    }
#endif

    // Where planes u = const and v = const are crossed; by a component that does not change, at infinity
    const float deep_u = along.x != 0.0f ? deep.x : -INFINITY;
    const float deep_v = along.y != 0.0f ? deep.y : -INFINITY;
    const float inverse_u = along.x != 0.0f ? 1.0f / along.x : 1.0f;
    const float inverse_v = along.y != 0.0f ? 1.0f / along.y : 1.0f;
    const int step_i = along.x > 0.0f ? 1 : -1;
    const int step_j = along.y > 0.0f ? 1 : -1;
    // From a list's index to its border ahead: exact
    const float border_u = (along.x > 0.0f ? 1.0f : 0.0f) - half_wide;
    const float border_v = (along.y > 0.0f ? 1.0f : 0.0f) - half_high;
// Where the ray leaves column i, or row j, of lists: from the border's number, never accumulated
#define CROSSING_U(i) (((float)(i) + border_u - deep_u) * inverse_u)
#define CROSSING_V(j) (((float)(j) + border_v - deep_v) * inverse_v)
    // Depth in the ray's sense, see raycasting/lists.cl: it does not decrease along the ray
    const float sense = away ? 1.0f : -1.0f;
    const float along_depth = sense * along.z;
    const float deep_depth = sense * deep.z;
    const float inverse_depth = along.z != 0.0f ? 1.0f / along_depth : 0.0f;

#if defined(FIRST_HIT)
    float met = 0.0f; // optical depth
    float r_hit = r_begin;
    bool hit = false;
#elif !defined(SEGMENTS)
    float3 color = (float3)(0.0f);
    float transmittance = 1.0f;
    float4 rest = (float4)(0.0f);
#endif
    float r = r_begin;
    float depth = sense * start.z;
    Search search = begin_search(0);
#ifdef SKIP_EMPTY
    const int tiles_wide = (lists_wide + TILE - 1) >> TILE_SHIFT;
    bool enters_tile = lists_crossed > FEW_LISTS;
    int turn = 0;
#endif
    while (true) {
#ifdef SKIP_EMPTY
        // Pass by tiles, and parts of tiles, whose slabs ahead are empty. Written with selects, and in a loop of its own, so
        // that the lanes of a vector meet again behind it.
        bool leaves_lists = false;
        bool looks = enters_tile && turn % TURNS_PER_TEST == 0;
        ++turn;
        while (looks) {
            looks = false;
            enters_tile = false;
            const int edge_i = along.x > 0.0f ? i | (TILE - 1) : i & ~(TILE - 1);
            const int edge_j = along.y > 0.0f ? j | (TILE - 1) : j & ~(TILE - 1);
            const ulong mask = masks[(j >> TILE_SHIFT) * tiles_wide + (i >> TILE_SHIFT)];
            const int slab = slab_of(depth_offset(sense * depth, DEPTHS), first_depth, slabs_per_depth);
            const ulong ahead = mask & (away ? slabs_from(slab) : slabs_to(slab));
            const int nearest = away ? (int)popcount((ahead & -ahead) - 1) : SLABS - 1 - (int)clz(ahead);
            if (ahead == 0 || nearest != slab) {
                // Up to here nothing is met: the tile's border, or the face of the next occupied slab
                float r_until = fmin(CROSSING_U(edge_i), CROSSING_V(edge_j));
                if (ahead != 0 && along.z != 0.0f) {
                    const float face = first_depth + (float)(away ? nearest : nearest + 1) / slabs_per_depth;
                    r_until = fmin(r_until, (sense * depth_coordinate(face, DEPTHS) - deep_depth) * inverse_depth);
                }
                // The list that steps from list to list would have reached, by the crossings of its borders: where r_until
                // lies by its coordinates, one back or one on where rounding has it otherwise
                int column = (int)floor(fma(r_until, along.x, deep.x) + half_wide);
                int row = (int)floor(fma(r_until, along.y, deep.y) + half_high);
                column = along.x > 0.0f ? clamp(column, i, edge_i + 1) : clamp(column, edge_i - 1, i);
                row = along.y > 0.0f ? clamp(row, j, edge_j + 1) : clamp(row, edge_j - 1, j);
                column = column != i && CROSSING_U(column - step_i) > r_until ? column - step_i
                       : CROSSING_U(column) <= r_until                        ? column + step_i
                                                                              : column;
                row = row != j && CROSSING_V(row - step_j) > r_until ? row - step_j
                    : CROSSING_V(row) <= r_until                     ? row + step_j
                                                                     : row;
                column = along.x != 0.0f ? column : i;
                row = along.y != 0.0f ? row : j;
                r = column != i ? fmax(r, CROSSING_U(column - step_i)) : r;
                r = row != j ? fmax(r, CROSSING_V(row - step_j)) : r;
                if (column != i || row != j) {
                    depth = fma(r, along_depth, deep_depth);
                    search = begin_search(search.n);
                }
                enters_tile = (((i ^ column) | (j ^ row)) >> TILE_SHIFT) != 0;
                i = column;
                j = row;
                leaves_lists = r_until >= r_end || i < 0 || i >= lists_wide || j < 0 || j >= lists_high;
                enters_tile = enters_tile && !leaves_lists;
                looks = enters_tile;
            }
        }
        if (leaves_lists)
            break;
        const int last_i = i;
        const int last_j = j;
#endif
        // The ray crosses list (i, j) from r to r_next
        const float r_u = CROSSING_U(i);
        const float r_v = CROSSING_V(j);
        const float r_next = HIGHER(r, LOWER(r_end, LOWER(r_u, r_v)));
        const float next_depth = fma(r_next, along_depth, deep_depth);

        const List list = LIST_AT(i, j);
        float2 face;
        const bool found = search_on(&search, list, SUPERSEGMENTS_ARGUMENTS depth, away, &face);
        bool stays = !found; // in this list
#ifdef ONE_LIST
        for (bool meets = found && face.x <= next_depth; meets;) {
#else
        if (found && face.x <= next_depth) {
#endif
            // Clip to the supersegment by interval: between two faces it never leaves [r, r_next]
            const float r_enters = (face.x - deep_depth) * inverse_depth;
            const float r_leaves = (face.y - deep_depth) * inverse_depth;
            const float from = face.x > depth ? LOWER(HIGHER(r_enters, r), r_next) : r;
            const float to = face.y < next_depth ? LOWER(HIGHER(r_leaves, from), r_next) : r_next;
            const float4 medium = MEDIUM(list, away ? search.n : list.count - 1 - search.n);
            stays = face.y <= next_depth;
#if defined(SEGMENTS)
            // The parts of it that are drawn
            for (int n = 0; n < drawn_parts(&ray); ++n) {
                float r_from = from;
                float r_to = to;
                cut_to_drawn_part(&ray, n, &r_from, &r_to);
                if (!(r_from < r_to))
                    continue;
                const float z_from = fma(r_from, along.z, deep.z);
                const float z_to = fma(r_to, along.z, deep.z);
                const float length_crossed = model_length(ray.scale, r_from, z_from, r_to, z_to, DEPTHS);
                const float optical_depth = fmin(medium.w * length_crossed, MAX_OPTICAL_DEPTH);
                if (!(optical_depth > 0.0f))
                    continue;
                const float begins = fmax(ray_depth(&ray, r_from, z_from, DEPTHS) + depth_shift, t_reached);
                t_reached = fmax(ray_depth(&ray, r_to, z_to, DEPTHS) + depth_shift, begins);
                if (slot < capacity) {
                    SEGMENT(pool, band_ray, slot, capacity, SEGMENT_FROM) = begins;
                    SEGMENT(pool, band_ray, slot, capacity, SEGMENT_TO) = t_reached;
                    SEGMENT(pool, band_ray, slot, capacity, SEGMENT_OPTICAL_DEPTH) = optical_depth;
                    SEGMENT(pool, band_ray, slot, capacity, SEGMENT_COLOR) = medium.x;
                    SEGMENT(pool, band_ray, slot, capacity, SEGMENT_COLOR + 1) = medium.y;
                    SEGMENT(pool, band_ray, slot, capacity, SEGMENT_COLOR + 2) = medium.z;
                }
                ++slot;
                absorbed += optical_depth;
            }
#else
            const float length_crossed = length_drawn(&ray, from, to, DEPTHS);
#ifdef FIRST_HIT
            const float tau = medium.w * length_crossed;
            met = accumulated ? met + tau : tau;
            hit = met > 0.0f && met >= least_optical_depth;
            r_hit = first_drawn(&ray, from);
            stays = stays && !hit;
#else
            const float weight = transmittance * opacity_of(medium.w * length_crossed); // over, front to back
            composite_over(&color, &transmittance, &rest, weight, medium.xyz);
#endif
#endif
            // Behind it comes the next one, and nothing is left to search for
            search.n += stays ? 1 : 0;
            search.low = search.n;
#ifdef ONE_LIST
            // All lanes stay in their lists, and come to the next one in step
            stays = stays && !RAY_IS_DONE;
            meets = stays && search.n < list.count;
            if (meets) {
                face = face_met(list, SUPERSEGMENTS_ARGUMENTS search.n, away);
                meets = face.x <= next_depth;
                stays = meets;
            }
#endif
        }
        if (!stays) {
            if (r_next >= r_end || RAY_IS_DONE)
                break;
            r = r_next;
            depth = next_depth;
            search = begin_search(search.n);
            i += r_u <= r_v ? step_i : 0;
            j += r_u <= r_v ? 0 : step_j;
            if (i < 0 || i >= lists_wide || j < 0 || j >= lists_high)
                break;
        }
#ifdef SKIP_EMPTY
        enters_tile = enters_tile || (((i ^ last_i) | (j ^ last_j)) >> TILE_SHIFT) != 0;
#endif
    }
#if defined(SEGMENTS)
    ends[stream * rays + band_ray] = slot;
    if (RAY_IS_DONE)
        dark[band_ray] = fmin(dark_before, t_reached);
    if (slot > first_slot) {
        bool inside = true;
        for (int corner = 0; corner < 4; ++corner) {
            float t0 = -INFINITY;
            float t1 = INFINITY;
            inside = clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, BOX_PLANES, a + (corner & 1 ? margin : -margin),
                                    b + (corner & 2 ? margin : -margin), &t0, &t1) && inside;
        }
        contributes[stream * rays + band_ray] = inside ? 2 : 1;
    }
#elif defined(FIRST_HIT)
    const float z_hit = fma(r_hit, along.z, deep.z);
    const float passed_by = model_length(ray.scale, r_begin, start.z, r_hit, z_hit, DEPTHS);
    image[place] = hit ? ray.t_begin + passed_by / model_speed(forms, a, b) : NOTHING;
#else
    image[place] = composited(color, transmittance, rest);
#endif
}
