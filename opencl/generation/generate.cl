// Volume to lists of supersegments, one march per ray (paper section 2; DESIGN section 3 "Merging", "Budget").
//
// -D VOXEL_T, INDEX_T, RGBA, NEAREST, BY_SCALAR, SKIP_EMPTY, BLOCK_SHIFT: see volume/sampling.cl and volume/march.cl
// -D SHADED, HEADLIGHT, POSITIONAL_LIGHTS, GRADIENT_OPACITY: see volume/shading.cl; OCCLUSION: see volume/occlusion.cl
// -D SAMPLED: see volume/samples.cl
// -D CRITERION: see generation/criteria.cl; without it lists are shortened at least error
// -D COMPENSATED: see lib/compositing.cl; FAR_ENTRIES: see lib/rays.cl
//
// A ray's march is cut into chunks of equally many steps. march_lists takes the steps of one chunk and appends what is not
// homogeneous with the run before; shorten_lists then shortens the records that have grown too long, and raises the
// ray's threshold. After the last chunk it shortens each record to the budget, generation/offsets.cl sums up the lists' lengths, and
// pack_lists writes the arrays.
// The march is one kernel and the merging another because they want different vector code on a CPU.
//
// Lengths along a ray are t, the view depth of V_O less the VDI's depth origin, world units; with FAR_ENTRIES, less that of
// where the ray enters, until they are packed.
#include "volume/march.cl"
#include "generation/runs.cl"
#include "generation/criteria.cl"
#pragma OPENCL FP_CONTRACT OFF

// Work-items are the pixels of V_O in rows first_row .. first_row + rows - 1, in blocks of 4 x 4; records are in the order
// of the work-items, counts and offsets in the order of the lists.

__kernel void march_lists(
    __global const VOXEL_T *voxels,
    int4 size,                     // points along x, y, z
    __global const float4 *table,  // transfer function, `entries` (R, G, B, opacity)
    int entries,
    float low, float per_scalar,   // scalar to table position
    __global const uchar *reaches, // of the blocks, see volume/volume_blocks.cl
    int4 blocks,                   // along x, y, z
    SHADING_PARAMETERS             // see volume/shading.cl
    __global const float *forms,   // see begin_march
    int planes,
    float sample_distance,         // model units
    float unit_distance,           // opacity unit distance, model units
    int width, int height,         // of V_O's window
    int first_row, int rows,
    int first_step, int steps,     // of this chunk
    int grain,                     // steps in a voxel
    float finest,                  // threshold of rays whose record has never been full
    int capacity,                  // runs in a record: at least as many as are in it now and `steps` more
    float reference_length,        // model units
    float hidden_weight,           // weight of what the view from V_O cannot see, 0 to 1
    __global const float *thresholds, // merge errors up to this are accepted, one per ray
    __global float *records,
    __global uint *counts)         // runs in each record, by list
{
    const uint item = (uint)get_global_id(0);
    const int2 pixel = block_pixel(item, width);
    if (pixel.x >= width || pixel.y >= rows)
        return;
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)(first_row + pixel.y) + 0.5f - 0.5f * (float)height;
    __global uint *length_of_list = counts + (size_t)pixel.y * width + pixel.x;
    March march;
    if (!begin_march(&march, forms, planes, a, b, sample_distance, unit_distance, INFINITY))
        return;
    const Medium medium = {voxels, size, table, entries, low, per_scalar, reaches, blocks SHADING_ARGUMENTS};
    if (march.steps <= first_step)
        return;
    const float per_reference = march.units * unit_distance / reference_length;
    const float threshold = thresholds[item];
    __global float *record = records + record_start(item, capacity, RUN_WORDS);

    // The record's last run may still grow. Until it is stored its components are kept one by one, and so is its feature, the
    // mean of its steps', which is cheaper to keep than its medium's
    int count = (int)*length_of_list;
    float8 run = (float8)(0.0f);
    run.BACK = -INFINITY;
    float transmittance = 1.0f;
    if (count > 0) {
        run = load_run(record, count - 1);
        transmittance = run.TRANSMITTANCE - run.TRANSMITTANCE * run.OPACITY;
    }
    const float4 begun_feature = run_feature(run, per_reference);
    float front = run.FRONT, back = run.BACK, tau = run.TAU, before = run.TRANSMITTANCE;
    float red = run.s4, green = run.s5, blue = run.s6, opacity = run.OPACITY;
    float run_length = count > 0 ? (back - front) * per_reference : 0.0f;
    float red_feature = begun_feature.x, green_feature = begun_feature.y, blue_feature = begun_feature.z;
    float density = begun_feature.w;
#if defined(COMPENSATED) && COMPENSATED > 1
    float8 rest = (float8)(0.0f); // what the growing run's sums have rounded off in this chunk
#endif
    // A ray that cannot keep every detail asks about homogeneity once in a voxel only: the steps of a group are composited
    // without asking
    const int group = threshold > finest ? grain : 1;
    const int end = min(first_step + steps, march.steps);
    int k = first_step;
    int left = group; // steps of this group
    float group_front = step_face(&march, k);
    float group_tau = 0.0f, group_red = 0.0f, group_green = 0.0f, group_blue = 0.0f, group_opacity = 0.0f;
    // Every turn does the same for every ray, and what depends on the ray is selected: the lanes of a vector need no masks
    while (k < end) {
        const int empty = left == group ? empty_steps(&march, &medium, k, end, group) : 0;
        const float step_back = step_face(&march, k + 1);
        const float4 step = step_medium(&march, &medium, k, step_face(&march, k), step_back);
        // What is passed by is transparent, and so is its first step, which is looked at all the same
        const float step_tau = empty > 0 ? 0.0f : step.w;
        const float weight = (1.0f - group_opacity) * opacity_of(step_tau); // over, front to back
        group_tau += step_tau;
        group_red += weight * step.x;
        group_green += weight * step.y;
        group_blue += weight * step.z;
        group_opacity += weight;
        k += max(empty, 1);
        --left;
        const bool whole = left == 0 || empty > 0 || k >= end;
        const bool visible = whole && group_opacity > 0.0f && step_back > group_front;

        // A gap ends a run
        const float8 sample = (float8)(group_front, step_back, group_tau, transmittance, group_red, group_green, group_blue,
                                       group_opacity);
        const float sample_length = (step_back - group_front) * per_reference;
        const float4 feature = run_feature(sample, per_reference);
        const float share = sample_length / (run_length + sample_length);
        const float4 difference = (float4)(feature.x - red_feature, feature.y - green_feature, feature.z - blue_feature,
                                           feature.w - density);
        run = (float8)(front, back, tau, before, red, green, blue, opacity);
        const float error = run_length * share * square_of(difference) * seen_weight(run, hidden_weight);
        const bool grows = visible && back == group_front && error <= threshold;
        const bool begins = visible && !grows;
        if (begins && count > 0)
            store_run(record, count - 1, run);
#if defined(COMPENSATED) && COMPENSATED > 1
        float8 grown_rest = rest;
        const float8 grown = merged_runs_with_rest(run, sample, &grown_rest);
        rest = grows ? grown_rest : begins ? (float8)(0.0f) : rest;
#else
        const float8 grown = merged_runs(run, sample);
#endif
        count += begins ? 1 : 0;
        front = begins ? group_front : front;
        back = visible ? step_back : back;
        tau = grows ? grown.TAU : begins ? group_tau : tau;
        before = begins ? transmittance : before;
        red = grows ? grown.s4 : begins ? group_red : red;
        green = grows ? grown.s5 : begins ? group_green : green;
        blue = grows ? grown.s6 : begins ? group_blue : blue;
        opacity = grows ? grown.OPACITY : begins ? group_opacity : opacity;
        run_length = grows ? run_length + sample_length : begins ? sample_length : run_length;
        red_feature = grows ? red_feature + share * difference.x : begins ? feature.x : red_feature;
        green_feature = grows ? green_feature + share * difference.y : begins ? feature.y : green_feature;
        blue_feature = grows ? blue_feature + share * difference.z : begins ? feature.z : blue_feature;
        density = grows ? density + share * difference.w : begins ? feature.w : density;
        transmittance = visible ? transmittance - transmittance * group_opacity : transmittance;

        left = whole ? group : left;
        group_front = whole ? step_face(&march, k) : group_front;
        group_tau = whole ? 0.0f : group_tau;
        group_red = whole ? 0.0f : group_red;
        group_green = whole ? 0.0f : group_green;
        group_blue = whole ? 0.0f : group_blue;
        group_opacity = whole ? 0.0f : group_opacity;
    }
    if (count > 0)
        store_run(record, count - 1, (float8)(front, back, tau, before, red, green, blue, opacity));
    *length_of_list = (uint)count;
}

// The steps of the longest ray of each slice of rows.
__kernel void longest_marches(
    __global const float *forms,
    int planes,
    float sample_distance,
    float unit_distance,
    int width, int height,
    int slice_rows,
    __global int *longest)         // of each slice; 0 at first
{
    const int2 pixel = block_pixel((uint)get_global_id(0), width);
    if (pixel.x >= width || pixel.y >= height)
        return;
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)pixel.y + 0.5f - 0.5f * (float)height;
    March march;
    if (begin_march(&march, forms, planes, a, b, sample_distance, unit_distance, INFINITY)) {
        __global int *of_slice = longest + pixel.y / slice_rows;
        if (march.steps > *of_slice) // an old value is only lower, and does no harm
            atomic_max(of_slice, march.steps);
    }
}

// Shorten records of more than `limit` runs: with `exactly`, at least error; otherwise by raising the ray's threshold.
__kernel void shorten_lists(
    int limit,
    int exactly,
    int width, int height,
    int first_row, int rows,
    __global const float *forms,
    int capacity,
    float reference_length,
    float hidden_weight,
    __global float *thresholds,
    __global float *records,
    __global float *all_errors,
    __global uint *counts)
{
    const uint item = (uint)get_global_id(0);
    const int2 pixel = block_pixel(item, width);
    if (pixel.x >= width || pixel.y >= rows)
        return;
    __global uint *length_of_list = counts + (size_t)pixel.y * width + pixel.x;
    const int count = (int)*length_of_list;
    if (count <= limit)
        return;
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)(first_row + pixel.y) + 0.5f - 0.5f * (float)height;
    const float per_reference = length(model_direction(forms, a, b)) / reference_length;
    __global float *record = records + record_start(item, capacity, RUN_WORDS);
    __global float *errors = all_errors + errors_start(item, capacity);
    if (exactly) {
        *length_of_list = (uint)merge_to_limit(record, errors, count, limit, per_reference, hidden_weight);
    } else {
        float threshold = thresholds[item];
        *length_of_list = (uint)make_room(record, errors, count, limit, &threshold, per_reference, hidden_weight);
        thresholds[item] = threshold;
    }
}

#ifdef CRITERION
// Bring records to at most `limit` runs by another criterion than least error, and merge neighbours as while marching: what
// is homogeneous needs no cut. Records have room for `limit` more runs.
__kernel void cut_lists(
    int limit,
    int width, int height,
    int first_row, int rows,
    __global const float *forms,
    int capacity,
    float reference_length,
    float hidden_weight,
    float threshold,               // merge errors up to this are accepted
    __global float *records,
    __global uint *counts)
{
    const uint item = (uint)get_global_id(0);
    const int2 pixel = block_pixel(item, width);
    if (pixel.x >= width || pixel.y >= rows)
        return;
    __global uint *length_of_list = counts + (size_t)pixel.y * width + pixel.x;
    const int count = (int)*length_of_list;
    if (count == 0)
        return;
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)(first_row + pixel.y) + 0.5f - 0.5f * (float)height;
    const float per_reference = length(model_direction(forms, a, b)) / reference_length;
    __global float *record = records + record_start(item, capacity, RUN_WORDS);
    const int cut = cut_to_limit(record, count, limit, per_reference);
    *length_of_list = (uint)merge_within(record, 0, cut, threshold, per_reference, hidden_weight);
}
#endif

// Records of a slice of rays to the VDI's arrays.
__kernel void pack_lists(
    __global const float *records,
    int capacity,
    int width, int rows,            // of the slice
    __global const ulong *offsets,  // where each list begins, and the last one ends
    uint made,                      // lists before the slice's
    ulong held,                     // supersegments before those that the arrays hold
    __global float *fronts,         // view depth less the depth origin, world units
    __global float *backs,
    __global float *colors,         // straight RGB, 3 per supersegment
    __global float *optical_depths
#ifdef FAR_ENTRIES
    , __global const float *forms,
    int planes,
    int height, int first_row
#endif
)
{
    const uint item = (uint)get_global_id(0);
    const int2 pixel = block_pixel(item, width);
    if (pixel.x >= width || pixel.y >= rows)
        return;
    __global const float *record = records + record_start(item, capacity, RUN_WORDS);
    const size_t list = made + (size_t)pixel.y * width + pixel.x;
    const ulong begin = offsets[list] - held;
    const int count = (int)(offsets[list + 1] - offsets[list]);
#ifdef FAR_ENTRIES
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)(first_row + pixel.y) + 0.5f - 0.5f * (float)height;
    float2 entry = (float2)(0.0f);
    float length = 0.0f;
    clip_from_entry(forms + 6 * FORM_SIZE, planes, a, b, INFINITY, &entry, &length);
    const float2 exit = pair_sum(entry, (float2)(length, 0.0f));
    // Faces as they are stored lie in the volume, or its bounds would cut off what rounding has put outside
    float least = entry.y > 0.0f ? nextafter(entry.x, INFINITY) : entry.x;
    const float most = exit.y < 0.0f ? nextafter(exit.x, -INFINITY) : exit.x;
#endif
    for (int k = 0; k < count; ++k) {
        float8 run = load_run(record, k);
#ifdef FAR_ENTRIES
        // Rounding must neither leave a supersegment without thickness nor let two overlap
        run.FRONT = fmax(pair_sum(entry, (float2)(run.FRONT, 0.0f)).x, least);
        run.BACK = fmin(pair_sum(entry, (float2)(run.BACK, 0.0f)).x, most);
        run.BACK = fmax(run.BACK, nextafter(run.FRONT, INFINITY));
        least = run.BACK;
#endif
        fronts[begin + k] = run.FRONT;
        backs[begin + k] = run.BACK;
        optical_depths[begin + k] = run.TAU;
        vstore3(clamp(run.COLOR / run.OPACITY, 0.0f, 1.0f), begin + k, colors);
    }
}
