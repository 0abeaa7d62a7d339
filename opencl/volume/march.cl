// The march along the rays of a volume: one place for the steps that generation and direct volume
// rendering share.
//
// Samples lie at the midpoints of steps of equal model length along the ray, the last one shorter
// (docs/dev/conventions.md, "From a volume to the medium").
// Every face is computed from its step's number, never accumulated.
//
// -D DOUBLE_FLOAT_RAYS  1: see lib/rays.cl; t counts from where the ray enters
// Others: see volume/medium.cl. Of sixteen rays INDEX_T is uint, COMPONENTS 1, and
// DOUBLE_FLOAT_RAYS 0.
#include "volume/rays_of_view.cl"
#include "volume/medium.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    Real3 start, slope; // position in index space at t = 0 and per unit of t
    Real3 inverse;      // 1 / slope
    Real t0, t1;        // where the ray is inside everything it is clipped to
    Real step;          // t of one full step
    Real per_step;      // 1 / step
    Real units;         // opacity unit distances per unit of t
    Int begin, steps;   // the first step, and the one behind the last; 0 where a ray misses
    float2 entry;       // if DOUBLE_FLOAT_RAYS: t of the rays' forms where t is 0 here
} March;

#if DOUBLE_FLOAT_RAYS
inline bool clip_march(March *march, __global const float *planes, int count, float a, float b,
                       float t_end)
{
    march->t0 = 0.0f;
    return clip_from_entry(planes, count, a, b, t_end, &march->entry, &march->t1);
}

// Value of a form where t of the march is 0.
inline float march_value(const March *march, __global const float *form, float a, float b)
{
    return form_at(form, a, b, march->entry).x;
}
#else
inline Int clip_march(March *march, __global const float *planes, int count, Real a, Real b,
                      Real t_end)
{
    march->t0 = -INFINITY;
    march->t1 = t_end;
    return clip_to_planes(planes, count, a, b, &march->t0, &march->t1);
}

#define march_value(march, form, a, b) form_value(form, a, b)
#endif

inline Real step_face(const March *march, Int k)
{
    return fmin(fma(TO_REAL(k), march->step, march->t0), march->t1);
}

// Where a ray leaves a slab between two index positions of one axis, in t: past the face ahead, or
// never.
inline Real leaves_slab(Real lower, Real upper, Real start, Real slope, Real inverse)
{
    return SELECT((Real)(INFINITY), (SELECT(lower, upper, slope > 0.0f) - start) * inverse,
                  slope != 0.0f);
}

// The first step from which on midpoints may lie outside a box that the ray is in. Here and below
// axes are scalars: compilers that put work-items into the lanes of a vector take a float3 apart
// and put it together again around each conversion.
inline Int first_step_outside(const March *march, Real lower_x, Real lower_y, Real lower_z,
                              Real upper_x, Real upper_y, Real upper_z)
{
    const Real leaves =
        fmin(leaves_slab(lower_x, upper_x, march->start.x, march->slope.x, march->inverse.x),
             fmin(leaves_slab(lower_y, upper_y, march->start.y, march->slope.y, march->inverse.y),
                  leaves_slab(lower_z, upper_z, march->start.z, march->slope.z, march->inverse.z)));
    // Steps with their midpoint before that, less a hundredth of a step for the rounding of
    // positions
    return TO_INT(fmin((leaves - march->t0) * march->per_step - 0.51f, 2e9f)) + 1;
}

// Whether a step's midpoint lies before the part's cells, or behind them, on any axis. A ray that
// does not move along an axis is before them if it is not in them.
inline Int beside_part(const March *march, const Classified *of, Int k, bool behind)
{
    const Real t = 0.5f * (step_face(march, k) + step_face(march, k + 1));
#define BESIDE_ON(axis)                                                                            \
    SELECT(fma(t, march->slope.axis, march->start.axis) >= of->part_upper.axis,                    \
           fma(t, march->slope.axis, march->start.axis) < of->part_lower.axis,                     \
           behind ? march->slope.axis < 0.0f : march->slope.axis >= 0.0f)
    return BESIDE_ON(x) | BESIDE_ON(y) | BESIDE_ON(z);
#undef BESIDE_ON
}

// Steps up to t, as far as rounding leaves it open.
inline Int steps_until(const March *march, Real t)
{
    return TO_INT(
        fmin(fmax((t - march->t0) * march->per_step, (Real)(0.0f)), TO_REAL(march->steps)));
}

// Restrict a march to the steps whose midpoints lie in the part's cells. They are a stretch of the
// ray: midpoints never turn back, whatever the rounding. It is found from where the ray enters and
// leaves, and then by the midpoints themselves.
inline void march_in_part(March *march, const Classified *of)
{
#define FACE_AHEAD(axis, lower_face, upper_face)                                                   \
    ((SELECT((Real)(lower_face), (Real)(upper_face), march->slope.axis > 0.0f) -                   \
      march->start.axis) *                                                                         \
     march->inverse.axis)
#define ENTERS(axis)                                                                               \
    SELECT((Real)(-INFINITY), FACE_AHEAD(axis, of->part_upper.axis, of->part_lower.axis),          \
           march->slope.axis != 0.0f)
#define LEAVES(axis)                                                                               \
    SELECT((Real)(INFINITY), FACE_AHEAD(axis, of->part_lower.axis, of->part_upper.axis),           \
           march->slope.axis != 0.0f)
    Int begin = steps_until(march, fmax(ENTERS(x), fmax(ENTERS(y), ENTERS(z))));
    Int end = steps_until(march, fmin(LEAVES(x), fmin(LEAVES(y), LEAVES(z))));
#undef ENTERS
#undef LEAVES
#undef FACE_AHEAD
#define WHILE(condition, change)                                                                   \
    for (;;) {                                                                                     \
        const Int moves = condition;                                                               \
        if (!ANY(moves))                                                                           \
            break;                                                                                 \
        change;                                                                                    \
    }
    WHILE((begin > 0) & !beside_part(march, of, begin - 1, false), begin -= COUNT(moves))
    WHILE((begin < march->steps) & beside_part(march, of, begin, false), begin += COUNT(moves))
    WHILE((end > begin) & beside_part(march, of, end - 1, true), end -= COUNT(moves))
    WHILE((end < march->steps) & !beside_part(march, of, end, true), end += COUNT(moves))
#undef WHILE
    march->begin = begin;
    march->steps = max(begin, end);
}

// Set up the marches of rays, to t_end at most. `forms`: 3 index positions, 3 model directions,
// then planes to clip to. Returns which of them meet anything.
inline Int begin_march(March *march, const RaysOfView *view, const Classified *of,
                       __global const float *forms, Real a, Real b, Real t_end)
{
    const Int meets = clip_march(march, forms + 6 * FORM_SIZE, view->planes, a, b, t_end);
    if (!ANY(meets))
        return meets;
    march->start =
        REAL3(march_value(march, forms, a, b), march_value(march, forms + FORM_SIZE, a, b),
              march_value(march, forms + 2 * FORM_SIZE, a, b));
    march->slope = REAL3(form_slope(forms, a, b), form_slope(forms + FORM_SIZE, a, b),
                         form_slope(forms + 2 * FORM_SIZE, a, b));
    march->inverse = REAL3(1.0f / march->slope.x, 1.0f / march->slope.y, 1.0f / march->slope.z);
    const Real speed = march_speed(forms, a, b);
    march->step = view->sample_distance / speed;
    march->per_step = 1.0f / march->step;
    march->units = speed / view->unit_distance;
    march->begin = 0;
    march->steps = SELECT((Int)(0), TO_INT(ceil((march->t1 - march->t0) / march->step)), meets);
    // Rays that miss beside others look at some place too, so that nothing that is added 0 times is
    // NaN
    march->t0 = SELECT((Real)(0.0f), march->t0, meets);
    march->t1 = SELECT((Real)(0.0f), march->t1, meets);
    if (of->part_first.w)
        march_in_part(march, of);
    return meets;
}

// Macrocell of an index position on one axis.
inline Int macrocell_of(Real position, int macrocells)
{
    return clamp(TO_INT(position) >> MACROCELL_SHIFT, 0, macrocells - 1);
}

// Steps from step k on, which lies between two faces, whose midpoints lie in transparent macrocells
// around the first one's, in whole groups of `group` steps, so that the others are grouped as if
// none had been passed by; 0 where there is something to look at, or a ray is not chosen. Skipping
// decides what is looked at and changes no sample.
inline Int empty_steps(const March *march, const Medium *medium, Int chosen, Int k, Int end,
                       Int group, Real front, Real back)
{
    const Classified *of = &medium->numbers;
    if (!medium->distances)
        return (Int)(0);
    const Real t = 0.5f * (front + back);
    const Int i =
        macrocell_of(IN_PART(*of, fma(t, march->slope.x, march->start.x), x), of->macrocells.x);
    const Int j =
        macrocell_of(IN_PART(*of, fma(t, march->slope.y, march->start.y), y), of->macrocells.y);
    const Int l =
        macrocell_of(IN_PART(*of, fma(t, march->slope.z, march->start.z), z), of->macrocells.z);
    const Places places = {(l * of->macrocells.y + j) * of->macrocells.x + i};
    Place *at = places.each;
#define MACROCELL_DISTANCE(n) medium->distances[at[n]]
    const Int distance = OF_LANES(Int, MACROCELL_DISTANCE);
#undef MACROCELL_DISTANCE
    const Int empty = chosen & (distance != 0);
    if (!ANY(empty))
        return (Int)(0);
    const Int before = distance - 1;
#define MACROCELL_FACE(n, axis) TO_REAL(((n) << MACROCELL_SHIFT) + of->part_first.axis)
    const Int outside =
        first_step_outside(march, MACROCELL_FACE(i - before, x), MACROCELL_FACE(j - before, y),
                           MACROCELL_FACE(l - before, z), MACROCELL_FACE(i + distance, x),
                           MACROCELL_FACE(j + distance, y), MACROCELL_FACE(l + distance, z));
#undef MACROCELL_FACE
    const Int steps = max(min(outside, end) - k, 0);
    // A division of whole numbers would be done lane by lane; half a step off, rounding crosses
    // none below 2^23
    return SELECT((Int)(0), group * TO_INT((TO_REAL(steps) + 0.5f) / TO_REAL(group)), empty);
}

// Colour (rgb) and optical depth (w) of the step between two faces.
inline Real4 step_medium(const March *march, const Medium *medium, Real front, Real back)
{
    const Real t = 0.5f * (front + back);
    return medium_at(medium, fma(t, march->slope.x, march->start.x),
                     fma(t, march->slope.y, march->start.y), fma(t, march->slope.z, march->start.z),
                     (back - front) * march->units);
}
