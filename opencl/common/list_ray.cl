// The ray of a pixel of V_N in V_O's list space: point(r) = deep + r along.
//
// r runs along the ray over an interval of length 1 and is 0 at the end that is deeper in V_O, where the interpolated 1/Z is
// smallest and its rounding matters most.
//
// -D CROPPED   see common/cropping.cl
#include "common/list_space.cl"
#include "common/cropping.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    float3 start; // where it enters what it is clipped to: u, v, depth coordinate
    float3 deep, along;
    bool away;     // from V_O: depth does not decrease along the ray
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

#ifdef CROPPED
// The kept parts of a ray from t_deep, where r is 0, to t_other. Over the homogeneous denominator, what is affine in t is
// linear in r.
inline Kept kept_list_parts(__global const float *forms, int planes, float a, float b, float t_deep, float t_other,
                            float r_other, uint regions)
{
    __global const float *form = forms + (PLANE_FORMS + planes) * FORM_SIZE;
    float at_deep[CROPPING_PLANES], at_other[CROPPING_PLANES];
    float w_deep = 1.0f, w_other = 1.0f;
#ifndef PARALLEL
    const float value = form_value(forms + DENOMINATOR_FORM * FORM_SIZE, a, b);
    const float slope = form_slope(forms + DENOMINATOR_FORM * FORM_SIZE, a, b);
    w_deep = 1.0f / fma(t_deep, slope, value);
    w_other = 1.0f / fma(t_other, slope, value);
#endif
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        at_deep[k] = fma(t_deep, form_slope(form, a, b), form_value(form, a, b)) * w_deep;
        at_other[k] = fma(t_other, form_slope(form, a, b), form_value(form, a, b)) * w_other;
    }
    return kept_parts(at_deep, at_other, 0.0f, r_other, regions);
}
#endif

// `forms`: list coordinates, model direction, then `planes` to clip to, then those of cropping if CROPPED; the ray ends at
// `t_end`. Returns false where it misses.
inline bool begin_list_ray(ListRay *ray, __global const float *forms, int planes, CROPPING_PARAMETER float a, float b,
                           float t_end, float depth_origin)
{
    float t0 = -INFINITY;
    float t1 = t_end;
    if (!clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, planes, a, b, &t0, &t1))
        return false;
    const float3 start = list_point(forms, a, b, t0);
    const float3 end = list_point(forms, a, b, t1);
    ray->t_begin = t0;
    ray->start = start;
    ray->along = end - start;
    ray->away = ray->along.z >= 0.0f;
    ray->deep = ray->away ? end : start;
    ray->r_begin = ray->away ? -1.0f : 0.0f;
    ray->scale = (t1 - t0) * model_speed(forms, a, b);
#ifndef PARALLEL
    ray->scale *= reciprocal_depth(start.z, depth_origin) * reciprocal_depth(end.z, depth_origin);
#endif
#ifdef SEGMENTS
    ray->t_deep = ray->away ? t1 : t0;
    ray->t_scale = t1 - t0;
#ifndef PARALLEL
    ray->t_scale *= reciprocal_depth(ray->away ? start.z : end.z, depth_origin);
#endif
#endif
#ifdef CROPPED
    ray->kept = kept_list_parts(forms, planes, a, b, ray->away ? t1 : t0, ray->away ? t0 : t1,
                                ray->away ? -1.0f : 1.0f, regions);
    return ray->kept.count > 0;
#else
    return true;
#endif
}

#ifdef SEGMENTS
// t at r, whose depth coordinate is z. With w = 1/Z linear in r and Z linear in t, the share of the ray between r and its
// deep end is r w_shallow / w(r): small where r is, so that nothing cancels there.
inline float ray_depth(const ListRay *ray, float r, float z, float depth_origin)
{
#ifdef PARALLEL
    return fma(r, ray->t_scale, ray->t_deep);
#else
    return ray->t_deep + r * ray->t_scale / reciprocal_depth(z, depth_origin);
#endif
}
#endif

// Model length from r = from to r = to, whose depth coordinates are z_from and z_to.
inline float model_length(float scale, float from, float z_from, float to, float z_to, float depth_origin)
{
#ifdef PARALLEL
    return scale * (to - from);
#else
    return scale * (to - from) / (reciprocal_depth(z_from, depth_origin) * reciprocal_depth(z_to, depth_origin));
#endif
}

// Model length of what is not cropped away from r = from to r = to.
inline float length_drawn(const ListRay *ray, float from, float to, float depth_origin)
{
#ifdef CROPPED
    float sum = 0.0f;
    for (int n = 0; n < ray->kept.count; ++n) {
        float r_from = from, r_to = to;
        cut_to_part(&ray->kept, n, &r_from, &r_to);
        if (r_from < r_to)
            sum += model_length(ray->scale, r_from, fma(r_from, ray->along.z, ray->deep.z), r_to,
                                fma(r_to, ray->along.z, ray->deep.z), depth_origin);
    }
    return sum;
#else
    return model_length(ray->scale, from, fma(from, ray->along.z, ray->deep.z), to, fma(to, ray->along.z, ray->deep.z),
                        depth_origin);
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
