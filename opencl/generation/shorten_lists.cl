// Fit: records that have grown too long, brought to a number of runs, by merging neighbours within
// a threshold that is raised until they fit, or, for the budget, by least error (docs/concepts.md,
// "The budget"). One ray for each work-item; sixteen: cpu16/generation_shorten.cl.
//
// -D DOUBLE_FLOAT_RAYS: see lib/rays.cl
#include "volume/rays_of_view.cl"
#include "generation/records.cl"
#pragma OPENCL FP_CONTRACT OFF

// Errors are looked at in rows, which are loaded at once and end with INFINITY, as the number of
// loads is what counts where work-items are the lanes of vectors.
#define ROW_NUMBERS (int8)(0, 1, 2, 3, 4, 5, 6, 7)

// Errors of a record of so many runs, in whole rows.
inline int errors_of(int count)
{
    return (count - 1 + ERRORS_AT_A_TIME - 1) / ERRORS_AT_A_TIME * ERRORS_AT_A_TIME;
}

// errors[k]: what merging runs k and k + 1 costs; INFINITY where there are no two.
inline void measure_errors(__global const float *record, __global float *errors, int count,
                           float per_reference, float hidden_weight)
{
    Run run = load_run(record, 0);
    float4 feature = run_feature(run, per_reference);
    for (int k = 0; k < errors_of(count); ++k) {
        if (k + 1 >= count) {
            errors[k] = INFINITY;
            continue;
        }
        const Run next = load_run(record, k + 1);
        const float4 next_feature = run_feature(next, per_reference);
        errors[k] = merge_error(1, run, feature, next, next_feature, per_reference, hidden_weight);
        run = next;
        feature = next_feature;
    }
}

// How many errors are within a threshold.
inline int count_within(__global const float *errors, int count, float threshold)
{
    int8 within = 0;
    for (int k = 0; k < errors_of(count); k += ERRORS_AT_A_TIME)
        within -= vload8(k / ERRORS_AT_A_TIME, errors) <= (float8)(threshold);
    const int4 sums = within.lo + within.hi;
    return sums.x + sums.y + sums.z + sums.w;
}

// The pair of the least error; of equals the first.
inline int least_error(__global const float *errors, int count)
{
    float8 least = INFINITY;
    int8 at = 0;
    for (int k = 0; k < errors_of(count); k += ERRORS_AT_A_TIME) {
        const float8 error = vload8(k / ERRORS_AT_A_TIME, errors);
        const int8 less = error < least;
        least = select(least, error, less);
        at = select(at, k + ROW_NUMBERS, less);
    }
    const float4 least4 = fmin(least.lo, least.hi);
    const float2 least2 = fmin(least4.lo, least4.hi);
    const int8 first = select((int8)(INT_MAX), at, least == fmin(least2.x, least2.y));
    const int4 first4 = min(first.lo, first.hi);
    const int2 first2 = min(first4.lo, first4.hi);
    return min(first2.x, first2.y);
}

// Merge neighbours whose error is within a threshold, in one pass from front to back. Returns how
// many runs are left.
inline int merge_within(__global float *record, int count, float threshold, float per_reference,
                        float hidden_weight)
{
    int kept = 0;
    Run run = load_run(record, 0);
    float4 feature = run_feature(run, per_reference);
    for (int k = 1; k < count; ++k) {
        const Run next = load_run(record, k);
        const float4 next_feature = run_feature(next, per_reference);
        if (merge_error(1, run, feature, next, next_feature, per_reference, hidden_weight) >
            threshold) {
            store_run(record, kept++, run);
            run = next;
            feature = next_feature;
        } else {
            run = merged_runs(run, next);
            feature = run_feature(run, per_reference);
        }
    }
    store_run(record, kept, run);
    return kept + 1;
}

// Raise the threshold and merge within it until at most `limit` runs are left.
inline int make_room(__global float *record, __global float *errors, int count, int limit,
                     __global float *threshold, float per_reference, float hidden_weight)
{
    while (count > limit) {
        measure_errors(record, errors, count, per_reference, hidden_weight);
        while (count_within(errors, count, *threshold) < count - limit)
            *threshold *= 4.0f;
        count = merge_within(record, count, *threshold, per_reference, hidden_weight);
    }
    return count;
}

inline int word_of(__global const float *record, int k, int word)
{
    return as_int(record[k * RUN_WORDS + word]);
}

// The run behind the k-th, or `count` where there is none.
inline int next_of(__global const float *record, int k, int count)
{
    if (k + 1 < count && word_of(record, k + 1, TAU_WORD) < 0)
        return word_of(record, k + 1, NEXT_WORD);
    return k + 1;
}

// The run before the k-th, or -1 where there is none.
inline int before_of(__global const float *record, int k)
{
    if (k > 0 && word_of(record, k - 1, TAU_WORD) < 0)
        return word_of(record, k - 1, BEFORE_WORD);
    return k - 1;
}

// Merge, least error first, until at most `limit` runs are left.
inline int merge_to_limit(__global float *record, __global float *errors, int count, int limit,
                          float per_reference, float hidden_weight)
{
    if (count <= limit)
        return count;
    measure_errors(record, errors, count, per_reference, hidden_weight);
    for (int left = count; left > limit; --left) {
        // The pair that costs least becomes one
        const int at = least_error(errors, count);
        const int next = next_of(record, at, count);
        const int behind = next_of(record, next, count);
        const int before = before_of(record, at);
        const Run merged = merged_runs(load_run(record, at), load_run(record, next));
        const float4 feature = run_feature(merged, per_reference);
        store_run(record, at, merged);
        record[next * RUN_WORDS + TAU_WORD] = -1.0f;
        record[(at + 1) * RUN_WORDS + NEXT_WORD] = as_float(behind);
        record[(behind - 1) * RUN_WORDS + BEFORE_WORD] = as_float(at);
        errors[next] = INFINITY;
        // Both its neighbours' errors have changed
        errors[at] = INFINITY;
        if (behind < count) {
            const Run last = load_run(record, behind);
            errors[at] = merge_error(1, merged, feature, last, run_feature(last, per_reference),
                                     per_reference, hidden_weight);
        }
        if (before >= 0) {
            const Run first = load_run(record, before);
            errors[before] = merge_error(1, first, run_feature(first, per_reference), merged,
                                         feature, per_reference, hidden_weight);
        }
    }
    // Close the gaps
    for (int to = 1, from = 1; to < limit; ++to, ++from) {
        if (record[from * RUN_WORDS + TAU_WORD] < 0.0f)
            from = word_of(record, from, NEXT_WORD);
        store_run(record, to, load_run(record, from));
    }
    return limit;
}

// Shorten records of more than recording.limit runs: with `exactly`, by least error; otherwise by
// raising the rays' thresholds.
__kernel void shorten_lists(const RaysOfView view, __global const float *forms,
                            const Recording recording, int exactly, __global float *thresholds,
                            __global float *records, __global float *errors, __global uint *counts)
{
    const uint item = (uint)get_global_id(0);
    const Rays ray = rays_of_view(&view, item);
    if (!ray.present)
        return;
    const int list = ray.y * view.columns + ray.x, count = (int)counts[list],
              limit = recording.limit;
    if (count <= limit)
        return;
    const float per_reference = march_speed(forms, ray.a, ray.b) / recording.reference_length;
    __global float *record = records + record_start(item, recording.capacity);
    errors += errors_start(item, recording.capacity);
    counts[list] = (uint)(exactly ? merge_to_limit(record, errors, count, limit, per_reference,
                                                   recording.hidden_weight)
                                  : make_room(record, errors, count, limit, thresholds + item,
                                              per_reference, recording.hidden_weight));
}
