// Criteria other than least error by which a record is brought to its budget (paper section 2, "Different criteria").
//
// -D CRITERION=EQUAL_LENGTH         cuts at equal depths from the first face to the last (Brady et al. 1997)
//              EQUAL_TRANSMITTANCE  cuts where the view from V_O has lost equal shares of its light (Lochmann et al. 2016)
//              EQUAL_OPTICAL_DEPTH  cuts at equal steps of optical depth: each supersegment lets the same share through
//              HOMOGENEITY          a supersegment goes on while the medium is like its mean so far; one threshold per ray,
//                                   the least that keeps the budget (Frey et al. 2013)
//
// Without it nothing is compiled. All work on the recorded runs: the volume is not marched again, and no run is dropped.
#include "lib/opacity.cl"
#include "generation/shorten_lists.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef CRITERION
#define EQUAL_LENGTH 1
#define EQUAL_TRANSMITTANCE 2
#define EQUAL_OPTICAL_DEPTH 3
#define HOMOGENEITY 4

#if CRITERION == HOMOGENEITY

// Bisections of the threshold: it is found to a thousandth, or to 2^-30 of the largest difference where that is tiny.
#define BISECTIONS 30
#define BISECTED 1e-3f

// Merge neighbours front to back while the next run's feature is within `threshold` of the mean so far. A gap is a medium
// of its own that is nothing: it is taken in where nothing is within the threshold, too. Returns how many runs are left;
// they are written only where `store`.
inline int merge_alike(__global float *record, int count, float threshold, float per_reference, bool store)
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

#else

// What is shared out equally, between the first face and a run's front (x) and back (y). `before`: the same at the back of
// the run before; `first`: where the record begins.
inline float2 measured(Run run, float before, float first)
{
#if CRITERION == EQUAL_LENGTH
    return (float2)(run.FRONT, run.BACK) - first;
#elif CRITERION == EQUAL_OPTICAL_DEPTH
    return (float2)(before, before + run.TAU);
#else
    return (float2)(before, before + run.TRANSMITTANCE * run.OPACITY);
#endif
}

// Where in a run, 0 to 1, so much of the measure has been passed since its front.
inline float place_in_run(Run run, float amount)
{
#if CRITERION == EQUAL_LENGTH
    return amount / (run.BACK - run.FRONT);
#elif CRITERION == EQUAL_OPTICAL_DEPTH
    return amount / run.TAU;
#else
    return -log1p(-amount / run.TRANSMITTANCE) / run.TAU;
#endif
}

// The part of a homogeneous medium from `front` to `back`, of optical depth `tau`, behind transmittance `transmittance`.
inline Run part_of_run(Run run, float front, float back, float tau, float transmittance)
{
    Run part;
    part.FRONT = front;
    part.BACK = back;
    part.TAU = tau;
    part.TRANSMITTANCE = transmittance;
    part.OPACITY = opacity_of(tau);
    part.COLOR = run.COLOR * (part.OPACITY / run.OPACITY);
    return part;
}

// Cut into at most `limit` supersegments of equal shares of the measure; they begin and end where their medium does. The
// record must have room for `limit` more runs.
inline int cut_to_limit(__global float *record, int count, int limit, float per_reference)
{
    const float first = record[0];
    float2 at = (float2)(0.0f);
    for (int k = 0; k < count; ++k)
        at = measured(load_run(record, k), at.y, first);
    const float share = at.y / (float)limit;
    at = (float2)(0.0f);
    int made = 0, cut = 1; // the cut that comes next, of limit - 1
    bool begun = false;
    Run run = (Run)(0.0f);
    for (int k = 0; k < count; ++k) {
        Run rest = load_run(record, k);
        at = measured(rest, at.y, first);
        for (bool left = true; left;) {
            bool ends = false;
            while (cut < limit && (float)cut * share <= at.x) {
                ends = true;
                ++cut;
            }
            if (ends && begun) {
                store_run(record, count + made++, run);
                begun = false;
            }
            Run part = rest;
            left = false;
            if (cut < limit && (float)cut * share < at.y) {
                // What is too thin to be cut is not
                const float place = place_in_run(rest, (float)cut * share - at.x);
                const float depth = rest.FRONT + place * (rest.BACK - rest.FRONT);
                const Run near = part_of_run(rest, rest.FRONT, depth, rest.TAU * place, rest.TRANSMITTANCE);
                const Run far = part_of_run(rest, depth, rest.BACK, rest.TAU - near.TAU,
                                               rest.TRANSMITTANCE - rest.TRANSMITTANCE * near.OPACITY);
                if (near.FRONT < near.BACK && far.FRONT < far.BACK && near.OPACITY > 0.0f && far.OPACITY > 0.0f) {
                    part = near;
                    rest = far;
                    at.x = (float)cut * share;
                    left = true;
                }
            }
            run = begun ? merged_runs(run, part) : part;
            begun = true;
        }
    }
    store_run(record, count + made++, run);
    for (int k = 0; k < made; ++k)
        store_run(record, k, load_run(record, count + k));
    return made;
}

#endif

// Bring records to at most `limit` runs by another criterion than least error, and merge neighbours as while marching: what
// is homogeneous needs no cut. Records have room for `limit` more runs.
__kernel void cut_lists(
    int limit,
    int width, int height,
    int first_column, int columns, int first_row, int rows,
    __global const float *forms,
    int capacity,
    float reference_length,
    float hidden_weight,
    float threshold,               // merge errors up to this are accepted
    __global float *records,
    __global uint *counts)
{
    const uint item = (uint)get_global_id(0);
    const Rays rays = rays_of_part(item, width, height, first_column, columns, first_row, rows);
    const Int list = rays.y * columns + rays.x;
    const int count = load_counts(counts, list, rays.present);
    if (count == 0)
        return;
    const float per_reference = march_speed(forms, rays.a, rays.b) / reference_length;
    __global float *record = records + record_start(item, capacity);
    const Places start = {0};
    const int cut = cut_to_limit(record, count, limit, per_reference);
    counts[list] = (uint)merge_within(record, &start, cut, threshold, 1, per_reference, hidden_weight);
}
#endif
