// Frey, Sadlo, Ertl 2013 without OpenGL: every supersegment is a truncated frustum, projected into the new view, in an order in
// which none hides an earlier one, and composited over the pixels that it covers (docs/rivals.md). Pixels are dealt in tiles.
#include "rivals/view_rays.cl"
#pragma OPENCL FP_CONTRACT OFF

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
