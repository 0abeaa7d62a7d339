// A VDI's arrays to what the raycaster reads: faces in list space and extinction in place of
// optical depth, by bundles of lists (raycasting/supersegments.cl), which are counted in the
// occupancy grid.
#define OFFSET_T long
#define PACKED 0
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

// One work-item per bundle of lists. Of values, to which a transfer function is applied, what is
// transparent is left out: the rest moves up.
__attribute__((vec_type_hint(float16))) __kernel void prepare_lists(
    __global const ulong *starts, // of the lists in the arrays, width * height + 1
    __global const ulong *begins, // where bundles begin that have all supersegments
    __global const float *fronts, // view depth less depth_origin
    __global const float *backs,
    __global const float *colors, // straight RGB; 0: there are values
    __global const float *optical_depths, __global const float *means,
    __global const float *spreads,
    __global const float *steps,      // of the march, in each supersegment
    __global const float4 *integrals, // as lib/values.cl has them
    int cells,
    int depth_kind,     // of faces: PARALLEL where offsets are kept
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
    const Depths depths = {depth_kind, depth_origin};
    const OFFSET_T first = (OFFSET_T)begins[bundle];
    const int room = (int)((OFFSET_T)begins[bundle + 1] - first) >> 2 * LIST_SHIFT;
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
                // A face on the eye's plane has no list coordinate; nothing nearer than `nearest`
                // is ever looked up. Extinction is finite however thin a supersegment is: nothing
                // or everything of such a one is crossed
                const float near = fmax(front, nearest - depth_origin);
                const float far = fmax(back, nearest - depth_origin);
                const float extinction =
                    fmin(medium.w / fmax((back - front) * per_depth, FLT_MIN), FLT_MAX);
                const OFFSET_T entry = first + ((OFFSET_T)n << 2 * LIST_SHIFT) + place;
                faces[entry] =
                    (float2)(depth_coordinate(near, depths), depth_coordinate(far, depths));
                media[entry] = (float4)(medium.xyz, extinction);
                ++n;
            }
        }
        lengths[place] = n;
        longest = max(longest, n);
    }
    // One entry beyond, if there is room: rays that meet nothing there weigh what they read with 0
    const int written = min(longest + 1, room);
    for (int place = 0; place < LISTS_PER_BUNDLE; ++place)
        for (int n = lengths[place]; n < written; ++n) {
            const OFFSET_T entry = first + ((OFFSET_T)n << 2 * LIST_SHIFT) + place;
            faces[entry] = NO_FACE;
            media[entry] = (float4)(0.0f);
        }
    headers[bundle] = (ulong)first | (ulong)longest << FIRST_BITS;
}

// Lists of 8-byte supersegments, whose faces are codes of depth (model/packing.py): each is written
// behind its scales. One work-item per list; the hint keeps Intel's compiler from copying lists in
// vectors, as long as their longest.
__attribute__((vec_type_hint(float16))) __kernel void prepare_packed(
    __global const ulong *starts,   // of the lists in `words`, width * height + 1
    __global const ulong *headers,  // the same in `faces`
    __global const int *origins,    // of the lists' depths, steps
    __global const ushort *strides, // steps per code
    __global const uint2 *words,
    float step, // of depth, world units
    __global const float
        *centre_ray, // 9: model-frame direction of the ray of pixel offsets (a, b), rows 1, a, b
    Counted grid,
    __global uint *changes, // of the occupancy grid's counts; all 0
    __global uint2 *faces)
{
    const size_t list = get_global_id(0);
    if (list >= (size_t)grid.width * (size_t)grid.height)
        return;
    const ulong begin = starts[list], end = starts[list + 1];
    if (begin == end)
        return;
    const int i = (int)(list % (size_t)grid.width), j = (int)(list / (size_t)grid.width);
    const float per_depth = length_per_depth(centre_ray, i, j, grid.width, grid.height);
    const int origin = origins[list], stride = strides[list];
    __global uint *counts = cells_of_list(&grid, list, changes);
    __global uint2 *target = faces + first_of_header(headers[list]);
    target[-LIST_HEADER] = (uint2)(as_uint(origin), (uint)stride);
    target[1 - LIST_HEADER] = (uint2)(as_uint(1.0f / (per_depth * (float)stride * step)), 0);
    for (ulong k = begin; k < end; ++k) {
        const int front = (int)(words[k].x & DEPTH_CODES);
        const int back = (int)(words[k].x >> 14 & DEPTH_CODES);
        count_supersegment(&grid, (float)(origin + front * stride) * step,
                           (float)(origin + back * stride) * step, counts);
        target[k - begin] = words[k];
    }
}
