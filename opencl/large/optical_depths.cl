// The optical depth of the steps of each ray in part of a grid: the first of the two passes over a
// volume in blocks. A ray or a block of 4 x 4 in a work-item (lib/lanes.cl).
//
// -D: see volume/march.cl. It decides by how much an error counts, and no colour: one step in
// `stride` is sampled, and at the faces of a block whose neighbours are not at hand the last point
// is taken for the next.
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

KERNEL_OF_LANES void optical_depths(MEDIUM_PARAMETERS, const RaysOfView view,
                                    __global const float *forms,
                                    int stride,             // steps
                                    __global float *depths) // of each ray, rows of columns
{
    const Rays rays = rays_of_view(&view, (uint)get_global_id(0) * LANES);
    if (!ANY(rays.present))
        return;
    Real depth = 0.0f;
    March march;
    if (ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b, INFINITY))) {
        const Medium medium = MEDIUM_OF_PARAMETERS;
        // The same steps whatever the blocks
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
