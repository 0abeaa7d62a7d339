// Projections of a volume: see volume/projection.cl. One ray for each work-item; sixteen:
// cpu16/volume_project.cl.
#include "volume/projection.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void
project(const Classified classified, __global const VOXEL_T *voxels, __global const float4 *table,
        __global const uchar *distances, __global const uchar *blanked,
        __global const float *gradient, __global const float *lighting,
        __global const float *ambient, const RaysOfView view, __global const float *forms,
        __global const float
            *opaque_depth, // t at which each pixel's ray ends, top row first; 0: none does
        uint regions,      // that cropping keeps; its planes are forms behind the others
        float per_range, float at_zero, // scalar to 0 .. 1 over the volume's range
        __global float4 *image)         // premultiplied RGBA, top row first
{
    const Rays ray = rays_of_view(&view, (uint)get_global_id(0));
    if (!ray.present)
        return;
    const size_t place = (size_t)(view.height - 1 - ray.y) * view.width + ray.x;
    const Medium medium = {classified, voxels,   table,    distances,
                           blanked,    gradient, lighting, ambient};
    Projection projection = {NAN, 0.0f, 0.0f, 0.0f};
    March march;
    if (begin_march(&march, &view, &classified, forms, ray.a, ray.b,
                    opaque_depth ? opaque_depth[place] : INFINITY)) {
        Kept kept;
        if (CROPPED)
            kept = kept_march(&march, forms + (6 + view.planes) * FORM_SIZE, ray.a, ray.b, regions);
        for (int k = 0; k < march.steps; ++k) {
            const float front = step_face(&march, k), back = step_face(&march, k + 1);
            const float t = 0.5f * (front + back);
            const float x = fma(t, march.slope.x, march.start.x),
                        y = fma(t, march.slope.y, march.start.y);
            const float z = fma(t, march.slope.z, march.start.z);
            float steps = (back - front) * march.per_step;
            if (CROPPED)
                steps *= kept_share(&kept, front, back);
            const float scalar = sample_volume(voxels, &classified.points, x, y, z);
            const bool blank = blanked && is_blank(blanked, classified.points.size, x, y, z);
            if (steps > 0.0f && !isnan(scalar) && !blank)
                project_sample(&projection, &medium, scalar, steps, per_range, at_zero, 1);
        }
    }
    image[place] = projected(&projection, &medium, &march);
}
