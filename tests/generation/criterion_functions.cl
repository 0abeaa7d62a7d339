// Entry point to opencl/generation/criteria.cl, one work-item per record. -D CRITERION.
#include "generation/criteria.cl"
#pragma OPENCL FP_CONTRACT OFF

// Cut record i; `runs` are in (record, k) order, before and after.
__kernel void cut(int count, int limit, int capacity, float per_reference, __global float8 *runs, __global int *lengths,
                  __global float *records)
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
