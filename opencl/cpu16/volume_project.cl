// Projections of a volume along sixteen rays in vectors that are written out: volume/project.cl, to
// the same bits.
#define LANES 16
#include "volume/projection.cl"
#include "cpu16/volume_picture.cl"
#pragma OPENCL FP_CONTRACT OFF

KERNEL_OF_LANES void project(const Classified classified, __global const VOXEL_T *voxels,
                             __global const float4 *table, __global const uchar *distances,
                             __global const uchar *blanked, __global const float *gradient,
                             __global const float *lighting, __global const float *ambient,
                             const RaysOfView view, __global const float *forms,
                             __global const float *opaque_depth, uint regions, float per_range,
                             float at_zero, __global float4 *image)
{
    const Rays rays = rays_of_view(&view, (uint)get_global_id(0) * LANES);
    if (!ANY(rays.present))
        return;
    const Places places = places_in_picture(&rays, view.width, view.height);
    const Medium medium = {classified, voxels,   table,    distances,
                           blanked,    gradient, lighting, ambient};
    Projection projection = {(Real)(NAN), (Real)(0.0f), (Real)(0.0f), (Real)(0.0f)};
    March march;
    if (ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b,
                        opaque_ends(&places, opaque_depth)))) {
        Kept kept;
        if (CROPPED)
            kept =
                kept_march(&march, forms + (6 + view.planes) * FORM_SIZE, rays.a, rays.b, regions);
        for (int k = 0; ANY(march.steps > k); ++k) {
            const Real front = step_face(&march, (Int)(k)), back = step_face(&march, (Int)(k + 1));
            const Real t = 0.5f * (front + back);
            const Real x = fma(t, march.slope.x, march.start.x),
                       y = fma(t, march.slope.y, march.start.y);
            const Real z = fma(t, march.slope.z, march.start.z);
            Real steps = (back - front) * march.per_step;
            if (CROPPED)
                steps *= kept_share(&kept, front, back);
            const Real scalar = sample_volume(voxels, &classified.points, x, y, z);
            Int counts = (march.steps > k) & (steps > 0.0f) & (scalar == scalar);
            if (blanked)
                counts = counts & !is_blank(blanked, classified.points.size, x, y, z);
            project_sample(&projection, &medium, scalar, steps, per_range, at_zero, counts);
        }
    }
    store_colors(image, &places, projected(&projection, &medium, &march));
}
