// Records to the budget as by shorten_lists (generation/generate.cl), to the last bit, but in vectors that are written out: a work-item
// shortens those of a block of 4 x 4 rays.
//
// Ray by ray each merge waits for the divisions of the one before, and for branches that no processor foresees. Here all rays
// of a block take the same steps: what depends on the ray is selected. Records lie as generation/runs.cl says, errors of a block of rays
// side by side.
//
// -D FAR_ENTRIES: see lib/rays.cl
#define LANES 16
#include "lib/rays.cl"
#include "generation/run_blocks.cl"
#pragma OPENCL FP_CONTRACT OFF

inline int largest(Ints x)
{
    const int8 of_two = max(x.lo, x.hi);
    const int4 of_four = max(of_two.lo, of_two.hi);
    const int2 of_eight = max(of_four.lo, of_four.hi);
    return max(of_eight.x, of_eight.y);
}

inline Runs selected_runs(Runs otherwise, Runs chosen, Ints where)
{
    Runs runs;
    runs.front = select(otherwise.front, chosen.front, where);
    runs.back = select(otherwise.back, chosen.back, where);
    runs.tau = select(otherwise.tau, chosen.tau, where);
    runs.transmittance = select(otherwise.transmittance, chosen.transmittance, where);
    runs.red = select(otherwise.red, chosen.red, where);
    runs.green = select(otherwise.green, chosen.green, where);
    runs.blue = select(otherwise.blue, chosen.blue, where);
    runs.opacity = select(otherwise.opacity, chosen.opacity, where);
    return runs;
}

inline Features selected_features(Features otherwise, Features chosen, Ints where)
{
    Features features;
    features.red = select(otherwise.red, chosen.red, where);
    features.green = select(otherwise.green, chosen.green, where);
    features.blue = select(otherwise.blue, chosen.blue, where);
    features.density = select(otherwise.density, chosen.density, where);
    return features;
}

// merge_error of each chosen ray; anything of the others.
inline Reals errors_of(Ints chosen, Runs a, Features of_a, Runs b, Features of_b, Reals per_reference, float hidden_weight)
{
    const Reals length_a = (a.back - a.front) * per_reference;
    const Reals length_b = (b.back - b.front) * per_reference;
    const Reals gap = (b.front - a.back) * per_reference;
    const Reals both = length_a + length_b;
    Reals error = length_a * length_b *
                  squares_of(of_a.red - of_b.red, of_a.green - of_b.green, of_a.blue - of_b.blue, of_a.density - of_b.density) /
                  both;
    const Ints apart = chosen & (gap > 0.0f);
    if (ANY(apart)) {
        const Reals mean_squares = squares_of(
            (length_a * of_a.red + length_b * of_b.red) / both, (length_a * of_a.green + length_b * of_b.green) / both,
            (length_a * of_a.blue + length_b * of_b.blue) / both, (length_a * of_a.density + length_b * of_b.density) / both);
        error = select(error, error + both * gap * mean_squares / (both + gap), apart);
    }
    error *= hidden_weight + (1.0f - hidden_weight) * a.transmittance;
    return select((Reals)(FLT_MAX), error, error < FLT_MAX); // also where it is not a number
}

// errors[k] of each ray: what merging its runs k and k + 1 costs; INFINITY where there are no two. `starts`: of its record.
inline void measure_all(__global const float *records, const volatile int *starts, __global float *errors, Ints counts, int most,
                        Reals per_reference, float hidden_weight)
{
    Runs runs = load_runs(records, starts);
    Features features = features_of(runs, per_reference);
    for (int k = 0; k + 1 < most; ++k) {
        const Runs next = load_runs(records + (k + 1) * RUN_WORDS, starts);
        const Features next_features = features_of(next, per_reference);
        const Ints there = k + 1 < counts;
        const Reals error = errors_of(there, runs, features, next, next_features, per_reference, hidden_weight);
        vstore16(select((Reals)(INFINITY), error, there), k, errors);
        runs = next;
        features = next_features;
    }
}

// Raise thresholds until so many errors are within.
inline Reals raised(Reals thresholds, __global const float *errors, int most, Ints wanted, Ints chosen)
{
    for (;;) {
        Ints within = (Ints)(0);
        for (int k = 0; k + 1 < most; ++k)
            within -= vload16(k, errors) <= thresholds;
        const Ints low = chosen & (within < wanted);
        if (!ANY(low))
            return thresholds;
        thresholds = select(thresholds, thresholds * 4.0f, low);
    }
}

// merge_within of chosen rays. Returns how many runs each has then.
inline Ints merge_all_within(__global float *records, const volatile int *starts, Ints counts, int most, Reals thresholds,
                             Ints chosen, Reals per_reference, float hidden_weight)
{
    Places places;
    places.all = *(const volatile Ints *)starts;
    Runs runs = load_runs(records, starts);
    Features features = features_of(runs, per_reference);
    Ints kept = (Ints)(0);
    for (int k = 1; k < most; ++k) {
        const Runs next = load_runs(records + k * RUN_WORDS, starts);
        const Features next_features = features_of(next, per_reference);
        const Ints there = chosen & (k < counts);
        const Reals error = errors_of(there, runs, features, next, next_features, per_reference, hidden_weight);
        const Ints grows = there & ~(error > thresholds);
        const Ints begins = there & (error > thresholds);
        // Where a run is not at its end, or a ray at its last one, it is stored for nothing
        if (ANY(begins))
            store_runs(records, (const volatile int *)places.each, runs);
        kept -= begins;
        places.all -= begins * RUN_WORDS;
        const Runs merged = merged_of(runs, next);
        runs = selected_runs(selected_runs(runs, next, begins), merged, grows);
        features = selected_features(next_features, features_of(runs, per_reference), ~begins);
    }
    store_runs(records, (const volatile int *)places.each, runs);
    return select(counts, kept + 1, chosen);
}

// make_room of each ray.
inline Ints make_all_room(__global float *records, const volatile int *starts, __global float *errors, Ints counts, int limit,
                          Reals *thresholds, Reals per_reference, float hidden_weight)
{
    for (;;) {
        const Ints chosen = counts > limit;
        if (!ANY(chosen))
            return counts;
        const int most = largest(counts);
        measure_all(records, starts, errors, counts, most, per_reference, hidden_weight);
        *thresholds = raised(*thresholds, errors, most, counts - limit, chosen);
        counts = merge_all_within(records, starts, counts, most, *thresholds, chosen, per_reference, hidden_weight);
    }
}

// Runs that others have taken in have a negative optical depth. The first behind a run says where the next run is, the last
// before one where that is which has taken it in.
#define NEXT_WORD 1
#define BEFORE_WORD 0
#define TAU_WORD 2

inline Ints words_at(__global const float *records, const volatile int *at, int word)
{
#define WORD(n) as_int(records[at[n] + word])
    return (Ints)(WORD(0), WORD(1), WORD(2), WORD(3), WORD(4), WORD(5), WORD(6), WORD(7), WORD(8), WORD(9), WORD(10), WORD(11),
                  WORD(12), WORD(13), WORD(14), WORD(15));
#undef WORD
}

// The run behind place k of each ray, or `counts` where there is none.
inline Ints next_of(__global const float *records, Ints starts, Ints k, Ints counts)
{
    Places places;
    places.all = starts + min(k + 1, counts - 1) * RUN_WORDS;
    const Ints taken = words_at(records, places.each, TAU_WORD) < 0;
    return select(k + 1, words_at(records, places.each, NEXT_WORD), taken & (k + 1 < counts));
}

// The run before place k, or -1 where there is none.
inline Ints before_of(__global const float *records, Ints starts, Ints k)
{
    Places places;
    places.all = starts + max(k - 1, 0) * RUN_WORDS;
    const Ints taken = words_at(records, places.each, TAU_WORD) < 0;
    return select(k - 1, words_at(records, places.each, BEFORE_WORD), taken & (k > 0));
}

inline Runs runs_at(__global const float *records, Ints starts, Ints k)
{
    Places places;
    places.all = starts + k * RUN_WORDS;
    return load_runs(records, places.each);
}

// merge_to_limit of each ray.
inline Ints merge_all_to_limit(__global float *records, Ints starts, __global float *errors, Ints counts, int limit,
                               Reals per_reference, float hidden_weight)
{
    const int most = largest(counts);
    Places places;
    places.all = starts;
    measure_all(records, places.each, errors, counts, most, per_reference, hidden_weight);
    Ints alive = counts;
    Ints within = max(counts, 2); // so that every lane has somewhere to look
    for (;;) {
        const Ints chosen = alive > limit;
        if (!ANY(chosen))
            break;
        Reals lowest = (Reals)(INFINITY);
        Ints at = (Ints)(0);
        for (int k = 0; k + 1 < most; ++k) {
            const Reals error = vload16(k, errors);
            const Ints less = error < lowest;
            lowest = select(lowest, error, less);
            at = select(at, k, less);
        }
        // Of rays that are done, and may have nothing, places are only somewhere in the record
        const Ints next = clamp(next_of(records, starts, at, within), 0, within - 1);
        const Ints behind = clamp(next_of(records, starts, next, within), 0, within);
        const Ints before = clamp(before_of(records, starts, at), -1, within - 1);
        const Runs a = runs_at(records, starts, at);
        const Runs b = runs_at(records, starts, next);
        const Runs c = runs_at(records, starts, min(behind, within - 1));
        const Runs d = runs_at(records, starts, max(before, 0));
        const Runs merged = merged_of(a, b);
        const Features features = features_of(merged, per_reference);
        const Reals ahead = errors_of(
            chosen & (behind < counts), merged, features, c, features_of(c, per_reference), per_reference, hidden_weight);
        const Reals error_before = errors_of(
            chosen & (before >= 0), d, features_of(d, per_reference), merged, features, per_reference, hidden_weight);
        Reals after = select((Reals)(INFINITY), ahead, behind < counts);
        Places taking, taken, last, earlier, who;
        taking.all = at;
        taken.all = next;
        last.all = behind;
        earlier.all = before;
        who.all = chosen;
        places.all = starts + at * RUN_WORDS;
        store_runs(records, places.each, selected_runs(a, merged, chosen));
        places.all = starts;
        const float *after_each = (const float *)&after;
        const float *before_each = (const float *)&error_before;
        for (int lane = 0; lane < LANES; ++lane) {
            if (!who.each[lane])
                continue;
            __global float *record = records + places.each[lane];
            record[taken.each[lane] * RUN_WORDS + TAU_WORD] = -1.0f;
            record[(taking.each[lane] + 1) * RUN_WORDS + NEXT_WORD] = as_float(last.each[lane]);
            record[(last.each[lane] - 1) * RUN_WORDS + BEFORE_WORD] = as_float(taking.each[lane]);
            errors[taken.each[lane] * LANES + lane] = INFINITY;
            errors[taking.each[lane] * LANES + lane] = after_each[lane];
            if (earlier.each[lane] >= 0)
                errors[earlier.each[lane] * LANES + lane] = before_each[lane];
        }
        alive += chosen;
    }
    // Close the gaps
    Places many;
    many.all = counts;
    places.all = starts;
    for (int lane = 0; lane < LANES; ++lane) {
        if (many.each[lane] <= limit)
            continue;
        __global float *record = records + places.each[lane];
        int from = 1;
        for (int to = 1; to < limit; ++to) {
            if (record[from * RUN_WORDS + TAU_WORD] < 0.0f)
                from = as_int(record[from * RUN_WORDS + NEXT_WORD]);
            store_run(record, to, load_run(record, from++));
        }
    }
    return min(counts, limit);
}

__attribute__((vec_type_hint(float16)))
__kernel void shorten_blocks(
    int limit,
    int exactly,
    int width, int height,
    int first_row, int rows,
    __global const float *forms,
    int capacity,
    float reference_length,
    float hidden_weight,
    __global float *thresholds,
    __global float *all_records,
    __global float *all_errors,
    __global uint *counts)
{
    const uint first = (uint)get_global_id(0) * LANES;
    const int2 corner = block_pixel(first, width);
    if (corner.x >= width || corner.y >= rows)
        return;
    __global uint *lengths = counts + (size_t)corner.y * width + corner.x;
    Places many;
    many.all = (Ints)(0);
    for (int lane = 0; lane < LANES; ++lane) {
        const int x = lane & 3, y = lane >> 2;
        if (corner.x + x < width && corner.y + y < rows)
            many.each[lane] = (int)lengths[(size_t)y * width + x];
    }
    Ints lengths_now = many.all;
    if (!ANY(lengths_now > limit))
        return;
    Reals per_reference = (Reals)(0.0f);
    float *each_reference = (float *)&per_reference;
    for (int lane = 0; lane < LANES; ++lane) {
        const float a = (float)(corner.x + (lane & 3)) + 0.5f - 0.5f * (float)width;
        const float b = (float)(first_row + corner.y + (lane >> 2)) + 0.5f - 0.5f * (float)height;
        each_reference[lane] = length(model_direction(forms, a, b)) / reference_length;
    }
    __global float *records = all_records + record_start(first, capacity, RUN_WORDS);
    __global float *errors = all_errors + errors_start(first, capacity);
    Places starts;
    starts.all = NUMBERS * (capacity * RUN_WORDS);
    if (exactly) {
        many.all = merge_all_to_limit(records, starts.all, errors, lengths_now, limit, per_reference, hidden_weight);
    } else {
        Reals raised_to = vload16(0, thresholds + first);
        many.all = make_all_room(records, starts.each, errors, lengths_now, limit, &raised_to, per_reference, hidden_weight);
        vstore16(raised_to, 0, thresholds + first);
    }
    for (int lane = 0; lane < LANES; ++lane) {
        const int x = lane & 3, y = lane >> 2;
        if (corner.x + x < width && corner.y + y < rows)
            lengths[(size_t)y * width + x] = (uint)many.each[lane];
    }
}
