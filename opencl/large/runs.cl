// Runs of blocks: from the records of a block's rays, and behind each other into the records of
// V_O's rays.
#include "volume/rays_of_view.cl"
#include "generation/merging.cl"
#pragma OPENCL FP_CONTRACT OFF

// A slice's records, one behind the other in the order of its lists.
__kernel void copy_runs(const RaysOfView view, int capacity, __global const float *records,
                        __global const uint *counts, // runs of each list
                        __global const uint *begins, // where those of each list go
                        __global float *runs)
{
    const uint item = (uint)get_global_id(0);
    const Rays ray = rays_of_view(&view, item);
    if (!ray.present)
        return;
    const size_t list = (size_t)ray.y * view.columns + ray.x;
    __global const float *record = records + record_start(item, capacity);
    __global float *to = runs + (size_t)begins[list] * RUN_WORDS;
    for (int k = 0; k < (int)counts[list]; ++k)
        store_run(to, k, load_run(record, k));
}

// Append a block's runs to the records of rays that come from nearer blocks. Runs that touch become
// one where a march would have gone on with the first. How much light is left is what those before
// have let through.
__kernel void
append_runs(const RaysOfView view, __global const float *forms, const Recording recording,
            int4 window, // of the block: first column, first row, columns, rows
            __global const uint *
                begins, // where the runs of each of the block's lists begin, and the last one's end
            __global const float *runs, __global float *records, __global uint *counts)
{
    const uint item = (uint)get_global_id(0);
    const Rays ray = rays_of_view(&view, item);
    const int x = view.first_column + ray.x - window.x, y = view.first_row + ray.y - window.y;
    if (!ray.present || x < 0 || x >= window.z || y < 0 || y >= window.w)
        return;
    const size_t of_block = (size_t)y * window.z + x;
    uint next = begins[of_block];
    const uint end = begins[of_block + 1];
    if (next == end)
        return;
    const int list = ray.y * view.columns + ray.x;
    __global float *record = records + record_start(item, recording.capacity);
    const float per_reference = march_speed(forms, ray.a, ray.b) / recording.reference_length;
    int count = (int)counts[list];
    float transmittance = 1.0f;
    if (count > 0) {
        const Run last = load_run(record, count - 1);
        Run run = load_run(runs + (size_t)next * RUN_WORDS, 0);
        transmittance = last.TRANSMITTANCE - last.TRANSMITTANCE * last.OPACITY;
        if (run.FRONT == last.BACK && merge_error(1, last, run_feature(last, per_reference), run,
                                                  run_feature(run, per_reference), per_reference,
                                                  recording.hidden_weight) <= recording.finest) {
            transmittance -= transmittance * run.OPACITY;
            store_run(record, count - 1, merged_runs(last, run));
            ++next;
        }
    }
    for (; next < end; ++next) {
        Run run = load_run(runs + (size_t)next * RUN_WORDS, 0);
        run.TRANSMITTANCE = transmittance;
        transmittance -= transmittance * run.OPACITY;
        store_run(record, count++, run);
    }
    counts[list] = (uint)count;
}
