// VDI to image from any view: the paper's raycaster (section 3).
//
// A ray steps from list to list (Amanatides and Woo), finds the first supersegment of each by the index found in the last
// one, and composites, front to back, the length that it crosses of each (DESIGN section 3 "Lengths", "A supersegment is a
// homogeneous medium").
//
// -D OFFSET_T           type of an offset into the supersegments: uint or ulong
// -D PARALLEL, SHIFTED  the depth coordinate, see common/list_space.cl
// -D FAR_ENTRIES        see common/list_space.cl
// -D COMPENSATED        see common/over.cl
// -D PACKED             the form of the supersegments, see common/supersegments.cl
// -D CROPPED            only some regions are drawn, see common/cropping.cl
// -D SKIP_EMPTY         pass by what the occupancy grid says is empty; the picture is the same to the last bit
// -D SEGMENTS           write what each ray crosses into a pool, to be merged with other VDIs by vdi/merge.cl, in place of
//                       compositing it; for a band of rays
// -D FIRST_HIT          in place of a picture, where each ray enters the first supersegment that reaches an opacity
#include "common/list_ray.cl"
#include "common/lists.cl"
#include "common/classification.cl"
#include "common/occupancy.cl"
#include "common/over.cl"
#include "common/segments.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef SEGMENTS
#define BOX_PLANES 6 // of the VDI's bounds: the first of `forms`' planes
// More cannot be told from opaque, and a part of it is still a number
#define MAX_OPTICAL_DEPTH 1e30f
#endif

// A ray that crosses fewer lists than this is not worth a look at the grid: at V_O it stays in one.
#define FEW_LISTS 2.0f

__kernel void raycast(
    __global const OFFSET_T *offsets,   // lists_wide * lists_high + 1
    SUPERSEGMENTS_PARAMETERS            // see common/supersegments.cl
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
    uint first_item,                    // work-item of the band's first ray
    int stream,                         // of this VDI
    int rays,                           // in the band
    float depth_shift,                  // this VDI's reference depth less the frame's
    float margin,                       // pixels; see `contributes`
    int capacity,                       // slots of a ray
    __global float *pool,               // see common/segments.cl
    __global int *ends,                 // (streams, rays): slot behind each stream's last, beyond the capacity if it was full
    __global uchar *contributes)        // (streams, rays): 1 if a ray meets the VDI, 2 if its neighbours at `margin` pixels
                                        // meet its bounds, too
#define RAY_IS_DONE (absorbed > optical_depth_cutoff)
#elif defined(FIRST_HIT)
    float least_optical_depth,          // a hit has some, and at least this much: by itself, or with all before it
    int accumulated,                    // whether what is before it counts
    __global float *image)              // t of the first hit, infinite where there is none, top row first
#define NOTHING INFINITY
#define RAY_IS_DONE hit
#else
    __global float4 *image)             // premultiplied RGBA, top row first
#define NOTHING (float4)(0.0f)
#define RAY_IS_DONE (transmittance < transmittance_cutoff)
#endif
{
#ifdef SEGMENTS
    const int band_ray = (int)get_global_id(0);
    const uint item = first_item + (uint)band_ray;
#else
    const uint item = (uint)get_global_id(0);
#endif
    const int2 pixel = block_pixel(item, width);
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
#endif

    ListRay ray;
    if (!begin_list_ray(&ray, forms, planes, CROPPING_ARGUMENT a, b, has_opaque_depth ? opaque_depth[place] : INFINITY,
                        depth_origin)) {
#ifndef SEGMENTS
        image[place] = NOTHING;
#endif
        return;
    }
    const float3 start = ray.start;
    const float3 deep = ray.deep;
    const float3 along = ray.along;
    const bool away = ray.away;
    const float r_begin = ray.r_begin;
    const float r_end = r_begin + 1.0f;

    // Where planes u = const, v = const and z = const are crossed; a component that does not change crosses none
    const float inverse_u = along.x != 0.0f ? 1.0f / along.x : 0.0f;
    const float inverse_v = along.y != 0.0f ? 1.0f / along.y : 0.0f;
    const float inverse_z = along.z != 0.0f ? 1.0f / along.z : 0.0f;
    const float half_wide = 0.5f * (float)lists_wide;
    const float half_high = 0.5f * (float)lists_high;
    int i = clamp((int)floor(start.x + half_wide), 0, lists_wide - 1);
    int j = clamp((int)floor(start.y + half_high), 0, lists_high - 1);
    const int step_i = along.x > 0.0f ? 1 : -1;
    const int step_j = along.y > 0.0f ? 1 : -1;
    const float border_i = along.x > 0.0f ? 1.0f : 0.0f; // from a list's lower border to the one ahead
    const float border_j = along.y > 0.0f ? 1.0f : 0.0f;
// Where the ray leaves column i, or row j, of lists: from the border's number, never accumulated
#define CROSSING_U(i) (((float)(i) + border_i - half_wide - deep.x) * inverse_u)
#define CROSSING_V(j) (((float)(j) + border_j - half_high - deep.y) * inverse_v)

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
    float z = start.z;
    int passed = 0; // supersegments passed in the list before: the first guess in the next
#ifdef SKIP_EMPTY
    const int tiles_wide = (lists_wide + TILE - 1) >> TILE_SHIFT;
    bool enters_tile = fabs(along.x) + fabs(along.y) > FEW_LISTS;
#endif
    while (true) {
#ifdef SKIP_EMPTY
        // Pass by tiles, and parts of tiles, whose slabs ahead are empty. Written with selects, and in a loop of its own, so
        // that the lanes of a vector meet again behind it.
        bool leaves_lists = false;
        while (enters_tile) {
            enters_tile = false;
            const int edge_i = along.x > 0.0f ? i | (TILE - 1) : i & ~(TILE - 1);
            const int edge_j = along.y > 0.0f ? j | (TILE - 1) : j & ~(TILE - 1);
            const ulong mask = masks[(j >> TILE_SHIFT) * tiles_wide + (i >> TILE_SHIFT)];
            const int slab = slab_of(depth_offset(z, DEPTHS), first_depth, slabs_per_depth);
            const ulong ahead = mask & (away ? slabs_from(slab) : slabs_to(slab));
            const int nearest = away ? (int)popcount((ahead & -ahead) - 1) : SLABS - 1 - (int)clz(ahead);
            if (ahead == 0 || nearest != slab) {
                // Up to here nothing is met: the tile's border, or the face of the next occupied slab
                float r_until = fmin(along.x != 0.0f ? CROSSING_U(edge_i) : INFINITY,
                                     along.y != 0.0f ? CROSSING_V(edge_j) : INFINITY);
                if (ahead != 0 && along.z != 0.0f) {
                    const float face = first_depth + (float)(away ? nearest : nearest + 1) / slabs_per_depth;
                    r_until = fmin(r_until, (depth_coordinate(face, DEPTHS) - deep.z) * inverse_z);
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
                z = column != i || row != j ? fma(r, along.z, deep.z) : z;
                enters_tile = (((i ^ column) | (j ^ row)) >> TILE_SHIFT) != 0;
                i = column;
                j = row;
                leaves_lists = r_until >= r_end || i < 0 || i >= lists_wide || j < 0 || j >= lists_high;
                enters_tile = enters_tile && !leaves_lists;
            }
        }
        if (leaves_lists)
            break;
        const int last_i = i;
        const int last_j = j;
#endif
        // The ray crosses list (i, j) from r to r_next
        const float r_u = along.x != 0.0f ? CROSSING_U(i) : INFINITY;
        const float r_v = along.y != 0.0f ? CROSSING_V(j) : INFINITY;
        const float r_next = fmax(r, fmin(r_end, fmin(r_u, r_v)));
        const float z_next = fma(r_next, along.z, deep.z);

        const size_t list = (size_t)j * (size_t)lists_wide + (size_t)i;
        const OFFSET_T begin = offsets[list];
        const int count = LIST_LENGTH(begin, offsets[list + 1]);
        if (count > 0) {
            BEGIN_LIST(begin)
            passed = count_passing(LIST(begin), count, z, away, passed);
            // Going away, supersegments passed, passed + 1 … follow; coming back, passed - 1, passed - 2 …
            while (away ? passed < count : passed > 0) {
                const OFFSET_T k = begin + (OFFSET_T)(away ? passed : passed - 1);
                const float2 face = FACE(k);
                if (away ? face.x > z_next : face.y < z_next)
                    break;
                // Clip to the supersegment by interval: between two faces it never leaves [r, r_next]
                float from = r;
                float to = r_next;
                const float enters = away ? face.x : face.y;
                const float leaves = away ? face.y : face.x;
                if (away ? enters > z : enters < z)
                    from = clamp((enters - deep.z) * inverse_z, r, r_next);
                const bool ends_here = away ? leaves <= z_next : leaves >= z_next;
                if (away ? leaves < z_next : leaves > z_next)
                    to = clamp((leaves - deep.z) * inverse_z, from, r_next);
                const float4 medium = MEDIUM(k);
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
                        __global float *segment = pool + segment_place(band_ray, slot, capacity, 0);
                        segment[SEGMENT_FROM * RAY_BLOCK] = begins;
                        segment[SEGMENT_TO * RAY_BLOCK] = t_reached;
                        segment[SEGMENT_OPTICAL_DEPTH * RAY_BLOCK] = optical_depth;
                        segment[SEGMENT_COLOR * RAY_BLOCK] = medium.x;
                        segment[(SEGMENT_COLOR + 1) * RAY_BLOCK] = medium.y;
                        segment[(SEGMENT_COLOR + 2) * RAY_BLOCK] = medium.z;
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
                if (hit)
                    break;
#else
                const float weight = transmittance * opacity_of(medium.w * length_crossed); // over, front to back
                composite_over(&color, &transmittance, &rest, weight, medium.xyz);
#endif
#endif
                if (!ends_here)
                    break;
                passed += away ? 1 : -1;
            }
        }
        if (r_next >= r_end || RAY_IS_DONE)
            break;
        r = r_next;
        z = z_next;
        if (r_u <= r_v) {
            i += step_i;
            if (i < 0 || i >= lists_wide)
                break;
        } else {
            j += step_j;
            if (j < 0 || j >= lists_high)
                break;
        }
#ifdef SKIP_EMPTY
        enters_tile = (((i ^ last_i) | (j ^ last_j)) >> TILE_SHIFT) != 0;
#endif
    }
#if defined(SEGMENTS)
    ends[stream * rays + band_ray] = slot;
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
