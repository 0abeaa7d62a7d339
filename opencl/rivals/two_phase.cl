// Brady et al. 1997: rays of V_O are composited over levels of equal depth, once; a nearby view blends the levels, each a
// rectangle with a picture, resampled bilinearly (docs/rivals.md). What a new ray crosses of a cell is not asked.
#include "rivals/view_rays.cl"
#pragma OPENCL FP_CONTRACT OFF

// Phase one, a work-item per list and level.
__kernel void cut_cells(
    __global const int *offsets, __global const float2 *faces, __global const float4 *media,
    float first, float thickness, int levels,   // view depth less the origin
    __global const float *forms, int planes,    // V_O's own
    int lists_wide, int lists_high,
    __global float4 *cells)                     // premultiplied, (levels, lists)
{
    const size_t lists = (size_t)lists_wide * lists_high;
    const int list = (int)(get_global_id(0) % lists), level = (int)(get_global_id(0) / lists);
    if (level >= levels)
        return;
    const ViewRay ray = view_ray((int2)(list % lists_wide, list / lists_wide), lists_wide, lists_high, forms, planes);
    const float from = fmax(first + level * thickness, point_at(&ray, ray.t0).z);
    const float to = fmin(first + (level + 1) * thickness, point_at(&ray, ray.t1).z);
    Seen seen = nothing_seen();
    for (int n = offsets[list]; n < offsets[list + 1] && ray.present; ++n) {
        const float crossed = fmin(faces[n].y, to) - fmax(faces[n].x, from);
        if (crossed > 0.0f)
            composite_medium(&seen, crossed * ray.speed * media[n].w, media[n], true); // t is V_O's depth
    }
    cells[get_global_id(0)] = composited(&seen);
}

inline float4 cell_at(__global const float4 *level, int x, int y, int wide, int high)
{
    return x >= 0 && y >= 0 && x < wide && y < high ? level[y * wide + x] : (float4)(0.0f);
}

// Phase two.
__kernel void blend_levels(
    __global const float4 *cells, float first, float thickness, int levels,
    int lists_wide, int lists_high,
    __global const float *forms, int planes,
    int width, int height, float first_t, // of rays: the eye
    __global float4 *image)
{
    const int2 pixel = block_pixel((uint)get_global_id(0), width);
    if (!ray_of_pixel(pixel, width, height).present)
        return;
    const ViewRay ray = view_ray(pixel, width, height, forms, planes);
    float4 seen = (float4)(0.0f);
    for (int n = 0; n < levels; ++n) {
        const int level = ray.slope.z >= 0.0f ? n : levels - 1 - n;
        const float t = (first + (level + 0.5f) * thickness - ray.value.z) / ray.slope.z;
        const float4 at = point_at(&ray, t);
        if (!(isfinite(t) && t > first_t && at.w > 0.0f))
            continue;
        const float2 place = clamp(at.xy / at.w - 0.5f, -2.0f, (float2)(lists_wide + 1, lists_high + 1));
        const float2 corner = floor(place), share = place - corner;
        const int x = (int)corner.x, y = (int)corner.y;
        __global const float4 *picture = cells + (size_t)level * lists_wide * lists_high;
        const float4 low = mix(cell_at(picture, x, y, lists_wide, lists_high),
                               cell_at(picture, x + 1, y, lists_wide, lists_high), share.x);
        const float4 high = mix(cell_at(picture, x, y + 1, lists_wide, lists_high),
                                cell_at(picture, x + 1, y + 1, lists_wide, lists_high), share.x);
        seen += (1.0f - seen.w) * mix(low, high, share.y);
    }
    image[ray.place] = seen;
}
