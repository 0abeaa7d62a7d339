// The occupancy grid: how many supersegments reach into each cell (paper, section 4), and for each
// stack of cells the set of its occupied slabs as one 64-bit mask, which answers a ray's whole
// crossing of the stack with one load.
#include "raycasting/stacks.cl"
#pragma OPENCL FP_CONTRACT OFF

// The grid as it is counted, and the lists' window.
typedef struct {
    int width, height; // lists
    int stacks_wide;
    float first_depth;     // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth; // per world unit
    float margin;          // by which supersegments count beyond their faces, world units
} Counted;

// The cells of the stack that a list is in.
inline __global uint *cells_of_list(const Counted *grid, size_t list, __global uint *changes)
{
    const size_t i = (list % (size_t)grid->width) >> STACK_SHIFT;
    const size_t j = (list / (size_t)grid->width) >> STACK_SHIFT;
    return changes + (j * (size_t)grid->stacks_wide + i) * SLABS;
}

// Add 1 where a supersegment begins, and take 1 away behind its end, whatever it spans:
// `occupied_slabs` sums up. Counts are whole numbers, so that their order changes nothing.
inline void count_supersegment(const Counted *grid, float front, float back, __global uint *cells)
{
    const int first = slab_of(front - grid->margin, grid->first_depth, grid->slabs_per_depth);
    const int last = slab_of(back + grid->margin, grid->first_depth, grid->slabs_per_depth);
    atomic_inc(cells + first);
    if (last + 1 < SLABS)
        atomic_dec(cells + last + 1);
}

// How many entries each bundle of lists takes, the longest list's length, and the first front and
// the last back of each list that is not empty. One work-item per bundle.
__kernel void measure_bundles(__global const ulong *starts, __global const float *fronts,
                              __global const float *backs, int width, int height,
                              __global uint *lengths, __global uint *longest, __global float2 *ends)
{
    const int wide = (width + BUNDLE - 1) / BUNDLE, bundle = (int)get_global_id(0);
    uint most = 0;
    for (int n = 0; n < BUNDLE * BUNDLE; ++n) {
        const int i = bundle % wide * BUNDLE + n % BUNDLE, j = bundle / wide * BUNDLE + n / BUNDLE;
        if (i >= width || j >= height)
            continue;
        const size_t list = (size_t)j * (size_t)width + (size_t)i;
        const ulong first = starts[list], end = starts[list + 1];
        if (first < end)
            ends[list] = (float2)(fronts[first], backs[end - 1]);
        most = max(most, (uint)(end - first));
    }
    if (bundle / wide * BUNDLE < height)
        lengths[bundle] = most * BUNDLE * BUNDLE;
    if (most > *longest)
        atomic_max(longest, most);
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
