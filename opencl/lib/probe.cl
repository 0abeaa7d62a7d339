// Purpose:  run on a device before it is trusted. Uses what the real kernels use: 32-bit float
//           functions, fma, 64-bit index arithmetic, local memory with a barrier, integer atomics.
// Launch:   one dimension, global size = count, local size = the given group size.
// Argument: x         count floats in (0, 1)
//           values    count float4: expm1(-x), log1p(-x), exp(-x), fma(x, x, -x*x as rounded)
//           group_sum one uint per group: sum of the work items' global indices, by local memory
//           total     one uint, zero before the launch: sum of (index + 1), by atomics
// Expects:  no -D names.
#pragma OPENCL FP_CONTRACT OFF

__kernel void probe(__global const float *x, __global float4 *values, __global uint *group_sum,
                    __global uint *total, __local uint *shared)
{
    const ulong index = get_global_id(0);
    const uint lane = (uint)get_local_id(0);
    const float value = x[index];

    // The rounding error of the square: zero if the compiler contracts or fma is not fused.
    const float square = value * value;
    values[index] = (float4)(expm1(-value), log1p(-value), exp(-value), fma(value, value, -square));
    atomic_add(total, (uint)index + 1u);

    shared[lane] = (uint)index;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0u) {
        uint sum = 0u;
        for (uint i = 0u; i < (uint)get_local_size(0); ++i)
            sum += shared[i];
        group_sum[get_group_id(0)] = sum;
    }
}
