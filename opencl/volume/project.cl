// Projections of a volume, the blend modes of volume rendering beside compositing: along a ray, the
// greatest or the least scalar, classified; or the mean or the integral of opacity times scalar, as
// a grey value (docs/dev/conventions.md, "Blending").
// A ray or a block of 4 x 4 in a work-item (lib/lanes.cl).
//
// -D BLEND_MODE: which of them
#include "volume/cropped_march.cl"
#include "lib/pixels.cl"
#pragma OPENCL FP_CONTRACT OFF

#define MAXIMUM 1
#define MINIMUM 2
#define AVERAGE 3
#define ADDITIVE 4

// What a ray has met so far.
typedef struct {
    Real extreme;   // scalar; NaN: none
    Real sum, lost; // of opacity times scalar, and what it rounded off
    Real length;    // that was sampled, steps
} Projection;

// Take the samples that count into projections; `steps`: lengths that they stand for.
inline void project_sample(Projection *so_far, const Medium *medium, Real scalar, Real steps,
                           float per_range, float at_zero, Int counts)
{
    so_far->length = SELECT(so_far->length, so_far->length + steps, counts);
    if (BLEND_MODE == MAXIMUM) {
        so_far->extreme = SELECT(so_far->extreme, fmax(so_far->extreme, scalar), counts);
    } else if (BLEND_MODE == MINIMUM) {
        so_far->extreme = SELECT(so_far->extreme, fmin(so_far->extreme, scalar), counts);
    } else {
        const Classified *of = &medium->numbers;
        const Real opacity =
            classify(scalar, medium->table, of->entries, of->low, of->per_scalar).w;
        const Real more =
            opacity * fma(scalar, (Real)(per_range), (Real)(at_zero)) * steps - so_far->lost;
        const Real next = so_far->sum + more;
        so_far->lost = SELECT(so_far->lost, (next - so_far->sum) - more, counts);
        so_far->sum = SELECT(so_far->sum, next, counts);
    }
}

// Premultiplied RGBA of projections along marches.
inline Real4 projected(const Projection *whole, const Medium *medium, const March *march)
{
    if (BLEND_MODE == MAXIMUM || BLEND_MODE == MINIMUM) {
        const Classified *of = &medium->numbers;
        const Real4 color =
            classify(whole->extreme, medium->table, of->entries, of->low, of->per_scalar);
        return REAL4(color.x * color.w, color.y * color.w, color.z * color.w, color.w);
    }
    const Real mean = BLEND_MODE == AVERAGE ? whole->sum / whole->length
                                            : whole->sum * (march->units * march->step);
    const Int some = whole->length > 0.0f;
    const Real grey = SELECT((Real)(0.0f), clamp(mean, 0.0f, 1.0f), some);
    return REAL4(grey, grey, grey, SELECT((Real)(0.0f), (Real)(1.0f), some));
}

KERNEL_OF_LANES void
project(MEDIUM_PARAMETERS, const RaysOfView view, __global const float *forms,
        __global const float
            *opaque_depth, // t at which each pixel's ray ends, top row first; 0: none does
        uint regions,      // that cropping keeps; its planes are forms behind the others
        float per_range, float at_zero, // scalar to 0 .. 1 over the volume's range
        __global float4 *image)         // premultiplied RGBA, top row first
{
    const Rays rays = rays_of_view(&view, (uint)get_global_id(0) * LANES);
    if (!ANY(rays.present))
        return;
    const Int pixels = places_in_picture(rays.x, rays.y, rays.present, view.width, view.height);
    const Medium medium = MEDIUM_OF_PARAMETERS;
    Projection projection = {(Real)(NAN), (Real)(0.0f), (Real)(0.0f), (Real)(0.0f)};
    March march;
    if (ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b,
                        opaque_ends(pixels, opaque_depth)))) {
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
    store_fours(image, pixels, projected(&projection, &medium, &march));
}
