// The renderers that docs/baselines.md measures: rays of a new view in V_O's homogeneous coordinates. The product has none of this.
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

// Lochmann et al. 2016: a ray of the new view is projected into V_O's image, a DDA gives the lists that the projection runs
// through, and each supersegment, a truncated pyramid in the world, is intersected there.
//
// -D BINARY_SEARCH  a list's first supersegment by halving; otherwise the list is looked through from its beginning

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

// Frey, Sadlo, Ertl 2013 without OpenGL: every supersegment is a truncated frustum, projected into the new view, in an order in
// which none hides an earlier one, and composited over the pixels that it covers. Pixels are dealt in tiles.
#define TILE 4 // pixels along its edges

// Tiles that the k-th frustum of the order may cover, the last ones excluded.
inline int4 tiles_of(int supersegment, int list, __global const float2 *faces, int lists_wide, __global const float *to_window,
                     float depth_origin, int parallel, int2 tiles)
{
    const float i = (float)(list % lists_wide), j = (float)(list / lists_wide);
    float2 low = (float2)(INFINITY), high = (float2)(-INFINITY);
    for (int corner = 0; corner < 8; ++corner) {
        const float z = (corner & 4) ? faces[supersegment].y : faces[supersegment].x;
        const float d = parallel ? 1.0f : z + depth_origin;
        const float4 at = (float4)((i + (corner & 1)) * d, (j + (corner >> 1 & 1)) * d, z, 1.0f);
        const float w = dot(vload4(2, to_window), at);
        if (w <= to_window[12]) // not in front of the new eye
            return (int4)(0, 0, tiles);
        const float2 pixel = (float2)(dot(vload4(0, to_window), at), dot(vload4(1, to_window), at)) / w;
        low = fmin(low, pixel);
        high = fmax(high, pixel);
    }
    const float2 last = convert_float2(tiles);
    const float2 first = clamp(floor((low - 0.1f) / TILE), 0.0f, last);
    const float2 end = clamp(floor((high + 0.1f) / TILE) + 1.0f, 0.0f, last);
    return (int4)(convert_int2(first), convert_int2(end));
}

// How many tiles each frustum may cover; with `begins`, which, in the frusta's order.
__kernel void deal_to_tiles(
    int count,
    __global const int *order, // supersegments, nearest first
    __global const int *lists, // list of each supersegment
    __global const float2 *faces, int lists_wide,
    __global const float *to_window, // rows for x w, y w, w of window coordinates; then the least w
    float depth_origin, int parallel, int tiles_wide, int tiles_high,
    __global const int *begins, // or null
    __global int *numbers,      // (count), without `begins`
    __global ushort *tiles_met, // (pairs)
    __global int *frusta_met)
{
    const int k = (int)get_global_id(0);
    if (k >= count)
        return;
    const int s = order[k];
    const int4 met = tiles_of(s, lists[s], faces, lists_wide, to_window, depth_origin, parallel, (int2)(tiles_wide, tiles_high));
    if (!begins) {
        numbers[k] = (met.z - met.x) * (met.w - met.y);
        return;
    }
    int place = begins[k];
    for (int y = met.y; y < met.w; ++y) {
        for (int x = met.x; x < met.z; ++x) {
            tiles_met[place] = (ushort)(y * tiles_wide + x);
            frusta_met[place++] = s;
        }
    }
}

// A work-item per pixel, TILE x TILE of them to a tile.
__kernel void composite_tiles(
    __global const int *tile_begins, // (tiles + 1)
    __global const int *frusta,      // of each tile, nearest first
    __global const int *lists,
    __global const float2 *faces, __global const float4 *media, int lists_wide,
    __global const float *forms, int planes,
    int width, int height, int tiles_wide, int tile_count,
    __global float4 *image)
{
    const int tile = (int)(get_global_id(0) / (TILE * TILE)), pixel = (int)(get_global_id(0) % (TILE * TILE));
    if (tile >= tile_count)
        return;
    const int2 at = (int2)(tile % tiles_wide * TILE + pixel % TILE, tile / tiles_wide * TILE + pixel / TILE);
    if (at.x >= width || at.y >= height)
        return;
    const ViewRay ray = view_ray(at, width, height, forms, planes);
    Seen seen = nothing_seen();
    for (int k = tile_begins[tile]; ray.present && k < tile_begins[tile + 1]; ++k) {
        const int s = frusta[k];
        const float i = (float)(lists[s] % lists_wide), j = (float)(lists[s] / lists_wide);
        float from = ray.t0, to = ray.t1;
        keep(ray.value.x - i * ray.value.w, ray.slope.x - i * ray.slope.w, &from, &to);
        keep((i + 1) * ray.value.w - ray.value.x, (i + 1) * ray.slope.w - ray.slope.x, &from, &to);
        keep(ray.value.y - j * ray.value.w, ray.slope.y - j * ray.slope.w, &from, &to);
        keep((j + 1) * ray.value.w - ray.value.y, (j + 1) * ray.slope.w - ray.slope.y, &from, &to);
        keep_between(&ray, faces[s], &from, &to);
        if (from < to)
            composite_medium(&seen, (to - from) * ray.speed * media[s].w, media[s], true);
    }
    image[ray.place] = composited(&seen);
}

// Brady et al. 1997: rays of V_O are composited over levels of equal depth, once; a nearby view blends the levels, each a
// rectangle with a picture, resampled bilinearly. What a new ray crosses of a cell is not asked.

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
