// Runs: the supersegments of one ray while they are being made, and how two neighbours become one.
//
// Colour is premultiplied by the run's own opacity and merged front to back, so that the view from V_O stays exact
// (DESIGN section 3, "Merging samples into a supersegment").
//
// Merging is judged by how inhomogeneous the merged run would be (the criterion of Frey et al. 2013, which the paper
// follows): by Ward's increase of the sum of squares, along the ray in reference lengths, of the feature
// (opacity-weighted colour, opacity) of one reference length of the medium. Opacity is part of it, because black material of
// changing density is not homogeneous. That opacity is taken as tau / (tau + l), which saturates as 1 - exp(-tau / l)
// does and costs one division.
#include "lib/classification.cl"
#pragma OPENCL FP_CONTRACT OFF

// A run is a float8, which compilers keep in registers where they put a structure into memory. It holds components together,
// and what is computed is computed from one component at a time: compilers that put work-items into the lanes of a vector then
// have nothing to take apart and to put together again.
#define FRONT s0         // t of the ray
#define BACK s1
#define TAU s2           // optical depth
#define TRANSMITTANCE s3 // from the eye to the front face
#define COLOR s456       // premultiplied by the run's opacity
#define OPACITY s7       // 1 - exp(-tau), accumulated

// Opacity-weighted colour and opacity of one reference length of a run's medium.
inline float4 run_feature(float8 run, float per_reference)
{
    const float length = (run.BACK - run.FRONT) * per_reference;
    const float density = run.TAU / (run.TAU + length);
    const float per_color = density / run.OPACITY;
    return (float4)(run.s4 * per_color, run.s5 * per_color, run.s6 * per_color, density);
}

// One run from two neighbours; a gap between them is covered by the merged medium.
inline float8 merged_runs(float8 a, float8 b)
{
    float8 run = a;
    const float through = 1.0f - a.OPACITY;
    run.BACK = b.BACK;
    run.TAU = a.TAU + b.TAU;
    run.s4 = a.s4 + through * b.s4;
    run.s5 = a.s5 + through * b.s5;
    run.s6 = a.s6 + through * b.s6;
    run.OPACITY = a.OPACITY + through * b.OPACITY;
    return run;
}

#if defined(COMPENSATED) && COMPENSATED > 1
// The same, where very many samples become one run: `rest` carries what the sums have rounded off so far (Kahan), see
// lib/compositing.cl.
inline float8 merged_runs_with_rest(float8 a, float8 b, float8 *rest)
{
    const float through = 1.0f - a.OPACITY;
    const float8 term =
        (float8)(0.0f, 0.0f, b.TAU, 0.0f, through * b.COLOR, through * b.OPACITY) - *rest;
    float8 run = a + term;
    *rest = (run - a) - term;
    run.FRONT = a.FRONT;
    run.BACK = b.BACK;
    run.TRANSMITTANCE = a.TRANSMITTANCE;
    return run;
}
#endif

// How much an error in a run counts: by what of it the eye of V_O sees, but never less than `hidden_weight`.
inline float seen_weight(float8 run, float hidden_weight)
{
    return hidden_weight + (1.0f - hidden_weight) * run.TRANSMITTANCE;
}

// As dot() of the drivers at hand sums up, so that measure_errors and merge_error give the same on any.
inline float square_of(float4 v)
{
    return (v.x * v.x + v.y * v.y) + (v.z * v.z + v.w * v.w);
}

// Ward's increase of the sum of squares when neighbours a and b, and the empty gap between them, become one, weighted by
// how much of it the eye sees.
inline float merge_error(float8 a, float4 feature_a, float8 b, float4 feature_b, float per_reference, float hidden_weight)
{
    const float length_a = (a.BACK - a.FRONT) * per_reference;
    const float length_b = (b.BACK - b.FRONT) * per_reference;
    const float gap = (b.FRONT - a.BACK) * per_reference;
    const float both = length_a + length_b;
    const float4 difference = feature_a - feature_b;
    float error = length_a * length_b * square_of(difference) / both;
    if (gap > 0.0f) {
        const float4 mean = (length_a * feature_a + length_b * feature_b) / both;
        error += both * gap * square_of(mean) / (both + gap);
    }
    // Finite whatever the numbers, so that there always is a least error
    return fmin(error * seen_weight(a, hidden_weight), FLT_MAX);
}

// -- the record of a ray -------------------------------------------------------------------------------------------------
//
// A ray's runs lie one behind the other, and its errors likewise: what shortens them goes from run to run, and rays whose
// records grow at different places write to one line of the cache each. A run moves as four words of 8 bytes, because the
// number of loads and stores is what counts where a vector's lanes go to different places.
inline size_t record_start(uint item, int capacity, int words)
{
    return (size_t)item * (size_t)(capacity * words);
}

inline float8 load_run(__global const float *record, int k)
{
    __global const ulong *pairs = (__global const ulong *)(record + k * RUN_WORDS);
    return (float8)(as_float2(pairs[0]), as_float2(pairs[1]), as_float2(pairs[2]), as_float2(pairs[3]));
}

inline void store_run(__global float *record, int k, float8 run)
{
    __global ulong *pairs = (__global ulong *)(record + k * RUN_WORDS);
    pairs[0] = as_ulong(run.s01);
    pairs[1] = as_ulong(run.s23);
    pairs[2] = as_ulong(run.s45);
    pairs[3] = as_ulong(run.s67);
}

// A ray's errors are looked through ERRORS_AT_A_TIME at a time, and end with INFINITY.

inline size_t errors_start(uint item, int capacity)
{
    return (size_t)item * (size_t)((capacity + ERRORS_AT_A_TIME - 1) / ERRORS_AT_A_TIME * ERRORS_AT_A_TIME);
}

// errors[k]: what merging runs k and k + 1 costs, merge_error of eight pairs at a time.
inline void measure_errors(__global const float *record, __global float *errors, int count, float per_reference, float hidden_weight)
{
    const int last = count - 1;
    float8 h = load_run(record, 0);
    for (int k = 0; k < count; k += ERRORS_AT_A_TIME) {
        const float8 a = h;
        const float8 b = load_run(record, min(k + 1, last));
        const float8 c = load_run(record, min(k + 2, last));
        const float8 d = load_run(record, min(k + 3, last));
        const float8 e = load_run(record, min(k + 4, last));
        const float8 f = load_run(record, min(k + 5, last));
        const float8 g = load_run(record, min(k + 6, last));
        const float8 i = load_run(record, min(k + 7, last));
        h = load_run(record, min(k + 8, last));
#define OF_RUNS(word) (float8)(a.word, b.word, c.word, d.word, e.word, f.word, g.word, i.word)
#define OF_NEXT(of_runs, next) (float8)(of_runs.s1234, of_runs.s567, next)
        const float8 fronts = OF_RUNS(s0), backs = OF_RUNS(s1), taus = OF_RUNS(s2);
        const float8 lengths = (backs - fronts) * per_reference;
        const float8 densities = taus / (taus + lengths);
        const float8 per_color = densities / OF_RUNS(s7);
        const float8 reds = OF_RUNS(s4) * per_color, greens = OF_RUNS(s5) * per_color, blues = OF_RUNS(s6) * per_color;
        const float4 feature = run_feature(h, per_reference);
        const float8 next_lengths = OF_NEXT(lengths, (h.BACK - h.FRONT) * per_reference);
        const float8 next_reds = OF_NEXT(reds, feature.x), next_greens = OF_NEXT(greens, feature.y);
        const float8 next_blues = OF_NEXT(blues, feature.z), next_densities = OF_NEXT(densities, feature.w);
        const float8 gaps = (OF_NEXT(fronts, h.FRONT) - backs) * per_reference;
        const float8 both = lengths + next_lengths;
        const float8 red = reds - next_reds, green = greens - next_greens, blue = blues - next_blues;
        const float8 density = densities - next_densities;
        const float8 squares = (red * red + green * green) + (blue * blue + density * density);
        const float8 close = lengths * next_lengths * squares / both;
        const float8 red_mean = (lengths * reds + next_lengths * next_reds) / both;
        const float8 green_mean = (lengths * greens + next_lengths * next_greens) / both;
        const float8 blue_mean = (lengths * blues + next_lengths * next_blues) / both;
        const float8 density_mean = (lengths * densities + next_lengths * next_densities) / both;
        const float8 mean_squares = (red_mean * red_mean + green_mean * green_mean) +
                                    (blue_mean * blue_mean + density_mean * density_mean);
        const float8 error = select(close, close + both * gaps * mean_squares / (both + gaps), gaps > 0.0f);
        const float8 seen = hidden_weight + (1.0f - hidden_weight) * OF_RUNS(s3);
        const int8 pair = k + (int8)(0, 1, 2, 3, 4, 5, 6, 7);
        vstore8(select((float8)(INFINITY), fmin(error * seen, FLT_MAX), pair < last), 0, errors + k);
#undef OF_RUNS
#undef OF_NEXT
    }
}

inline int count_within(__global const float *errors, int count, float threshold)
{
    int8 n = (int8)(0);
    for (int k = 0; k < count; k += ERRORS_AT_A_TIME)
        n += vload8(0, errors + k) <= threshold; // -1 where it is so
    const int4 sums = n.lo + n.hi;
    return -(sums.x + sums.y + sums.z + sums.w);
}

// The pair of the least error; of equals the first.
inline int least_of(__global const float *errors, int count)
{
    float8 least = (float8)(INFINITY);
    int8 at = (int8)(INT_MAX);
    for (int k = 0; k < count; k += ERRORS_AT_A_TIME) {
        const float8 error = vload8(0, errors + k);
        const int8 less = error < least;
        least = select(least, error, less);
        at = select(at, k + (int8)(0, 1, 2, 3, 4, 5, 6, 7), less);
    }
    const float4 least4 = fmin(least.lo, least.hi);
    const float2 least2 = fmin(least4.lo, least4.hi);
    const int8 first = select((int8)(INT_MAX), at, least == fmin(least2.x, least2.y));
    const int4 first4 = min(first.lo, first.hi);
    const int2 first2 = min(first4.lo, first4.hi);
    return min(first2.x, first2.y);
}

// Merge neighbours whose error is within `threshold`, in one pass from front to back. Returns how many runs are left.
// `errors`: those of the record as it is, or null.
inline int merge_within(__global float *record, __global const float *errors, int count, float threshold,
                        float per_reference, float hidden_weight)
{
    int kept = 0;
    float8 run = load_run(record, 0);
    float4 feature = (float4)(0.0f);
    bool as_recorded = errors != 0; // the run: its error is known
    if (errors == 0)
        feature = run_feature(run, per_reference);
    for (int k = 1; k < count; ++k) {
        const float8 next = load_run(record, k);
        float4 next_feature = (float4)(0.0f);
        float error;
        if (as_recorded) {
            error = errors[k - 1];
        } else {
            next_feature = run_feature(next, per_reference);
            error = merge_error(run, feature, next, next_feature, per_reference, hidden_weight);
        }
        if (!(error > threshold)) {
            run = merged_runs(run, next);
            feature = run_feature(run, per_reference);
            as_recorded = false;
        } else {
            store_run(record, kept++, run);
            run = next;
            feature = next_feature;
            as_recorded = errors != 0;
        }
    }
    store_run(record, kept++, run);
    return kept;
}

// Raise *threshold and merge within it until at most `limit` runs are left.
inline int make_room(__global float *record, __global float *errors, int count, int limit, float *threshold,
                     float per_reference, float hidden_weight)
{
    while (count > limit) {
        measure_errors(record, errors, count, per_reference, hidden_weight);
        while (count_within(errors, count, *threshold) < count - limit)
            *threshold *= 4.0f;
        count = merge_within(record, errors, count, *threshold, per_reference, hidden_weight);
    }
    return count;
}

// Merge, least error first, until at most `limit` runs are left.
inline int merge_to_limit(__global float *record, __global float *errors, int count, int limit, float per_reference, float hidden_weight)
{
    if (count <= limit)
        return count;
    measure_errors(record, errors, count, per_reference, hidden_weight);
    int alive = count;
    while (alive > limit) {
        const int least = least_of(errors, count);
        // Merged-away runs keep a negative optical depth and an infinite error
        int next = least + 1;
        while (record[next * RUN_WORDS + 2] < 0.0f)
            ++next;
        const float8 a = load_run(record, least);
        const float8 b = load_run(record, next);
        const float8 run = merged_runs(a, b);
        const float4 feature = run_feature(run, per_reference);
        store_run(record, least, run);
        record[next * RUN_WORDS + 2] = -1.0f;
        const bool last = errors[next] == INFINITY;
        errors[next] = INFINITY;
        errors[least] = INFINITY;
        --alive;
        if (!last) {
            int behind = next + 1;
            while (record[behind * RUN_WORDS + 2] < 0.0f)
                ++behind;
            const float8 other = load_run(record, behind);
            errors[least] =
                merge_error(run, feature, other, run_feature(other, per_reference), per_reference, hidden_weight);
        }
        int before = least - 1;
        while (before >= 0 && record[before * RUN_WORDS + 2] < 0.0f)
            --before;
        if (before >= 0) {
            const float8 other = load_run(record, before);
            errors[before] =
                merge_error(other, run_feature(other, per_reference), run, feature, per_reference, hidden_weight);
        }
    }
    // Close the gaps
    int kept = 0;
    for (int k = 0; k < count; ++k) {
        const float8 run = load_run(record, k);
        if (run.TAU >= 0.0f)
            store_run(record, kept++, run);
    }
    return kept;
}
