// A ray in V_O's list space: point(r) = deep + r along (paper, section 3: from t_near to t_far).
//
// r runs along a ray over an interval of length 1 and is 0 at the end that is deeper in V_O, where
// the interpolated 1/Z is smallest and its rounding matters most.
//
// -D CROPPED=0, 1           only parts of it are drawn, see lib/cropping.cl
// -D DOUBLE_FLOAT_RAYS=2    r is 0 at the other end, `deep` is that one and Z_deep is its depth:
// the
//                           lists lie near it
#include "lib/list_space.cl"
#include "lib/cropping.cl"
#include "raycasting/frame.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    bool present;       // it meets what it is clipped to, and something of it is kept
    float3 start;       // where it enters that: u, v, depth coordinate
    float3 deep, along; // u and v that change by less than a normal number do not change
    bool away;          // from V_O: depth does not decrease along the ray
    Depths depths;
    float r_begin;         // 0 or -1; it ends at r_begin + 1
    float scale;           // model length per unit of r, but for w(r_a) w(r_b) in perspective
    float t_begin, t_deep; // t where it begins, and where r is 0
    float t_scale;         // t per unit of r, but for the division by w(r) in perspective
    Kept kept;             // parts of it, in r
} ListRay;

// t on a ray; where it begins and ends; a form, and (u, v, depth coordinate), there.
#ifdef DOUBLE_FLOAT_RAYS
typedef float2 Time;
typedef struct {
    bool present;
    Time begin, end;
    float length;
} Span;

#define NEAREST_FLOAT(t) (t).x
#define ENDS_AT_ZERO(away) (DOUBLE_FLOAT_RAYS == 2 ? !(away) : (away)) // whether r is 0 at the end

inline Span clip_ray(__global const float *planes, int count, float a, float b, float t_end)
{
    Span span;
    float2 begin = (float2)(0.0f);
    float length = 1.0f;
    span.present = clip_from_entry(planes, count, a, b, t_end, &begin, &length);
    span.begin = begin;
    span.end = double_float_sum(begin, (float2)(length, 0.0f));
    span.length = length;
    return span;
}

inline float form_on_ray(__global const float *form, float a, float b, Time t)
{
    return form_at(form, a, b, t).x;
}

inline void set_depths(Depths *depths, __global const float *forms, float a, float b, Time t0,
                       Time t1, float depth_origin)
{
    const float2 start = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t0);
    const float2 end = form_at(forms + DEPTH_FORM * FORM_SIZE, a, b, t1);
    depths->deep = ENDS_AT_ZERO(!double_float_less(end, start)) ? end : start;
    depths->reciprocal = 1.0f / (depths->deep.x + depth_origin);
    depths->depth_origin = depth_origin;
}

// The offset is handed in: with its form in here, Intel's compiler for CPUs mixes up rays.
inline float3 point_of_offset(__global const float *forms, float a, float b, Time t, float2 offset,
                              Depths depths)
{
    const float u = form_on_ray(forms + U_FORM * FORM_SIZE, a, b, t);
    const float v = form_on_ray(forms + V_FORM * FORM_SIZE, a, b, t);
    const float beyond = double_float_sum(offset, -depths.deep).x;
    const float d =
        DEPTH == PARALLEL ? 1.0f : form_on_ray(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
    const float scale = DEPTH == PARALLEL ? 1.0f : depths.reciprocal;
    return (float3)(u / d, v / d, beyond * scale / d);
}

#define point_on_ray(forms, a, b, t, depths)                                                       \
    point_of_offset(forms, a, b, t, form_at((forms) + DEPTH_FORM * FORM_SIZE, a, b, t), depths)
#else
typedef float Time;
typedef struct {
    bool present;
    Time begin, end;
    float length;
} Span;

#define NEAREST_FLOAT(t) (t)
#define ENDS_AT_ZERO(away) (away)
#define form_on_ray(form, a, b, t) list_form(form, a, b, t)
#define set_depths(depths, forms, a, b, t0, t1, depth_origin) (*(depths) = (depth_origin))
#define point_on_ray(forms, a, b, t, depths) list_point(forms, a, b, t)

inline Span clip_ray(__global const float *planes, int count, float a, float b, float t_end)
{
    Span span;
    float t0 = -INFINITY, t1 = t_end;
    span.present = clip_to_planes(planes, count, a, b, &t0, &t1);
    span.begin = span.present ? t0 : 0.0f; // where nothing is to be drawn, anything finite
    span.end = span.present ? t1 : 1.0f;
    span.length = span.end - span.begin;
    return span;
}
#endif

// 1 / Z at r. Not used in parallel projection.
inline float reciprocal_depth_at(const ListRay *ray, float r)
{
    return reciprocal_depth(fma(r, ray->along.z, ray->deep.z), ray->depths);
}

#include "raycasting/lengths.cl"

// Begin the ray of pixel offsets (a, b), which ends at `t_end`. `forms`: list coordinates, model
// direction, planes to clip to, then those of cropping if CROPPED.
inline void begin_ray(ListRay *ray, __global const float *forms, const Frame *frame, float a,
                      float b, float t_end)
{
    // Clip it to the bounds, to V_O's viewport and to planes
    const Span span = clip_ray(forms + PLANE_FORMS * FORM_SIZE, frame->planes, a, b, t_end);
    const Time t0 = span.begin, t1 = span.end;
    ray->present = span.present;
    // Bring both ends to list space
    set_depths(&ray->depths, forms, a, b, t0, t1, frame->depth_origin);
    ray->start = point_on_ray(forms, a, b, t0, ray->depths);
    const float3 end = point_on_ray(forms, a, b, t1, ray->depths);
    ray->along = end - ray->start;
    ray->along.x =
        fabs(ray->along.x) < FLT_MIN ? 0.0f : ray->along.x; // its reciprocal is not finite
    ray->along.y = fabs(ray->along.y) < FLT_MIN ? 0.0f : ray->along.y;
    ray->away = ray->along.z >= 0.0f;
    // Let r be 0 at the deep end
    const bool ends_at_zero = ENDS_AT_ZERO(ray->away);
    ray->deep = ends_at_zero ? end : ray->start;
    ray->r_begin = ends_at_zero ? -1.0f : 0.0f;
    // Lengths and t per unit of r
    ray->t_begin = NEAREST_FLOAT(t0);
    ray->t_deep = NEAREST_FLOAT(ends_at_zero ? t1 : t0);
    ray->t_scale = span.length;
    ray->scale = span.length * model_speed(forms, a, b);
    if (DEPTH != PARALLEL) {
        ray->scale *=
            reciprocal_depth(ray->start.z, ray->depths) * reciprocal_depth(end.z, ray->depths);
        ray->t_scale *= reciprocal_depth(ends_at_zero ? ray->start.z : end.z, ray->depths);
    }
    if (CROPPED) {
        ray->kept =
            kept_parts_of_ray(forms, frame->planes, a, b, ends_at_zero ? t1 : t0,
                              ends_at_zero ? t0 : t1, ends_at_zero ? -1.0f : 1.0f, frame->regions);
        ray->present = ray->present && ray->kept.count > 0;
    }
}
