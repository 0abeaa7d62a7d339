// The ray of a pixel of V_N in V_O's list space: point(r) = deep + r along.
//
// r runs along the ray over an interval of length 1 and is 0 at the end that is deeper in V_O, where the interpolated 1/Z is
// smallest and its rounding matters most.
//
// -D CROPPED            see lib/cropping.cl
// -D FAR_ENTRIES=2      r is 0 at the other end, `deep` is that one and Z_deep is its depth: the lists lie near it
#include "lib/list_space.cl"
#include "lib/cropping.cl"
#pragma OPENCL FP_CONTRACT OFF

#if defined(FAR_ENTRIES) && FAR_ENTRIES == 2
#define DEEP_IS_ZERO false
#else
#define DEEP_IS_ZERO true
#endif

typedef struct {
    float3 start; // where it enters what it is clipped to: u, v, depth coordinate
    float3 deep, along;
    bool away;     // from V_O: depth does not decrease along the ray
#ifdef FAR_ENTRIES
    Depths depths;
#endif
    float r_begin; // 0 or -1; it ends at r_begin + 1
    float scale;   // model length per unit of r, but for the division by w(r_a) w(r_b) in perspective
    float t_begin; // where it enters, as t
#ifdef SEGMENTS
    float t_deep;  // t where r is 0
    float t_scale; // t per unit of r, but for the division by w(r) in perspective
#endif
#ifdef CROPPED
    Kept kept; // parts of it, in r
#endif
} ListRay;

#ifdef FAR_ENTRIES
typedef float2 ListDepth; // t
#define LIST_DEPTH(t) (t).x
#define DEPTHS_OF(ray) (ray)->depths

inline float list_form(__global const float *form, float a, float b, ListDepth t)
{
    return form_at(form, a, b, t).x;
}

// (u, v, depth coordinate) at t, where the offset is known.
inline float3 list_point(__global const float *forms, float a, float b, ListDepth t, float2 offset, Depths depths)
{
    const float u = list_form(forms + U_FORM * FORM_SIZE, a, b, t);
    const float v = list_form(forms + V_FORM * FORM_SIZE, a, b, t);
    const float beyond = pair_sum(offset, -depths.deep).x;
#ifdef PARALLEL
    return (float3)(u, v, beyond);
#else
    const float d = list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
    return (float3)(u / d, v / d, beyond * depths.reciprocal / d);
#endif
}
#else
typedef float ListDepth;
#define LIST_DEPTH(t) (t)
#define DEPTHS_OF(ray) depth_origin

inline float list_form(__global const float *form, float a, float b, ListDepth t)
{
    return fma(t, form_slope(form, a, b), form_value(form, a, b));
}
#endif

#ifdef CROPPED
// The kept parts of a ray from t_deep, where r is 0, to t_other. Over the homogeneous denominator, what is affine in t is
// linear in r.
inline Kept kept_list_parts(__global const float *forms, int planes, float a, float b, ListDepth t_deep,
                            ListDepth t_other, float r_other, uint regions)
{
    __global const float *form = forms + (PLANE_FORMS + planes) * FORM_SIZE;
    float at_deep[CROPPING_PLANES], at_other[CROPPING_PLANES];
    float w_deep = 1.0f, w_other = 1.0f;
#ifndef PARALLEL
    w_deep = 1.0f / list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_deep);
    w_other = 1.0f / list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_other);
#endif
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        at_deep[k] = list_form(form, a, b, t_deep) * w_deep;
        at_other[k] = list_form(form, a, b, t_other) * w_other;
    }
    return kept_parts(at_deep, at_other, 0.0f, r_other, regions);
}
#endif

// `forms`: list coordinates, model direction, then `planes` to clip to, then those of cropping if CROPPED; the ray ends at
// `t_end`. Returns false where it misses.
inline bool begin_list_ray(ListRay *ray, __global const float *forms, int planes, CROPPING_PARAMETER float a, float b,
                           float t_end, float depth_origin)
{
#ifdef FAR_ENTRIES
    float2 t0;
    float t_length;
    if (!clip_from_entry(forms + PLANE_FORMS * FORM_SIZE, planes, a, b, t_end, &t0, &t_length))
        return false;
    const float2 t1 = pair_sum(t0, (float2)(t_length, 0.0f));
    const float2 offset = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t0);
    const float2 end_offset = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t1);
    const bool end_is_deep = !pair_less(end_offset, offset);
    ray->depths.deep = end_is_deep == DEEP_IS_ZERO ? end_offset : offset;
    ray->depths.reciprocal = 1.0f / (ray->depths.deep.x + depth_origin);
    ray->depths.depth_origin = depth_origin;
    const float3 start = list_point(forms, a, b, t0, offset, ray->depths);
    const float3 end = list_point(forms, a, b, t1, end_offset, ray->depths);
#else
    float t0 = -INFINITY;
    float t1 = t_end;
    if (!clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, planes, a, b, &t0, &t1))
        return false;
    const float t_length = t1 - t0;
    const float3 start = list_point(forms, a, b, t0);
    const float3 end = list_point(forms, a, b, t1);
#endif
    ray->t_begin = LIST_DEPTH(t0);
    ray->start = start;
    ray->along = end - start;
    ray->away = ray->along.z >= 0.0f;
    const bool ends_at_zero = ray->away == DEEP_IS_ZERO;
    ray->deep = ends_at_zero ? end : start;
    ray->r_begin = ends_at_zero ? -1.0f : 0.0f;
    ray->scale = t_length * model_speed(forms, a, b);
#ifndef PARALLEL
    ray->scale *= reciprocal_depth(start.z, DEPTHS_OF(ray)) * reciprocal_depth(end.z, DEPTHS_OF(ray));
#endif
#ifdef SEGMENTS
    ray->t_deep = LIST_DEPTH(ends_at_zero ? t1 : t0);
    ray->t_scale = t_length;
#ifndef PARALLEL
    ray->t_scale *= reciprocal_depth(ends_at_zero ? start.z : end.z, DEPTHS_OF(ray));
#endif
#endif
#ifdef CROPPED
    ray->kept = kept_list_parts(forms, planes, a, b, ends_at_zero ? t1 : t0, ends_at_zero ? t0 : t1,
                                ends_at_zero ? -1.0f : 1.0f, regions);
    return ray->kept.count > 0;
#else
    return true;
#endif
}

#ifdef SEGMENTS
// t at r, whose depth coordinate is z. With w = 1/Z linear in r and Z linear in t, the share of the ray between r and its
// deep end is r w_shallow / w(r): small where r is, so that nothing cancels there.
inline float ray_depth(const ListRay *ray, float r, float z, Depths depths)
{
#ifdef PARALLEL
    return fma(r, ray->t_scale, ray->t_deep);
#else
    return ray->t_deep + r * ray->t_scale / reciprocal_depth(z, depths);
#endif
}
#endif

// Model length from r = from to r = to, whose depth coordinates are z_from and z_to.
inline float model_length(float scale, float from, float z_from, float to, float z_to, Depths depths)
{
#ifdef PARALLEL
    return scale * (to - from);
#else
    return scale * (to - from) / (reciprocal_depth(z_from, depths) * reciprocal_depth(z_to, depths));
#endif
}

// Model length of what is not cropped away from r = from to r = to.
inline float length_drawn(const ListRay *ray, float from, float to, Depths depths)
{
#ifdef CROPPED
    float sum = 0.0f;
    for (int n = 0; n < ray->kept.count; ++n) {
        float r_from = from, r_to = to;
        cut_to_part(&ray->kept, n, &r_from, &r_to);
        if (r_from < r_to)
            sum += model_length(ray->scale, r_from, fma(r_from, ray->along.z, ray->deep.z), r_to,
                                fma(r_to, ray->along.z, ray->deep.z), depths);
    }
    return sum;
#else
    return model_length(ray->scale, from, fma(from, ray->along.z, ray->deep.z), to, fma(to, ray->along.z, ray->deep.z),
                        depths);
#endif
}

#ifdef SEGMENTS
// How many parts of the ray are drawn, and the part of [*from, *to] that lies in the n-th; empty where not *from < *to.
inline int drawn_parts(const ListRay *ray)
{
#ifdef CROPPED
    return ray->kept.count;
#else
    return 1;
#endif
}

inline void cut_to_drawn_part(const ListRay *ray, int n, float *from, float *to)
{
#ifdef CROPPED
    cut_to_part(&ray->kept, n, from, to);
#endif
}
#endif

// Where, from r = from on, the ray is first in what is not cropped away.
inline float first_drawn(const ListRay *ray, float from)
{
#ifdef CROPPED
    for (int n = 0; n < ray->kept.count; ++n) {
        if (from < ray->kept.to[n])
            return fmax(from, ray->kept.from[n]);
    }
#endif
    return from;
}
