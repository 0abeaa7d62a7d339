// Entry point to opencl/common/lists.cl, one work-item per query.
#include "common/lists.cl"
#pragma OPENCL FP_CONTRACT OFF

// Query i asks list lists[i].x .. lists[i].x + lists[i].y; (direction, guess) = how[i].
__kernel void counts_passing(int count, __global const float2 *faces, __global const int2 *lists,
                             __global const float *depths, __global const int2 *how, __global int *results)
{
    const int i = get_global_id(0);
    if (i < count)
        results[i] = count_passing(faces + lists[i].x, lists[i].y, depths[i], how[i].x != 0, how[i].y);
}
