// Entry points to opencl/generation/merging.cl, shorten_lists.cl and homogeneity.cl, one work-item per case or record.
#include "generation/homogeneity.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void merged(int count, __global const float *first, __global const float *second, __global float *results)
{
    const int i = get_global_id(0);
    if (i < count)
        store_run(results, i, merged_runs(load_run(first, i), load_run(second, i)));
}

__kernel void merge_errors(int count, __global const float *first, __global const float *second, float per_reference,
                           float hidden_weight, __global float *results)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Run a = load_run(first, i), b = load_run(second, i);
    results[i] = merge_error(1, a, run_feature(a, per_reference), b, run_feature(b, per_reference), per_reference,
                             hidden_weight);
}

#define WITHIN 0
#define ROOM 1
#define LIMIT 2
#define ALIKE 3

// Shorten record i by one of these; `runs` are in (record, k) order, before and after.
__kernel void shortened(int count, int way, int limit, int capacity, float per_reference, float hidden_weight,
                        __global float *runs, __global int *lengths, __global float *thresholds,
                        __global float *records, __global float *all_errors)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    __global float *record = records + record_start((uint)i, capacity);
    int n = lengths[i];
    for (int k = 0; k < n; ++k)
        store_run(record, k, load_run(runs, i * capacity + k));
    __global float *errors = all_errors + errors_start((uint)i, capacity);
    float threshold = thresholds[i];
    if (way == WITHIN)
        n = merge_within(record, 0, n, threshold, true, per_reference, hidden_weight);
    else if (way == ROOM)
        n = make_room(record, 0, errors, n, limit, &threshold, per_reference, hidden_weight);
    else if (way == ALIKE)
        n = cut_to_limit(record, n, limit, per_reference);
    else
        n = merge_to_limit(record, 0, errors, n, limit, per_reference, hidden_weight);
    thresholds[i] = threshold;
    lengths[i] = n;
    for (int k = 0; k < n; ++k)
        store_run(runs, i * capacity + k, load_run(record, k));
}
