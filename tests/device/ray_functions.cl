// Entry points to opencl/lib/rays.cl, one work-item per case.
#include "lib/rays.cl"
#pragma OPENCL FP_CONTRACT OFF

// Case i clips interval i to `planes` forms of its own.
__kernel void clipped(int count, __global const float *forms, int planes, __global const float2 *offsets,
                      __global float2 *intervals, __global int *left)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    float t0 = intervals[i].x;
    float t1 = intervals[i].y;
    left[i] = clip_to_planes(forms + i * planes * FORM_SIZE, planes, offsets[i].x, offsets[i].y, &t0, &t1);
    intervals[i] = (float2)(t0, t1);
}

__kernel void block_pixels(int count, int width, uint first, __global int2 *pixels)
{
    const int i = get_global_id(0);
    if (i < count)
        pixels[i] = block_pixel(first + (uint)i, width);
}

