// The joint picture of several VDIs: rays' streams of segments, merged by depth and composited
// front to back, a ray or a block of 4 x 4 in a work-item (lib/lanes.cl).
//
// Every VDI is piecewise constant along a ray, so all of them together are: where several segments
// cover a piece of the ray, their extinctions add and the colour is the mean by extinction
// (docs/dev/conventions.md, "Several VDIs"). Streams are walked together from boundary to boundary:
// each turn composites one piece, and comes to the next segment of those streams whose segment ends
// there. The sums are formed in the order of the streams.
//
// -D STREAMS   how many VDIs
#include "lib/rays.cl"
#include "lib/compositing.cl"
#include "multi_vdi/pool.cl"
#pragma OPENCL FP_CONTRACT OFF

// The rays' streams of one VDI: slots of the segments that are not behind what has been composited,
// and of those behind the last ones. At the end of a stream a segment begins at infinity.
typedef struct {
    Int slots, ends;
    Segments at;
} Stream;

// Load the segments of the rays that are chosen.
inline void come_to_segments(Stream *stream, __global const float *rows, int capacity, Int chosen)
{
    const Int left = chosen && stream->slots < stream->ends;
    const Segments next = load_segments(rows, SELECT((Int)(0), stream->slots, left), capacity);
    stream->at.from = SELECT(stream->at.from, SELECT((Real)(INFINITY), next.from, left), chosen);
    stream->at.to = SELECT(stream->at.to, SELECT((Real)(INFINITY), next.to, left), chosen);
    stream->at.optical_depth = SELECT(stream->at.optical_depth, next.optical_depth, left);
    stream->at.color.x = SELECT(stream->at.color.x, next.color.x, left);
    stream->at.color.y = SELECT(stream->at.color.y, next.color.y, left);
    stream->at.color.z = SELECT(stream->at.color.z, next.color.z, left);
}

KERNEL_OF_LANES void
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
      __global int
          *needed, // slots that a ray of each cell needs; over the capacity, the ray is not drawn
      __global float4 *image, // premultiplied RGBA, top row first
      __global short *owner)  // the VDI to which each pixel belongs, top row first; -1: to none
{
    const int first_ray = (int)get_global_id(0) * LANES;
    const Rays pixel = rays_at(cell_pixel(cells + first_cell, first_ray), width, height);
    if (!ANY(pixel.present))
        return;
    // Has every segment found room?
    const Int used =
        SELECT((Int)(0), LOAD_LANES(0, ends + (STREAMS - 1) * rays + first_ray), pixel.present);
    const int most = largest_lane(used);
    __global int *const needed_here = needed + first_cell + first_ray / CELL_ITEMS;
    if (most > *needed_here) // an old value is only lower, and does no harm
        atomic_max(needed_here, most);
    if (most > capacity)
        return;

    // A pixel belongs to the first VDI that surely covers it, or else to the first that it meets
    Int owned_by = -1;
    Int grades = 0;
    for (int vdi = 0; vdi < STREAMS; ++vdi) {
        const Int meets = TO_INT(LOAD_LANES(0, contributes + streams_of[vdi] * rays + first_ray));
        owned_by = SELECT(owned_by, (Int)(vdi), meets > grades);
        grades = max(meets, grades);
    }
    const Int place = places_in_picture(pixel.x, pixel.y, pixel.present, width, height);
    const Places places = {place}, owners = {owned_by};
    for (int k = 0; k < LANES; ++k)
        if (places.each[k] >= 0)
            owner[places.each[k]] = (short)owners.each[k];

    __global const float *const rows = pool_of(pool, first_ray, capacity);
    Stream streams[STREAMS];
    Int first = 0;
    for (int j = 0; j < STREAMS; ++j) {
        streams[j].slots = first;
        first = streams[j].ends =
            SELECT((Int)(0), LOAD_LANES(0, ends + j * rays + first_ray), pixel.present);
        streams[j].at.optical_depth = streams[j].at.color.x = streams[j].at.color.y =
            streams[j].at.color.z = 0.0f;
        streams[j].at.from = streams[j].at.to = INFINITY;
        come_to_segments(&streams[j], rows, capacity, pixel.present);
    }
    Seen seen = nothing_seen();
    Real reached = -INFINITY;
    while (true) {
        // Find the next piece that no segment begins or ends in
        Real begin = INFINITY, end = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            begin = LOWER_OF(begin, HIGHER_OF(streams[j].at.from, reached));
        const Int goes = begin < INFINITY && !(seen.sums.w < transmittance_cutoff);
        if (!ANY(goes))
            break;
        for (int j = 0; j < STREAMS; ++j)
            end = LOWER_OF(
                end, SELECT(streams[j].at.from, streams[j].at.to, streams[j].at.from <= begin));

        // Sum up its medium: optical depths, and colours times them
        Real optical_depth = 0.0f, red = 0.0f, green = 0.0f, blue = 0.0f;
        Real4 color; // of the last one
        color.x = color.y = color.z = color.w = 0.0f;
        Int covering = 0;
        for (int j = 0; j < STREAMS; ++j) {
            const Segments at = streams[j].at;
            const Int covers = goes && at.from <= begin;
            const Int ends_here = covers && at.to <= end;
            // A segment that nothing cuts keeps its optical depth, however short it is in t
            const Real share = SELECT((end - begin) / (at.to - at.from), (Real)(1.0f),
                                      ends_here && at.from >= begin);
            const Real part = SELECT((Real)(0.0f), at.optical_depth * share, covers);
            red += part * at.color.x;
            green += part * at.color.y;
            blue += part * at.color.z;
            optical_depth += part;
            color.x = SELECT(color.x, at.color.x, covers);
            color.y = SELECT(color.y, at.color.y, covers);
            color.z = SELECT(color.z, at.color.z, covers);
            covering += COUNT(covers);
            if (ANY(ends_here)) {
                streams[j].slots += COUNT(ends_here);
                come_to_segments(&streams[j], rows, capacity, ends_here);
            }
        }
        const Int several = covering > 1;
        const Real per_depth = 1.0f / optical_depth;        // one division, not three
        const Int meets = goes && optical_depth >= FLT_MIN; // of less, the reciprocal is not finite
        color.x = SELECT(color.x, red * per_depth, several);
        color.y = SELECT(color.y, green * per_depth, several);
        color.z = SELECT(color.z, blue * per_depth, several);
        composite_medium(&seen, optical_depth, color, meets);
        reached = SELECT(reached, end, goes);
    }
    store_fours(image, place, composited(&seen));
}
