// The optical depths of sixteen rays in vectors that are written out: large/optical_depths.cl, to
// the same bits.
#define LANES 16
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

KERNEL_OF_LANES void optical_depths(const Classified classified, __global const VOXEL_T *voxels,
                                    __global const float4 *table, __global const uchar *distances,
                                    __global const uchar *blanked, __global const float *gradient,
                                    __global const float *lighting, __global const float *ambient,
                                    const RaysOfView view, __global const float *forms, int stride,
                                    __global float *depths)
{
    const Rays rays = rays_of_view(&view, (uint)get_global_id(0) * LANES);
    if (!ANY(rays.present))
        return;
    Real depth = 0.0f;
    March march;
    if (ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b, INFINITY))) {
        const Medium medium = {classified, voxels,   table,    distances,
                               blanked,    gradient, lighting, ambient};
        Int k = (march.begin + (stride - 1)) / stride * stride;
        for (;;) {
            const Int active = rays.present & (k < march.steps);
            if (!ANY(active))
                break;
            const Real front = step_face(&march, k), back = step_face(&march, k + 1);
            const Int empty =
                empty_steps(&march, &medium, active, k, march.steps, stride, front, back);
            const Int here = active & (empty == 0);
            if (ANY(here)) {
                const Real of_step = step_medium(&march, &medium, front, back).w;
                depth += SELECT((Real)(0.0f), of_step * (float)stride, here);
            }
            k += max(empty, stride);
        }
    }
    const Places places = {rays.y * view.columns + rays.x}, wanted = {rays.present};
    const float *of_ray = (const float *)&depth;
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            depths[places.each[lane]] = of_ray[lane];
}
