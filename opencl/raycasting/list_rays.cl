// The rays that a work-item follows (lib/lanes.cl), in V_O's list space: point(r) = deep + r along.
//
// r runs along a ray over an interval of length 1 and is 0 at the end that is deeper in V_O, where the interpolated 1/Z is
// smallest and its rounding matters most.
//
// -D CROPPED            see lib/cropping.cl
// -D SEGMENTS           t of the new view is asked for, too
// -D DOUBLE_FLOAT_RAYS=2      r is 0 at the other end, `deep` is that one and Z_deep is its depth: the lists lie near it
#include "lib/list_space.cl"
#include "lib/cropping.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    Int present;       // those that meet what they are clipped to, and of which something is kept
    Real3 start;       // where they enter it: u, v, depth coordinate
    Real3 deep, along; // u and v that change by less than a normal number do not change: the reciprocal is not finite
    Int away;          // from V_O: depth does not decrease along the ray
#ifdef DOUBLE_FLOAT_RAYS
    Depths depths;
#endif
    Real r_begin; // 0 or -1; they end at r_begin + 1
    Real scale;   // model length per unit of r, but for the division by w(r_a) w(r_b) in perspective
    Real t_begin; // where they enter, as t
#if LANES > 1 && !defined(PARALLEL)
    Real w_deep, w_along; // 1 / Z is w_deep + r w_along
#endif
#ifdef SEGMENTS
    Real t_deep;  // t where r is 0
    Real t_scale; // t per unit of r, but for the division by w(r) in perspective
#endif
#ifdef CROPPED
    Kept kept; // parts of them, in r
#endif
} ListRays;

#if defined(DOUBLE_FLOAT_RAYS) && DOUBLE_FLOAT_RAYS == 2
#define ENDS_AT_ZERO(away) (!(away)) // whether r is 0 where the ray ends
#else
#define ENDS_AT_ZERO(away) (away)
#endif

#ifdef DOUBLE_FLOAT_RAYS
typedef float2 RayTime; // t
#define NEAREST_REAL(t) (t).x

inline float list_form(__global const float *form, float a, float b, float2 t)
{
    return form_at(form, a, b, t).x;
}

// (u, v, depth coordinate) at t, where the offset is known.
inline float3 list_point(__global const float *forms, float a, float b, float2 t, float2 offset, Depths depths)
{
    const float u = list_form(forms + U_FORM * FORM_SIZE, a, b, t);
    const float v = list_form(forms + V_FORM * FORM_SIZE, a, b, t);
    const float beyond = double_float_sum(offset, -depths.deep).x;
#ifdef PARALLEL
    return (float3)(u, v, beyond);
#else
    const float d = list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
    return (float3)(u / d, v / d, beyond * depths.reciprocal / d);
#endif
}
#else
typedef Real RayTime;
#define NEAREST_REAL(t) (t)
#endif

// 1 / Z at r. Not used in parallel projection.
inline Real reciprocal_depth_at(const ListRays *rays, Real r, Depths depths)
{
#if LANES > 1 && !defined(PARALLEL)
    return fma(r, rays->w_along, rays->w_deep); // fewer operations; with SHIFTED rounded otherwise
#else
    return reciprocal_depth(fma(r, rays->along.z, rays->deep.z), depths);
#endif
}

#ifdef CROPPED
// The kept parts of rays from t_deep, where r is 0, to t_other. Over the homogeneous denominator, what is affine in t is
// linear in r.
inline Kept kept_list_parts(__global const float *forms, int planes, Real a, Real b, RayTime t_deep, RayTime t_other,
                            Real r_other, uint regions)
{
    __global const float *form = forms + (PLANE_FORMS + planes) * FORM_SIZE;
    Real at_deep[CROPPING_PLANES], at_other[CROPPING_PLANES];
    Real w_deep = 1.0f, w_other = 1.0f;
#ifndef PARALLEL
    w_deep = 1.0f / list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_deep);
    w_other = 1.0f / list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_other);
#endif
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        at_deep[k] = list_form(form, a, b, t_deep) * w_deep;
        at_other[k] = list_form(form, a, b, t_other) * w_other;
    }
    return kept_parts(at_deep, at_other, (Real)(0.0f), r_other, regions);
}
#endif

// The rays of pixel offsets (a, b) that are `wanted`. `forms`: list coordinates, model direction, then `planes` to clip to,
// then those of cropping if CROPPED; rays end at `t_end`.
inline ListRays begin_rays(__global const float *forms, int planes, CROPPING_PARAMETER Real a, Real b, Real t_end, Int wanted,
                       float depth_origin)
{
    ListRays rays;
#ifdef DOUBLE_FLOAT_RAYS
    float2 t0 = (float2)(0.0f);
    float t_length = 1.0f;
    rays.present = wanted && clip_from_entry(forms + PLANE_FORMS * FORM_SIZE, planes, a, b, t_end, &t0, &t_length);
    const float2 t1 = double_float_sum(t0, (float2)(t_length, 0.0f));
    const float2 offset = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t0);
    const float2 end_offset = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t1);
    rays.depths.deep = ENDS_AT_ZERO(!double_float_less(end_offset, offset)) ? end_offset : offset;
    rays.depths.reciprocal = 1.0f / (rays.depths.deep.x + depth_origin);
    rays.depths.depth_origin = depth_origin;
    rays.start = list_point(forms, a, b, t0, offset, rays.depths);
    const float3 end = list_point(forms, a, b, t1, end_offset, rays.depths);
#else
    Real t0 = -INFINITY;
    Real t1 = t_end;
    rays.present = clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, planes, a, b, &t0, &t1) && wanted;
    // Where nothing is to be drawn, anything finite
    t0 = SELECT((Real)(0.0f), t0, rays.present);
    t1 = SELECT((Real)(1.0f), t1, rays.present);
    const Real t_length = t1 - t0;
    rays.start = list_point(forms, a, b, t0);
    const Real3 end = list_point(forms, a, b, t1);
#endif
    rays.t_begin = NEAREST_REAL(t0);
    rays.along.x = end.x - rays.start.x;
    rays.along.y = end.y - rays.start.y;
    rays.along.z = end.z - rays.start.z;
    rays.along.x = SELECT(rays.along.x, (Real)(0.0f), fabs(rays.along.x) < FLT_MIN);
    rays.along.y = SELECT(rays.along.y, (Real)(0.0f), fabs(rays.along.y) < FLT_MIN);
    rays.away = rays.along.z >= 0.0f;
    const Int ends_at_zero = ENDS_AT_ZERO(rays.away);
    rays.deep.x = SELECT(rays.start.x, end.x, ends_at_zero);
    rays.deep.y = SELECT(rays.start.y, end.y, ends_at_zero);
    rays.deep.z = SELECT(rays.start.z, end.z, ends_at_zero);
    rays.r_begin = SELECT((Real)(0.0f), (Real)(-1.0f), ends_at_zero);
    rays.scale = t_length * model_speed(forms, a, b);
#ifndef PARALLEL
    rays.scale *= reciprocal_depth(rays.start.z, DEPTHS_OF(&rays)) * reciprocal_depth(end.z, DEPTHS_OF(&rays));
#endif
#if LANES > 1 && !defined(PARALLEL)
    rays.w_deep = reciprocal_depth(rays.deep.z, depth_origin);
    rays.w_along = -rays.along.z;
#ifdef SHIFTED
    rays.w_along /= depth_origin;
#endif
#endif
#if defined(SEGMENTS) || defined(CROPPED)
    const RayTime t_deep = SELECT(t0, t1, ends_at_zero);
    const Real r_other = SELECT((Real)(1.0f), (Real)(-1.0f), ends_at_zero);
#endif
#ifdef SEGMENTS
    rays.t_deep = NEAREST_REAL(t_deep);
    rays.t_scale = t_length;
#if !defined(PARALLEL) && LANES == 1
    rays.t_scale *= reciprocal_depth(ends_at_zero ? rays.start.z : end.z, DEPTHS_OF(&rays));
#elif !defined(PARALLEL) // rounded as along the ray
    rays.t_scale *= reciprocal_depth_at(&rays, r_other, DEPTHS_OF(&rays));
#endif
#endif
#ifdef CROPPED
    const RayTime t_other = SELECT(t1, t0, ends_at_zero);
    rays.kept = kept_list_parts(forms, planes, a, b, t_deep, t_other, r_other, regions);
    rays.present = rays.present && rays.kept.count > 0;
#endif
    return rays;
}

#ifdef SEGMENTS
// t at r. With w = 1/Z linear in r and Z linear in t, the share of the ray between r and its deep end is r w_shallow / w(r):
// small where r is, so that nothing cancels there.
inline Real ray_time(const ListRays *rays, Real r, Depths depths)
{
#ifdef PARALLEL
    return fma(r, rays->t_scale, rays->t_deep);
#else
    return rays->t_deep + r * rays->t_scale / reciprocal_depth_at(rays, r, depths);
#endif
}
#endif

// Model lengths from r = from to r = to.
inline Real length_crossed(const ListRays *rays, Real from, Real to, Depths depths)
{
#ifdef PARALLEL
    return rays->scale * (to - from);
#else
    return rays->scale * (to - from) / (reciprocal_depth_at(rays, from, depths) * reciprocal_depth_at(rays, to, depths));
#endif
}

// Depth in the sense of rays that all go away, or all come back: it does not decrease along them (raycasting/lists.cl).
typedef struct {
    bool away;
    float sign;          // of the depth coordinate
    Real along, deep;    // at r it is fma(r, along, deep)
    Real inverse;        // of `along`, or 0
} Sense;

inline Sense sense_of(const ListRays *rays, bool away)
{
    Sense sense;
    sense.away = away;
    sense.sign = away ? 1.0f : -1.0f;
    sense.along = sense.sign * rays->along.z;
    sense.deep = sense.sign * rays->deep.z;
    sense.inverse = SELECT((Real)(0.0f), 1.0f / sense.along, rays->along.z != 0.0f);
    return sense;
}

inline Real depth_at(const Sense *sense, Real r)
{
    return fma(r, sense->along, sense->deep);
}

// What lies between depths `near` and `far` of the rays from r to r_next, where depths are `depth` and `next_depth`: clipped to
// the supersegment by interval; between two faces it never leaves [r, r_next].
inline void clip_to_faces(Real *from, Real *to, const Sense *sense, Real near, Real far, Real r, Real r_next, Real depth,
                          Real next_depth)
{
    const Real r_enters = (near - sense->deep) * sense->inverse;
    const Real r_leaves = (far - sense->deep) * sense->inverse;
    *from = SELECT(r, LOWER_OF(HIGHER_OF(r_enters, r), r_next), near > depth);
    *to = SELECT(r_next, LOWER_OF(HIGHER_OF(r_leaves, *from), r_next), far < next_depth);
}
