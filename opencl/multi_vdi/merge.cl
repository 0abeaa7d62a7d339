// The joint picture of several VDIs: a ray's streams of segments, merged by depth and composited
// front to back, a ray in a work-item.
//
// Every VDI is piecewise constant along a ray, so all of them together are: where several segments
// cover a piece of the ray, their extinctions add and the colour is the mean by extinction
// (docs/conventions.md, "Several VDIs"). Streams are walked together from boundary to boundary:
// each turn composites one piece, and comes to the next segment of those streams whose segment ends
// there. The sums are formed in the order of the streams.
//
// -D STREAMS   how many VDIs
#include "lib/rays.cl"
#include "lib/compositing.cl"
#include "multi_vdi/pool.cl"
#pragma OPENCL FP_CONTRACT OFF

// A ray's stream of one VDI: the segment that is not behind what has been composited, its slot, and
// that behind the last one. At the end of a stream a segment begins at infinity.
typedef struct {
    int slot, end;
    Segments at;
} Stream;

inline void come_to_segment(Stream *stream, __global const float *rows)
{
    if (stream->slot >= stream->end) {
        stream->at.from = stream->at.to = INFINITY;
        return;
    }
    __global const float *const at = rows + SLOT(stream->slot);
    stream->at.from = at[0];
    stream->at.to = at[FLOATS_APART];
    stream->at.optical_depth = at[2 * FLOATS_APART];
    stream->at.color =
        (float4)(at[3 * FLOATS_APART], at[4 * FLOATS_APART], at[5 * FLOATS_APART], 0.0f);
}

__kernel void
merge(__global float *pool,              // see multi_vdi/pool.cl
      int capacity,                      // slots of a ray
      __global const int *ends,          // (streams, rays)
      __global const uchar *contributes, // (streams, rays), see multi_vdi/segments.cl
      int rays,                          // in the band
      __global const int2 *cells,        // see lib/rays.cl
      int first_cell,                    // the band's
      int width, int height,             // window of V_N
      float transmittance_cutoff,        // the ray ends where less than this is left
      __global const int *streams_of,    // (VDIs): the stream of each, in the order of the owners
      __global int *needed,   // slots that a ray of each cell needs; over the capacity, the
                              // ray is not drawn
      __global float4 *image, // premultiplied RGBA, top row first
      __global short *owner)  // the VDI to which each pixel belongs; -1: to none
{
    const int place = (int)get_global_id(0);
    const Ray pixel = ray_of_pixel(cell_pixel(cells + first_cell, place), width, height);
    if (!pixel.present)
        return;
    // Has every segment found room?
    const int used = ends[(STREAMS - 1) * rays + place];
    __global int *const needed_here = needed + first_cell + place / CELL_ITEMS;
    if (used > *needed_here) // an old value is only lower, and does no harm
        atomic_max(needed_here, used);
    if (used > capacity)
        return;

    // A pixel belongs to the first VDI that surely covers it, or else to the first that it meets
    int owned_by = -1, grade = 0;
    for (int vdi = 0; vdi < STREAMS; ++vdi) {
        const int meets = contributes[streams_of[vdi] * rays + place];
        owned_by = meets > grade ? vdi : owned_by;
        grade = max(meets, grade);
    }
    owner[pixel.place] = (short)owned_by;

    __global const float *const rows = pool_of(pool, place, capacity);
    Stream streams[STREAMS];
    for (int j = 0; j < STREAMS; ++j) {
        streams[j].slot = j > 0 ? streams[j - 1].end : 0;
        streams[j].end = ends[j * rays + place];
        come_to_segment(&streams[j], rows);
    }
    Seen seen = nothing_seen();
    float reached = -INFINITY;
    while (!(seen.sums.w < transmittance_cutoff)) {
        // Find the next piece that no segment begins or ends in
        float begin = INFINITY, end = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            begin = LOWER_OF(begin, HIGHER_OF(streams[j].at.from, reached));
        if (!(begin < INFINITY))
            break;
        for (int j = 0; j < STREAMS; ++j)
            end =
                LOWER_OF(end, streams[j].at.from <= begin ? streams[j].at.to : streams[j].at.from);

        // Sum up its medium: optical depths, and colours times them
        float optical_depth = 0.0f;
        float3 colors = (float3)(0.0f);
        float3 color = (float3)(0.0f); // of the last one
        int covering = 0;
        for (int j = 0; j < STREAMS; ++j) {
            const Segments at = streams[j].at;
            if (!(at.from <= begin))
                continue;
            const bool ends_here = at.to <= end;
            // A segment that nothing cuts keeps its optical depth, however short it is in t
            const float share =
                ends_here && at.from >= begin ? 1.0f : (end - begin) / (at.to - at.from);
            const float part = at.optical_depth * share;
            colors += part * at.color.xyz;
            optical_depth += part;
            color = at.color.xyz;
            ++covering;
            if (ends_here) {
                ++streams[j].slot;
                come_to_segment(&streams[j], rows);
            }
        }
        color = covering > 1 && optical_depth > 0.0f ? colors / optical_depth : color;
        composite_medium(&seen, optical_depth, (float4)(color, 0.0f), optical_depth > 0.0f);
        reached = end;
    }
    image[pixel.place] = composited(&seen);
}
