// Runs: the supersegments of one ray while they are being made, and how two neighbours become one.
//
// Colour is premultiplied by the run's own opacity and merged front to back, so that the view from V_O stays exact
// (docs/conventions.md, "Merging samples into a supersegment").
//
// Merging is judged by how inhomogeneous the merged run would be (the criterion of Frey et al. 2013, which the paper
// follows): by Ward's increase of the sum of squares, along the ray in reference lengths, of the feature
// (opacity-weighted colour, opacity) of one reference length of the medium. Opacity is part of it, because black material of
// changing density is not homogeneous. That opacity is taken as tau / (tau + l), which saturates as 1 - exp(-tau / l)
// does and costs one division.
#include "lib/lanes.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

#if LANES == 1
// Which compilers keep in registers where they put a structure into memory. It holds components together, and what is computed
// is computed from one component at a time: compilers that put work-items into the lanes of a vector then have nothing to take
// apart and to put together again.
typedef float8 Run;
#define FRONT s0         // t of the ray
#define BACK s1
#define TAU s2           // optical depth
#define TRANSMITTANCE s3 // from the eye to the front face
#define RED s4           // premultiplied by the run's opacity
#define GREEN s5
#define BLUE s6
#define COLOR s456
#define OPACITY s7       // 1 - exp(-tau), accumulated
#define RUN(front, back, tau, before, red, green, blue, opacity) (float8)(front, back, tau, before, red, green, blue, opacity)
#else
typedef struct {
    Real FRONT, BACK, TAU, TRANSMITTANCE, RED, GREEN, BLUE, OPACITY;
} Run;
#define RUN(front, back, tau, before, red, green, blue, opacity) ((Run){front, back, tau, before, red, green, blue, opacity})
#endif

// Opacity-weighted colour and opacity (w) of one reference length of a run's medium.
inline Real4 run_feature(Run run, Real per_reference)
{
    const Real length = (run.BACK - run.FRONT) * per_reference;
    const Real density = run.TAU / (run.TAU + length);
    const Real per_color = density / run.OPACITY;
    return REAL4(run.RED * per_color, run.GREEN * per_color, run.BLUE * per_color, density);
}

// One run from two neighbours; a gap between them is covered by the merged medium.
inline Run merged_runs(Run a, Run b)
{
    Run run = a;
    const Real through = 1.0f - a.OPACITY;
    run.BACK = b.BACK;
    run.TAU = a.TAU + b.TAU;
    run.RED = a.RED + through * b.RED;
    run.GREEN = a.GREEN + through * b.GREEN;
    run.BLUE = a.BLUE + through * b.BLUE;
    run.OPACITY = a.OPACITY + through * b.OPACITY;
    return run;
}

#if defined(COMPENSATED) && COMPENSATED > 1
// The same, where very many samples become one run: `compensation` is what the sums have rounded off so far (Kahan), see
// lib/compositing.cl.
inline Run merged_runs_compensated(Run a, Run b, Run *compensation)
{
    const float through = 1.0f - a.OPACITY;
    const Run term = (Run)(0.0f, 0.0f, b.TAU, 0.0f, through * b.COLOR, through * b.OPACITY) - *compensation;
    Run run = a + term;
    *compensation = (run - a) - term;
    run.FRONT = a.FRONT;
    run.BACK = b.BACK;
    run.TRANSMITTANCE = a.TRANSMITTANCE;
    return run;
}
#endif

// How much an error in a run counts: by what of it the eye of V_O sees, but never less than `hidden_weight`.
inline Real seen_weight(Run run, float hidden_weight)
{
    return hidden_weight + (1.0f - hidden_weight) * run.TRANSMITTANCE;
}

inline Real4 difference_of(Real4 a, Real4 b)
{
    return REAL4(a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w);
}

// As dot() of the drivers at hand sums up.
inline Real square_of(Real4 v)
{
    return (v.x * v.x + v.y * v.y) + (v.z * v.z + v.w * v.w);
}

// Ward's increase of the sum of squares when neighbours a and b, and the empty gap between them, become one, weighted by
// how much of it the eye sees. Where they are not `chosen`, anything.
inline Real merge_error(Int chosen, Run a, Real4 feature_a, Run b, Real4 feature_b, Real per_reference, float hidden_weight)
{
    const Real length_a = (a.BACK - a.FRONT) * per_reference;
    const Real length_b = (b.BACK - b.FRONT) * per_reference;
    const Real gap = (b.FRONT - a.BACK) * per_reference;
    const Real both = length_a + length_b;
    Real error = length_a * length_b * square_of(difference_of(feature_a, feature_b)) / both;
    const Int apart = chosen & (gap > 0.0f);
    if (ANY(apart)) {
#define MEAN_OF(component) ((length_a * feature_a.component + length_b * feature_b.component) / both)
        const Real4 mean = REAL4(MEAN_OF(x), MEAN_OF(y), MEAN_OF(z), MEAN_OF(w));
#undef MEAN_OF
        error = SELECT(error, error + both * gap * square_of(mean) / (both + gap), apart);
    }
    // Finite whatever the numbers, so that there always is a least error
    error *= seen_weight(a, hidden_weight);
    return SELECT((Real)(FLT_MAX), error, error < FLT_MAX);
}

// -- the records of rays ---------------------------------------------------------------------------------------------------
//
// A ray's runs lie one behind the other, `capacity` of them: what shortens them goes from run to run, and rays whose records
// grow at different places write to one line of the cache each. A work-item's runs are numbered from its first ray's record on.
inline size_t record_start(uint ray, int capacity)
{
    return (size_t)ray * (size_t)(capacity * RUN_WORDS);
}

#if LANES == 1
// A run moves as four words of 8 bytes, because the number of loads and stores is what counts where a vector's lanes go to
// different places.
inline Run load_run(__global const float *records, int k)
{
    __global const ulong *words = (__global const ulong *)(records + k * RUN_WORDS);
    return (Run)(as_float2(words[0]), as_float2(words[1]), as_float2(words[2]), as_float2(words[3]));
}

inline void store_run(__global float *records, int k, Run run)
{
    __global ulong *words = (__global ulong *)(records + k * RUN_WORDS);
    words[0] = as_ulong(run.s01);
    words[1] = as_ulong(run.s23);
    words[2] = as_ulong(run.s45);
    words[3] = as_ulong(run.s67);
}

inline Run load_run_at(__global const float *records, Place *at)
{
    return load_run(records + at[0], 0);
}

inline void store_run_at(__global float *records, Place *at, Run run)
{
    store_run(records + at[0], 0, run);
}
#else
// In one load each, which a compiler may not take apart to put the words where they go one by one.
inline Run load_run_at(__global const float *records, Place *at)
{
#define ROW(n) (*(__global const volatile float8 *)(records + at[n]))
#define ROWS(n) (Real)(ROW(n), ROW((n) + 4))
    const Real4 low = transpose(REAL4(ROWS(0), ROWS(1), ROWS(2), ROWS(3)));
    const Real4 high = transpose(REAL4(ROWS(8), ROWS(9), ROWS(10), ROWS(11)));
#undef ROW
#undef ROWS
#define EVEN_QUARTERS(word) (Real)(low.word.s0123, low.word.s89ab, high.word.s0123, high.word.s89ab)
#define ODD_QUARTERS(word) (Real)(low.word.s4567, low.word.scdef, high.word.s4567, high.word.scdef)
    const Run run = {EVEN_QUARTERS(x), EVEN_QUARTERS(y), EVEN_QUARTERS(z), EVEN_QUARTERS(w),
                     ODD_QUARTERS(x), ODD_QUARTERS(y), ODD_QUARTERS(z), ODD_QUARTERS(w)};
#undef EVEN_QUARTERS
#undef ODD_QUARTERS
    return run;
}

// But of rays whose place is negative.
inline void store_run_at(__global float *records, Place *at, Run run)
{
#define STORE_ROW(n, row)                                                                                             \
    if (at[n] >= 0)                                                                                                   \
        vstore8((float8)(row.s0123, row.s89ab), 0, records + at[n]);                                                  \
    if (at[(n) + 4] >= 0)                                                                                             \
        vstore8((float8)(row.s4567, row.scdef), 0, records + at[(n) + 4]);
#define STORE_HALF(first, half)                                                                                       \
    {                                                                                                                 \
        const Real4 rows =                                                                                            \
            transpose(REAL4((Real)(run.FRONT.half, run.RED.half), (Real)(run.BACK.half, run.GREEN.half),             \
                             (Real)(run.TAU.half, run.BLUE.half), (Real)(run.TRANSMITTANCE.half, run.OPACITY.half))); \
        STORE_ROW(first, rows.x)                                                                                      \
        STORE_ROW(first + 1, rows.y)                                                                                  \
        STORE_ROW(first + 2, rows.z)                                                                                  \
        STORE_ROW(first + 3, rows.w)                                                                                  \
    }
    STORE_HALF(0, lo)
    STORE_HALF(8, hi)
#undef STORE_HALF
#undef STORE_ROW
}
#endif

// How many runs there are of each ray that is in the window, from `counts` by list; the others have none.
inline Int load_counts(__global const uint *counts, Int lists, Int in_window)
{
    const Places places = {lists}, wanted = {in_window};
    Places runs = {(Int)(0)};
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            runs.each[lane] = (int)counts[places.each[lane]];
    return runs.all;
}

inline void store_counts(__global uint *counts, Int lists, Int in_window, Int runs)
{
    const Places places = {lists}, wanted = {in_window}, many = {runs};
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            counts[places.each[lane]] = (uint)many.each[lane];
}
