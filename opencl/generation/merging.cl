// The criterion by which neighbouring runs are merged, and how two become one. For another
// criterion than the least error, this file changes.
//
// Colour is premultiplied by the run's own opacity and merged front to back, so that the view from
// V_O stays exact (docs/dev/conventions.md, "Merging samples into a supersegment").
//
// Merging is judged by the merge error, which is this package's own (docs/decisions/merging.md):
// Ward's increase of the sum of squares, along the ray in reference lengths, of the feature
// (opacity-weighted colour, opacity) of one reference length of the medium. The paper's criterion,
// homogeneity (Frey et al. 2013), compares the same features: generation/homogeneity.cl. Opacity is
// part of them, because black material of changing density is not homogeneous. That opacity is
// taken as tau / (tau + l), which saturates as 1 - exp(-tau / l) does and costs one division.
#include "generation/records.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

// Opacity-weighted colour and opacity (w) of one reference length of a run's medium.
inline Real4 run_feature(Run run, Real per_reference)
{
    const Real length = (run.BACK - run.FRONT) * per_reference;
    const Real density = run.TAU / (run.TAU + length);
    const Real per_color = density / run.OPACITY;
    return REAL4(run.RED * per_color, run.GREEN * per_color, run.BLUE * per_color, density);
}

// One run from a run and what is behind it, which is taken in; a gap between them is covered by the
// merged medium. `lost`: what the sums have rounded off so far, if COMPENSATED
// (lib/compositing.cl).
inline Run grown_run(Run run, Run behind, Run *lost)
{
    const Real through = 1.0f - run.OPACITY;
    run.BACK = behind.BACK;
#define ADD(component, summand)                                                                    \
    {                                                                                              \
        const Sum sum = sum_of(run.component, lost->component, summand);                           \
        run.component = sum.value;                                                                 \
        lost->component = sum.rounded_up;                                                          \
    }
    ADD(TAU, behind.TAU)
    ADD(RED, through * behind.RED)
    ADD(GREEN, through * behind.GREEN)
    ADD(BLUE, through * behind.BLUE)
    ADD(OPACITY, through * behind.OPACITY)
#undef ADD
    return run;
}

inline Run merged_runs(Run a, Run b)
{
    Run lost = RUN(0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f);
    return grown_run(a, b, &lost);
}

// How much an error in a run counts: by what of it the eye of V_O sees, but never less than
// `hidden_weight`.
inline Real seen_weight(Run run, float hidden_weight)
{
    return hidden_weight + (1.0f - hidden_weight) * run.TRANSMITTANCE;
}

inline Real4 difference_of(Real4 a, Real4 b)
{
    return REAL4(a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w);
}

// As dot() of the drivers at hand sums up.
inline Real square_of(Real4 v) { return (v.x * v.x + v.y * v.y) + (v.z * v.z + v.w * v.w); }

// Ward's increase of the sum of squares when neighbours a and b, and the empty gap between them,
// become one, weighted by how much of it the eye sees. Where they are not `chosen`, anything.
inline Real merge_error(Int chosen, Run a, Real4 feature_a, Run b, Real4 feature_b,
                        Real per_reference, float hidden_weight)
{
    const Real length_a = (a.BACK - a.FRONT) * per_reference;
    const Real length_b = (b.BACK - b.FRONT) * per_reference;
    const Real gap = (b.FRONT - a.BACK) * per_reference;
    const Real both = length_a + length_b;
    Real error = length_a * length_b * square_of(difference_of(feature_a, feature_b)) / both;
    const Int apart = chosen & (gap > 0.0f);
    if (ANY(apart)) {
#define MEAN_OF(component)                                                                         \
    ((length_a * feature_a.component + length_b * feature_b.component) / both)
        const Real4 mean = REAL4(MEAN_OF(x), MEAN_OF(y), MEAN_OF(z), MEAN_OF(w));
#undef MEAN_OF
        error = SELECT(error, error + both * gap * square_of(mean) / (both + gap), apart);
    }
    // Finite whatever the numbers, so that there always is a least error
    error *= seen_weight(a, hidden_weight);
    return SELECT((Real)(FLT_MAX), error, error < FLT_MAX);
}

// A record's last run, which may still grow while a ray is marched. Its feature, the mean of its
// samples', is kept, which is cheaper than computing it of its medium.
typedef struct {
    Run run;
    Run lost; // what its sums have rounded off
    Real4 feature;
    Real length; // reference lengths
} Growing;

// Take a sample into the growing runs of the rays that are `visible`, where it touches and the
// merge error, of runs that touch, is within the threshold. Returns which have taken it.
inline Int grow(Growing *growing, Run sample, Real4 feature, Real length, Real threshold,
                float hidden_weight, Int visible)
{
    const Real share = length / (growing->length + length);
    const Real4 difference = difference_of(feature, growing->feature);
    const Real error =
        growing->length * share * square_of(difference) * seen_weight(growing->run, hidden_weight);
    // A gap ends a run
    const Int grows = visible & (growing->run.BACK == sample.FRONT) & (error <= threshold);
    Run lost = growing->lost;
    const Run grown = grown_run(growing->run, sample, &lost);
#define GROW(component, larger) growing->component = SELECT(growing->component, larger, grows)
#define GROW_SUM(component)                                                                        \
    GROW(run.component, grown.component);                                                          \
    GROW(lost.component, lost.component)
    GROW(run.BACK, sample.BACK);
    GROW_SUM(TAU);
    GROW_SUM(RED);
    GROW_SUM(GREEN);
    GROW_SUM(BLUE);
    GROW_SUM(OPACITY);
    GROW(feature.x, growing->feature.x + share * difference.x);
    GROW(feature.y, growing->feature.y + share * difference.y);
    GROW(feature.z, growing->feature.z + share * difference.z);
    GROW(feature.w, growing->feature.w + share * difference.w);
    GROW(length, growing->length + length);
#undef GROW_SUM
#undef GROW
    return grows;
}

inline Real4 selected_feature(Real4 otherwise, Real4 then, Int condition)
{
    return REAL4(SELECT(otherwise.x, then.x, condition), SELECT(otherwise.y, then.y, condition),
                 SELECT(otherwise.z, then.z, condition), SELECT(otherwise.w, then.w, condition));
}

inline Run selected_run(Run otherwise, Run then, Int condition)
{
    const Run run = {selected_feature(otherwise.ends, then.ends, condition),
                     selected_feature(otherwise.light, then.light, condition)};
    return run;
}
