// The joint picture of several VDIs: what multi_vdi/merge.cl does, for a block of 4 x 4 rays (raycasting/blocks.cl) in vectors.
//
// In each turn every ray of the block composites one piece, and comes to the next segment of those streams whose segment ends
// there. Segments are loaded in whole rows.
//
// -D STREAMS          how many VDIs
// -D SEGMENTS (2)     see raycasting/segments.cl
// -D COMPENSATED (1)  see lib/compositing.cl
#define LANES 16
#include "raycasting/packet_light.cl"
#include "raycasting/segment_rows.cl"
#pragma OPENCL FP_CONTRACT OFF

#define BLOCK 4 // rays along each edge

// The rays' streams of one VDI: slots of the segments that are not behind what has been composited, and of those behind the last
// ones. At the end of a stream a segment begins at infinity.
typedef struct {
    Ints slots, ends;
    Segments at;
} Stream;

// Load the segments of the rays that are chosen.
inline void come_to_segments(Stream *stream, __global const float *rows, int capacity, Ints chosen)
{
    const Ints left = chosen && stream->slots < stream->ends;
    const Segments next = load_segments(rows, select((Ints)(0), stream->slots, left), capacity);
    stream->at.from = select(stream->at.from, select((Reals)(INFINITY), next.from, left), chosen);
    stream->at.to = select(stream->at.to, select((Reals)(INFINITY), next.to, left), chosen);
    stream->at.optical_depth = select(stream->at.optical_depth, next.optical_depth, left);
    stream->at.red = select(stream->at.red, next.red, left);
    stream->at.green = select(stream->at.green, next.green, left);
    stream->at.blue = select(stream->at.blue, next.blue, left);
}

__attribute__((vec_type_hint(float16)))
__kernel void merge_blocks(
    __global const float *pool,         // all as in multi_vdi/merge.cl
    int capacity,
    __global const int *ends,
    __global const uchar *contributes,
    int rays,
    __global const int2 *cells,
    int first_cell,
    int width, int height,
    float transmittance_cutoff,
    __global const int *streams_of,
    __global int *needed,
    __global float4 *image,
    __global short *owner)
{
    const int first_ray = (int)get_global_id(0) * LANES;
    const int2 corner = cell_pixel(cells + first_cell, first_ray);
    const Ints x = corner.x + (NUMBERS & (BLOCK - 1));
    const Ints y = corner.y + (NUMBERS / BLOCK);
    const Ints in_window = x < width && y < height;
    if (!ANY(in_window))
        return;
    const Pixels pixels = pixels_at(x, y, in_window, width, height);
    const Ints used = select((Ints)(0), vload16(0, ends + (STREAMS - 1) * rays + first_ray), in_window);
    const int most = -least(-used);
    atomic_max(needed + first_cell + first_ray / CELL_ITEMS, most);
    if (most > capacity)
        return;

    Ints owned_by = -1;
    Ints grades = 0;
    for (int vdi = 0; vdi < STREAMS; ++vdi) {
        const Ints meets = convert_int16(vload16(0, contributes + streams_of[vdi] * rays + first_ray));
        owned_by = select(owned_by, (Ints)(vdi), meets > grades);
        grades = max(meets, grades);
    }
    int owners[LANES];
    vstore16(owned_by, 0, owners);
    for (int k = 0; k < LANES; ++k) {
        if (pixels.wanted[k])
            owner[pixels.places[k]] = (short)owners[k];
    }

    __global const float *const rows = POOL_OF(pool, first_ray, capacity);
    Stream streams[STREAMS];
    Ints first = 0;
    for (int j = 0; j < STREAMS; ++j) {
        streams[j].slots = first;
        first = streams[j].ends = select((Ints)(0), vload16(0, ends + j * rays + first_ray), in_window);
        streams[j].at.optical_depth = streams[j].at.red = streams[j].at.green = streams[j].at.blue = 0.0f;
        streams[j].at.from = streams[j].at.to = INFINITY;
        come_to_segments(&streams[j], rows, capacity, in_window);
    }
    Seen seen = nothing_seen();
    Reals reached = -INFINITY;
    while (true) {
        // The next piece that no segment begins or ends in
        Reals begin = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            begin = LOWER_OF(begin, HIGHER_OF(streams[j].at.from, reached));
        const Ints goes = begin < INFINITY && !(seen.transmittance < transmittance_cutoff);
        if (!ANY(goes))
            break;
        Reals end = INFINITY;
        for (int j = 0; j < STREAMS; ++j)
            end = LOWER_OF(end, select(streams[j].at.from, streams[j].at.to, streams[j].at.from <= begin));

        // Its medium
        Reals optical_depth = 0.0f, red = 0.0f, green = 0.0f, blue = 0.0f; // colour times optical depth
        Reals only_red = 0.0f, only_green = 0.0f, only_blue = 0.0f;        // of the last one
        Ints covering = 0;
        for (int j = 0; j < STREAMS; ++j) {
            const Segments at = streams[j].at;
            const Ints covers = goes && at.from <= begin;
            const Ints ends_here = covers && at.to <= end;
            // A segment that nothing cuts keeps its optical depth, however short it is in t
            const Reals share = select((end - begin) / (at.to - at.from), (Reals)(1.0f), ends_here && at.from >= begin);
            const Reals part = select((Reals)(0.0f), at.optical_depth * share, covers);
            red += part * at.red;
            green += part * at.green;
            blue += part * at.blue;
            optical_depth += part;
            only_red = select(only_red, at.red, covers);
            only_green = select(only_green, at.green, covers);
            only_blue = select(only_blue, at.blue, covers);
            covering -= covers;
            if (ANY(ends_here)) {
                streams[j].slots -= ends_here;
                come_to_segments(&streams[j], rows, capacity, ends_here);
            }
        }
        const Ints several = covering > 1;
        const Reals per_depth = 1.0f / optical_depth;
        composite_medium(&seen, optical_depth, select(only_red, red * per_depth, several),
                         select(only_green, green * per_depth, several), select(only_blue, blue * per_depth, several),
                         goes && optical_depth >= FLT_MIN); // of less, the reciprocal is not finite
        reached = select(reached, end, goes);
    }
    write_pixels(image, &pixels, &seen);
}
