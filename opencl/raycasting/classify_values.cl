// Values that a VDI keeps to the arrays of a classified one (lib/values.cl).
#include "lib/values.cl"
#pragma OPENCL FP_CONTRACT OFF

// One work-item per supersegment.
__kernel void classify_values(uint count, int cells, __global const float *means,
                              __global const float *spreads,
                              __global const float *steps, // of the march, in each supersegment
                              __global const float4 *integrals, // as lib/values.cl has them
                              __global float *colors,           // straight RGB, 3 per supersegment
                              __global float *optical_depths)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count)
        return;
    const float4 medium = classified(integrals, cells, means[i], spreads[i], steps[i]);
    optical_depths[i] = medium.w;
    vstore3(medium.xyz, i, colors);
}
