// What a device must do right before it is trusted, as the real kernels use it: float functions,
// fma that is fused and a product that is not, indices of 64 bits, local memory, barriers and
// atomics.
#pragma OPENCL FP_CONTRACT OFF

// x: in (0, 1). values: expm1(-x), log1p(-x), exp(-x), the rounding error of x * x. total: 0
// before; the sum of all (index + 1), which each group sums up in `shared`, an element for each
// item.
__kernel void probe(__global const float *x, __global float4 *values, __global uint *total,
                    __local uint *shared)
{
    const ulong index = get_global_id(0);
    const uint lane = (uint)get_local_id(0);
    const float value = x[index], square = value * value;
    values[index] = (float4)(expm1(-value), log1p(-value), exp(-value), fma(value, value, -square));
    shared[lane] = (uint)index + 1u;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0u) {
        uint sum = 0u;
        for (uint i = 0u; i < (uint)get_local_size(0); ++i)
            sum += shared[i];
        atomic_add(total, sum);
    }
}
