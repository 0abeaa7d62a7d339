// The ray of a pixel of V_N in V_O's list space: point(r) = deep + r along.
//
// r runs along the ray over an interval of length 1 and is 0 at the end that is deeper in V_O, where the interpolated 1/Z is
// smallest and its rounding matters most.
#include "common/list_space.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    float3 start; // where it enters what it is clipped to: u, v, depth coordinate
    float3 deep, along;
    bool away;     // from V_O: depth does not decrease along the ray
    float r_begin; // 0 or -1; it ends at r_begin + 1
    float scale;   // model length per unit of r, but for the division by w(r_a) w(r_b) in perspective
    float t_begin; // where it enters, as t
} ListRay;

// `forms`: list coordinates, model direction, then `planes` to clip to; the ray ends at `t_end`. Returns false where it
// misses.
inline bool begin_list_ray(ListRay *ray, __global const float *forms, int planes, float a, float b, float t_end,
                           float depth_origin)
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
    return true;
}

// Model length from r = from to r = to, whose depth coordinates are z_from and z_to.
inline float model_length(float scale, float from, float z_from, float to, float z_to, float depth_origin)
{
#ifdef PARALLEL
    return scale * (to - from);
#else
    return scale * (to - from) / (reciprocal_depth(z_from, depth_origin) * reciprocal_depth(z_to, depth_origin));
#endif
}
