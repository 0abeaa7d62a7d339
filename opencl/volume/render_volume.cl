// Direct volume rendering: the baseline that a VDI is measured against, by the same march as generation.
//
// -D VOXEL_T, INDEX_T, RGBA, NEAREST, BY_SCALAR, SKIP_EMPTY, MACROCELL_SHIFT: see volume/sampling.cl and volume/march.cl
// -D SHADED, HEADLIGHT, POSITIONAL_LIGHTS, GRADIENT_OPACITY: see volume/shading.cl; OCCLUSION: see volume/occlusion.cl
// -D COMPENSATED: see lib/compositing.cl; DOUBLE_FLOAT_RAYS: see lib/rays.cl
// -D CROPPED: see lib/cropping.cl
// -D OPACITY_MULTIPLIER: optical depths are multiplied
// -D SAMPLED: see volume/samples.cl; some steps of some rows at a time then, as they are sampled
#include "volume/cropped_march.cl"
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

__kernel void render_volume(
    MEDIUM_PARAMETERS
    VIEW_PARAMETERS
    __global const float *opaque_depth,   // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    float transmittance_cutoff,           // the ray ends where no more than this is left; negative: never
    CROPPING_PARAMETER                    // regions that are kept; their planes are forms behind the others
    MULTIPLIER_PARAMETER
    PART_PARAMETERS
    __global float4 *image)               // premultiplied RGBA, top row first
{
    int2 pixel = block_pixel((uint)get_global_id(0), width);
#ifdef SAMPLED
    pixel.y = pixel.y < rows ? first_row + pixel.y : height;
    __global float4 *state = states + 2 * (size_t)get_global_id(0);
#else
    const int first_step = 0, steps = INT_MAX;
#endif
    const Ray ray = ray_of_pixel(pixel, width, height);
    if (!ray.present)
        return;
    const float t_end = has_opaque_depth ? opaque_depth[ray.place] : INFINITY;

    Seen seen = nothing_seen();
#ifdef SAMPLED
    if (first_step > 0) {
        seen.sums = state[0];
        seen.compensation = state[1];
    }
#endif
    March march;
    if (begin_march(&march, forms, planes, ray.a, ray.b, sample_distance, unit_distance, t_end)) {
        const Medium medium = MEDIUM;
#ifdef CROPPED
        const Kept kept = kept_march(&march, forms + (6 + planes) * FORM_SIZE, ray.a, ray.b, regions);
#endif
        int k = first_step;
        const int end = march.steps - first_step > steps ? first_step + steps : march.steps;
        float front = step_face(&march, k);
        while (k < end && seen.sums.w > transmittance_cutoff) {
            const float back = step_face(&march, k + 1);
            const int empty = empty_steps(&march, &medium, 1, k, end, 1, front, back);
            k += empty;
            if (empty > 0) {
                front = step_face(&march, k);
                continue;
            }
            float4 step = step_medium(&march, &medium, k, front, back);
#ifdef CROPPED
            step.w *= kept_share(&kept, front, back);
#endif
#ifdef OPACITY_MULTIPLIER
            step.w *= opacity_multiplier;
#endif
            composite_medium(&seen, step.w, step, true);
            front = back;
            ++k;
        }
    }
#ifdef SAMPLED
    state[0] = seen.sums;
    state[1] = seen.compensation;
#endif
    image[ray.place] = composited(&seen);
}
