// Entry points to opencl/lib/double_float.cl, one work-item per case.
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
