// Runs: the supersegments of one ray while they are being made, and how two neighbours become one.
//
// Colour is premultiplied by the run's own opacity and merged front to back, so that the view from
// V_O stays exact (docs/conventions.md, "Merging samples into a supersegment").
//
// Merging is judged by the merge error, which is this package's own (docs/decisions/merging.md):
// Ward's increase of the sum of squares, along the ray in reference lengths, of the feature
// (opacity-weighted colour, opacity) of one reference length of the medium. The paper's criterion,
// homogeneity (Frey et al. 2013), compares the same features: generation/homogeneity.cl. Opacity is
// part of them, because black material of changing density is not homogeneous. That opacity is
// taken as tau / (tau + l), which saturates as 1 - exp(-tau / l) does and costs one division.
//
// The formulas are those of one ray's run, and of sixteen rays' runs: Run and its components are
// generation/records.cl's or cpu16/generation_records.cl's.
#pragma OPENCL FP_CONTRACT OFF

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
// become one, weighted by how much of it the eye sees. Where they are not `chosen`, anything. While
// marching, of runs that touch, merged_with of generation/march_lists.cl and march_lists of
// cpu16/generation_march.cl have the same formula from the share of b.
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

// The numbers of records: RECORDING of pyvista_vdi/generation/kernels.py.
typedef struct {
    int capacity;   // runs that a record has room for
    int limit;      // that are to be left of one
    int grain;      // steps in a voxel
    int window_row; // the first row of rays of which it is known how much light enters a part of a
                    // grid
    float finest;   // threshold of rays whose record has never been full
    float reference_length; // model units
    float hidden_weight;    // weight of what the view from V_O cannot see, 0 to 1
} Recording;

// A ray's runs lie one behind the other, `capacity` of them: what shortens them goes from run to
// run, and rays whose records grow at different places write to one line of the cache each. A
// work-item's runs are numbered from its first ray's record on.
inline size_t record_start(uint ray, int capacity)
{
    return (size_t)ray * (size_t)(capacity * RUN_WORDS);
}

// Where the merge errors of a ray begin.
inline size_t errors_start(uint ray, int capacity)
{
    return (size_t)ray *
           (size_t)((capacity + ERRORS_AT_A_TIME - 1) / ERRORS_AT_A_TIME * ERRORS_AT_A_TIME);
}

// Runs that others have taken in have a negative optical depth. The first behind a run says where
// the next run is, the last before one where that is which has taken it in.
#define NEXT_WORD 1
#define BEFORE_WORD 0
#define TAU_WORD 2
