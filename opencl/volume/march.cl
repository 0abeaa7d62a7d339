// The march along one ray of a volume: one place for the steps that generation and direct volume rendering share.
//
// Samples lie at the midpoints of steps of equal model length along the ray, the last one shorter (docs/conventions.md).
// Every face is computed from its step's number, never accumulated.
//
// -D BY_SCALAR     with NEAREST and voxels of integers: the table holds the medium of each scalar from `low` on, of which no
//                  voxel is outside (volume/scalar_media.cl); otherwise it is classified at each sample
// -D DOUBLE_FLOAT_RAYS   see lib/rays.cl: t counts from where the ray enters
// -D LANES         see lib/lanes.cl; 16 with INDEX_T of uint, and without DOUBLE_FLOAT_RAYS, SAMPLED, RGBA, OCCLUSION,
//                  SHARP_HIGHLIGHTS
// -D GRID_PART     `voxels` are part of a grid, and of a ray's steps those are marched whose midpoints lie in its own cells
//                  (large/blocks.py). Positions stay the whole grid's, so that no step is taken twice or left out; less the
//                  part's first point, which rounds nothing, they are sampled
#include "lib/rays.cl"
#include "lib/transpose.cl"
#include "lib/classification.cl"
#include "volume/sampling.cl"
#include "volume/shading.cl"
#include "volume/empty_macrocells.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef GRID_PART
#define GRID_PART_FIELDS                                                     \
    int4 first;          /* the part's first point */                   \
    float4 lower, upper; /* of its own cells, the upper ones excluded; infinite at the grid's ends */
#define GRID_PART_PARAMETERS int4 part_first, float4 part_lower, float4 part_upper,
#define GRID_PART_ARGUMENTS , part_first, part_lower, part_upper
#define IN_PART(position, axis) ((position) - (float)medium->first.axis)
#define FIRST_OF_PART(axis) medium->first.axis
#define BEGIN_OF(march) (march).begin
#else
#define GRID_PART_FIELDS
#define GRID_PART_PARAMETERS
#define GRID_PART_ARGUMENTS
#define IN_PART(position, axis) (position)
#define FIRST_OF_PART(axis) 0
#define BEGIN_OF(march) 0
#endif

typedef struct {
    __global const VOXEL_T *voxels;
    int4 size;                    // points along x, y, z
    __global const float4 *table; // transfer function, or the media of scalars
    int entries;
    float low, per_scalar;        // scalar to table position
    __global const uchar *distances; // of the macrocells from visible ones, see volume/macrocells.cl
    int4 macrocells;                 // along x, y, z
    GRID_PART_FIELDS
    SHADING_FIELDS
} Medium;

// What each kernel that marches takes first, and the medium that it makes of it
#define MEDIUM_PARAMETERS                                                                                                 \
    __global const VOXEL_T *voxels, int4 size, __global const float4 *table, int entries, float low, float per_scalar,    \
        __global const uchar *distances, int4 macrocells, GRID_PART_PARAMETERS SHADING_PARAMETERS
// And behind it: the view's rays. forms: see begin_march; lengths: model units; the window: pixels
#define VIEW_PARAMETERS                                                                                                   \
    __global const float *forms, int planes, float sample_distance, float unit_distance, int width, int height,
#define MEDIUM {voxels, size, table, entries, low, per_scalar, distances, macrocells GRID_PART_ARGUMENTS SHADING_ARGUMENTS}

typedef struct {
    Real3 start, slope; // position in index space at t = 0 and per unit of t
    Real3 inverse;      // 1 / slope
    Real t0, t1;        // where the ray is inside everything it is clipped to
    Real step;          // t of one full step
    Real per_step;      // 1 / step
    Real units;         // opacity unit distances per unit of t
    Int steps;          // 0 where a ray misses
#ifdef GRID_PART
    Int begin;          // the first step in the part; `steps` is the one behind the last
#endif
#ifdef DOUBLE_FLOAT_RAYS
    float2 entry;       // t of the rays' forms where t is 0 here
#endif
} March;

// Value of a form where t of the march is 0.
inline Real march_value(const March *march, __global const float *form, Real a, Real b)
{
#ifdef DOUBLE_FLOAT_RAYS
    return form_at(form, a, b, march->entry).x;
#else
    return form_value(form, a, b);
#endif
}

// Set up the march of pixel offsets (a, b). `forms`: 3 index positions, 3 model directions, then `planes` to clip to.
// `sample_distance` and `unit_distance` in model units. Returns whether it meets anything.
inline Int begin_march(March *march, __global const float *forms, int planes, Real a, Real b, float sample_distance,
                       float unit_distance, Real t_end)
{
#ifdef DOUBLE_FLOAT_RAYS
    march->t0 = 0.0f;
    const Int meets = clip_from_entry(forms + 6 * FORM_SIZE, planes, a, b, t_end, &march->entry, &march->t1);
#else
    march->t0 = -INFINITY;
    march->t1 = t_end;
    const Int meets = clip_to_planes(forms + 6 * FORM_SIZE, planes, a, b, &march->t0, &march->t1);
#endif
    if (!ANY(meets))
        return meets;
    march->start = REAL3(march_value(march, forms, a, b), march_value(march, forms + FORM_SIZE, a, b),
                         march_value(march, forms + 2 * FORM_SIZE, a, b));
    march->slope = REAL3(form_slope(forms, a, b), form_slope(forms + FORM_SIZE, a, b),
                         form_slope(forms + 2 * FORM_SIZE, a, b));
    march->inverse = REAL3(1.0f / march->slope.x, 1.0f / march->slope.y, 1.0f / march->slope.z);
    const Real speed = march_speed(forms, a, b);
    march->step = sample_distance / speed;
    march->per_step = 1.0f / march->step;
    march->units = speed / unit_distance;
    march->steps = SELECT((Int)(0), TO_INT(ceil((march->t1 - march->t0) / march->step)), meets);
#if LANES > 1
    // Rays that miss look at some place too, so that nothing that is added 0 times is NaN
    march->t0 = SELECT((Real)(0.0f), march->t0, meets);
    march->t1 = SELECT((Real)(0.0f), march->t1, meets);
#endif
    return meets;
}

inline Real step_face(const March *march, Int k)
{
    return fmin(fma(TO_REAL(k), march->step, march->t0), march->t1);
}

// Where a ray leaves a slab between two index positions of one axis, in t: past the face ahead, or never.
inline Real leaves_slab(Real lower, Real upper, Real start, Real slope, Real inverse)
{
    return SELECT((Real)(INFINITY), (SELECT(lower, upper, slope > 0.0f) - start) * inverse, slope != 0.0f);
}

// The first step from which on midpoints may lie outside a box that the ray is in. Here and below axes are scalars: compilers
// that put work-items into the lanes of a vector take a float3 apart and put it together again around each conversion.
inline Int first_step_outside(const March *march, Real lower_x, Real lower_y, Real lower_z, Real upper_x, Real upper_y,
                              Real upper_z)
{
    const Real leaves = fmin(leaves_slab(lower_x, upper_x, march->start.x, march->slope.x, march->inverse.x),
                             fmin(leaves_slab(lower_y, upper_y, march->start.y, march->slope.y, march->inverse.y),
                                  leaves_slab(lower_z, upper_z, march->start.z, march->slope.z, march->inverse.z)));
    // Steps with their midpoint before that, less a hundredth of a step for the rounding of positions
    return TO_INT(fmin((leaves - march->t0) * march->per_step - 0.51f, 2e9f)) + 1;
}

#ifdef GRID_PART
// Whether a step's midpoint lies before the part's cells on an axis, and whether it lies behind them. A ray that does not move
// along the axis is before them if it is not in them.
#define BEFORE_ON(axis, at) SELECT(at >= medium->upper.axis, at < medium->lower.axis, march->slope.axis >= 0.0f)
#define BEHIND_ON(axis, at) SELECT(at < medium->lower.axis, at >= medium->upper.axis, march->slope.axis >= 0.0f)
#define MIDPOINT_ON(axis) fma(t, march->slope.axis, march->start.axis)

inline Int before_part(const March *march, const Medium *medium, Int k)
{
    const Real t = 0.5f * (step_face(march, k) + step_face(march, k + 1));
    const Real x = MIDPOINT_ON(x), y = MIDPOINT_ON(y), z = MIDPOINT_ON(z);
    return BEFORE_ON(x, x) | BEFORE_ON(y, y) | BEFORE_ON(z, z);
}

inline Int behind_part(const March *march, const Medium *medium, Int k)
{
    const Real t = 0.5f * (step_face(march, k) + step_face(march, k + 1));
    const Real x = MIDPOINT_ON(x), y = MIDPOINT_ON(y), z = MIDPOINT_ON(z);
    return BEHIND_ON(x, x) | BEHIND_ON(y, y) | BEHIND_ON(z, z);
}

// Steps up to t, as far as rounding leaves it open.
inline Int steps_until(const March *march, Real t)
{
    return TO_INT(fmin(fmax((t - march->t0) * march->per_step, (Real)(0.0f)), TO_REAL(march->steps)));
}

// Restrict a march to the steps whose midpoints lie in the part's cells. They are a stretch of the ray: midpoints never turn
// back, whatever the rounding. It is found from where the ray enters and leaves, and then by the midpoints themselves.
inline void march_in_part(March *march, const Medium *medium)
{
#define FACE_AHEAD(axis, lower_face, upper_face) \
    ((SELECT((Real)(lower_face), (Real)(upper_face), march->slope.axis > 0.0f) - march->start.axis) * march->inverse.axis)
#define ENTERS(axis) SELECT((Real)(-INFINITY), FACE_AHEAD(axis, medium->upper.axis, medium->lower.axis), march->slope.axis != 0.0f)
#define LEAVES(axis) SELECT((Real)(INFINITY), FACE_AHEAD(axis, medium->lower.axis, medium->upper.axis), march->slope.axis != 0.0f)
    Int begin = steps_until(march, fmax(ENTERS(x), fmax(ENTERS(y), ENTERS(z))));
    Int end = steps_until(march, fmin(LEAVES(x), fmin(LEAVES(y), LEAVES(z))));
#undef ENTERS
#undef LEAVES
#undef FACE_AHEAD
#define WHILE(condition, change)            \
    for (;;) {                              \
        const Int moves = condition;        \
        if (!ANY(moves))                    \
            break;                          \
        change;                             \
    }
    WHILE((begin > 0) & !before_part(march, medium, begin - 1), begin -= COUNT(moves))
    WHILE((begin < march->steps) & before_part(march, medium, begin), begin += COUNT(moves))
    WHILE((end > begin) & behind_part(march, medium, end - 1), end -= COUNT(moves))
    WHILE((end < march->steps) & !behind_part(march, medium, end), end += COUNT(moves))
#undef WHILE
    march->begin = begin;
    march->steps = max(begin, end);
}
#endif

// Macrocell of an index position on one axis.
inline Int macrocell_of(Real position, int macrocells)
{
    return clamp(TO_INT(position) >> MACROCELL_SHIFT, 0, macrocells - 1);
}

// Steps from step k on, which lies between two faces, whose midpoints lie in transparent macrocells around the first one's, in
// whole groups of `group` steps, so that the others are grouped as if none had been passed by; 0 where there is something to
// look at, or a ray is not chosen. Skipping decides what is looked at and changes no sample. -D SKIP_EMPTY, or every step is
// looked at.
inline Int empty_steps(const March *march, const Medium *medium, Int chosen, Int k, Int end, Int group, Real front, Real back)
{
#ifdef SKIP_EMPTY
#if LANES == 1
    if (!chosen)
        return 0;
#endif
    const Real t = 0.5f * (front + back);
    const Int i = macrocell_of(IN_PART(fma(t, march->slope.x, march->start.x), x), medium->macrocells.x);
    const Int j = macrocell_of(IN_PART(fma(t, march->slope.y, march->start.y), y), medium->macrocells.y);
    const Int l = macrocell_of(IN_PART(fma(t, march->slope.z, march->start.z), z), medium->macrocells.z);
    const Places places = {(l * medium->macrocells.y + j) * medium->macrocells.x + i};
    Place *at = places.each;
#define MACROCELL_DISTANCE(n) medium->distances[at[n]]
    const Int distance = OF_LANES(Int, MACROCELL_DISTANCE);
#undef MACROCELL_DISTANCE
#define MACROCELL_FACE(n, axis) TO_REAL(((n) << MACROCELL_SHIFT) + FIRST_OF_PART(axis))
    const Int empty = chosen & (distance != 0);
    if (!ANY(empty))
        return (Int)(0);
    const Int before = distance - 1;
    const Int outside = first_step_outside(
        march, MACROCELL_FACE(i - before, x), MACROCELL_FACE(j - before, y), MACROCELL_FACE(l - before, z),
        MACROCELL_FACE(i + distance, x), MACROCELL_FACE(j + distance, y), MACROCELL_FACE(l + distance, z));
    const Int steps = max(min(outside, end) - k, 0);
#undef MACROCELL_FACE
    // A division of whole numbers would be done lane by lane; half a step off, rounding crosses none below 2^23
    return SELECT((Int)(0), group * TO_INT((TO_REAL(steps) + 0.5f) / TO_REAL(group)), empty);
#else
    return (Int)(0);
#endif
}

#ifdef BY_SCALAR
// Colour and optical depth of one opacity unit distance, of an entry of the table.
inline Real4 entry_of(__global const float4 *table, Uint entry)
{
#if LANES == 1
    // Two loads where a vector's lanes load from different places, and not four
    __global const ulong *halves = (__global const ulong *)(table + entry);
    return (float4)(as_float2(halves[0]), as_float2(halves[1]));
#else
    return load_fours(table, AS_INT(entry));
#endif
}
#endif

// Colour (rgb) and optical depth (w) of a step of `units` opacity unit distances around index position (x, y, z).
inline Real4 medium_at(const Medium *medium, Real x, Real y, Real z, Real units)
{
    const Real at_x = IN_PART(x, x), at_y = IN_PART(y, y), at_z = IN_PART(z, z);
#ifdef BY_SCALAR
    const Int scalar = TO_INT(nearest_component(medium->voxels, medium->size, at_x, at_y, at_z, SCALAR));
    Real4 sample = entry_of(medium->table, min(AS_UINT(scalar - (int)medium->low), (uint)(medium->entries - 1)));
    sample.w = scaled_to_step(sample.w, units);
#else
    const Real scalar = sample_volume(medium->voxels, medium->size, at_x, at_y, at_z);
    Real4 sample = classify(scalar, medium->table, medium->entries, medium->low, medium->per_scalar);
    const Int some = sample.w > 0.0f;
    if (ANY(some))
        sample.w = SELECT((Real)(0.0f), step_optical_depth(sample.w, units), some);
#endif
#ifdef BLANKED
    sample.w = SELECT(sample.w, (Real)(0.0f), is_blank(medium->blanked, medium->size, x, y, z));
#endif
#if defined(RGBA) || defined(SHADED) || defined(GRADIENT_OPACITY) || defined(OCCLUSION)
    const Int visible = sample.w > 0.0f;
    if (ANY(visible)) {
#ifdef RGBA
        sample.xyz = sample_color(medium->voxels, medium->size, at_x, at_y, at_z);
#endif
#if defined(SHADED) || defined(GRADIENT_OPACITY)
        const Real3 differences = scalar_differences(medium->voxels, medium->size, at_x, at_y, at_z);
#ifdef GRADIENT_OPACITY
        const Real scaled = scaled_optical_depth(sample.w, gradient_opacity(differences, medium->gradient));
        sample.w = SELECT(sample.w, scaled, visible);
#endif
#ifdef SHADED
        const Real3 color = lit(REAL3(sample.x, sample.y, sample.z), differences, x, y, z, medium->lighting);
        sample = REAL4(SELECT(sample.x, color.x, visible), SELECT(sample.y, color.y, visible),
                       SELECT(sample.z, color.z, visible), sample.w);
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
inline Real4 step_medium(const March *march, const Medium *medium, Int k, Real front, Real back)
{
#ifdef SAMPLED
    return medium->samples[(k - medium->first_sample) * SAMPLE_LANES];
#else
    const Real t = 0.5f * (front + back);
    return medium_at(medium, fma(t, march->slope.x, march->start.x), fma(t, march->slope.y, march->start.y),
                     fma(t, march->slope.z, march->start.z), (back - front) * march->units);
#endif
}
