// A deferred VDI's values to what the raycaster reads, by a transfer function: as
// classify_values.cl, prepare.cl and occupancy.cl do one after the other, in one pass. What is
// transparent is left out.
//
// -D PACKED=0   the raycaster's names hold here (raycasting/supersegments.cl)
#include "lib/values.cl"
#include "raycasting/occupancy.cl"
#include "raycasting/prepare.cl"
#pragma OPENCL FP_CONTRACT OFF

// One work-item per bundle of lists: they move up in it.
__attribute__((vec_type_hint(float16))) __kernel void
prepare_values(__global const ulong *starts, // of the lists in the arrays, width * height + 1
               __global const ulong *places, // headers of the bundles with all supersegments
               __global const float *fronts, // view depth less depth_origin
               __global const float *backs, __global const float *means,
               __global const float *spreads,
               __global const float *steps,      // of the march, in each supersegment
               __global const float4 *integrals, // as lib/values.cl has them
               int cells,
               float depth_origin, // world units
               float nearest,      // least view depth that is in front of the eye, world units
               __global const float *centre_ray, // as prepare_lists has it
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
                const float4 medium = classified(integrals, cells, means[k], spreads[k], steps[k]);
                if (!(medium.w > 0.0f))
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
