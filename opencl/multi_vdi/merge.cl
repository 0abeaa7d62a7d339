// The joint picture of several VDIs: a ray's streams of segments, merged by depth and composited front to back.
//
// Every VDI is piecewise constant along a ray, so all of them together are: where several segments cover a piece of the ray,
// their extinctions add and the colour is the mean by extinction (docs/conventions.md, "Several VDIs"). Streams are walked
// together from boundary to boundary. The sums are formed in the order of the streams.
//
// -D STREAMS      how many VDIs
// -D SEGMENTS     see raycasting/segments.cl
// -D COMPENSATED  see lib/compositing.cl
#include "lib/rays.cl"
#include "lib/classification.cl"
#include "lib/compositing.cl"
#include "raycasting/segments.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void merge(
    __global const float *pool,         // see raycasting/segments.cl
    int capacity,                       // slots of a ray
    __global const int *ends,           // (streams, rays)
    __global const uchar *contributes,  // (streams, rays), see raycasting/raycast.cl
    int rays,                           // in the band
    __global const int2 *cells,         // see lib/rays.cl
    int first_cell,                     // the band's
    int width, int height,              // window of V_N
    float transmittance_cutoff,         // the ray ends where less than this is left
    __global const int *streams_of,     // (VDIs): the stream of each, in the order in which owners are numbered
    __global int *needed,               // slots that a ray of each cell needs; over the capacity, the ray is not drawn
    __global float4 *image,             // premultiplied RGBA, top row first
    __global short *owner)              // the VDI to which each pixel belongs, top row first; -1: to none
{
    const int ray = (int)get_global_id(0);
    const int2 pixel = cell_pixel(cells + first_cell, ray);
    if (pixel.x >= width || pixel.y >= height)
        return;
    const size_t place = (size_t)(height - 1 - pixel.y) * width + pixel.x;
    const int used = ends[(STREAMS - 1) * rays + ray];
    __global int *const needed_here = needed + first_cell + ray / CELL_ITEMS;
    if (used > *needed_here) // an old value is only lower, and does no harm
        atomic_max(needed_here, used);
    if (used > capacity)
        return;

    // A pixel belongs to the first VDI that surely covers it, or else to the first that it meets
    int owned_by = -1;
    int grade = 0;
    for (int vdi = 0; vdi < STREAMS; ++vdi) {
        const int meets = contributes[streams_of[vdi] * rays + ray];
        owned_by = meets > grade ? vdi : owned_by;
        grade = max(meets, grade);
    }
    owner[place] = (short)owned_by;

    // The segment of each stream that is not behind `reached`; at the end of a stream it begins at infinity
    int slot[STREAMS];
    float from[STREAMS];
    float to[STREAMS];
    for (int j = 0; j < STREAMS; ++j) {
        slot[j] = j > 0 ? ends[(j - 1) * rays + ray] : 0;
        const bool left = slot[j] < ends[j * rays + ray];
        from[j] = left ? SEGMENT(pool, ray, slot[j], capacity, SEGMENT_FROM) : INFINITY;
        to[j] = left ? SEGMENT(pool, ray, slot[j], capacity, SEGMENT_TO) : INFINITY;
    }
    float3 color = (float3)(0.0f);
    float transmittance = 1.0f;
    float4 rest = (float4)(0.0f);
    float reached = -INFINITY;
    while (transmittance >= transmittance_cutoff) {
        // The next piece that no segment begins or ends in
        float begin = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            begin = fmin(begin, fmax(from[j], reached));
        if (begin == INFINITY)
            break;
        float end = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            end = fmin(end, from[j] <= begin ? to[j] : from[j]);

        // Its medium
        float optical_depth = 0.0f;
        float3 weighted = (float3)(0.0f);
        float3 single = (float3)(0.0f);
        int covering = 0;
        for (int j = 0; j < STREAMS; ++j) {
            if (from[j] > begin)
                continue;
            const bool ends_here = to[j] <= end;
            // A segment that nothing cuts keeps its optical depth, however short it is in t
            const float share = ends_here && from[j] >= begin ? 1.0f : (end - begin) / (to[j] - from[j]);
            const float part = SEGMENT(pool, ray, slot[j], capacity, SEGMENT_OPTICAL_DEPTH) * share;
            single = (float3)(SEGMENT(pool, ray, slot[j], capacity, SEGMENT_COLOR),
                              SEGMENT(pool, ray, slot[j], capacity, SEGMENT_COLOR + 1),
                              SEGMENT(pool, ray, slot[j], capacity, SEGMENT_COLOR + 2));
            weighted += part * single;
            optical_depth += part;
            ++covering;
            if (ends_here) {
                ++slot[j];
                const bool left = slot[j] < ends[j * rays + ray];
                from[j] = left ? SEGMENT(pool, ray, slot[j], capacity, SEGMENT_FROM) : INFINITY;
                to[j] = left ? SEGMENT(pool, ray, slot[j], capacity, SEGMENT_TO) : INFINITY;
            }
        }
        if (optical_depth > 0.0f) {
            const float weight = transmittance * opacity_of(optical_depth); // over, front to back
            composite_over(&color, &transmittance, &rest, weight, covering == 1 ? single : weighted / optical_depth);
        }
        reached = end;
    }
    image[place] = composited(color, transmittance, rest);
}
