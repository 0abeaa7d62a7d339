// Direct volume rendering: the baseline that a VDI is measured against, by the same march as
// generation. One ray for each work-item; sixteen: cpu16/volume_render.cl.
//
// -D CROPPED: see lib/cropping.cl; COMPENSATED: see lib/compositing.cl; the volume's: see
// volume/march.cl
#include "volume/cropped_march.cl"
#include "volume/samples.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void render_volume(
    const Classified classified, __global const VOXEL_T *voxels, __global const float4 *table,
    __global const uchar *distances, __global const uchar *blanked, __global const float *gradient,
    __global const float *lighting, __global const float *ambient, const RaysOfView view,
    __global const float *forms,
    __global const float
        *opaque_depth,              // t at which each pixel's ray ends, top row first; 0: none does
    float transmittance_cutoff,     // a ray ends where no more than this is left; negative: never
    float opacity_multiplier,       // of optical depths
    uint regions,                   // that cropping keeps; its planes are forms behind the others
    __global const float4 *samples, // see volume/samples.cl; 0: steps are sampled here
    __global float4 *states, // of each ray behind a part of its steps: what has been seen; 0: all
                             // steps are taken
    __global float4 *image)  // premultiplied RGBA, top row first
{
    const uint item = (uint)get_global_id(0);
    const Rays ray = rays_of_view(&view, item);
    if (!ray.present)
        return;
    const size_t place = (size_t)(view.height - 1 - (view.first_row + ray.y)) * view.width + ray.x;
    Seen seen = nothing_seen();
    if (states && view.first_step > 0) {
        seen.sums = states[2 * (size_t)item];
        seen.compensation = states[2 * (size_t)item + 1];
    }
    March march;
    if (begin_march(&march, &view, &classified, forms, ray.a, ray.b,
                    opaque_depth ? opaque_depth[place] : INFINITY)) {
        const Medium medium = {classified, voxels,   table,    distances,
                               blanked,    gradient, lighting, ambient};
        __global const float4 *sampled = samples + samples_start(item, view.steps);
        Kept kept;
        if (CROPPED)
            kept = kept_march(&march, forms + (6 + view.planes) * FORM_SIZE, ray.a, ray.b, regions);
        const int end = min(view.first_step + view.steps, march.steps);
        bool look = true;
        for (int k = view.first_step; k < end && seen.sums.w > transmittance_cutoff;) {
            // Skip what is transparent, but not where something was seen in the step before
            const float front = step_face(&march, k), back = step_face(&march, k + 1);
            const int empty = look ? empty_steps(&march, &medium, 1, k, end, 1, front, back) : 0;
            if (empty > 0) {
                k += empty;
                continue;
            }
            // Sample the step's midpoint, classify and shade it
            float4 step = samples ? sampled[(k - view.first_step) * SAMPLE_LANES]
                                  : step_medium(&march, &medium, front, back);
            if (CROPPED)
                step.w *= kept_share(&kept, front, back);
            step.w *= opacity_multiplier;
            look = !(step.w > 0.0f);
            // Composite it behind what has been seen
            composite_medium(&seen, step.w, step, 1);
            ++k;
        }
    }
    if (states) {
        states[2 * (size_t)item] = seen.sums;
        states[2 * (size_t)item + 1] = seen.compensation;
    }
    image[place] = composited(&seen);
}
