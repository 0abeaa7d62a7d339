// Volume to records of runs, one march per ray (paper, section 2; docs/dev/conventions.md, "Merging
// samples into a supersegment"), a ray or a block of 4 x 4 in a work-item (lib/lanes.cl).
//
// -D COMPENSATED: see lib/compositing.cl; the volume's: see volume/march.cl
//
// A VDI is made in four steps. A ray's march is cut into chunks of equally many steps. march_lists
// samples the steps of one chunk, and merges what is homogeneous with the run before.
// generation/shorten_lists.cl then fits records that have grown too long, and raises the ray's
// threshold; after the last chunk it fits each record to the budget. generation/offsets.cl sums up
// the lists' lengths, and generation/pack_lists.cl packs the arrays.
//
// Lengths along a ray are t, the view depth of V_O less the VDI's depth origin, world units; with
// DOUBLE_FLOAT_RAYS, less that of where the ray enters, until they are packed.
#include "volume/march.cl"
#include "generation/merging.cl"
#pragma OPENCL FP_CONTRACT OFF

#define NO_RUN RUN(0.0f, -INFINITY, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f)

// Records are in the order of the rays, counts and offsets in the order of the lists.
KERNEL_OF_LANES void march_lists(
    MEDIUM_PARAMETERS, const RaysOfView view, __global const float *forms,
    __global const float4 *samples, // see volume/rays_of_view.cl; 0: steps are sampled here
    const Recording recording,
    __global const float
        *entering, // light that enters the part of the grid along each ray, 0 to 1; 0: all of it
    __global const float *thresholds, // merge errors up to this are accepted, one per ray
    __global float *records,
    __global uint *counts) // runs in each record, by list
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_view(&view, first);
    if (!ANY(rays.present))
        return;
    March march;
    if (!ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b, INFINITY)))
        return;
    const Int begin = march.begin + view.first_step;
    const Int begun = rays.present & (march.steps > begin);
    if (!ANY(begun))
        return;
    const Int end = SELECT(begin, min(begin + view.steps, march.steps), begun);
    const Medium medium = MEDIUM_OF_PARAMETERS;
    const Real per_reference = march.units * view.unit_distance / recording.reference_length;
    const Real threshold = LOAD_LANES(0, thresholds + first);
    samples = LANES == 1 && samples ? samples + samples_start(first, view.steps) : 0;
    records += record_start(first, recording.capacity);
    const Int lists = rays.y * view.columns + rays.x;
    const Int starts = LANE_NUMBERS * recording.capacity;

    // Go on with the records' last runs
    Int count = load_counts(counts, lists, rays.present);
    const Int some = count > 0;
    Growing growing = {NO_RUN, RUN(0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f),
                       REAL4((Real)(0.0f), (Real)(0.0f), (Real)(0.0f), (Real)(0.0f)), 0.0f};
    if (ANY(some)) {
        const Run last = load_run(records, SELECT((Int)(0), starts + count - 1, some));
        growing.run = selected_run(growing.run, last, some);
        growing.feature = run_feature(growing.run, per_reference);
        const Real length = (growing.run.BACK - growing.run.FRONT) * per_reference;
        growing.length = SELECT((Real)(0.0f), length, some);
    }
    Real transmittance = 1.0f;
    if (entering) {
        const Places places = {
            SELECT((Int)(0), (view.first_row - recording.window_row) * view.columns + lists,
                   rays.present)};
#define ENTERING(n) entering[places.each[n]]
        transmittance = OF_LANES(Real, ENTERING);
#undef ENTERING
    }
    const Real behind_last =
        growing.run.TRANSMITTANCE - growing.run.TRANSMITTANCE * growing.run.OPACITY;
    transmittance = SELECT(transmittance, behind_last, some);

    // A ray that cannot keep every detail asks about homogeneity once in a voxel only: the steps of
    // a group are composited without asking
    const Int group = SELECT((Int)(1), (Int)(recording.grain), threshold > recording.finest);
    Int k = begin;
    Int left = group; // steps of this group
    Run sample = RUN(step_face(&march, k), 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f);
    // Every turn does the same for every ray, and what depends on the ray is selected: the lanes of
    // a vector need no masks
    for (;;) {
        const Int active = k < end;
        if (!ANY(active))
            break;
        // Sample the step's midpoint, classify and shade it; or see how far nothing is visible
        const Real front = step_face(&march, k), back = step_face(&march, k + 1);
        const Int empty =
            empty_steps(&march, &medium, active & (left == group), k, end, group, front, back);
        Real4 step = REAL4((Real)(0.0f), (Real)(0.0f), (Real)(0.0f), (Real)(0.0f));
        if (LANES > 1 || ANY(active & (empty == 0)))
            step = LANES == 1 && samples ? load_fours(samples, (k - view.first_step) * SAMPLE_LANES)
                                         : step_medium(&march, &medium, front, back);
        // Composite it with the others of its group
        const Real tau = SELECT(step.w, (Real)(0.0f), empty > 0);
        const Real weight = (1.0f - sample.OPACITY) * opacity_of(tau);
        sample.BACK = back;
        sample.TAU += tau;
        sample.RED += weight * step.x;
        sample.GREEN += weight * step.y;
        sample.BLUE += weight * step.z;
        sample.OPACITY += weight;
        k += max(empty, 1);
        --left;
        const Int whole = (left == 0) | (empty > 0) | (k >= end);
        const Int visible = active & whole & (sample.OPACITY > 0.0f) & (sample.BACK > sample.FRONT);
        if (ANY(visible)) {
            // Merge the group with the run before, or begin another
            sample.TRANSMITTANCE = transmittance;
            const Real4 feature = run_feature(sample, per_reference);
            const Real length = (sample.BACK - sample.FRONT) * per_reference;
            const Run before = growing.run;
            const Int grows = grow(&growing, sample, feature, length, threshold,
                                   recording.hidden_weight, visible);
            const Int begins = visible & !grows;
            // Where a run is not at its end it is stored for nothing
            if (ANY(begins & (count > 0)))
                store_run(records, SELECT((Int)(-1), starts + count - 1, count > 0), before);
            count += COUNT(begins);
            growing.run = selected_run(growing.run, sample, begins);
            growing.lost = selected_run(growing.lost, NO_RUN, begins);
            growing.feature = selected_feature(growing.feature, feature, begins);
            growing.length = SELECT(growing.length, length, begins);
            transmittance =
                SELECT(transmittance, transmittance - transmittance * sample.OPACITY, visible);
        }
        left = SELECT(left, group, whole);
        sample = selected_run(
            sample, RUN(step_face(&march, k), 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f), whole);
    }
    if (ANY(count > 0))
        store_run(records, SELECT((Int)(-1), starts + count - 1, count > 0), growing.run);
    store_counts(counts, lists, rays.present, count);
}
