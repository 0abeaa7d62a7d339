// Projections of a volume, the blend modes of volume rendering beside compositing: along a ray, the greatest or the least
// scalar, classified; or the mean or the integral of opacity times scalar, as a grey value (docs/conventions.md, "Projections").
//
// -D MAXIMUM, MINIMUM, AVERAGE or ADDITIVE: which of them
// -D VOXEL_T, INDEX_T, RGBA, NEAREST: see volume/sampling.cl; DOUBLE_FLOAT_RAYS: see lib/rays.cl; CROPPED: see lib/cropping.cl
#include "volume/cropped_march.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void project(
    MEDIUM_PARAMETERS
    VIEW_PARAMETERS
    __global const float *opaque_depth,   // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    CROPPING_PARAMETER                    // regions that are kept; their planes are forms behind the others
    float per_range, float at_zero,       // scalar to 0 .. 1 over the volume's range
    __global float4 *image)               // premultiplied RGBA, top row first
{
    const Ray ray = ray_of_pixel(block_pixel((uint)get_global_id(0), width), width, height);
    if (!ray.present)
        return;
    const float t_end = has_opaque_depth ? opaque_depth[ray.place] : INFINITY;

    float extreme = NAN;
    float sum = 0.0f, lost = 0.0f; // and what it rounded off
    float length = 0.0f;           // that was sampled, steps
    March march;
    if (begin_march(&march, forms, planes, ray.a, ray.b, sample_distance, unit_distance, t_end)) {
        const Medium medium = MEDIUM;
#ifdef CROPPED
        const Kept kept = kept_march(&march, forms + (6 + planes) * FORM_SIZE, ray.a, ray.b, regions);
#endif
        float front = step_face(&march, 0);
        for (int k = 0; k < march.steps; ++k) {
            const float back = step_face(&march, k + 1);
            const float t = 0.5f * (front + back);
            float steps = (back - front) * march.per_step;
#ifdef CROPPED
            steps *= kept_share(&kept, front, back);
#endif
            front = back;
            const float scalar = sample_volume(medium.voxels, medium.size, fma(t, march.slope.x, march.start.x),
                                               fma(t, march.slope.y, march.start.y), fma(t, march.slope.z, march.start.z));
            if (!(steps > 0.0f) || isnan(scalar))
                continue;
            length += steps;
#if defined(MAXIMUM)
            extreme = fmax(extreme, scalar);
#elif defined(MINIMUM)
            extreme = fmin(extreme, scalar);
#else
            const float opacity = classify(scalar, medium.table, medium.entries, medium.low, medium.per_scalar).w;
            const float more = opacity * fma(scalar, per_range, at_zero) * steps - lost;
            const float next = sum + more;
            lost = (next - sum) - more;
            sum = next;
#endif
        }
    }
    float4 color = (float4)(0.0f);
#if defined(MAXIMUM) || defined(MINIMUM)
    color = classify(extreme, table, entries, low, per_scalar);
    color.xyz *= color.w;
#else
    if (length > 0.0f) {
#ifdef AVERAGE
        const float grey = sum / length;
#else
        const float grey = sum * (march.units * march.step);
#endif
        color = (float4)((float3)(clamp(grey, 0.0f, 1.0f)), 1.0f);
    }
#endif
    image[ray.place] = color;
}
