// Entry points to opencl/lib/double_float.cl and to what lib/rays.cl does with it, one work-item per case.
//
// -D DOUBLE_FLOAT_RAYS
#include "lib/rays.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void arithmetic(int count, __global const float2 *a, __global const float2 *b, __global float2 *sums,
                         __global float2 *products, __global float2 *quotients, __global int *less)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    sums[i] = double_float_sum(a[i], b[i]);
    products[i] = double_float_product(a[i], b[i]);
    quotients[i] = double_float_quotient(a[i], b[i]);
    less[i] = double_float_less(a[i], b[i]);
}

// Case i is clipped to `planes` forms of its own, and has its first form evaluated where it enters.
__kernel void entries(int count, __global const float *forms, int planes, __global const float2 *offsets, float t_end,
                      __global float2 *entry, __global float2 *length_and_value, __global int *left)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    __global const float *own = forms + i * planes * FORM_SIZE;
    float2 t = (float2)(0.0f);
    float length = 0.0f;
    left[i] = clip_from_entry(own, planes, offsets[i].x, offsets[i].y, t_end, &t, &length);
    entry[i] = t;
    length_and_value[i] = (float2)(length, form_at(own, offsets[i].x, offsets[i].y, t).x);
}
