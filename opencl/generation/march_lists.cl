// Volume to records of runs, one march per ray (paper, section 2; docs/conventions.md, "Merging
// samples into a supersegment"). One ray for each work-item; sixteen: cpu16/generation_march.cl.
//
// -D COMPENSATED: see lib/compositing.cl; the volume's: see volume/march.cl
//
// A VDI is made in four steps. A ray's march is cut into chunks of equally many steps. march_lists
// samples the steps of one chunk, and merges what is homogeneous with the run before.
// generation/shorten_lists.cl then fits records that have grown too long, and raises the ray's
// threshold; after the last chunk it fits each record to the budget. generation/offsets.cl sums up
// the lists' lengths, and generation/pack_lists.cl packs the arrays.
//
// Lengths along a ray are t, the view depth of V_O less the VDI's depth origin, world units; with
// DOUBLE_FLOAT_RAYS, less that of where the ray enters, until they are packed.
#include "volume/march.cl"
#include "volume/samples.cl"
#include "generation/records.cl"
#pragma OPENCL FP_CONTRACT OFF

// A record's last run, which may still grow. Its feature, the mean of its steps', is kept, which is
// cheaper than computing it of its medium.
typedef struct {
    Run run;
    Run compensation; // what its sums have rounded off in this chunk
    float4 feature;
    float length; // reference lengths
} Growing;

// Sample: the next group of steps that are not all passed by, composited front to back as one run.
// `samples`: those of the ray's steps from `first` on, or 0. Moves k behind them.
inline Run sampled_run(const March *march, const Medium *medium, __global const float4 *samples,
                       int first, int *k, int end, int group)
{
    // Skip what is transparent
    float front = step_face(march, *k), back = step_face(march, *k + 1);
    for (int empty; (empty = empty_steps(march, medium, 1, *k, end, group, front, back)) > 0;) {
        *k += empty;
        front = step_face(march, *k);
        back = step_face(march, *k + 1);
        if (*k >= end)
            return RUN(front, front, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f);
    }
    // Classify and shade each step's midpoint, and composite
    Run run = RUN(front, back, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f);
    for (int left = group; left > 0 && *k < end; --left, ++*k) {
        front = step_face(march, *k);
        run.BACK = step_face(march, *k + 1);
        const float4 step = samples ? samples[(*k - first) * SAMPLE_LANES]
                                    : step_medium(march, medium, front, run.BACK);
        const float weight = (1.0f - run.OPACITY) * opacity_of(step.w);
        run.TAU += step.w;
        run.COLOR += weight * step.xyz;
        run.OPACITY += weight;
    }
    return run;
}

// Merge: the sample with the growing run, where that is homogeneous. Returns whether it is. The
// error is merge_error's (generation/runs.cl) of runs that touch; cpu16/generation_march.cl has it,
// too.
inline bool merged_with(Growing *growing, Run sample, float4 feature, float length, float threshold,
                        float hidden_weight)
{
    const float share = length / (growing->length + length);
    const float4 difference = difference_of(feature, growing->feature);
    const float error =
        growing->length * share * square_of(difference) * seen_weight(growing->run, hidden_weight);
    // A gap ends a run
    if (!(growing->run.BACK == sample.FRONT && error <= threshold))
        return false;
    growing->run = COMPENSATED > 1
                       ? merged_runs_compensated(growing->run, sample, &growing->compensation)
                       : merged_runs(growing->run, sample);
    growing->feature += share * difference;
    growing->length += length;
    return true;
}

// Work-items are the rays of the view; records are in the order of the work-items, counts and
// offsets in the order of the lists.
__kernel void march_lists(
    const Classified classified, __global const VOXEL_T *voxels, __global const float4 *table,
    __global const uchar *distances, __global const uchar *blanked, __global const float *gradient,
    __global const float *lighting, __global const float *ambient, const RaysOfView view,
    __global const float *forms,
    __global const float4 *samples, // see volume/samples.cl; 0: steps are sampled here
    const Recording recording,
    __global const float
        *entering, // light that enters the part of the grid along each ray, 0 to 1; 0: all of it
    __global const float *thresholds, // merge errors up to this are accepted, one per ray
    __global float *records,
    __global uint *counts) // runs in each record, by list
{
    const uint item = (uint)get_global_id(0);
    const Rays ray = rays_of_view(&view, item);
    if (!ray.present)
        return;
    March march;
    if (!begin_march(&march, &view, &classified, forms, ray.a, ray.b, INFINITY))
        return;
    const int begin = march.begin + view.first_step;
    const int end = min(begin + view.steps, march.steps);
    if (begin >= end)
        return;
    const Medium medium = {classified, voxels,   table,    distances,
                           blanked,    gradient, lighting, ambient};
    __global const float4 *sampled = samples ? samples + samples_start(item, view.steps) : 0;
    __global float *record = records + record_start(item, recording.capacity);
    const float per_reference = march.units * view.unit_distance / recording.reference_length;
    const float threshold = thresholds[item];
    const int list = ray.y * view.columns + ray.x;

    // Go on with the record's last run
    int count = (int)counts[list];
    Growing growing = {RUN(0.0f, -INFINITY, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f), (Run)(0.0f),
                       (float4)(0.0f), 0.0f};
    float transmittance =
        entering ? entering[(view.first_row - recording.window_row) * view.columns + list] : 1.0f;
    if (count > 0) {
        growing.run = load_run(record, count - 1);
        growing.feature = run_feature(growing.run, per_reference);
        growing.length = (growing.run.BACK - growing.run.FRONT) * per_reference;
        transmittance = growing.run.TRANSMITTANCE - growing.run.TRANSMITTANCE * growing.run.OPACITY;
    }
    // A ray that cannot keep every detail asks about homogeneity once in a voxel only
    const int group = threshold > recording.finest ? recording.grain : 1;
    for (int k = begin; k < end;) {
        // Sample
        Run sample = sampled_run(&march, &medium, sampled, view.first_step, &k, end, group);
        sample.TRANSMITTANCE = transmittance;
        if (!(sample.OPACITY > 0.0f && sample.BACK > sample.FRONT))
            continue;
        // Merge it with the run before, or begin another
        const float4 feature = run_feature(sample, per_reference);
        const float length = (sample.BACK - sample.FRONT) * per_reference;
        if (!merged_with(&growing, sample, feature, length, threshold, recording.hidden_weight)) {
            if (count > 0)
                store_run(record, count - 1, growing.run);
            ++count;
            growing = (Growing){sample, (Run)(0.0f), feature, length};
        }
        transmittance -= transmittance * sample.OPACITY;
    }
    if (count > 0)
        store_run(record, count - 1, growing.run);
    counts[list] = (uint)count;
}

// Find the steps of the longest ray of each slice of rows.
__kernel void longest_marches(const Classified classified, const RaysOfView view,
                              __global const float *forms,
                              int slice_rows,        // a multiple of a block's
                              __global int *longest) // of each slice; 0 at first
{
    const Rays ray = rays_of_view(&view, (uint)get_global_id(0));
    March march;
    if (!ray.present || !begin_march(&march, &view, &classified, forms, ray.a, ray.b, INFINITY))
        return;
    __global int *of_slice = longest + ray.y / slice_rows;
    const int steps = march.steps - march.begin;
    if (steps > *of_slice) // an old value is only lower, and does no harm
        atomic_max(of_slice, steps);
}
