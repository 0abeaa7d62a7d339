// A VDI's arrays to what the raycaster reads: faces in list space and extinction in place of
// optical depth, by bundles of lists (raycasting/supersegments.cl, whose -D names hold here), which
// are counted in the occupancy grid.
#include "lib/values.cl"
#include "raycasting/occupancy.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Model length per unit of view depth along the centre ray of a list.
inline float length_per_depth(__global const float *centre_ray, int i, int j, int width, int height)
{
    const float a = (float)i + 0.5f - 0.5f * (float)width;
    const float b = (float)j + 0.5f - 0.5f * (float)height;
    return length(
        fma(b, vload3(2, centre_ray), fma(a, vload3(1, centre_ray), vload3(0, centre_ray))));
}

// A supersegment's faces in list space, of offsets from depth_origin. A face on the eye's plane has
// no list coordinate; nothing nearer than `nearest` is ever looked up.
inline float2 prepared_face(float front, float back, float depth_origin, float nearest)
{
    const float least = DEPTH == PARALLEL ? -INFINITY : nearest - depth_origin;
    return (float2)(KEPT_FACE(fmax(front, least), depth_origin),
                    KEPT_FACE(fmax(back, least), depth_origin));
}

// Its extinction, finite however thin: nothing or everything of such a supersegment is crossed.
inline float prepared_extinction(float front, float back, float optical_depth, float per_depth)
{
    return fmin(optical_depth / fmax((back - front) * per_depth, FLT_MIN), FLT_MAX);
}

#if !PACKED
// One work-item per bundle of lists. Of values, to which a transfer function is applied, what is
// transparent is left out: the rest moves up.
__attribute__((vec_type_hint(float16))) __kernel void prepare_lists(
    __global const ulong *starts, // of the lists in the arrays, width * height + 1
    __global const ulong *places, // headers of the bundles with all supersegments
    __global const float *fronts, // view depth less depth_origin
    __global const float *backs,
    __global const float *colors, // straight RGB; 0: there are values
    __global const float *optical_depths, __global const float *means,
    __global const float *spreads,
    __global const float *steps,      // of the march, in each supersegment
    __global const float4 *integrals, // as lib/values.cl has them
    int cells,
    float depth_origin, // world units
    float nearest,      // least view depth that is in front of the eye, world units
    __global const float
        *centre_ray, // 9: model-frame direction of the ray of pixel offsets (a, b), rows 1, a, b
    Counted grid,
    __global uint *changes, // of the occupancy grid's counts; all 0
    __global ulong *headers, __global float2 *faces,
    __global float4 *media) // straight RGB, extinction per model length
{
    const size_t bundle = get_global_id(0);
    const int wide = (grid.width + BUNDLE - 1) >> BUNDLE_SHIFT;
    if (bundle >= (size_t)wide * (size_t)((grid.height + BUNDLE - 1) >> BUNDLE_SHIFT))
        return;
    const OFFSET_T first = first_of_header(places[bundle]);
    int lengths[LISTS_PER_BUNDLE], longest = 0;
    for (int place = 0; place < LISTS_PER_BUNDLE; ++place) {
        const int i = (int)(bundle % (size_t)wide) * BUNDLE + (place & (BUNDLE - 1));
        const int j = (int)(bundle / (size_t)wide) * BUNDLE + (place >> BUNDLE_SHIFT);
        int n = 0;
        if (i < grid.width && j < grid.height) {
            const size_t list = (size_t)j * (size_t)grid.width + (size_t)i;
            const ulong end = starts[list + 1];
            __global uint *counts = cells_of_list(&grid, list, changes);
            const float per_depth = length_per_depth(centre_ray, i, j, grid.width, grid.height);
            for (ulong k = starts[list]; k < end; ++k) {
                const float4 medium =
                    colors ? (float4)(vload3(k, colors), optical_depths[k])
                           : classified(integrals, cells, means[k], spreads[k], steps[k]);
                if (!colors && !(medium.w > 0.0f))
                    continue;
                const float front = fronts[k], back = backs[k];
                count_supersegment(&grid, front, back, counts);
                const OFFSET_T entry = first + ((OFFSET_T)n << 2 * LIST_SHIFT) + place;
                faces[entry] = prepared_face(front, back, depth_origin, nearest);
                media[entry] =
                    (float4)(medium.xyz, prepared_extinction(front, back, medium.w, per_depth));
                ++n;
            }
        }
        lengths[place] = n;
        longest = max(longest, n);
    }
    // One entry beyond, if there is room: rays that meet nothing there weigh what they read with 0
    const int written = min(longest + 1, count_of_header(places[bundle]));
    for (int place = 0; place < LISTS_PER_BUNDLE; ++place)
        for (int n = lengths[place]; n < written; ++n) {
            const OFFSET_T entry = first + ((OFFSET_T)n << 2 * LIST_SHIFT) + place;
            faces[entry] = NO_FACE;
            media[entry] = (float4)(0.0f);
        }
    headers[bundle] = (ulong)first | (ulong)longest << FIRST_BITS;
}
#else
// Lists of 8-byte supersegments: each begins with its scales. One work-item per list; the hint
// keeps Intel's compiler from copying lists in vectors, as long as their longest.
__attribute__((vec_type_hint(float16))) __kernel void prepare_packed(
    __global const ulong *starts,     // of the lists in `stored`, width * height + 1
    __global const OFFSET_T *headers, // the same in `words`
    __global const int *origins,      // of the lists' depths, steps
    __global const ushort *strides,   // steps per code
    __global const uint2 *stored,
    float step, // of depth, world units
    int width, int height,
    __global const float
        *centre_ray, // 9: model-frame direction of the ray of pixel offsets (a, b), rows 1, a, b
    __global uint2 *words)
{
    const size_t list = get_global_id(0);
    if (list >= (size_t)width * (size_t)height)
        return;
    const ulong begin = starts[list], end = starts[list + 1];
    if (begin == end)
        return;
    const int i = (int)(list % (size_t)width), j = (int)(list / (size_t)width);
    const float per_depth = length_per_depth(centre_ray, i, j, width, height);
    const int origin = origins[list], stride = strides[list];
    __global uint2 *target = words + headers[list];
    target[0] = (uint2)(as_uint(origin), (uint)stride);
    target[1] = (uint2)(as_uint(1.0f / (per_depth * (float)stride * step)), 0);
    for (ulong k = begin; k < end; ++k)
        target[LIST_HEADER + k - begin] = stored[k];
}
#endif
