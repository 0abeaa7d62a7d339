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
#include "common/classification.cl"
#pragma OPENCL FP_CONTRACT OFF

// A run is a float8, which compilers keep in registers where they put a structure into memory.
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
    return (float4)(run.COLOR * (density / run.OPACITY), density);
}

// One run from two neighbours; a gap between them is covered by the merged medium.
inline float8 merged_runs(float8 a, float8 b)
{
    float8 run = a;
    const float through = 1.0f - a.OPACITY;
    run.BACK = b.BACK;
    run.TAU = a.TAU + b.TAU;
    run.COLOR = a.COLOR + through * b.COLOR;
    run.OPACITY = a.OPACITY + through * b.OPACITY;
    return run;
}

#if defined(COMPENSATED) && COMPENSATED > 1
// The same, where very many samples become one run: `rest` carries what the sums have rounded off so far (Kahan), see
// common/over.cl.
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

// Ward's increase of the sum of squares when neighbours a and b, and the empty gap between them, become one, weighted by
// how much of it the eye sees.
inline float merge_error(float8 a, float4 feature_a, float8 b, float4 feature_b, float per_reference, float hidden_weight)
{
    const float length_a = (a.BACK - a.FRONT) * per_reference;
    const float length_b = (b.BACK - b.FRONT) * per_reference;
    const float gap = (b.FRONT - a.BACK) * per_reference;
    const float both = length_a + length_b;
    const float4 difference = feature_a - feature_b;
    float error = length_a * length_b * dot(difference, difference) / both;
    if (gap > 0.0f) {
        const float4 mean = (length_a * feature_a + length_b * feature_b) / both;
        error += both * gap * dot(mean, mean) / (both + gap);
    }
    // Finite whatever the numbers, so that there always is a least error
    return fmin(error * seen_weight(a, hidden_weight), FLT_MAX);
}

// -- the record of a ray -------------------------------------------------------------------------------------------------
//
// Rays are stored in blocks of 16, component by component, so that neighbouring work-items touch neighbouring words:
// word ((block * capacity + k) * RUN_WORDS + component) * 16 + lane holds one component of run k.
#define LANES 16
#define RUN_WORDS 8

inline size_t record_start(uint item, int capacity, int words)
{
    return (size_t)(item / LANES) * (size_t)capacity * (size_t)(words * LANES) + item % LANES;
}

inline float8 load_run(__global const float *record, int k)
{
    __global const float *word = record + k * (RUN_WORDS * LANES);
    return (float8)(word[0], word[LANES], word[2 * LANES], word[3 * LANES], word[4 * LANES], word[5 * LANES],
                    word[6 * LANES], word[7 * LANES]);
}

inline void store_run(__global float *record, int k, float8 run)
{
    __global float *word = record + k * (RUN_WORDS * LANES);
    word[0] = run.s0;
    word[LANES] = run.s1;
    word[2 * LANES] = run.s2;
    word[3 * LANES] = run.s3;
    word[4 * LANES] = run.s4;
    word[5 * LANES] = run.s5;
    word[6 * LANES] = run.s6;
    word[7 * LANES] = run.s7;
}

// errors[k]: what merging runs k and k + 1 costs.
inline void measure_errors(__global const float *record, __global float *errors, int count, float per_reference, float hidden_weight)
{
    float8 run = load_run(record, 0);
    float4 feature = run_feature(run, per_reference);
    for (int k = 1; k < count; ++k) {
        const float8 next = load_run(record, k);
        const float4 next_feature = run_feature(next, per_reference);
        errors[(k - 1) * LANES] = merge_error(run, feature, next, next_feature, per_reference, hidden_weight);
        run = next;
        feature = next_feature;
    }
}

inline int count_within(__global const float *errors, int count, float threshold)
{
    int n = 0;
    for (int k = 0; k < count; ++k)
        n += errors[k * LANES] > threshold ? 0 : 1;
    return n;
}

// Merge neighbours whose error is within `threshold`, in one pass from front to back. Returns how many runs are left.
inline int merge_within(__global float *record, int count, float threshold, float per_reference, float hidden_weight)
{
    int kept = 0;
    float8 run = load_run(record, 0);
    float4 feature = run_feature(run, per_reference);
    for (int k = 1; k < count; ++k) {
        const float8 next = load_run(record, k);
        const float4 next_feature = run_feature(next, per_reference);
        if (!(merge_error(run, feature, next, next_feature, per_reference, hidden_weight) > threshold)) {
            run = merged_runs(run, next);
            feature = run_feature(run, per_reference);
        } else {
            store_run(record, kept++, run);
            run = next;
            feature = next_feature;
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
        while (count_within(errors, count - 1, *threshold) < count - limit)
            *threshold *= 4.0f;
        count = merge_within(record, count, *threshold, per_reference, hidden_weight);
    }
    return count;
}

// Merge, least error first, until at most `limit` runs are left.
inline int merge_to_limit(__global float *record, __global float *errors, int count, int limit, float per_reference, float hidden_weight)
{
    if (count <= limit)
        return count;
    measure_errors(record, errors, count, per_reference, hidden_weight);
    errors[(count - 1) * LANES] = INFINITY; // the last run has no neighbour behind it
    int alive = count;
    while (alive > limit) {
        int least = 0;
        float least_error = INFINITY;
        for (int k = 0; k < count; ++k) {
            const float error = errors[k * LANES];
            if (error < least_error) {
                least_error = error;
                least = k;
            }
        }
        // Merged-away runs keep a negative optical depth and an infinite error
        int next = least + 1;
        while (record[(next * RUN_WORDS + 2) * LANES] < 0.0f)
            ++next;
        const float8 a = load_run(record, least);
        const float8 b = load_run(record, next);
        const float8 run = merged_runs(a, b);
        const float4 feature = run_feature(run, per_reference);
        store_run(record, least, run);
        record[(next * RUN_WORDS + 2) * LANES] = -1.0f;
        const bool last = errors[next * LANES] == INFINITY;
        errors[next * LANES] = INFINITY;
        errors[least * LANES] = INFINITY;
        --alive;
        if (!last) {
            int behind = next + 1;
            while (record[(behind * RUN_WORDS + 2) * LANES] < 0.0f)
                ++behind;
            const float8 other = load_run(record, behind);
            errors[least * LANES] =
                merge_error(run, feature, other, run_feature(other, per_reference), per_reference, hidden_weight);
        }
        int before = least - 1;
        while (before >= 0 && record[(before * RUN_WORDS + 2) * LANES] < 0.0f)
            --before;
        if (before >= 0) {
            const float8 other = load_run(record, before);
            errors[before * LANES] =
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
