// The optical depth of the steps of each ray in part of a grid: the first of the two passes over a volume in blocks.
//
// -D GRID_PART and the names of volume/march.cl. It decides by how much an error counts, and no colour: one step in `stride` is
// sampled, and at the faces of a block whose neighbours are not at hand the last point is taken for the next.
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

// Work-items are the pixels of part of V_O's window, as of generation/march_lists.cl.
KERNEL_OF_LANES void optical_depths(
    MEDIUM_PARAMETERS
    VIEW_PARAMETERS
    int first_column, int columns, int first_row, int rows,
    int stride,                   // steps
    __global float *depths)       // of each ray, rows of `columns`
{
    const Rays rays = rays_of_part((uint)get_global_id(0) * LANES, width, height, first_column, columns, first_row, rows);
    if (!ANY(rays.present))
        return;
    Real depth = 0.0f;
    March march;
    if (ANY(begin_march(&march, forms, planes, rays.a, rays.b, sample_distance, unit_distance, INFINITY))) {
        const Medium medium = MEDIUM;
        march_in_part(&march, &medium);
        Int k = (march.begin + (stride - 1)) / stride * stride; // the same steps whatever the blocks
        for (;;) {
            const Int going = rays.present & (k < march.steps);
            if (!ANY(going))
                break;
            const Real front = step_face(&march, k), back = step_face(&march, k + 1);
            const Int empty = empty_steps(&march, &medium, going, k, march.steps, stride, front, back);
            const Int here = going & (empty == 0);
            if (ANY(here)) {
                const Real of_step = step_medium(&march, &medium, k, front, back).w;
                depth += SELECT((Real)(0.0f), of_step * (float)stride, here);
            }
            k += max(empty, stride);
        }
    }
    const Places places = {rays.y * columns + rays.x}, wanted = {rays.present};
    const float *of_ray = (const float *)&depth;
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            depths[places.each[lane]] = of_ray[lane];
}
