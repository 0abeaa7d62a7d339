// The merge of multi_vdi/merge.cl, a block of 4 x 4 rays in a work-item.
#define LANES 16
#define SEGMENT_ROWS 1
#include "cpu16/pixels.cl"
#include "cpu16/pool.cl"
#include "lib/compositing.cl"
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
    const Segments next = load_segments(rows, select((Int)(0), stream->slots, left), capacity);
    stream->at.from = select(stream->at.from, select((Real)(INFINITY), next.from, left), chosen);
    stream->at.to = select(stream->at.to, select((Real)(INFINITY), next.to, left), chosen);
    stream->at.optical_depth = select(stream->at.optical_depth, next.optical_depth, left);
    stream->at.color.x = select(stream->at.color.x, next.color.x, left);
    stream->at.color.y = select(stream->at.color.y, next.color.y, left);
    stream->at.color.z = select(stream->at.color.z, next.color.z, left);
}

KERNEL_OF_LANES void merge_blocks(
    __global float *pool,              // see multi_vdi/pool.cl
    int capacity,                      // slots of a ray
    __global const int *ends,          // (streams, rays)
    __global const uchar *contributes, // (streams, rays), see multi_vdi/segments.cl
    int rays,                          // in the band
    __global const int2 *cells,        // see lib/rays.cl
    int first_cell,                    // the band's
    int width, int height,             // window of V_N
    float transmittance_cutoff,        // the ray ends where less than this is left
    __global const int
        *streams_of, // (VDIs): the stream of each, in the order in which owners are numbered
    __global int
        *needed, // slots that a ray of each cell needs; over the capacity, the ray is not drawn
    __global float4 *image, // premultiplied RGBA, top row first
    __global short *owner)  // the VDI to which each pixel belongs, top row first; -1: to none
{
    const int first_ray = (int)get_global_id(0) * LANES;
    const int2 corner = cell_pixel(cells + first_cell, first_ray);
    const Int x = X_OF_BLOCK(corner);
    const Int y = Y_OF_BLOCK(corner);
    const Int in_window = x < width && y < height;
    if (!ANY(in_window))
        return;
    const Pixels pixels = pixels_at(x, y, in_window, width, height);
    const Int used =
        select((Int)(0), vload16(0, ends + (STREAMS - 1) * rays + first_ray), in_window);
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
        const Int meets = TO_INT(vload16(0, contributes + streams_of[vdi] * rays + first_ray));
        owned_by = select(owned_by, (Int)(vdi), meets > grades);
        grades = max(meets, grades);
    }
    int owners[LANES];
    STORE_LANES(owned_by, 0, owners);
    for (int k = 0; k < LANES; ++k) {
        if (pixels.wanted[k])
            owner[pixels.places[k]] = (short)owners[k];
    }

    __global const float *const rows = pool_of(pool, first_ray, capacity);
    Stream streams[STREAMS];
    Int first = 0;
    for (int j = 0; j < STREAMS; ++j) {
        streams[j].slots = first;
        first = streams[j].ends =
            select((Int)(0), vload16(0, ends + j * rays + first_ray), in_window);
        streams[j].at.optical_depth = streams[j].at.color.x = streams[j].at.color.y =
            streams[j].at.color.z = 0.0f;
        streams[j].at.from = streams[j].at.to = INFINITY;
        come_to_segments(&streams[j], rows, capacity, in_window);
    }
    Seen seen = nothing_seen();
    Real reached = -INFINITY;
    while (true) {
        // The next piece that no segment begins or ends in
        Real begin = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            begin = LOWER_OF(begin, HIGHER_OF(streams[j].at.from, reached));
        const Int goes = begin < INFINITY && !(seen.sums.w < transmittance_cutoff);
        if (!ANY(goes))
            break;
        Real end = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            end = LOWER_OF(
                end, select(streams[j].at.from, streams[j].at.to, streams[j].at.from <= begin));

        // Its medium
        Real optical_depth = 0.0f, red = 0.0f, green = 0.0f,
             blue = 0.0f; // colour times optical depth
        Real4 color;      // of the last one
        color.x = color.y = color.z = color.w = 0.0f;
        Int covering = 0;
        for (int j = 0; j < STREAMS; ++j) {
            const Segments at = streams[j].at;
            const Int covers = goes && at.from <= begin;
            const Int ends_here = covers && at.to <= end;
            // A segment that nothing cuts keeps its optical depth, however short it is in t
            const Real share = select((end - begin) / (at.to - at.from), (Real)(1.0f),
                                      ends_here && at.from >= begin);
            const Real part = select((Real)(0.0f), at.optical_depth * share, covers);
            red += part * at.color.x;
            green += part * at.color.y;
            blue += part * at.color.z;
            optical_depth += part;
            color.x = select(color.x, at.color.x, covers);
            color.y = select(color.y, at.color.y, covers);
            color.z = select(color.z, at.color.z, covers);
            covering += COUNT(covers);
            if (ANY(ends_here)) {
                streams[j].slots += COUNT(ends_here);
                come_to_segments(&streams[j], rows, capacity, ends_here);
            }
        }
        const Int several = covering > 1;
        const Real per_depth = 1.0f / optical_depth;        // one division, not three
        const Int meets = goes && optical_depth >= FLT_MIN; // of less, the reciprocal is not finite
        color.x = select(color.x, red * per_depth, several);
        color.y = select(color.y, green * per_depth, several);
        color.z = select(color.z, blue * per_depth, several);
        composite_medium(&seen, optical_depth, color, meets);
        reached = select(reached, end, goes);
    }
    write_pixels(image, &pixels, composited(&seen));
}
