// A ray in V_O's list space, or sixteen (lib/lanes.cl): point(r) = deep + r along (paper, section
// 3: from t_near to t_far).
//
// r runs along a ray over an interval of length 1 and is 0 at the end that is deeper in V_O, where
// the interpolated 1/Z is smallest and its rounding matters most.
//
// With DOUBLE_FLOAT_RAYS, where LANES is 1, and lists that lie near the other end, r is 0 there,
// `deep` is that one and Z_deep is its depth.
#include "lib/list_space.cl"
#include "lib/cropping.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    Int present;       // it meets what it is clipped to, and something of it is kept
    Real3 start;       // where it enters that: u, v, depth coordinate
    Real3 deep, along; // u and v that change by less than a normal number do not change
    Int away;          // from V_O: depth does not decrease along the ray
    Depths depths;
    Real r_begin;         // 0 or -1; it ends at r_begin + 1
    Real w_deep, w_along; // w(r) = w_deep + r w_along is 1 / Z, or 1 in parallel projection
    Real scale;           // model length per unit of r, but for the division by w(r_a) w(r_b)
    Real t_begin;         // t where it begins
    Real t_deep, t_scale; // t where r is 0; t per unit of r, but for the division by w(r)
    uint regions;         // of cropping that are kept, see lib/cropping.cl; 0: all
    Kept kept;            // parts of it, in r, if CROPPED
} ListRay;

#ifndef CROPPED // whether only parts of `ray` are drawn; 0 where none ever is
#define CROPPED (ray->regions != 0)
#endif

// t on a ray; where it begins and ends; a form, and (u, v, depth coordinate), there.
#ifdef DOUBLE_FLOAT_RAYS
typedef float2 Time;
#define NEAREST_FLOAT(t) (t).x
#define ENDS_AT_ZERO(away) (frame->lists_near ? !(away) : (away)) // whether r is 0 at the end

inline bool clip_ray(__global const float *planes, int count, float a, float b, float t_end,
                     bool wanted, Time *t0, Time *t1, float *t_length)
{
    *t0 = (float2)(0.0f);
    *t_length = 1.0f;
    const bool present = wanted && clip_from_entry(planes, count, a, b, t_end, t0, t_length);
    *t1 = double_float_sum(*t0, (float2)(*t_length, 0.0f));
    return present;
}

inline float form_on_ray(__global const float *form, float a, float b, Time t)
{
    return form_at(form, a, b, t).x;
}

inline Depths depths_of_ray(__global const float *forms, float a, float b, Time t0, Time t1,
                            const Frame *frame)
{
    const float2 start = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t0);
    const float2 end = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t1);
    Depths depths = {frame->depth_kind, frame->depth_origin};
    depths.deep = ENDS_AT_ZERO(!double_float_less(end, start)) ? end : start;
    depths.reciprocal = depths.kind == PARALLEL ? 1.0f : 1.0f / (depths.deep.x + depths.origin);
    return depths;
}

// The offset is handed in: with its form in here, Intel's compiler for CPUs mixes up rays.
inline float3 point_of_offset(__global const float *forms, float a, float b, Time t, float2 offset,
                              Depths depths)
{
    const float u = form_on_ray(forms + U_FORM * FORM_SIZE, a, b, t);
    const float v = form_on_ray(forms + V_FORM * FORM_SIZE, a, b, t);
    const float beyond = double_float_sum(offset, -depths.deep).x;
    const float d = form_on_ray(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
    return (float3)(u / d, v / d, beyond * depths.reciprocal / d);
}

#define point_on_ray(forms, a, b, t, depths)                                                       \
    point_of_offset(forms, a, b, t, form_at((forms) + DEPTH_FORM * FORM_SIZE, a, b, t), depths)
#else
typedef Real Time;
#define NEAREST_FLOAT(t) (t)
#define ENDS_AT_ZERO(away) (away)
#define form_on_ray(form, a, b, t) list_form(form, a, b, t)
#define depths_of_ray(forms, a, b, t0, t1, frame)                                                  \
    ((Depths){(frame)->depth_kind, (frame)->depth_origin})
#define point_on_ray(forms, a, b, t, depths) list_point(forms, a, b, t)

inline Int clip_ray(__global const float *planes, int count, Real a, Real b, Real t_end, Int wanted,
                    Time *t0, Time *t1, Real *t_length)
{
    *t0 = -INFINITY;
    *t1 = t_end;
    const Int present = clip_to_planes(planes, count, a, b, t0, t1) && wanted;
    *t0 = SELECT((Real)(0.0f), *t0, present); // where nothing is to be drawn, anything finite
    *t1 = SELECT((Real)(1.0f), *t1, present);
    *t_length = *t1 - *t0;
    return present;
}
#endif

inline Real reciprocal_depth_at(const ListRay *ray, Real r)
{
    return fma(r, ray->w_along, ray->w_deep);
}

// The kept parts of a ray from t_deep, where r is 0, to t_other. Over the homogeneous denominator,
// what is affine in t is linear in r.
inline Kept kept_parts_of_ray(__global const float *forms, int planes, Real a, Real b, Time t_deep,
                              Time t_other, Real r_other, uint regions)
{
    __global const float *form = forms + (PLANE_FORMS + planes) * FORM_SIZE;
    Real at_deep[CROPPING_PLANES], at_other[CROPPING_PLANES];
    const Real w_deep = 1.0f / form_on_ray(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_deep);
    const Real w_other = 1.0f / form_on_ray(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_other);
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        at_deep[k] = form_on_ray(form, a, b, t_deep) * w_deep;
        at_other[k] = form_on_ray(form, a, b, t_other) * w_other;
    }
    return kept_parts(at_deep, at_other, (Real)(0.0f), r_other, regions);
}

// Begin the rays of pixel offsets (a, b) that are `wanted`, which end at `t_end`. `forms`: list
// coordinates, model direction, planes to clip to, then those of cropping if CROPPED.
inline void begin_ray(ListRay *ray, __global const float *forms, const Frame *frame, Real a, Real b,
                      Real t_end, Int wanted)
{
    ray->regions = frame->regions;
    // Clip them to the bounds, to V_O's viewport and to planes
    Time t0, t1;
    Real t_length;
    ray->present = clip_ray(forms + PLANE_FORMS * FORM_SIZE, frame->planes, a, b, t_end, wanted,
                            &t0, &t1, &t_length);
    // Bring both ends to list space
    ray->depths = depths_of_ray(forms, a, b, t0, t1, frame);
    ray->start = point_on_ray(forms, a, b, t0, ray->depths);
    const Real3 end = point_on_ray(forms, a, b, t1, ray->depths);
    ray->along = REAL3(end.x - ray->start.x, end.y - ray->start.y, end.z - ray->start.z);
    // The reciprocal of a smaller number is not finite
    ray->along.x = SELECT(ray->along.x, (Real)(0.0f), fabs(ray->along.x) < FLT_MIN);
    ray->along.y = SELECT(ray->along.y, (Real)(0.0f), fabs(ray->along.y) < FLT_MIN);
    ray->away = ray->along.z >= 0.0f;
    // Let r be 0 at the deep end
    const Int ends_at_zero = ENDS_AT_ZERO(ray->away);
    ray->deep =
        REAL3(SELECT(ray->start.x, end.x, ends_at_zero), SELECT(ray->start.y, end.y, ends_at_zero),
              SELECT(ray->start.z, end.z, ends_at_zero));
    ray->r_begin = SELECT((Real)(0.0f), (Real)(-1.0f), ends_at_zero);
    const Real r_other = SELECT((Real)(1.0f), (Real)(-1.0f), ends_at_zero);
    const Time t_deep = SELECT(t0, t1, ends_at_zero), t_other = SELECT(t1, t0, ends_at_zero);
    // Lengths and t per unit of r
    ray->t_begin = NEAREST_FLOAT(t0);
    ray->t_deep = NEAREST_FLOAT(t_deep);
    ray->w_deep = reciprocal_depth(ray->deep.z, ray->depths);
    ray->w_along = ray->depths.kind == PARALLEL  ? (Real)(0.0f)
                   : ray->depths.kind == SHIFTED ? -ray->along.z / ray->depths.origin
                                                 : -ray->along.z;
    ray->scale =
        t_length * model_speed(forms, a, b) *
        (reciprocal_depth(ray->start.z, ray->depths) * reciprocal_depth(end.z, ray->depths));
    ray->t_scale = t_length * reciprocal_depth_at(ray, r_other); // rounded as along the ray
    if (CROPPED) {
        ray->kept =
            kept_parts_of_ray(forms, frame->planes, a, b, t_deep, t_other, r_other, frame->regions);
        ray->present = ray->present && ray->kept.count > 0;
    }
}

// t at r. With w = 1/Z linear in r and Z linear in t, the share of the ray between r and its deep
// end is r w_shallow / w(r): small where r is, so that nothing cancels there.
inline Real ray_time(const ListRay *ray, Real r)
{
    return ray->t_deep + r * ray->t_scale / reciprocal_depth_at(ray, r);
}

// Model length from r = from to r = to.
inline Real length_between(const ListRay *ray, Real from, Real to)
{
    return ray->scale * (to - from) /
           (reciprocal_depth_at(ray, from) * reciprocal_depth_at(ray, to));
}

// The same of what is kept between them, of the rays that are chosen.
inline Real length_crossed(const ListRay *ray, Real from, Real to, Int chosen)
{
    if (!CROPPED)
        return length_between(ray, from, to);
    Real length = 0.0f;
    for (int n = 0; n < MOST_KEPT; ++n) { // not to an end of each ray's own, see lib/cropping.cl
        if (LANES > 1 && !ANY(chosen && ray->kept.count > n))
            break;
        Real kept_from = from, kept_to = to;
        cut_to_part(&ray->kept, n, &kept_from, &kept_to);
        length +=
            SELECT((Real)(0.0f), length_between(ray, kept_from, kept_to), kept_from < kept_to);
    }
    return length;
}
