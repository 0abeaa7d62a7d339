// Fit: records that have grown too long, brought to a number of runs, by merging neighbours within
// a threshold that is raised until they fit, or, for the budget, by least error (docs/concepts.md,
// "The budget"). A ray or a block of 4 x 4 in a work-item (lib/lanes.cl).
//
// Of sixteen rays each merge would wait for the divisions of the one before, and for branches that
// no processor foresees: all take the same steps, and what depends on the ray is selected. `starts`
// says where the words of each ray's runs begin, from `records` on.
#include "volume/rays_of_view.cl"
#include "generation/merging.cl"
#pragma OPENCL FP_CONTRACT OFF

// Merge errors lie in rows of ERROR_LANES rays', so that neighbouring work-items, or lanes, touch
// neighbouring words.
#define ERROR_LANES 16
#define ERRORS(k) (errors + (k) * ERROR_LANES)

// Where the merge errors of a ray, or of a block, begin.
inline size_t errors_start(uint ray, int capacity)
{
    return (size_t)(ray / ERROR_LANES) * (size_t)(capacity * ERROR_LANES) + ray % ERROR_LANES;
}

// Errors of k: what merging runs k and k + 1 costs; INFINITY where there are no two.
inline void measure_errors(__global const float *records, Int starts, __global float *errors,
                           Int counts, int most, Real per_reference, float hidden_weight)
{
    Run run = load_run_at(records, starts);
    Real4 feature = run_feature(run, per_reference);
    for (int k = 0; k < most - 1; ++k) {
        const Run next = load_run_at(records + min(k + 1, most - 1) * RUN_WORDS, starts);
        const Real4 next_feature = run_feature(next, per_reference);
        const Int there = k + 1 < counts;
        const Real error =
            merge_error(there, run, feature, next, next_feature, per_reference, hidden_weight);
        STORE_LANES(SELECT((Real)(INFINITY), error, there), 0, ERRORS(k));
        run = next;
        feature = next_feature;
    }
}

// The pair of the least error; of equals the first.
inline Int least_error(__global const float *errors, int most)
{
    Real least = INFINITY;
    Int at = 0;
    for (int k = 0; k < most - 1; ++k) {
        const Real error = LOAD_LANES(0, ERRORS(k));
        const Int less = error < least;
        least = SELECT(least, error, less);
        at = SELECT(at, (Int)(k), less);
    }
    return at;
}

// Merge neighbours whose error is within thresholds, in one pass from front to back, for rays that
// are chosen. Returns how many runs each ray has then.
inline Int merge_within(__global float *records, Int starts, Int counts, Real thresholds,
                        Int chosen, Real per_reference, float hidden_weight)
{
    const int most = largest_lane(counts);
    Run run = load_run_at(records, starts);
    Real4 feature = run_feature(run, per_reference);
    Int kept = 0;
    Int place = starts;
    for (int k = 1; k < most; ++k) {
        const Run next = load_run_at(records + k * RUN_WORDS, starts);
        const Real4 next_feature = run_feature(next, per_reference);
        const Int there = chosen & (k < counts);
        const Real error =
            merge_error(there, run, feature, next, next_feature, per_reference, hidden_weight);
        const Int begins = there & (error > thresholds);
        const Int grows = there & !begins;
        // Where a run is not at its end, or a ray at its last one, it is stored for nothing
        if (ANY(begins))
            store_run_at(records, place, run);
        kept += COUNT(begins);
        place += COUNT(begins) * RUN_WORDS;
        const Run merged = merged_runs(run, next);
        run = selected_run(selected_run(run, next, begins), merged, grows);
        feature = selected_feature(run_feature(run, per_reference), next_feature, begins);
    }
    store_run_at(records, place, run);
    return SELECT(counts, kept + 1, chosen);
}

// Raise thresholds and merge within them until at most `limit` runs of each ray are left.
inline Int make_room(__global float *records, Int starts, __global float *errors, Int counts,
                     int limit, Real *thresholds, Real per_reference, float hidden_weight)
{
    for (;;) {
        const Int chosen = counts > limit;
        if (!ANY(chosen))
            return counts;
        const int most = largest_lane(counts);
        measure_errors(records, starts, errors, counts, most, per_reference, hidden_weight);
        for (;;) {
            Int within = 0;
            for (int k = 0; k < most - 1; ++k)
                within += COUNT(LOAD_LANES(0, ERRORS(k)) <= *thresholds);
            const Int low = chosen & (within < counts - limit);
            if (!ANY(low))
                break;
            *thresholds = SELECT(*thresholds, *thresholds * 4.0f, low);
        }
        counts = merge_within(records, starts, counts, *thresholds, chosen, per_reference,
                              hidden_weight);
    }
}

// Runs that others have taken in have a negative optical depth. The first behind a run says where
// the next run is, the last before one where that is which has taken it in.
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
    return load_run_at(records, starts + k * RUN_WORDS);
}

// Merge, least error first, until at most `limit` runs of each ray are left.
inline Int merge_to_limit(__global float *records, Int starts, __global float *errors, Int counts,
                          int limit, Real per_reference, float hidden_weight)
{
    const int most = largest_lane(counts);
    const Places many = {counts}, first = {starts};
    measure_errors(records, starts, errors, counts, most, per_reference, hidden_weight);
    Int alive = counts;
    const Int within = max(counts, 2); // so that every lane has somewhere to look
    for (;;) {
        const Int chosen = alive > limit;
        if (!ANY(chosen))
            break;
        // The pair that costs least becomes one. Of rays that are done, and may have nothing,
        // places are only somewhere in the record
        const Int at = least_error(errors, most);
        const Int next = clamp(next_of(records, starts, at, within), 0, within - 1);
        const Int behind = clamp(next_of(records, starts, next, within), 0, within);
        const Int before = clamp(before_of(records, starts, at), -1, within - 1);
        const Run a = run_of(records, starts, at), b = run_of(records, starts, next);
        const Run c = run_of(records, starts, min(behind, within - 1));
        const Run d = run_of(records, starts, max(before, 0));
        const Run merged = merged_runs(a, b);
        store_run_at(records, starts + at * RUN_WORDS, selected_run(a, merged, chosen));
        // Both its neighbours' errors change
        const Real4 feature = run_feature(merged, per_reference);
        const Real ahead = merge_error(chosen & (behind < counts), merged, feature, c,
                                       run_feature(c, per_reference), per_reference, hidden_weight);
        const Real error_before =
            merge_error(chosen & (before >= 0), d, run_feature(d, per_reference), merged, feature,
                        per_reference, hidden_weight);
        const Real error_after = SELECT((Real)(INFINITY), ahead, behind < counts);
        const Places taking = {at}, taken = {next}, last = {behind}, earlier = {before},
                     who = {chosen};
        const float *after_each = (const float *)&error_after;
        const float *before_each = (const float *)&error_before;
        for (int lane = 0; lane < LANES; ++lane) {
            if (!who.each[lane])
                continue;
            __global float *record = records + first.each[lane];
            record[taken.each[lane] * RUN_WORDS + TAU_WORD] = -1.0f;
            record[(taking.each[lane] + 1) * RUN_WORDS + NEXT_WORD] = as_float(last.each[lane]);
            record[(last.each[lane] - 1) * RUN_WORDS + BEFORE_WORD] = as_float(taking.each[lane]);
            ERRORS(taken.each[lane])[lane] = INFINITY;
            ERRORS(taking.each[lane])[lane] = after_each[lane];
            if (earlier.each[lane] >= 0)
                ERRORS(earlier.each[lane])[lane] = before_each[lane];
        }
        alive -= COUNT(chosen);
    }
    // Close the gaps
    for (int lane = 0; lane < LANES; ++lane) {
        if (many.each[lane] <= limit)
            continue;
        __global ulong4 *record = (__global ulong4 *)(records + first.each[lane]);
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

// Shorten records of more than recording.limit runs: with `exactly`, by least error; otherwise by
// raising the rays' thresholds.
KERNEL_OF_LANES void shorten_lists(const RaysOfView view, __global const float *forms,
                                   const Recording recording, int exactly,
                                   __global float *thresholds, __global float *records,
                                   __global float *errors, __global uint *counts)
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_view(&view, first);
    if (!ANY(rays.present))
        return;
    const int limit = recording.limit;
    const Int lists = rays.y * view.columns + rays.x;
    Int runs = load_counts(counts, lists, rays.present);
    if (!ANY(runs > limit))
        return;
    const Real per_reference = march_speed(forms, rays.a, rays.b) / recording.reference_length;
    records += record_start(first, recording.capacity);
    errors += errors_start(first, recording.capacity);
    const Int starts = LANE_NUMBERS * (recording.capacity * RUN_WORDS);
    if (exactly) {
        runs = merge_to_limit(records, starts, errors, runs, limit, per_reference,
                              recording.hidden_weight);
    } else {
        Real raised = LOAD_LANES(0, thresholds + first);
        runs = make_room(records, starts, errors, runs, limit, &raised, per_reference,
                         recording.hidden_weight);
        STORE_LANES(raised, 0, thresholds + first);
    }
    store_counts(counts, lists, rays.present, runs);
}
