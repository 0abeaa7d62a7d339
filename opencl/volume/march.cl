// The march along one ray of a volume: one place for the steps that generation and direct volume rendering share.
//
// Samples lie at the midpoints of steps of equal model length along the ray, the last one shorter (DESIGN section 3).
// Every face is computed from its step's number, never accumulated.
//
// -D BY_SCALAR     with NEAREST and voxels of integers: the table holds the medium of each scalar from `low` on, of which no
//                  voxel is outside (volume/scalar_media.cl); otherwise it is classified at each sample
// -D FAR_ENTRIES   see lib/rays.cl: t counts from where the ray enters
#include "lib/rays.cl"
#include "lib/classification.cl"
#include "volume/sampling.cl"
#include "volume/shading.cl"
#include "volume/empty_blocks.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    __global const VOXEL_T *voxels;
    int4 size;                    // points along x, y, z
    __global const float4 *table; // transfer function, or the media of scalars
    int entries;
    float low, per_scalar;        // scalar to table position
    __global const uchar *reaches; // of the blocks, see volume/volume_blocks.cl
    int4 blocks;                  // along x, y, z
    SHADING_FIELDS
} Medium;

typedef struct {
    float3 start, slope; // position in index space at t = 0 and per unit of t
    float3 inverse;      // 1 / slope
    float t0, t1;        // where the ray is inside everything it is clipped to
    float step;          // t of one full step
    float per_step;      // 1 / step
    float units;         // opacity unit distances per unit of t
    int steps;
#ifdef FAR_ENTRIES
    float2 entry;        // t of the rays' forms where t is 0 here
#endif
} March;

// Value of a form where t of the march is 0.
inline float march_value(const March *march, __global const float *form, float a, float b)
{
#ifdef FAR_ENTRIES
    return form_at(form, a, b, march->entry).x;
#else
    return form_value(form, a, b);
#endif
}

// Set up the march of pixel offsets (a, b). `forms`: 3 index positions, 3 model directions, then `planes` to clip to.
// `sample_distance` and `unit_distance` in model units. Returns false where the ray misses.
inline bool begin_march(March *march, __global const float *forms, int planes, float a, float b,
                        float sample_distance, float unit_distance, float t_end)
{
#ifdef FAR_ENTRIES
    march->t0 = 0.0f;
    if (!clip_from_entry(forms + 6 * FORM_SIZE, planes, a, b, t_end, &march->entry, &march->t1))
        return false;
#else
    march->t0 = -INFINITY;
    march->t1 = t_end;
    if (!clip_to_planes(forms + 6 * FORM_SIZE, planes, a, b, &march->t0, &march->t1))
        return false;
#endif
    march->start = (float3)(march_value(march, forms, a, b), march_value(march, forms + FORM_SIZE, a, b),
                            march_value(march, forms + 2 * FORM_SIZE, a, b));
    march->slope = (float3)(form_slope(forms, a, b), form_slope(forms + FORM_SIZE, a, b),
                            form_slope(forms + 2 * FORM_SIZE, a, b));
    const float speed = length(model_direction(forms, a, b)); // model units per unit of t
    march->inverse = 1.0f / march->slope;
    march->step = sample_distance / speed;
    march->per_step = 1.0f / march->step;
    march->units = speed / unit_distance;
    march->steps = (int)ceil((march->t1 - march->t0) / march->step);
    return true;
}

inline float step_face(const March *march, int k)
{
    return fmin(fma((float)k, march->step, march->t0), march->t1);
}

// Where a ray leaves a slab between two index positions of one axis, in t: past the face ahead, or never.
inline float leaves_slab(float lower, float upper, float start, float slope, float inverse)
{
    return slope != 0.0f ? ((slope > 0.0f ? upper : lower) - start) * inverse : INFINITY;
}

// The first step from which on midpoints may lie outside a box that the ray is in. Here and below axes are scalars: compilers
// that put work-items into the lanes of a vector take a float3 apart and put it together again around each conversion.
inline int first_step_outside(const March *march, float lower_x, float lower_y, float lower_z, float upper_x, float upper_y,
                              float upper_z)
{
    const float leaves =
        fmin(leaves_slab(lower_x, upper_x, march->start.x, march->slope.x, march->inverse.x),
             fmin(leaves_slab(lower_y, upper_y, march->start.y, march->slope.y, march->inverse.y),
                  leaves_slab(lower_z, upper_z, march->start.z, march->slope.z, march->inverse.z)));
    // Steps with their midpoint before that, less a hundredth of a step for the rounding of positions
    return (int)fmin((leaves - march->t0) * march->per_step - 0.51f, 2e9f) + 1;
}

// Block of an index position on one axis.
inline int block_of(float position, int blocks)
{
    return clamp((int)position >> BLOCK_SHIFT, 0, blocks - 1);
}

// Steps from step k on whose midpoints lie in transparent blocks around the first one's, in whole groups of `group` steps, so
// that the others are grouped as if none had been passed by; 0 where there is something to look at. Skipping decides what is
// looked at and changes no sample. -D SKIP_EMPTY, or every step is looked at.
inline int empty_steps(const March *march, const Medium *medium, int k, int end, int group)
{
#ifdef SKIP_EMPTY
    const float t = 0.5f * (step_face(march, k) + step_face(march, k + 1));
    const int i = block_of(fma(t, march->slope.x, march->start.x), medium->blocks.x);
    const int j = block_of(fma(t, march->slope.y, march->start.y), medium->blocks.y);
    const int l = block_of(fma(t, march->slope.z, march->start.z), medium->blocks.z);
    const int reach = medium->reaches[((size_t)l * medium->blocks.y + j) * medium->blocks.x + i];
    if (reach == 0)
        return 0;
    const int before = reach - 1;
    const int outside = first_step_outside(
        march, (float)((i - before) << BLOCK_SHIFT), (float)((j - before) << BLOCK_SHIFT),
        (float)((l - before) << BLOCK_SHIFT), (float)((i + reach) << BLOCK_SHIFT), (float)((j + reach) << BLOCK_SHIFT),
        (float)((l + reach) << BLOCK_SHIFT));
    const int steps = max(min(outside, end) - k, 0);
    // A division of whole numbers would be done lane by lane; half a step off, rounding crosses none below 2^23
    return group * (int)(((float)steps + 0.5f) / (float)group);
#else
    return 0;
#endif
}

// Colour (rgb) and optical depth (w) of a step of `units` opacity unit distances around index position (x, y, z).
inline float4 medium_at(const Medium *medium, float x, float y, float z, float units)
{
#ifdef BY_SCALAR
    const int scalar = (int)nearest_component(medium->voxels, medium->size, x, y, z, SCALAR);
    const uint entry = min((uint)(scalar - (int)medium->low), (uint)(medium->entries - 1));
    // Two loads where a vector's lanes load from different places, and not four
    __global const ulong *halves = (__global const ulong *)(medium->table + entry);
    float4 sample = (float4)(as_float2(halves[0]), as_float2(halves[1]));
    sample.w = scaled_to_step(sample.w, units);
#else
    const float scalar = sample_volume(medium->voxels, medium->size, x, y, z);
    float4 sample = classify(scalar, medium->table, medium->entries, medium->low, medium->per_scalar);
    if (sample.w > 0.0f)
        sample.w = step_optical_depth(sample.w, units);
#endif
#if defined(RGBA) || defined(SHADED) || defined(GRADIENT_OPACITY) || defined(OCCLUSION)
    if (sample.w > 0.0f) {
#ifdef RGBA
        sample.xyz = sample_color(medium->voxels, medium->size, x, y, z);
#endif
#if defined(SHADED) || defined(GRADIENT_OPACITY)
        const float3 differences = scalar_differences(medium->voxels, medium->size, x, y, z);
#ifdef GRADIENT_OPACITY
        sample.w = scaled_optical_depth(sample.w, gradient_opacity(differences, medium->gradient));
#endif
#ifdef SHADED
        sample.xyz = lit(sample.xyz, differences, x, y, z, medium->lighting);
#endif
#endif
#ifdef OCCLUSION
        sample.xyz *= ambient_factor(medium->ambient, medium->nodes, medium->to_nodes, x, y, z);
#endif
    }
#endif
    return sample;
}

// Colour (rgb) and optical depth (w) of step k, between two faces.
inline float4 step_medium(const March *march, const Medium *medium, int k, float front, float back)
{
#ifdef SAMPLED
    return medium->samples[(k - medium->first_sample) * SAMPLE_LANES];
#else
    const float t = 0.5f * (front + back);
    return medium_at(medium, fma(t, march->slope.x, march->start.x), fma(t, march->slope.y, march->start.y),
                     fma(t, march->slope.z, march->start.z), (back - front) * march->units);
#endif
}
