// Volume to records of runs along sixteen rays in vectors that are written out:
// generation/march_lists.cl, to the same bits.
//
// A compiler would scatter the words of runs one by one in each turn, and gather: here a run is
// stored as it lies, by one store. The march is one kernel and the fitting another because they
// want different vector code on a CPU.
#define LANES 16
#include "volume/march.cl"
#include "cpu16/generation_records.cl"
#pragma OPENCL FP_CONTRACT OFF

// Records of rays that meet nothing are not touched: a system makes memory of them page by page.
inline void store_last_run(__global float *records, Int starts, Int count, Run run)
{
    const Places places = {SELECT((Int)(-1), starts + (count - 1) * RUN_WORDS, count > 0)};
    store_run_at(records, places.each, run);
}

// Work-items are blocks of 4 x 4 rays.
KERNEL_OF_LANES void march_lists(const Classified classified, __global const VOXEL_T *voxels,
                                 __global const float4 *table, __global const uchar *distances,
                                 __global const uchar *blanked, __global const float *gradient,
                                 __global const float *lighting, __global const float *ambient,
                                 const RaysOfView view, __global const float *forms,
                                 const Recording recording, __global const float *entering,
                                 __global const float *thresholds, __global float *records,
                                 __global uint *counts)
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_view(&view, first);
    if (!ANY(rays.present))
        return;
    March march;
    if (!ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b, INFINITY)))
        return;
    const Medium medium = {classified, voxels,   table,    distances,
                           blanked,    gradient, lighting, ambient};
    const Int begin = march.begin + view.first_step;
    const Int begun = rays.present & (march.steps > begin);
    if (!ANY(begun))
        return;
    const Int end = SELECT(begin, min(begin + view.steps, march.steps), begun);
    const Real per_reference = march.units * view.unit_distance / recording.reference_length;
    const Real threshold = LOAD_LANES(0, thresholds + first);
    records += record_start(first, recording.capacity);
    const Int lists = rays.y * view.columns + rays.x;

    // The records' last runs may still grow. Their features, the means of their steps', are kept,
    // which is cheaper than computing them of their media
    Int count = load_counts(counts, lists, rays.present);
    const Int starts = LANE_NUMBERS * (recording.capacity * RUN_WORDS);
    const Int some = count > 0;
    Real run_front = 0.0f, run_back = -INFINITY, tau = 0.0f, before = 0.0f, red = 0.0f,
         green = 0.0f, blue = 0.0f, opacity = 0.0f;
    if (ANY(some)) {
        const Places places = {SELECT((Int)(0), starts + (count - 1) * RUN_WORDS, some)};
        const Run last = load_run_at(records, places.each);
        run_front = SELECT(run_front, last.FRONT, some);
        run_back = SELECT(run_back, last.BACK, some);
        tau = SELECT(tau, last.TAU, some);
        before = SELECT(before, last.TRANSMITTANCE, some);
        red = SELECT(red, last.RED, some);
        green = SELECT(green, last.GREEN, some);
        blue = SELECT(blue, last.BLUE, some);
        opacity = SELECT(opacity, last.OPACITY, some);
    }
#define GROWING_RUN RUN(run_front, run_back, tau, before, red, green, blue, opacity)
    Real unmet = 1.0f; // before the ray's first run
    if (entering) {
        const Places places = {
            SELECT((Int)(0), (view.first_row - recording.window_row) * view.columns + lists,
                   rays.present)};
#define ENTERING(n) entering[places.each[n]]
        unmet = OF_LANES(Real, ENTERING);
#undef ENTERING
    }
    Real transmittance = SELECT(unmet, before - before * opacity, some);
    Real4 feature = run_feature(GROWING_RUN, per_reference);
    Real run_length = SELECT((Real)(0.0f), (run_back - run_front) * per_reference, some);
    // A ray that cannot keep every detail asks about homogeneity once in a voxel only: the steps of
    // a group are composited without asking
    const Int group = SELECT((Int)(1), (Int)(recording.grain), threshold > recording.finest);
    Int k = begin;
    Int left = group; // steps of this group
    Real group_front = step_face(&march, k);
    Real group_tau = 0.0f, group_red = 0.0f, group_green = 0.0f, group_blue = 0.0f,
         group_opacity = 0.0f;
    // Every turn does the same for every ray, and what depends on the ray is selected: the lanes of
    // a vector need no masks
    for (;;) {
        const Int active = k < end;
        if (!ANY(active))
            break;
        const Real front = step_face(&march, k), back = step_face(&march, k + 1);
        const Int empty =
            empty_steps(&march, &medium, active & (left == group), k, end, group, front, back);
        const Real4 step = step_medium(&march, &medium, front, back);
        // What is passed by is transparent, and so is its first step, which is looked at all the
        // same
        const Real step_tau = SELECT(step.w, (Real)(0.0f), empty > 0);
        const Real weight = (1.0f - group_opacity) * opacity_of(step_tau); // over, front to back
        group_tau += step_tau;
        group_red += weight * step.x;
        group_green += weight * step.y;
        group_blue += weight * step.z;
        group_opacity += weight;
        k += max(empty, 1);
        --left;
        const Int whole = (left == 0) | (empty > 0) | (k >= end);
        const Int visible = active & whole & (group_opacity > 0.0f) & (back > group_front);

        if (ANY(visible)) {
            const Run sample = RUN(group_front, back, group_tau, transmittance, group_red,
                                   group_green, group_blue, group_opacity);
            const Real sample_length = (back - group_front) * per_reference;
            const Real4 sample_feature = run_feature(sample, per_reference);
            const Real share = sample_length / (run_length + sample_length);
            const Real4 difference = difference_of(sample_feature, feature);
            const Run run = GROWING_RUN;
            // merge_error of generation/runs.cl, of runs that touch: as merged_with of one ray
            const Real error = run_length * share * square_of(difference) *
                               seen_weight(run, recording.hidden_weight);
            // A gap ends a run
            const Int grows = visible & (run_back == group_front) & (error <= threshold);
            const Int begins = visible & !grows;
            // Where a run is not at its end it is stored for nothing
            if (ANY(begins & (count > 0)))
                store_last_run(records, starts, count, run);
            count += COUNT(begins);
            const Run grown = merged_runs(run, sample);
#define KEPT_OR(kept, if_begins, if_grows) SELECT(SELECT(kept, if_begins, begins), if_grows, grows)
            run_front = SELECT(run_front, group_front, begins);
            run_back = SELECT(run_back, back, visible);
            tau = KEPT_OR(tau, group_tau, grown.TAU);
            before = SELECT(before, transmittance, begins);
            red = KEPT_OR(red, group_red, grown.RED);
            green = KEPT_OR(green, group_green, grown.GREEN);
            blue = KEPT_OR(blue, group_blue, grown.BLUE);
            opacity = KEPT_OR(opacity, group_opacity, grown.OPACITY);
            run_length = KEPT_OR(run_length, sample_length, run_length + sample_length);
            feature.x = KEPT_OR(feature.x, sample_feature.x, feature.x + share * difference.x);
            feature.y = KEPT_OR(feature.y, sample_feature.y, feature.y + share * difference.y);
            feature.z = KEPT_OR(feature.z, sample_feature.z, feature.z + share * difference.z);
            feature.w = KEPT_OR(feature.w, sample_feature.w, feature.w + share * difference.w);
            transmittance =
                SELECT(transmittance, transmittance - transmittance * group_opacity, visible);
#undef KEPT_OR
        }
        left = SELECT(left, group, whole);
        group_front = SELECT(group_front, step_face(&march, k), whole);
        group_tau = SELECT(group_tau, (Real)(0.0f), whole);
        group_red = SELECT(group_red, (Real)(0.0f), whole);
        group_green = SELECT(group_green, (Real)(0.0f), whole);
        group_blue = SELECT(group_blue, (Real)(0.0f), whole);
        group_opacity = SELECT(group_opacity, (Real)(0.0f), whole);
    }
    if (ANY(count > 0))
        store_last_run(records, starts, count, GROWING_RUN);
    store_counts(counts, lists, rays.present, count);
}

KERNEL_OF_LANES void longest_marches(const Classified classified, const RaysOfView view,
                                     __global const float *forms, int slice_rows,
                                     __global int *longest)
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_view(&view, first);
    March march;
    if (!ANY(rays.present) ||
        !ANY(begin_march(&march, &view, &classified, forms, rays.a, rays.b, INFINITY)))
        return;
    __global int *of_slice = longest + block_pixel(first, view.columns).y / slice_rows;
    const int steps = largest_lane(SELECT((Int)(0), march.steps - march.begin, rays.present));
    if (steps > *of_slice) // an old value is only lower, and does no harm
        atomic_max(of_slice, steps);
}
