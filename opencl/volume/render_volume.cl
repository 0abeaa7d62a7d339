// Direct volume rendering: the baseline that a VDI is measured against, by the same march as
// generation. A ray or a block of 4 x 4 in a work-item (lib/lanes.cl).
//
// -D COMPENSATED: see lib/compositing.cl; the volume's: see volume/march.cl
#include "volume/march.cl"
#include "lib/cropping.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

// The kept parts of a ray, in t. `form`: the first of the planes of cropping.
inline Kept kept_march(const March *march, __global const float *form, Real a, Real b, uint regions)
{
    Real at_t0[CROPPING_PLANES], at_t1[CROPPING_PLANES];
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        const Real value = march_value(march, form, a, b);
        at_t0[k] = fma(march->t0, form_slope(form, a, b), value);
        at_t1[k] = fma(march->t1, form_slope(form, a, b), value);
    }
    return kept_parts(at_t0, at_t1, march->t0, march->t1, regions);
}

// The share of a step that is kept.
inline Real kept_share(const Kept *kept, Real front, Real back)
{
    Real sum = 0.0f;
    for (int n = 0; n < MOST_KEPT; ++n) {
        Real from = front, to = back;
        cut_to_part(kept, n, &from, &to);
        sum += fmax(to - from, 0.0f);
    }
    return sum / (back - front);
}

KERNEL_OF_LANES void render_volume(
    MEDIUM_PARAMETERS, const RaysOfView view, __global const float *forms,
    __global const float
        *opaque_depth,          // t at which each pixel's ray ends, top row first; 0: none does
    float transmittance_cutoff, // a ray ends where no more than this is left; negative: never
    float opacity_multiplier,   // of optical depths
    uint regions, // that cropping keeps, its planes are forms behind the others; 0: nothing is
    __global const float4 *samples, // see volume/rays_of_view.cl; 0: steps are sampled here
    __global float4 *states, // of each ray behind a part of its steps: what has been seen; 0: all
                             // steps are taken
    __global float4 *image)  // premultiplied RGBA, top row first
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_view(&view, first);
    if (!ANY(rays.present))
        return;
    const Int pixels =
        places_in_picture(rays.x, view.first_row + rays.y, rays.present, view.width, view.height);
    const bool in_parts = LANES == 1 && states;
    Seen seen = nothing_seen();
    if (in_parts && view.first_step > 0) {
        seen.sums = load_fours(states, 2 * (int)first);
        seen.compensation = load_fours(states, 2 * (int)first + 1);
    }
    March march;
    if (ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b,
                        opaque_ends(pixels, opaque_depth)))) {
        const Medium medium = MEDIUM_OF_PARAMETERS;
        const size_t sampled = samples_start(first, view.steps);
        Kept kept;
        if (regions)
            kept =
                kept_march(&march, forms + (6 + view.planes) * FORM_SIZE, rays.a, rays.b, regions);
        const Int end = min(view.first_step + view.steps, march.steps);
        Int k = view.first_step;
        bool look = true; // for empty space: not where something was seen in the turn before
        for (;;) {
            const Int active = (k < end) & (seen.sums.w > transmittance_cutoff);
            if (!ANY(active))
                break;
            // Skip what is transparent
            const Real front = step_face(&march, k), back = step_face(&march, k + 1);
            const Int empty =
                look ? empty_steps(&march, &medium, active, k, end, 1, front, back) : (Int)(0);
            const Int here = active & (empty == 0);
            if (ANY(here)) {
                // Sample the step's midpoint, classify and shade it
                Real4 step =
                    LANES == 1 && samples
                        ? load_fours(samples + sampled, (k - view.first_step) * SAMPLE_LANES)
                        : step_medium(&march, &medium, front, back);
                if (regions)
                    step.w *= kept_share(&kept, front, back);
                step.w *= opacity_multiplier;
                look = !ANY(here & (step.w > 0.0f));
                // Composite it behind what has been seen
                composite_medium(&seen, step.w, step, here);
            }
            k += max(empty, 1);
        }
    }
    if (in_parts) {
        store_fours(states, 2 * (int)first, seen.sums);
        store_fours(states, 2 * (int)first + 1, seen.compensation);
    }
    store_fours(image, pixels, composited(&seen));
}
