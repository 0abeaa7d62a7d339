// Entry point to opencl/volume/sampling.cl, one work-item per sample.
//
// -D VOXEL_T, INDEX_T, COMPONENTS: see volume/sampling.cl
#include "volume/sampling.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void samples(int count, __global const VOXEL_T *voxels, int4 size, __global const float *positions,
                      int nearest, __global float *results)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const float3 at = vload3(i, positions);
    const Points points = {size, size};
    results[i] = nearest ? (float)nearest_component(voxels, &points, at.x, at.y, at.z, SCALAR)
                         : linear_component(voxels, &points, at.x, at.y, at.z, SCALAR);
}
