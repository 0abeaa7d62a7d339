// Entry points to opencl/lib/classification.cl and opacity.cl, one work-item per case.
#include "lib/classification.cl"
#pragma OPENCL FP_CONTRACT OFF

#if LANES == 1
__kernel void classified(int count, __global const float *scalars, __global const float4 *table, int entries, float low,
                         float per_scalar, __global float4 *results)
{
    const int i = get_global_id(0);
    if (i < count)
        results[i] = classify(scalars[i], table, entries, low, per_scalar);
}

__kernel void step_optical_depths(int count, __global const float *opacities, __global const float *units,
                                  __global float *results)
{
    const int i = get_global_id(0);
    if (i < count)
        results[i] = step_optical_depth(opacities[i], units[i]);
}
#endif

// LANES of them for each work-item
__kernel void opacities(int count, __global const float *optical_depths, __global float *results)
{
    const int i = get_global_id(0);
    if (i < count)
        STORE_LANES(opacity_of(LOAD_LANES(i, optical_depths)), i, results);
}
