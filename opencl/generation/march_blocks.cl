// A chunk of the march as by march_lists (generation/generate.cl), to the last bit, but in vectors that are written out: a work-item
// marches the rays of a block of 4 x 4. For nearest samples that are looked up by scalar, and neither shaded nor occluded.
//
// What a compiler makes of that kernel scatters the words of runs one by one in each turn, and gathers: here a run is stored as
// it lies, by one store, and what is sampled is loaded lane by lane.
//
// -D VOXEL_T, SKIP_EMPTY, BLOCK_SHIFT: see volume/sampling.cl and volume/march.cl
#define LANES 16
#include "lib/rays.cl"
#include "volume/empty_blocks.cl"
#include "generation/run_blocks.cl"
#pragma OPENCL FP_CONTRACT OFF

DEFINE_OPACITY_OF(opacities_of, 16)

// The march of each ray, see volume/march.cl.
typedef struct {
    Reals start_x, start_y, start_z, slope_x, slope_y, slope_z;
    Reals t0, t1, step, units;
    Ints steps; // 0 where a ray misses
} Marches;

inline Marches begin_marches(__global const float *forms, int planes, Reals a, Reals b, float sample_distance,
                             float unit_distance, Ints in_window)
{
    Marches marches;
    marches.t0 = (Reals)(-INFINITY);
    marches.t1 = (Reals)(INFINITY);
    for (int k = 0; k < planes; ++k) {
        __global const float *plane = forms + (6 + k) * FORM_SIZE;
        const Reals value = FORM_VALUE(Reals, plane, a, b);
        const Reals slope = FORM_SLOPE(Reals, plane, a, b);
        const Reals t = -value / slope;
        marches.t0 = select(marches.t0, fmax(marches.t0, t), slope > 0.0f);
        marches.t1 = select(marches.t1, fmin(marches.t1, t), slope < 0.0f);
        marches.t1 = select(marches.t1, (Reals)(-INFINITY), slope == 0.0f & value < 0.0f);
    }
    marches.start_x = FORM_VALUE(Reals, forms, a, b);
    marches.start_y = FORM_VALUE(Reals, forms + FORM_SIZE, a, b);
    marches.start_z = FORM_VALUE(Reals, forms + 2 * FORM_SIZE, a, b);
    marches.slope_x = FORM_SLOPE(Reals, forms, a, b);
    marches.slope_y = FORM_SLOPE(Reals, forms + FORM_SIZE, a, b);
    marches.slope_z = FORM_SLOPE(Reals, forms + 2 * FORM_SIZE, a, b);
    // length() of each direction, which drivers compute in ways of their own
    Reals speeds = (Reals)(0.0f);
    float *speed = (float *)&speeds;
    const float *each_a = (const float *)&a, *each_b = (const float *)&b;
    for (int lane = 0; lane < LANES; ++lane)
        speed[lane] = length(model_direction(forms, each_a[lane], each_b[lane]));
    marches.step = sample_distance / speeds;
    marches.units = speeds / unit_distance;
    marches.steps = select((Ints)(0), convert_int16(ceil((marches.t1 - marches.t0) / marches.step)),
                           in_window & (marches.t0 < marches.t1));
    return marches;
}

inline Reals faces(const Marches *marches, Ints k)
{
    return fmin(fma(convert_float16(k), marches->step, marches->t0), marches->t1);
}

#ifdef SKIP_EMPTY
inline Ints blocks_of(Reals position, int blocks)
{
    return clamp(convert_int16(position) >> BLOCK_SHIFT, 0, blocks - 1);
}

inline Reals leave_slabs(Ints block, Ints before, Ints reach, Reals start, Reals slope)
{
    const Reals lower = convert_float16((block - before) << BLOCK_SHIFT);
    const Reals upper = convert_float16((block + reach) << BLOCK_SHIFT);
    const Reals leaves = (select(lower, upper, slope > 0.0f) - start) * (1.0f / slope);
    return select((Reals)(INFINITY), leaves, slope != 0.0f);
}
#endif

// empty_steps of chosen rays, 0 for the others.
inline Ints all_empty_steps(const Marches *marches, __global const uchar *reaches, int4 blocks, Ints chosen, Ints k, Ints end,
                            Ints group, Reals front, Reals back)
{
#ifdef SKIP_EMPTY
    const Reals t = 0.5f * (front + back);
    const Ints i = blocks_of(fma(t, marches->slope_x, marches->start_x), blocks.x);
    const Ints j = blocks_of(fma(t, marches->slope_y, marches->start_y), blocks.y);
    const Ints l = blocks_of(fma(t, marches->slope_z, marches->start_z), blocks.z);
    Places places;
    places.all = (l * blocks.y + j) * blocks.x + i;
    const volatile int *at = places.each;
    const Ints reach = (Ints)(reaches[at[0]], reaches[at[1]], reaches[at[2]], reaches[at[3]], reaches[at[4]], reaches[at[5]],
                              reaches[at[6]], reaches[at[7]], reaches[at[8]], reaches[at[9]], reaches[at[10]],
                              reaches[at[11]], reaches[at[12]], reaches[at[13]], reaches[at[14]], reaches[at[15]]);
    const Ints empty = chosen & (reach != 0);
    if (!ANY(empty))
        return (Ints)(0);
    const Ints before = reach - 1;
    const Reals leaves = fmin(leave_slabs(i, before, reach, marches->start_x, marches->slope_x),
                              fmin(leave_slabs(j, before, reach, marches->start_y, marches->slope_y),
                                   leave_slabs(l, before, reach, marches->start_z, marches->slope_z)));
    const Reals per_step = 1.0f / marches->step;
    const Ints outside = convert_int16(fmin((leaves - marches->t0) * per_step - 0.51f, 2e9f)) + 1;
    const Ints steps = max(min(outside, end) - k, 0);
    const Ints whole = group * convert_int16((convert_float16(steps) + 0.5f) / convert_float16(group));
    return select((Ints)(0), whole, empty);
#else
    return (Ints)(0);
#endif
}

// Colours and optical depths of steps of `units` opacity unit distances around index positions.
typedef struct {
    Reals red, green, blue, tau;
} Media;

inline Media media_at(__global const VOXEL_T *voxels, int4 size, __global const float4 *table, int entries, float low, Reals x,
                      Reals y, Reals z, Reals units)
{
    const Ints i = clamp(convert_int16(x + 0.5f), 0, size.x - 1);
    const Ints j = clamp(convert_int16(y + 0.5f), 0, size.y - 1);
    const Ints k = clamp(convert_int16(z + 0.5f), 0, size.z - 1);
    Places places;
    places.all = (k * size.y + j) * size.x + i;
    const volatile uint *at = (const volatile uint *)places.each;
    const Ints scalar = (Ints)(voxels[at[0]], voxels[at[1]], voxels[at[2]], voxels[at[3]], voxels[at[4]], voxels[at[5]],
                               voxels[at[6]], voxels[at[7]], voxels[at[8]], voxels[at[9]], voxels[at[10]], voxels[at[11]],
                               voxels[at[12]], voxels[at[13]], voxels[at[14]], voxels[at[15]]);
    Places entry;
    entry.all = as_int16(min(as_uint16(scalar - (int)low), (uint)(entries - 1)));
    const volatile int *of = entry.each;
#define ENTRY(n) (*((__global const volatile float4 *)table + of[n]))
#define ENTRIES(n) (Reals)(ENTRY(n), ENTRY((n) + 4), ENTRY((n) + 8), ENTRY((n) + 12))
    Media media = {ENTRIES(0), ENTRIES(1), ENTRIES(2), ENTRIES(3)};
#undef ENTRY
#undef ENTRIES
    transpose(&media.red, &media.green, &media.blue, &media.tau);
    media.tau = select(fmax((Reals)(OPAQUE_OPTICAL_DEPTH), units), media.tau * units, media.tau < INFINITY);
    return media;
}

__attribute__((vec_type_hint(float16)))
__kernel void march_blocks(
    __global const VOXEL_T *voxels,
    int4 size,
    __global const float4 *table,
    int entries,
    float low, float per_scalar,
    __global const uchar *reaches,
    int4 blocks,
    __global const float *forms,
    int planes,
    float sample_distance,
    float unit_distance,
    int width, int height,
    int first_row, int rows,
    int first_step, int steps,
    int grain,
    float finest,
    int capacity,
    float reference_length,
    float hidden_weight,
    __global const float *thresholds,
    __global float *all_records,
    __global uint *counts)
{
    const uint first = (uint)get_global_id(0) * LANES;
    const int2 corner = block_pixel(first, width);
    const Ints x = corner.x + (NUMBERS & 3), y = corner.y + (NUMBERS >> 2);
    const Ints in_window = x < width & y < rows;
    if (!ANY(in_window))
        return;
    const Reals a = convert_float16(x) + 0.5f - 0.5f * (float)width;
    const Reals b = convert_float16(first_row + y) + 0.5f - 0.5f * (float)height;
    const Marches marches = begin_marches(forms, planes, a, b, sample_distance, unit_distance, in_window);
    const Ints begun = marches.steps > first_step;
    if (!ANY(begun))
        return;
    const Ints end = min(first_step + steps, marches.steps);
    const Reals per_reference = marches.units * unit_distance / reference_length;
    const Reals threshold = vload16(0, thresholds + first);
    __global float *records = all_records + record_start(first, capacity, RUN_WORDS);
    __global uint *lengths = counts + (size_t)corner.y * width + corner.x;
    Places many;
    many.all = (Ints)(0);
    for (int lane = 0; lane < LANES; ++lane) {
        if (corner.x + (lane & 3) < width && corner.y + (lane >> 2) < rows)
            many.each[lane] = (int)lengths[(size_t)(lane >> 2) * width + (lane & 3)];
    }

    // The growing runs, and their features, see march_lists
    Ints count = many.all;
    const Ints starts = NUMBERS * (capacity * RUN_WORDS);
    const Ints some = count > 0;
    Places places;
    places.all = select((Ints)(0), starts + (count - 1) * RUN_WORDS, some);
    Runs run = load_runs(records, places.each);
    // Records of rays that meet nothing are not touched: a system makes memory of them page by page
    places.all = select((Ints)(-1), places.all, some);
    run.front = select((Reals)(0.0f), run.front, some);
    run.back = select((Reals)(-INFINITY), run.back, some);
    run.tau = select((Reals)(0.0f), run.tau, some);
    run.transmittance = select((Reals)(0.0f), run.transmittance, some);
    run.red = select((Reals)(0.0f), run.red, some);
    run.green = select((Reals)(0.0f), run.green, some);
    run.blue = select((Reals)(0.0f), run.blue, some);
    run.opacity = select((Reals)(0.0f), run.opacity, some);
    Reals transmittance = select((Reals)(1.0f), run.transmittance - run.transmittance * run.opacity, some);
    Features feature = features_of(run, per_reference);
    Reals run_length = select((Reals)(0.0f), (run.back - run.front) * per_reference, some);

    const Ints group = select((Ints)(1), (Ints)(grain), threshold > finest);
    Ints k = (Ints)(first_step);
    Ints left = group;
    Reals front = faces(&marches, k), group_front = front;
    Reals group_tau = (Reals)(0.0f), group_red = (Reals)(0.0f), group_green = (Reals)(0.0f), group_blue = (Reals)(0.0f);
    Reals group_opacity = (Reals)(0.0f);
    for (;;) {
        const Ints going = begun & (k < end);
        if (!ANY(going))
            break;
        const Reals back = faces(&marches, k + 1);
        const Ints empty =
            all_empty_steps(&marches, reaches, blocks, going & (left == group), k, end, group, front, back);
        const Reals t = 0.5f * (front + back);
        const Media step = media_at(voxels, size, table, entries, low, fma(t, marches.slope_x, marches.start_x),
                                    fma(t, marches.slope_y, marches.start_y), fma(t, marches.slope_z, marches.start_z),
                                    (back - front) * marches.units);
        const Reals step_tau = select(step.tau, (Reals)(0.0f), empty > 0);
        const Reals weight = (1.0f - group_opacity) * opacities_of(step_tau);
        group_tau += step_tau;
        group_red += weight * step.red;
        group_green += weight * step.green;
        group_blue += weight * step.blue;
        group_opacity += weight;
        k += max(empty, 1);
        --left;
        const Ints whole = (left == 0) | (empty > 0) | (k >= end);
        const Ints visible = going & whole & (group_opacity > 0.0f) & (back > group_front);

        if (ANY(visible)) {
            const Runs sample = {group_front, back, group_tau, transmittance, group_red, group_green, group_blue, group_opacity};
            const Reals sample_length = (back - group_front) * per_reference;
            const Features of_sample = features_of(sample, per_reference);
            const Reals share = sample_length / (run_length + sample_length);
            const Reals red = of_sample.red - feature.red, green = of_sample.green - feature.green;
            const Reals blue = of_sample.blue - feature.blue, density = of_sample.density - feature.density;
            const Reals error = run_length * share * squares_of(red, green, blue, density) *
                                (hidden_weight + (1.0f - hidden_weight) * run.transmittance);
            const Ints grows = visible & (run.back == group_front) & (error <= threshold);
            const Ints begins = visible & ~grows;
            // Where a run is not at its end it is stored for nothing
            if (ANY(begins))
                store_runs(records, places.each, run);
            count -= begins;
            places.all = select((Ints)(-1), starts + (count - 1) * RUN_WORDS, count > 0);
            const Runs grown = merged_of(run, sample);
            run.front = select(run.front, group_front, begins);
            run.back = select(run.back, back, visible);
            run.tau = select(select(run.tau, group_tau, begins), grown.tau, grows);
            run.transmittance = select(run.transmittance, transmittance, begins);
            run.red = select(select(run.red, group_red, begins), grown.red, grows);
            run.green = select(select(run.green, group_green, begins), grown.green, grows);
            run.blue = select(select(run.blue, group_blue, begins), grown.blue, grows);
            run.opacity = select(select(run.opacity, group_opacity, begins), grown.opacity, grows);
            run_length = select(select(run_length, sample_length, begins), run_length + sample_length, grows);
            feature.red = select(select(feature.red, of_sample.red, begins), feature.red + share * red, grows);
            feature.green = select(select(feature.green, of_sample.green, begins), feature.green + share * green, grows);
            feature.blue = select(select(feature.blue, of_sample.blue, begins), feature.blue + share * blue, grows);
            feature.density = select(select(feature.density, of_sample.density, begins), feature.density + share * density, grows);
            transmittance = select(transmittance, transmittance - transmittance * group_opacity, visible);
        }
        front = faces(&marches, k);
        left = select(left, group, whole);
        group_front = select(group_front, front, whole);
        group_tau = select(group_tau, (Reals)(0.0f), whole);
        group_red = select(group_red, (Reals)(0.0f), whole);
        group_green = select(group_green, (Reals)(0.0f), whole);
        group_blue = select(group_blue, (Reals)(0.0f), whole);
        group_opacity = select(group_opacity, (Reals)(0.0f), whole);
    }
    store_runs(records, places.each, run);
    many.all = count;
    for (int lane = 0; lane < LANES; ++lane) {
        if (corner.x + (lane & 3) < width && corner.y + (lane >> 2) < rows)
            lengths[(size_t)(lane >> 2) * width + (lane & 3)] = (uint)many.each[lane];
    }
}
