// Entry point to opencl/generation/criteria.cl, one work-item per record. -D CRITERION.
#include "generation/criteria.cl"
#pragma OPENCL FP_CONTRACT OFF

// Cut record i; arguments are those of record_functions.cl's shortened().
__kernel void cut(int count, int way, int limit, int capacity, float per_reference, float hidden_weight,
                  __global float8 *runs, __global int *lengths, __global float *thresholds, __global float *records,
                  __global float *all_errors)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    __global float *record = records + record_start((uint)i, capacity);
    for (int k = 0; k < lengths[i]; ++k)
        store_run(record, k, runs[(size_t)i * capacity + k]);
    lengths[i] = cut_to_limit(record, lengths[i], limit, per_reference);
    for (int k = 0; k < lengths[i]; ++k)
        runs[(size_t)i * capacity + k] = load_run(record, k);
}
