// Lists of 8-byte supersegments to what the raycaster reads: each begins with its scales, see
// raycasting/supersegments.cl.
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// One work-item per list; the hint keeps Intel's compiler from copying lists in vectors, as long as
// their longest.
__attribute__((vec_type_hint(float16))) __kernel void prepare_packed(
    __global const ulong *starts,     // of the lists in `stored`, width * height + 1
    __global const OFFSET_T *headers, // the same in `words`
    __global const int *origins,      // of the lists' depths, steps
    __global const ushort *strides,   // steps per code
    __global const uint2 *stored,
    float step, // of depth, world units
    int width, int height,
    __global const float
        *centre_ray, // 9: model-frame direction of the ray of pixel offsets (a, b), rows 1, a, b
    __global uint2 *words)
{
    const size_t list = get_global_id(0);
    if (list >= (size_t)width * (size_t)height)
        return;
    const ulong begin = starts[list], end = starts[list + 1];
    if (begin == end)
        return;
    const float a = (float)(list % (size_t)width) + 0.5f - 0.5f * (float)width;
    const float b = (float)(list / (size_t)width) + 0.5f - 0.5f * (float)height;
    const float3 direction =
        fma(b, vload3(2, centre_ray), fma(a, vload3(1, centre_ray), vload3(0, centre_ray)));
    const int origin = origins[list], stride = strides[list];
    __global uint2 *target = words + headers[list];
    target[0] = (uint2)(as_uint(origin), (uint)stride);
    target[1] = (uint2)(as_uint(1.0f / (length(direction) * (float)stride * step)), 0);
    for (ulong k = begin; k < end; ++k)
        target[LIST_HEADER + k - begin] = stored[k];
}
