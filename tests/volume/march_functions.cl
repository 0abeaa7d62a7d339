// Entry point to opencl/volume/march.cl: whole marches, one ray per work-item.
//
// -D: as opencl/volume/march.cl
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

// Of each ray its interval and step, its number of steps (-1 where it misses), every face, every step's medium, and how
// many steps could be passed by there.
__kernel void marches(int count, MEDIUM_PARAMETERS
                      __global const float *forms, int planes, __global const float2 *offsets, float sample_distance,
                      float unit_distance, float t_end, int group, int capacity, __global float4 *intervals,
                      __global int *steps, __global float *faces, __global float4 *media, __global int *empty)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    March march;
    steps[i] = -1;
    if (!begin_march(&march, forms, planes, offsets[i].x, offsets[i].y, sample_distance, unit_distance, t_end))
        return;
    const Medium medium = MEDIUM;
    steps[i] = march.steps;
    intervals[i] = (float4)(march.t0, march.t1, march.step, march.units);
    for (int k = 0; k < min(march.steps, capacity - 1); ++k) {
        const int at = i * capacity + k;
        faces[at] = step_face(&march, k);
        media[at] = step_medium(&march, &medium, k, step_face(&march, k), step_face(&march, k + 1));
        empty[at] = empty_steps(&march, &medium, 1, k, march.steps, group, step_face(&march, k), step_face(&march, k + 1));
    }
    faces[i * capacity + min(march.steps, capacity - 1)] = step_face(&march, march.steps);
}
