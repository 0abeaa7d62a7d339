// Lochmann et al. 2016: a ray of the new view is projected into V_O's image, a DDA gives the lists that the projection runs
// through, and each supersegment, a truncated pyramid in the world, is intersected there (docs/rivals.md).
//
// -D BINARY_SEARCH  a list's first supersegment by halving; otherwise the list is looked through from its beginning
#include "rivals/view_rays.cl"
#pragma OPENCL FP_CONTRACT OFF

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

// t at which the ray leaves the present lists: it meets the plane through V_O's eye and their border.
inline float leaves_at(const Dda *dda, float value, float slope, float d_value, float d_slope)
{
    if (dda->at == dda->last)
        return INFINITY;
    const float border = (float)(dda->at + (dda->step > 0));
    return -(value - border * d_value) / (slope - border * d_slope);
}

// The first supersegment, in the ray's sense, that reaches behind depth z; list_end if there is none.
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
    if (!ray_of_pixel(pixel, width, height).present)
        return;
    const ViewRay ray = view_ray(pixel, width, height, forms, planes);
    Seen seen = nothing_seen();
    if (ray.present) {
        const float4 p0 = point_at(&ray, ray.t0), p1 = point_at(&ray, ray.t1);
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
