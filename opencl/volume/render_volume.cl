// Direct volume rendering: the baseline that a VDI is measured against, by the same march as generation.
//
// -D VOXEL_T, INDEX_T, RGBA, NEAREST, BY_SCALAR, SKIP_EMPTY, MACROCELL_SHIFT: see volume/sampling.cl and volume/march.cl
// -D SHADED, HEADLIGHT, POSITIONAL_LIGHTS, GRADIENT_OPACITY: see volume/shading.cl; OCCLUSION: see volume/occlusion.cl
// -D COMPENSATED: see lib/compositing.cl; DOUBLE_FLOAT_RAYS: see lib/rays.cl
// -D CROPPED: see lib/cropping.cl
// -D OPACITY_MULTIPLIER: optical depths are multiplied
// -D LANES: see volume/march.cl
// -D SAMPLED: see volume/samples.cl; some steps of some rows at a time then, as they are sampled
#include "volume/cropped_march.cl"
#include "volume/picture.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef OPACITY_MULTIPLIER
#define MULTIPLIER_PARAMETER float opacity_multiplier,
#else
#define MULTIPLIER_PARAMETER
#endif

#ifdef SAMPLED
#define PART_PARAMETERS                                                                        \
    int first_row, int rows, int first_step, int steps,                                        \
    __global float4 *states, /* of each ray: colour and transmittance, what they rounded off */
#else
#define PART_PARAMETERS
#endif

// Work-items are pixels in blocks of 4 x 4, or the blocks.

KERNEL_OF_LANES void render_volume(
    MEDIUM_PARAMETERS
    VIEW_PARAMETERS
    OPAQUE_DEPTH_PARAMETERS
    float transmittance_cutoff,           // the ray ends where no more than this is left; negative: never
    CROPPING_PARAMETER                    // regions that are kept; their planes are forms behind the others
    MULTIPLIER_PARAMETER
    PART_PARAMETERS
    __global float4 *image)               // premultiplied RGBA, top row first
{
    const uint item = (uint)get_global_id(0) * LANES;
#ifdef SAMPLED
    __global float4 *state = states + 2 * (size_t)item;
#else
    const int first_row = 0, rows = height, first_step = 0, steps = INT_MAX;
#endif
    const Rays rays = rays_of_block(item, width, height, first_row, rows);
    if (!ANY(rays.present))
        return;
    const Places places = places_in_picture(&rays, width, height, first_row);
    const Real t_end = opaque_ends(&places, opaque_depth, has_opaque_depth);

    Seen seen = nothing_seen();
#ifdef SAMPLED
    if (first_step > 0) {
        seen.sums = state[0];
        seen.compensation = state[1];
    }
#endif
    March march;
    if (ANY(begin_march(&march, forms, planes, rays.a, rays.b, sample_distance, unit_distance, t_end))) {
        const Medium medium = MEDIUM;
#ifdef CROPPED
        const Kept kept = kept_march(&march, forms + (6 + planes) * FORM_SIZE, rays.a, rays.b, regions);
#endif
        Int k = first_step;
        const Int end = SELECT(march.steps, (Int)(first_step + steps), march.steps - first_step > steps);
        bool look = true; // for empty space: not where something was seen in the turn before
        for (;;) {
            const Int going = (k < end) & (seen.sums.w > transmittance_cutoff);
            if (!ANY(going))
                break;
            const Real front = step_face(&march, k), back = step_face(&march, k + 1);
            const Int empty = look ? empty_steps(&march, &medium, going, k, end, 1, front, back) : (Int)(0);
            const Int here = going & (empty == 0);
            if (ANY(here)) {
                Real4 step = step_medium(&march, &medium, k, front, back);
#ifdef CROPPED
                step.w *= kept_share(&kept, front, back);
#endif
#ifdef OPACITY_MULTIPLIER
                step.w *= opacity_multiplier;
#endif
                look = !ANY(here & (step.w > 0.0f));
                composite_medium(&seen, step.w, step, here);
            }
            k += max(empty, 1);
        }
    }
#ifdef SAMPLED
    state[0] = seen.sums;
    state[1] = seen.compensation;
#endif
    store_colors(image, &places, composited(&seen));
}
