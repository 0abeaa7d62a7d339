// The occupancy grid: how many supersegments reach into each cell (paper, section 4), and for each tile of lists the set of
// its occupied slabs as one 64-bit mask, which answers a ray's whole crossing of the tile with one load.
//
// -D OFFSET_T   type of an offset into the supersegments: uint or ulong
#include "common/occupancy.cl"
#pragma OPENCL FP_CONTRACT OFF

// One work-item per list. Counts are sums of whole numbers, so that their order changes nothing.
__kernel void count_supersegments(
    __global const OFFSET_T *offsets, // width * height + 1
    __global const float *fronts,     // view depth less depth_origin
    __global const float *backs,
    int width, int height,            // lists
    int tiles_wide,
    float first_depth,                // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth,            // per world unit
    float margin,                     // by which supersegments count beyond their faces, world units
    __global uint *counts)            // tiles_high, tiles_wide, SLABS; all 0
{
    const size_t list = get_global_id(0);
    if (list >= (size_t)width * (size_t)height)
        return;
    const size_t i = (list % (size_t)width) >> TILE_SHIFT;
    const size_t j = (list / (size_t)width) >> TILE_SHIFT;
    __global uint *cells = counts + (j * (size_t)tiles_wide + i) * SLABS;
    for (OFFSET_T k = offsets[list]; k < offsets[list + 1]; ++k) {
        const int first = slab_of(fronts[k] - margin, first_depth, slabs_per_depth);
        const int last = slab_of(backs[k] + margin, first_depth, slabs_per_depth);
        for (int slab = first; slab <= last; ++slab)
            atomic_inc(cells + slab);
    }
}

// One work-item per tile.
__kernel void occupied_slabs(__global const uint *counts, uint tiles, __global ulong *masks)
{
    const size_t tile = get_global_id(0);
    if (tile >= tiles)
        return;
    ulong mask = 0;
    for (int slab = 0; slab < SLABS; ++slab)
        mask |= (ulong)(counts[tile * SLABS + slab] > 0) << slab;
    masks[tile] = mask;
}
