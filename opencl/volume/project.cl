// Projections of a volume, the blend modes of volume rendering beside compositing: along a ray, the greatest or the least
// scalar, classified; or the mean or the integral of opacity times scalar, as a grey value (docs/conventions.md, "Blending").
//
// -D MAXIMUM, MINIMUM, AVERAGE or ADDITIVE: which of them
// -D VOXEL_T, INDEX_T, RGBA, NEAREST: see volume/sampling.cl; DOUBLE_FLOAT_RAYS: see lib/rays.cl; CROPPED: see lib/cropping.cl
#include "volume/cropped_march.cl"
#include "volume/picture.cl"
#pragma OPENCL FP_CONTRACT OFF

KERNEL_OF_LANES void project(
    MEDIUM_PARAMETERS
    VIEW_PARAMETERS
    OPAQUE_DEPTH_PARAMETERS
    CROPPING_PARAMETER                    // regions that are kept; their planes are forms behind the others
    float per_range, float at_zero,       // scalar to 0 .. 1 over the volume's range
    __global float4 *image)               // premultiplied RGBA, top row first
{
    const Rays rays = rays_of_block((uint)get_global_id(0) * LANES, width, height, 0, height);
    if (!ANY(rays.present))
        return;
    const Places places = places_in_picture(&rays, width, height, 0);
    const Real t_end = opaque_ends(&places, opaque_depth, has_opaque_depth);

    Real extreme = NAN;
    Real sum = 0.0f, lost = 0.0f; // and what it rounded off
    Real length = 0.0f;           // that was sampled, steps
    March march;
    if (ANY(begin_march(&march, forms, planes, rays.a, rays.b, sample_distance, unit_distance, t_end))) {
        const Medium medium = MEDIUM;
#ifdef CROPPED
        const Kept kept = kept_march(&march, forms + (6 + planes) * FORM_SIZE, rays.a, rays.b, regions);
#endif
        for (int k = 0; ANY(march.steps > k); ++k) {
            const Real front = step_face(&march, (Int)(k)), back = step_face(&march, (Int)(k + 1));
            const Real t = 0.5f * (front + back);
            Real steps = (back - front) * march.per_step;
#ifdef CROPPED
            steps *= kept_share(&kept, front, back);
#endif
            const Real scalar = sample_volume(medium.voxels, medium.size, fma(t, march.slope.x, march.start.x),
                                              fma(t, march.slope.y, march.start.y), fma(t, march.slope.z, march.start.z));
            Int counts = (march.steps > k) & (steps > 0.0f) & (scalar == scalar);
#ifdef BLANKED
            counts = counts & !is_blank(medium.blanked, medium.size, fma(t, march.slope.x, march.start.x),
                                        fma(t, march.slope.y, march.start.y), fma(t, march.slope.z, march.start.z));
#endif
            length = SELECT(length, length + steps, counts);
#if defined(MAXIMUM)
            extreme = SELECT(extreme, fmax(extreme, scalar), counts);
#elif defined(MINIMUM)
            extreme = SELECT(extreme, fmin(extreme, scalar), counts);
#else
            const Real opacity = classify(scalar, medium.table, medium.entries, medium.low, medium.per_scalar).w;
            const Real more = opacity * fma(scalar, (Real)(per_range), (Real)(at_zero)) * steps - lost;
            const Real next = sum + more;
            lost = SELECT(lost, (next - sum) - more, counts);
            sum = SELECT(sum, next, counts);
#endif
        }
    }
#if defined(MAXIMUM) || defined(MINIMUM)
    const Real4 color = classify(extreme, table, entries, low, per_scalar);
    store_colors(image, &places, REAL4(color.x * color.w, color.y * color.w, color.z * color.w, color.w));
#else
#ifdef AVERAGE
    const Real grey = clamp(sum / length, 0.0f, 1.0f);
#else
    const Real grey = clamp(sum * (march.units * march.step), 0.0f, 1.0f);
#endif
    const Int some = length > 0.0f;
    const Real shown = SELECT((Real)(0.0f), grey, some);
    store_colors(image, &places, REAL4(shown, shown, shown, SELECT((Real)(0.0f), (Real)(1.0f), some)));
#endif
}
