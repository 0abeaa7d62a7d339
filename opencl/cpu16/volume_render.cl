// Direct volume rendering of sixteen rays in vectors that are written out: volume/render_volume.cl,
// to the same bits.
#define LANES 16
#include "volume/cropped_march.cl"
#include "cpu16/volume_picture.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

// Work-items are blocks of 4 x 4 pixels of a whole window.
KERNEL_OF_LANES void render_volume(const Classified classified, __global const VOXEL_T *voxels,
                                   __global const float4 *table, __global const uchar *distances,
                                   __global const uchar *blanked, __global const float *gradient,
                                   __global const float *lighting, __global const float *ambient,
                                   const RaysOfView view, __global const float *forms,
                                   __global const float *opaque_depth, float transmittance_cutoff,
                                   float opacity_multiplier, uint regions, __global float4 *image)
{
    const Rays rays = rays_of_view(&view, (uint)get_global_id(0) * LANES);
    if (!ANY(rays.present))
        return;
    const Places places = places_in_picture(&rays, view.width, view.height);
    Seen seen = nothing_seen();
    March march;
    if (ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b,
                        opaque_ends(&places, opaque_depth)))) {
        const Medium medium = {classified, voxels,   table,    distances,
                               blanked,    gradient, lighting, ambient};
        Kept kept;
        if (CROPPED)
            kept =
                kept_march(&march, forms + (6 + view.planes) * FORM_SIZE, rays.a, rays.b, regions);
        Int k = 0;
        bool look = true; // for empty space: not where something was seen in the turn before
        for (;;) {
            const Int active = (k < march.steps) & (seen.sums.w > transmittance_cutoff);
            if (!ANY(active))
                break;
            const Real front = step_face(&march, k), back = step_face(&march, k + 1);
            const Int empty =
                look ? empty_steps(&march, &medium, active, k, march.steps, 1, front, back)
                     : (Int)(0);
            const Int here = active & (empty == 0);
            if (ANY(here)) {
                Real4 step = step_medium(&march, &medium, front, back);
                if (CROPPED)
                    step.w *= kept_share(&kept, front, back);
                step.w *= opacity_multiplier;
                look = !ANY(here & (step.w > 0.0f));
                composite_medium(&seen, step.w, step, here);
            }
            k += max(empty, 1);
        }
    }
    store_colors(image, &places, composited(&seen));
}
