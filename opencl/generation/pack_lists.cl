// Pack: records to the VDI's arrays.
#include "volume/rays_of_view.cl"
#include "generation/records.cl"
#pragma OPENCL FP_CONTRACT OFF

// Records of a slice of rays to the VDI's arrays.
__kernel void
pack_lists(const RaysOfView view,                         // the slice
           __global const float *forms, int double_float, // whether t counts from the entry
           int capacity, __global const float *records,
           __global const ulong *offsets, // where each list begins, and the last one ends
           uint made,                     // lists before the slice's
           ulong held,                    // supersegments before those that the arrays hold
           __global float *fronts,        // view depth less the depth origin, world units
           __global float *backs,
           __global float *colors, // straight RGB, 3 per supersegment
           __global float *optical_depths)
{
    const uint item = (uint)get_global_id(0);
    const Rays ray = rays_of_view(&view, item);
    if (!ray.present)
        return;
    __global const float *record = records + record_start(item, capacity);
    const size_t list = made + (size_t)ray.y * view.columns + ray.x;
    const ulong begin = offsets[list] - held;
    const int count = (int)(offsets[list + 1] - offsets[list]);
    float2 entry = (float2)(0.0f);
    float least = -INFINITY, most = INFINITY;
    if (double_float) {
        float length = 0.0f;
        clip_from_entry(forms + 6 * FORM_SIZE, view.planes, ray.a, ray.b, INFINITY, &entry,
                        &length);
        const float2 exit = double_float_sum(entry, (float2)(length, 0.0f));
        // Faces as they are stored lie in the volume, or its bounds would cut off what rounding has
        // put outside
        least = entry.y > 0.0f ? nextafter(entry.x, INFINITY) : entry.x;
        most = exit.y < 0.0f ? nextafter(exit.x, -INFINITY) : exit.x;
    }
    for (int k = 0; k < count; ++k) {
        Run run = load_run(record, k);
        if (double_float) {
            // Rounding must neither leave a supersegment without thickness nor let two overlap
            run.FRONT = fmax(double_float_sum(entry, (float2)(run.FRONT, 0.0f)).x, least);
            run.BACK = fmin(double_float_sum(entry, (float2)(run.BACK, 0.0f)).x, most);
            run.BACK = fmax(run.BACK, nextafter(run.FRONT, INFINITY));
            least = run.BACK;
        }
        fronts[begin + k] = run.FRONT;
        backs[begin + k] = run.BACK;
        optical_depths[begin + k] = run.TAU;
        vstore3(clamp(run.light.xyz / run.OPACITY, 0.0f, 1.0f), begin + k, colors);
    }
}
