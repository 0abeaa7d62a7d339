// Volume to records of runs, one march per ray (paper section 2; docs/conventions.md, "Merging").
//
// -D VOXEL_T, INDEX_T, RGBA, NEAREST, BY_SCALAR, SKIP_EMPTY, MACROCELL_SHIFT: see volume/sampling.cl and volume/march.cl
// -D SHADED, HEADLIGHT, POSITIONAL_LIGHTS, GRADIENT_OPACITY: see volume/shading.cl; OCCLUSION: see volume/occlusion.cl
// -D SAMPLED: see volume/samples.cl
// -D COMPENSATED: see lib/compositing.cl; DOUBLE_FLOAT_RAYS: see lib/rays.cl
// -D LANES: see volume/march.cl; 16 on CPUs, where a compiler would scatter the words of runs one by one in each turn, and
//    gather: a run is stored as it lies, by one store
//
// A ray's march is cut into chunks of equally many steps. march_lists takes the steps of one chunk and appends what is not
// homogeneous with the run before; generation/shorten_lists.cl then shortens the records that have grown too long, and raises
// the ray's threshold. After the last chunk it shortens each record to the budget, generation/offsets.cl sums up the lists'
// lengths, and generation/pack_lists.cl writes the arrays.
// The march is one kernel and the merging another because they want different vector code on a CPU.
//
// Lengths along a ray are t, the view depth of V_O less the VDI's depth origin, world units; with DOUBLE_FLOAT_RAYS, less that of
// where the ray enters, until they are packed.
#include "volume/march.cl"
#include "generation/runs.cl"
#pragma OPENCL FP_CONTRACT OFF

// Records of rays that meet nothing are not touched: a system makes memory of them page by page.
inline void store_last_run(__global float *records, Int starts, Int count, Run run)
{
    const Places places = {SELECT((Int)(-1), starts + (count - 1) * RUN_WORDS, count > 0)};
    store_run_at(records, places.each, run);
}

// Work-items are the pixels of V_O in columns first_column .. first_column + columns - 1 of rows first_row .. first_row + rows - 1,
// in blocks of 4 x 4, or the blocks; records are in the order of the work-items, counts and offsets in the order of the lists.
// -D GRID_PART: steps are counted from the first one in the part of the grid, see volume/march.cl

#ifdef GRID_PART
#define ENTERING_PARAMETER                                                                                        \
    int window_row, /* the first of the rows that `entering` has */                                               \
    __global const float *entering, /* light that enters the part along each ray, 0 to 1 */
#else
#define ENTERING_PARAMETER
#endif

KERNEL_OF_LANES void march_lists(
    MEDIUM_PARAMETERS
    VIEW_PARAMETERS
    int first_column, int columns, int first_row, int rows,
    int first_step, int steps,       // of this chunk
    int grain,                       // steps in a voxel
    float finest,                    // threshold of rays whose record has never been full
    int capacity,                    // runs in a record: at least as many as are in it now and `steps` more
    float reference_length,          // model units
    float hidden_weight,             // weight of what the view from V_O cannot see, 0 to 1
    ENTERING_PARAMETER
    __global const float *thresholds, // merge errors up to this are accepted, one per ray
    __global float *all_records,
    __global uint *counts)           // runs in each record, by list
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_part(first, width, height, first_column, columns, first_row, rows);
    if (!ANY(rays.present))
        return;
    March march;
    if (!ANY(begin_march(&march, forms, planes, rays.a, rays.b, sample_distance, unit_distance, INFINITY)))
        return;
    const Medium medium = MEDIUM;
#ifdef GRID_PART
    march_in_part(&march, &medium);
#endif
    const Int begin = BEGIN_OF(march) + first_step;
    const Int begun = rays.present & (march.steps > begin);
    if (!ANY(begun))
        return;
    const Int end = SELECT(begin, min(begin + steps, march.steps), begun);
    const Real per_reference = march.units * unit_distance / reference_length;
    const Real threshold = LOAD_LANES(0, thresholds + first);
    __global float *records = all_records + record_start(first, capacity);
    const Int lists = rays.y * columns + rays.x;

    // The records' last runs may still grow. Their features, the means of their steps', are kept, which is cheaper than
    // computing them of their media
    Int count = load_counts(counts, lists, rays.present);
    const Int starts = LANE_NUMBERS * (capacity * RUN_WORDS);
    const Int some = count > 0;
    Real run_front = 0.0f, run_back = -INFINITY, tau = 0.0f, before = 0.0f, red = 0.0f, green = 0.0f, blue = 0.0f, opacity = 0.0f;
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
#ifdef GRID_PART
    const Places places = {SELECT((Int)(0), (first_row - window_row) * columns + lists, rays.present)};
#define ENTERING(n) entering[places.each[n]]
    const Real unmet = OF_LANES(Real, ENTERING); // before the ray's first run
#undef ENTERING
#else
    const Real unmet = 1.0f;
#endif
    Real transmittance = SELECT(unmet, before - before * opacity, some);
    Real4 feature = run_feature(GROWING_RUN, per_reference);
    Real run_length = SELECT((Real)(0.0f), (run_back - run_front) * per_reference, some);
#if defined(COMPENSATED) && COMPENSATED > 1
    Run compensation = (Run)(0.0f); // what the growing run's sums have rounded off in this chunk
#endif
    // A ray that cannot keep every detail asks about homogeneity once in a voxel only: the steps of a group are composited
    // without asking
    const Int group = SELECT((Int)(1), (Int)(grain), threshold > finest);
    Int k = begin;
    Int left = group; // steps of this group
    Real group_front = step_face(&march, k);
    Real group_tau = 0.0f, group_red = 0.0f, group_green = 0.0f, group_blue = 0.0f, group_opacity = 0.0f;
    // Every turn does the same for every ray, and what depends on the ray is selected: the lanes of a vector need no masks
    for (;;) {
        const Int going = k < end;
        if (!ANY(going))
            break;
        const Real front = step_face(&march, k), back = step_face(&march, k + 1);
        const Int empty = empty_steps(&march, &medium, going & (left == group), k, end, group, front, back);
        const Real4 step = step_medium(&march, &medium, k, front, back);
        // What is passed by is transparent, and so is its first step, which is looked at all the same
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
        const Int visible = going & whole & (group_opacity > 0.0f) & (back > group_front);

        if (MAY_MATTER(visible)) {
            const Run sample = RUN(group_front, back, group_tau, transmittance, group_red, group_green, group_blue, group_opacity);
            const Real sample_length = (back - group_front) * per_reference;
            const Real4 sample_feature = run_feature(sample, per_reference);
            const Real share = sample_length / (run_length + sample_length);
            const Real4 difference = difference_of(sample_feature, feature);
            const Run run = GROWING_RUN;
            const Real error = run_length * share * square_of(difference) * seen_weight(run, hidden_weight);
            // A gap ends a run
            const Int grows = visible & (run_back == group_front) & (error <= threshold);
            const Int begins = visible & !grows;
            // Where a run is not at its end it is stored for nothing
            if (ANY(begins & (count > 0)))
                store_last_run(records, starts, count, run);
            count += COUNT(begins);
#if defined(COMPENSATED) && COMPENSATED > 1
            Run grown_compensation = compensation;
            const Run grown = merged_runs_compensated(run, sample, &grown_compensation);
            compensation = grows ? grown_compensation : begins ? (Run)(0.0f) : compensation;
#else
            const Run grown = merged_runs(run, sample);
#endif
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
            transmittance = SELECT(transmittance, transmittance - transmittance * group_opacity, visible);
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

// The steps of the longest ray of each slice of rows.
__kernel void longest_marches(
#ifdef GRID_PART
    MEDIUM_PARAMETERS
#endif
    VIEW_PARAMETERS
    int first_column, int columns, int first_row, int rows,
    int slice_rows,                // a multiple of a block's
    __global int *longest)         // of each slice; 0 at first
{
    const uint first = (uint)get_global_id(0) * LANES;
    const Rays rays = rays_of_part(first, width, height, first_column, columns, first_row, rows);
    if (!ANY(rays.present))
        return;
    March march;
    if (!ANY(begin_march(&march, forms, planes, rays.a, rays.b, sample_distance, unit_distance, INFINITY)))
        return;
#ifdef GRID_PART
    const Medium medium = MEDIUM;
    march_in_part(&march, &medium);
#endif
    __global int *of_slice = longest + block_pixel(first, columns).y / slice_rows;
    const int steps = largest_lane(SELECT((Int)(0), march.steps - BEGIN_OF(march), rays.present));
    if (steps > *of_slice) // an old value is only lower, and does no harm
        atomic_max(of_slice, steps);
}
