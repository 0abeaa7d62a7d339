// Rays of a new view in V_O's homogeneous coordinates, for the rivals that docs/rivals.md measures. The product has none of this.
//
// Everything is affine in t: U d and V d, where list (i, j) is i <= U < i + 1 and j <= V < j + 1; Z less the depth origin;
// and d, which is Z, or 1 in parallel projection. No list space: what is met is met in the world.
#include "lib/list_space.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    bool present;        // in the window, and it meets what it is clipped to
    size_t place;        // of the pixel
    float t0, t1;        // where it does
    float speed;         // model length per unit of t
    float4 value, slope; // U d, V d, Z less the origin, d
} ViewRay;

inline ViewRay view_ray(int2 pixel, int width, int height, __global const float *forms, int planes)
{
    const Ray of = ray_of_pixel(pixel, width, height);
    ViewRay ray;
    ray.place = of.place;
    ray.t0 = -INFINITY;
    ray.t1 = INFINITY;
    ray.present = of.present && clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, planes, of.a, of.b, &ray.t0, &ray.t1);
    ray.speed = model_speed(forms, of.a, of.b);
    float value[4], slope[4];
    for (int k = 0; k < 4; ++k) {
        value[k] = form_value(forms + k * FORM_SIZE, of.a, of.b);
        slope[k] = form_slope(forms + k * FORM_SIZE, of.a, of.b);
    }
    ray.value = vload4(0, value);
    ray.slope = vload4(0, slope);
    return ray;
}

inline float4 point_at(const ViewRay *ray, float t)
{
    return fma((float4)(t), ray->slope, ray->value);
}

// Keep of [*t0, *t1] where value + t slope >= 0.
inline void keep(float value, float slope, float *t0, float *t1)
{
    const float t = -value / slope;
    if (slope > 0.0f)
        *t0 = fmax(*t0, t);
    else if (slope < 0.0f)
        *t1 = fmin(*t1, t);
    else if (value < 0.0f)
        *t1 = -INFINITY;
}

// Where the ray is between two depths, [*t0, *t1] cut to that.
inline void keep_between(const ViewRay *ray, float2 faces, float *t0, float *t1)
{
    if (ray->slope.z == 0.0f && ray->value.z == faces.y) // a back face belongs to what is behind it
        *t1 = -INFINITY;
    keep(ray->value.z - faces.x, ray->slope.z, t0, t1);
    keep(faces.y - ray->value.z, -ray->slope.z, t0, t1);
}
