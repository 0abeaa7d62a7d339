// The occupancy grid: how many supersegments reach into each cell (paper, section 4), and for each stack of cells the set of
// its occupied slabs as one 64-bit mask, which answers a ray's whole crossing of the stack with one load.
//
// -D OFFSET_T   type of an offset into the supersegments: uint or ulong
// -D PACKED=8   faces are codes of depth, see model/packing.py
#include "raycasting/stacks.cl"
#pragma OPENCL FP_CONTRACT OFF

// One work-item per list. Each supersegment adds 1 where it begins and takes 1 away behind its end, whatever it spans;
// `occupied_slabs` sums up. Counts are sums of whole numbers, so that their order changes nothing.
__kernel void count_supersegments(
    __global const OFFSET_T *offsets, // width * height + 1
#ifdef PACKED
    __global const int *origins,      // of the lists' depths, steps
    __global const ushort *strides,   // steps per code
    __global const uint2 *words,
    float step,                       // of depth, world units
#else
    __global const float *fronts,     // view depth less depth_origin
    __global const float *backs,
#endif
    int width, int height,            // lists
    int stacks_wide,
    float first_depth,                // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth,            // per world unit
    float margin,                     // by which supersegments count beyond their faces, world units
    __global uint *changes)           // of the counts of each stack: stacks_high, stacks_wide, SLABS; all 0
{
    const size_t list = get_global_id(0);
    if (list >= (size_t)width * (size_t)height)
        return;
    const size_t i = (list % (size_t)width) >> STACK_SHIFT;
    const size_t j = (list / (size_t)width) >> STACK_SHIFT;
    __global uint *cells = changes + (j * (size_t)stacks_wide + i) * SLABS;
    for (OFFSET_T k = offsets[list]; k < offsets[list + 1]; ++k) {
#ifdef PACKED
        const int origin = origins[list], stride = strides[list];
        const float front = (float)(origin + (int)(words[k].x & DEPTH_CODES) * stride) * step;
        const float back = (float)(origin + (int)(words[k].x >> 14 & DEPTH_CODES) * stride) * step;
#else
        const float front = fronts[k], back = backs[k];
#endif
        const int first = slab_of(front - margin, first_depth, slabs_per_depth);
        const int last = slab_of(back + margin, first_depth, slabs_per_depth);
        atomic_inc(cells + first);
        if (last + 1 < SLABS)
            atomic_dec(cells + last + 1);
    }
}

// One work-item per stack: its changes become counts.
__kernel void occupied_slabs(__global uint *counts, uint stacks, __global ulong *masks)
{
    const size_t stack = get_global_id(0);
    if (stack >= stacks)
        return;
    ulong mask = 0;
    uint count = 0;
    for (int slab = 0; slab < SLABS; ++slab) {
        count += counts[stack * SLABS + slab];
        counts[stack * SLABS + slab] = count;
        mask |= (ulong)(count > 0) << slab;
    }
    masks[stack] = mask;
}
