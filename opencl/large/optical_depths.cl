// The optical depth of the steps of each ray in part of a grid: the first of the two passes over a
// volume in blocks. One ray for each work-item; sixteen: cpu16/generation_optical_depths.cl.
//
// -D GRID_PART and those of volume/march.cl. It decides by how much an error counts, and no colour:
// one step in `stride` is sampled, and at the faces of a block whose neighbours are not at hand the
// last point is taken for the next.
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void optical_depths(const Classified classified, __global const VOXEL_T *voxels,
                             __global const float4 *table, __global const uchar *distances,
                             __global const uchar *blanked, __global const float *gradient,
                             __global const float *lighting, __global const float *ambient,
                             const RaysOfView view, __global const float *forms,
                             int stride,             // steps
                             __global float *depths) // of each ray, rows of columns
{
    const Rays ray = rays_of_view(&view, (uint)get_global_id(0));
    if (!ray.present)
        return;
    float depth = 0.0f;
    March march;
    if (begin_march(&march, &view, &classified, forms, ray.a, ray.b, INFINITY)) {
        const Medium medium = {classified, voxels,   table,    distances,
                               blanked,    gradient, lighting, ambient};
        // The same steps whatever the blocks
        for (int k = (march.begin + (stride - 1)) / stride * stride; k < march.steps;) {
            const float front = step_face(&march, k), back = step_face(&march, k + 1);
            const int empty = empty_steps(&march, &medium, 1, k, march.steps, stride, front, back);
            if (empty == 0)
                depth += step_medium(&march, &medium, front, back).w * (float)stride;
            k += max(empty, stride);
        }
    }
    depths[ray.y * view.columns + ray.x] = depth;
}
