// Records that have grown too long, brought to a number of runs: by merging neighbours within a threshold that is raised until
// they fit, or, for the budget, at least error (docs/conventions.md, "Merging samples").
//
// -D LANES  16 on CPUs: ray by ray each merge waits for the divisions of the one before, and for branches that no processor
//           foresees. The rays of a block of 4 x 4 take the same steps, and what depends on the ray is selected.
// -D DOUBLE_FLOAT_RAYS: see lib/rays.cl
//
// Functions take the records of a work-item's rays, and where each begins.
#include "lib/rays.cl"
#include "generation/runs.cl"
#pragma OPENCL FP_CONTRACT OFF

// Errors lie in rows, which are loaded at once and end with INFINITY: the same of all lanes, or the next of one ray, as the
// number of loads is what counts where work-items are the lanes of vectors.
#if LANES == 1
#define ROW_ERRORS ERRORS_AT_A_TIME // of a ray
typedef float8 Row;
typedef int8 RowPlaces;
#define LOAD_ROW(k, errors) vload8((k) / ROW_ERRORS, errors)
#define ROW_NUMBERS (int8)(0, 1, 2, 3, 4, 5, 6, 7)
#else
#define ROW_ERRORS 1
typedef Real Row;
typedef Int RowPlaces;
#define LOAD_ROW(k, errors) LOAD_LANES(k, errors)
#define ROW_NUMBERS 0
#endif

inline size_t errors_start(uint ray, int capacity)
{
    return (size_t)ray * (size_t)((capacity + ERRORS_AT_A_TIME - 1) / ERRORS_AT_A_TIME * ERRORS_AT_A_TIME);
}

// Errors of records of up to `most` runs, in whole rows.
inline int errors_of(int most)
{
    return (most - 1 + ROW_ERRORS - 1) / ROW_ERRORS * ROW_ERRORS;
}

inline Run selected_run(Run otherwise, Run then, Int condition)
{
    Run run;
    run.FRONT = SELECT(otherwise.FRONT, then.FRONT, condition);
    run.BACK = SELECT(otherwise.BACK, then.BACK, condition);
    run.TAU = SELECT(otherwise.TAU, then.TAU, condition);
    run.TRANSMITTANCE = SELECT(otherwise.TRANSMITTANCE, then.TRANSMITTANCE, condition);
    run.RED = SELECT(otherwise.RED, then.RED, condition);
    run.GREEN = SELECT(otherwise.GREEN, then.GREEN, condition);
    run.BLUE = SELECT(otherwise.BLUE, then.BLUE, condition);
    run.OPACITY = SELECT(otherwise.OPACITY, then.OPACITY, condition);
    return run;
}

inline Real4 selected_feature(Real4 otherwise, Real4 then, Int condition)
{
    return REAL4(SELECT(otherwise.x, then.x, condition), SELECT(otherwise.y, then.y, condition),
                 SELECT(otherwise.z, then.z, condition), SELECT(otherwise.w, then.w, condition));
}

// errors[k]: what merging runs k and k + 1 costs; INFINITY where there are no two.
inline void measure_errors(__global const float *records, const Places *starts, __global float *errors, Int counts, int most,
                           Real per_reference, float hidden_weight)
{
    Run run = load_run_at(records, starts->each);
    Real4 feature = run_feature(run, per_reference);
    for (int k = 0; k < errors_of(most); ++k) {
        const Run next = load_run_at(records + min(k + 1, most - 1) * RUN_WORDS, starts->each);
        const Real4 next_feature = run_feature(next, per_reference);
        const Int there = k + 1 < counts;
        const Real error = merge_error(there, run, feature, next, next_feature, per_reference, hidden_weight);
        STORE_LANES(SELECT((Real)(INFINITY), error, there), k, errors);
        run = next;
        feature = next_feature;
    }
}

// How many errors are within thresholds.
inline Int count_within(__global const float *errors, int most, Real thresholds)
{
    RowPlaces within = 0;
    for (int k = 0; k < errors_of(most); k += ROW_ERRORS)
        within -= LOAD_ROW(k, errors) <= (Row)(thresholds);
#if LANES == 1
    const int4 sums = within.lo + within.hi;
    return sums.x + sums.y + sums.z + sums.w;
#else
    return within;
#endif
}

// The pair of the least error; of equals the first.
inline Int least_error(__global const float *errors, int most)
{
    Row least = INFINITY;
    RowPlaces at = 0;
    for (int k = 0; k < errors_of(most); k += ROW_ERRORS) {
        const Row error = LOAD_ROW(k, errors);
        const RowPlaces less = error < least;
        least = select(least, error, less);
        at = select(at, k + ROW_NUMBERS, less);
    }
#if LANES == 1
    const float4 least4 = fmin(least.lo, least.hi);
    const float2 least2 = fmin(least4.lo, least4.hi);
    const int8 first = select((int8)(INT_MAX), at, least == fmin(least2.x, least2.y));
    const int4 first4 = min(first.lo, first.hi);
    const int2 first2 = min(first4.lo, first4.hi);
    return min(first2.x, first2.y);
#else
    return at;
#endif
}

// Merge neighbours whose error is within thresholds, in one pass from front to back, for rays that are chosen. Returns how
// many runs each ray has then.
inline Int merge_within(__global float *records, const Places *starts, Int counts, Real thresholds, Int chosen, Real per_reference,
                        float hidden_weight)
{
    const int most = largest_lane(counts);
    Run run = load_run_at(records, starts->each);
    Real4 feature = run_feature(run, per_reference);
    Int kept = 0;
    Places place = {starts->all};
    for (int k = 1; k < most; ++k) {
        const Run next = load_run_at(records + k * RUN_WORDS, starts->each);
        const Real4 next_feature = run_feature(next, per_reference);
        const Int there = chosen & (k < counts);
        const Real error = merge_error(there, run, feature, next, next_feature, per_reference, hidden_weight);
        const Int begins = there & (error > thresholds);
        const Int grows = there & !begins;
        // Where a run is not at its end, or a ray at its last one, it is stored for nothing
        if (ANY(begins))
            store_run_at(records, place.each, run);
        kept += COUNT(begins);
        place.all += COUNT(begins) * RUN_WORDS;
        const Run merged = merged_runs(run, next);
        run = selected_run(selected_run(run, next, begins), merged, grows);
        feature = selected_feature(run_feature(run, per_reference), next_feature, begins);
    }
    store_run_at(records, place.each, run);
    return SELECT(counts, kept + 1, chosen);
}

// Raise thresholds and merge within them until at most `limit` runs of each ray are left.
inline Int make_room(__global float *records, const Places *starts, __global float *errors, Int counts, int limit, Real *thresholds,
                     Real per_reference, float hidden_weight)
{
    for (;;) {
        const Int chosen = counts > limit;
        if (!ANY(chosen))
            return counts;
        const int most = largest_lane(counts);
        measure_errors(records, starts, errors, counts, most, per_reference, hidden_weight);
        for (;;) {
            const Int low = chosen & (count_within(errors, most, *thresholds) < counts - limit);
            if (!ANY(low))
                break;
            *thresholds = SELECT(*thresholds, *thresholds * 4.0f, low);
        }
        counts = merge_within(records, starts, counts, *thresholds, chosen, per_reference, hidden_weight);
    }
}

// Runs that others have taken in have a negative optical depth. The first behind a run says where the next run is, the last
// before one where that is which has taken it in.
#define NEXT_WORD 1
#define BEFORE_WORD 0
#define TAU_WORD 2

inline Int words_at(__global const float *records, Int places, int word)
{
    const Places words = {places};
    Place *at = words.each;
#define WORD(n) as_int(records[at[n] + word])
    return OF_LANES(Int, WORD);
#undef WORD
}

// The run behind the k-th of each ray, or `counts` where there is none.
inline Int next_of(__global const float *records, Int starts, Int k, Int counts)
{
    const Int behind = starts + min(k + 1, counts - 1) * RUN_WORDS;
    const Int taken = words_at(records, behind, TAU_WORD) < 0;
    return SELECT(k + 1, words_at(records, behind, NEXT_WORD), taken & (k + 1 < counts));
}

// The run before the k-th, or -1 where there is none.
inline Int before_of(__global const float *records, Int starts, Int k)
{
    const Int before = starts + max(k - 1, 0) * RUN_WORDS;
    const Int taken = words_at(records, before, TAU_WORD) < 0;
    return SELECT(k - 1, words_at(records, before, BEFORE_WORD), taken & (k > 0));
}

inline Run run_of(__global const float *records, Int starts, Int k)
{
    const Places places = {starts + k * RUN_WORDS};
    return load_run_at(records, places.each);
}

// Merge, least error first, until at most `limit` runs of each ray are left.
inline Int merge_to_limit(__global float *records, const Places *first, __global float *errors, Int counts, int limit,
                          Real per_reference, float hidden_weight)
{
    const int most = largest_lane(counts);
    measure_errors(records, first, errors, counts, most, per_reference, hidden_weight);
    Int alive = counts;
    const Int within = max(counts, 2); // so that every lane has somewhere to look
    const Int starts = first->all;
    for (;;) {
        const Int chosen = alive > limit;
        if (!ANY(chosen))
            break;
        // Of rays that are done, and may have nothing, places are only somewhere in the record
        const Int at = least_error(errors, most);
        const Int next = clamp(next_of(records, starts, at, within), 0, within - 1);
        const Int behind = clamp(next_of(records, starts, next, within), 0, within);
        const Int before = clamp(before_of(records, starts, at), -1, within - 1);
        const Run a = run_of(records, starts, at);
        const Run b = run_of(records, starts, next);
        const Run c = run_of(records, starts, min(behind, within - 1));
        const Run d = run_of(records, starts, max(before, 0));
        const Run merged = merged_runs(a, b);
        const Real4 feature = run_feature(merged, per_reference);
        const Real ahead = merge_error(chosen & (behind < counts), merged, feature, c, run_feature(c, per_reference),
                                       per_reference, hidden_weight);
        const Real error_before = merge_error(chosen & (before >= 0), d, run_feature(d, per_reference), merged, feature,
                                              per_reference, hidden_weight);
        const Real error_after = SELECT((Real)(INFINITY), ahead, behind < counts);
        const Places place = {starts + at * RUN_WORDS};
        store_run_at(records, place.each, selected_run(a, merged, chosen));
        const Places taking = {at}, taken = {next}, last = {behind}, earlier = {before}, who = {chosen};
        const float *after_each = (const float *)&error_after;
        const float *before_each = (const float *)&error_before;
        for (int lane = 0; lane < LANES; ++lane) {
            if (!who.each[lane])
                continue;
            __global float *record = records + first->each[lane];
            record[taken.each[lane] * RUN_WORDS + TAU_WORD] = -1.0f;
            record[(taking.each[lane] + 1) * RUN_WORDS + NEXT_WORD] = as_float(last.each[lane]);
            record[(last.each[lane] - 1) * RUN_WORDS + BEFORE_WORD] = as_float(taking.each[lane]);
            errors[taken.each[lane] * LANES + lane] = INFINITY;
            errors[taking.each[lane] * LANES + lane] = after_each[lane];
            if (earlier.each[lane] >= 0)
                errors[earlier.each[lane] * LANES + lane] = before_each[lane];
        }
        alive -= COUNT(chosen);
    }
    // Close the gaps
    const Places many = {counts};
    for (int lane = 0; lane < LANES; ++lane) {
        if (many.each[lane] <= limit)
            continue;
        __global ulong4 *record = (__global ulong4 *)(records + first->each[lane]);
        int from = 1;
        for (int to = 1; to < limit; ++to) {
            __global const float *words = (__global const float *)(record + from);
            if (words[TAU_WORD] < 0.0f)
                from = as_int(words[NEXT_WORD]);
            record[to] = record[from++];
        }
    }
    return min(counts, limit);
}

// Shorten records of more than `limit` runs: with `exactly`, at least error; otherwise by raising the rays' thresholds. Other
// arguments as for march_lists.
KERNEL_OF_LANES void shorten_lists(
    int limit,
    int exactly,
    int width, int height,
    int first_column, int columns, int first_row, int rows,
    __global const float *forms,
    int capacity,
    float reference_length,
    float hidden_weight,
    __global float *all_thresholds,
    __global float *all_records,
    __global float *all_errors,
    __global uint *counts)
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_part(first, width, height, first_column, columns, first_row, rows);
    if (!ANY(rays.present))
        return;
    const Int lists = rays.y * columns + rays.x;
    Int runs = load_counts(counts, lists, rays.present);
    if (!ANY(runs > limit))
        return;
    const Real per_reference = march_speed(forms, rays.a, rays.b) / reference_length;
    __global float *records = all_records + record_start(first, capacity);
    __global float *errors = all_errors + errors_start(first, capacity);
    const Places starts = {LANE_NUMBERS * (capacity * RUN_WORDS)};
    if (exactly) {
        runs = merge_to_limit(records, &starts, errors, runs, limit, per_reference, hidden_weight);
    } else {
        Real thresholds = LOAD_LANES(0, all_thresholds + first);
        runs = make_room(records, &starts, errors, runs, limit, &thresholds, per_reference, hidden_weight);
        STORE_LANES(thresholds, 0, all_thresholds + first);
    }
    store_counts(counts, lists, rays.present, runs);
}
