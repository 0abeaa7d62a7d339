// Entry point to opencl/volume/march.cl: whole marches, one ray per work-item.
//
// -D: as opencl/volume/march.cl
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

// Of each ray its number of steps (-1 where it misses), every step's medium, and how many could be passed by there.
__kernel void marches(int count, MEDIUM_PARAMETERS
                      __global const float *forms, int planes, __global const float2 *offsets, float sample_distance,
                      float unit_distance, int group, int capacity, __global int *steps, __global float4 *media,
                      __global int *empty)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    March march;
    steps[i] = -1;
    if (!begin_march(&march, forms, planes, offsets[i].x, offsets[i].y, sample_distance, unit_distance, INFINITY))
        return;
    const Medium medium = MEDIUM;
    steps[i] = march.steps;
    for (int k = 0; k < min(march.steps, capacity - 1); ++k) {
        const int at = i * capacity + k;
        media[at] = step_medium(&march, &medium, k, step_face(&march, k), step_face(&march, k + 1));
        empty[at] = empty_steps(&march, &medium, 1, k, march.steps, group, step_face(&march, k), step_face(&march, k + 1));
    }
}
