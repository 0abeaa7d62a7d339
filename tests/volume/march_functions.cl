// Entry point to opencl/volume/march.cl: whole marches, one ray per work-item.
//
// -D: as opencl/volume/march.cl
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

// Of each ray its number of steps (-1 where it misses), every step's medium, and how many could be passed by there.
__kernel void marches(int count, const Classified classified, __global const VOXEL_T *voxels, __global const float4 *table,
                      __global const uchar *distances, const RaysOfView view, __global const float *forms,
                      __global const float2 *offsets, int group, int capacity, __global int *steps,
                      __global float4 *media, __global int *empty)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    March march;
    steps[i] = -1;
    if (!begin_march(&march, &view, &classified, forms, offsets[i].x, offsets[i].y, INFINITY))
        return;
    const Medium medium = {classified, voxels, table, distances, 0, 0, 0, 0};
    steps[i] = march.steps;
    for (int k = 0; k < min(march.steps, capacity - 1); ++k) {
        const int at = i * capacity + k;
        const float front = step_face(&march, k), back = step_face(&march, k + 1);
        media[at] = step_medium(&march, &medium, front, back);
        empty[at] = empty_steps(&march, &medium, 1, k, march.steps, group, front, back);
    }
}
