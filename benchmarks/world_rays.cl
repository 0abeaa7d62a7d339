// Lochmann et al. 2016: a ray of the new view is projected into V_O's image, a DDA gives the lists
// that the projection runs through, and each supersegment, a truncated pyramid in the world, is
// intersected there. Everything is affine in t: U d and V d, where list (i, j) is i <= U < i + 1,
// j <= V < j + 1; Z less the depth origin; and d, which is Z, or 1 in parallel projection.
//
// -D BINARY_SEARCH  a list's first supersegment by halving, not by looking from its beginning
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
    const Rays of = rays_at(pixel, width, height);
    const size_t place = (size_t)(height - 1 - pixel.y) * width + pixel.x;
    ViewRay ray = {.place = place, .t0 = -INFINITY, .t1 = INFINITY};
    __global const float *clipped = forms + PLANE_FORMS * FORM_SIZE;
    ray.present = of.present && clip_to_planes(clipped, planes, of.a, of.b, &ray.t0, &ray.t1);
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

// Lists along one axis of V_O's image, between the projections of the ray's two ends.
typedef struct {
    int at, last, step;
} Dda;

inline Dda dda_between(float from, float to, int lists)
{
    Dda dda;
    dda.at = clamp((int)floor(from), 0, lists - 1);
    dda.last = clamp((int)floor(to), 0, lists - 1);
    dda.step = dda.last > dda.at ? 1 : -1;
    return dda;
}

// t at which the ray leaves the present lists: at the plane through V_O's eye and their border.
inline float leaves_at(const Dda *dda, float value, float slope, float d_value, float d_slope)
{
    if (dda->at == dda->last)
        return INFINITY;
    const float border = (float)(dda->at + (dda->step > 0));
    return -(value - border * d_value) / (slope - border * d_slope);
}

// The first supersegment, in the ray's sense, that reaches behind depth z; the end if none does.
inline int first_behind(__global const float2 *faces, int begin, int end, float z, bool away)
{
    int n = away ? begin : end - 1;
#ifdef BINARY_SEARCH
    int low = begin, high = end;
    while (low < high) {
        const int middle = (low + high) >> 1;
        const bool before = away ? faces[middle].y <= z : faces[middle].x < z;
        low = before ? middle + 1 : low;
        high = before ? high : middle;
    }
    n = away ? low : low - 1;
#else
    while (n >= begin && n < end && (away ? faces[n].y <= z : faces[n].x >= z))
        n += away ? 1 : -1;
#endif
    return n;
}

__kernel void world_rays(
    __global const int *offsets,
    __global const float2 *faces, // view depths less the depth origin
    __global const float4 *media, // straight RGB, extinction per model length
    int lists_wide, int lists_high,
    __global const float *forms, int planes,
    int width, int height,
    float cutoff,                 // transmittance at which a ray ends
    __global float4 *image)
{
    const int2 pixel = block_pixel((uint)get_global_id(0), width);
    if (!rays_at(pixel, width, height).present)
        return;
    const ViewRay ray = view_ray(pixel, width, height, forms, planes);
    Seen seen = nothing_seen();
    if (ray.present) {
        const float4 p0 = fma((float4)(ray.t0), ray.slope, ray.value);
        const float4 p1 = fma((float4)(ray.t1), ray.slope, ray.value);
        Dda u = dda_between(p0.x / p0.w, p1.x / p1.w, lists_wide);
        Dda v = dda_between(p0.y / p0.w, p1.y / p1.w, lists_high);
        const bool away = ray.slope.z >= 0.0f;
        float enters = ray.t0;
        while (true) {
            const float t_u = leaves_at(&u, ray.value.x, ray.slope.x, ray.value.w, ray.slope.w);
            const float t_v = leaves_at(&v, ray.value.y, ray.slope.y, ray.value.w, ray.slope.w);
            const float leaves = fmax(enters, fmin(ray.t1, fmin(t_u, t_v)));
            const int list = v.at * lists_wide + u.at;
            const int begin = offsets[list], end = offsets[list + 1];
            const float z = fma(enters, ray.slope.z, ray.value.z);
            for (int n = first_behind(faces, begin, end, z, away); n >= begin && n < end; n += away ? 1 : -1) {
                float from = enters, to = leaves;
                keep_between(&ray, faces[n], &from, &to);
                if (from >= leaves)
                    break;
                if (from < to)
                    composite_medium(&seen, (to - from) * ray.speed * media[n].w, media[n], true);
            }
            if (leaves >= ray.t1 || seen.sums.w < cutoff)
                break;
            enters = leaves;
            if (t_u <= t_v)
                u.at += u.step;
            else
                v.at += v.step;
        }
    }
    image[ray.place] = composited(&seen);
}
