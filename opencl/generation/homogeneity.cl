// The paper's criterion, homogeneity (section 2, after Frey et al. 2013), by which a record is
// brought to its budget: a supersegment goes on while the medium is like its mean so far, by one
// threshold per ray, the least that keeps the budget.
//
// It works on the recorded runs: the volume is not marched again, and no run is dropped.
#include "generation/shorten_lists.cl"
#pragma OPENCL FP_CONTRACT OFF

// Bisections of the threshold: it is found to a thousandth, or to 2^-30 of the largest difference
// where that is tiny.
#define BISECTIONS 30
#define BISECTED 1e-3f

// Merge neighbours front to back while the next run's feature is within `threshold` of the mean so
// far. A gap is a medium of its own that is nothing: it is taken in where nothing is within the
// threshold, too. Returns how many runs are left; they are written only where `store`.
inline int merge_alike(__global float *record, int count, float threshold, float per_reference,
                       bool store)
{
    const float most = threshold * threshold;
    int kept = 0;
    Run run = load_run(record, 0);
    float4 feature = run_feature(run, per_reference);
    for (int k = 1; k < count; ++k) {
        const Run next = load_run(record, k);
        const float4 next_feature = run_feature(next, per_reference);
        bool alike = true;
        float4 mean = feature;
        if (next.FRONT > run.BACK) {
            alike = !(dot(feature, feature) > most);
            Run widened = run;
            widened.BACK = next.FRONT;
            mean = run_feature(widened, per_reference);
        }
        const float4 difference = next_feature - mean;
        if (alike && !(dot(difference, difference) > most)) {
            run = merged_runs(run, next);
            feature = run_feature(run, per_reference);
        } else {
            if (store)
                store_run(record, kept, run);
            ++kept;
            run = next;
            feature = next_feature;
        }
    }
    if (store)
        store_run(record, kept, run);
    return kept + 1;
}

// Cut to at most `limit` supersegments by the least threshold that bisection finds.
inline int cut_to_limit(__global float *record, int count, int limit, float per_reference)
{
    if (count <= limit)
        return count;
    float largest = 0.0f;
    for (int k = 0; k < count; ++k) {
        const float4 feature = run_feature(load_run(record, k), per_reference);
        largest = fmax(largest, dot(feature, feature));
    }
    float low = 0.0f;
    float high = 2.0f * sqrt(largest); // no two means differ by more
    for (int i = 0; i < BISECTIONS && high - low > BISECTED * high; ++i) {
        const float middle = 0.5f * (low + high);
        if (merge_alike(record, count, middle, per_reference, false) > limit)
            low = middle;
        else
            high = middle;
    }
    count = merge_alike(record, count, high, per_reference, true);
    // The promise holds where features are no numbers, too
    return count > limit ? merge_alike(record, count, INFINITY, per_reference, true) : count;
}

// Bring records to at most recording.limit runs by homogeneity, and merge neighbours as while
// marching: what is alike needs no cut.
__kernel void cut_lists(const RaysOfView view, __global const float *forms,
                        const Recording recording, __global float *records, __global uint *counts)
{
    const uint item = (uint)get_global_id(0);
    const Rays ray = rays_of_view(&view, item);
    const int list = ray.y * view.columns + ray.x;
    if (!ray.present || counts[list] == 0)
        return;
    const float per_reference = march_speed(forms, ray.a, ray.b) / recording.reference_length;
    __global float *record = records + record_start(item, recording.capacity);
    const int cut = cut_to_limit(record, (int)counts[list], recording.limit, per_reference);
    counts[list] = (uint)merge_within(record, 0, cut, recording.finest, true, per_reference,
                                      recording.hidden_weight);
}
