// VDI to image at V_O, where the pixels of the picture are those of the VDI's window, or some of them, or more: what
// raycasting/raycast.cl does, where the ray of each pixel goes through a list of its own from front to back, and through no other.
//
// A work-item draws a packet (raycasting/packet.cl) of LANES pixels: those of PACKET_TILES tiles of lists side by side. What
// these hold lies in one piece of memory (raycasting/supersegments.cl), and one packet's behind the other's; so it is loaded in
// whole vectors, and nothing is gathered or searched for. (Lists of 8-byte supersegments do not lie in tiles: here, four side
// by side are called one, and their words are loaded one by one.) Only depth matters: a supersegment is clipped to the ray
// in the depth coordinate, and a length is a difference of it over the reciprocal depths at both ends.
//
// -D OFFSET_T, PARALLEL, SHIFTED, PACKED, COMPENSATED (1)    as in raycasting/raycast.cl
#define LANES 16
#include "raycasting/packet_light.cl"
#include "lib/transpose.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Lane p * PACKET_TILES + n has place p in the n-th tile: vectors of tiles become vectors of lanes within each 128 bits
#define PACKET_TILES 4
#if defined(PACKED) && PACKED == 8
#define TILE_WIDE 4
#define TILE_HIGH 1
#define LANE_X (Ints)(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15)
#define LANE_Y (Ints)(0)
#else
#define TILE_WIDE LIST_TILE
#define TILE_HIGH LIST_TILE
#define LANE_X (Ints)(0, 2, 4, 6, 1, 3, 5, 7, 0, 2, 4, 6, 1, 3, 5, 7)
#define LANE_Y (Ints)(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1)
#endif
#define LISTS_OF_TILE (TILE_WIDE * TILE_HIGH)
#define PACKET_WIDE (PACKET_TILES * TILE_WIDE) // pixels; TILE_HIGH high. Those of pyvista_vdi/packets.py.
// The same of one lane, from the packet's first pixel
#define X_OF(lane) ((lane) % PACKET_TILES * TILE_WIDE + (lane) / PACKET_TILES % TILE_WIDE)
#define Y_OF(lane) ((lane) / PACKET_TILES / TILE_WIDE)

// The form of V_O's depth, or of that less a number
#ifdef PARALLEL
#define Z_FORM DEPTH_FORM
#else
#define Z_FORM DENOMINATOR_FORM
#endif

// Reciprocal depth at a depth coordinate; times the depth origin if SHIFTED
#ifdef SHIFTED
#define NEARNESS(z) (1.0f - (z))
#else
#define NEARNESS(z) (-(z))
#endif

typedef struct {
    Reals front, back; // depth coordinates
#ifdef PACKED
    uint16 words[2]; // as loaded with them: 16 bytes: extinction, colour; 8 bytes: all
#endif
} Faces;

typedef struct {
    Reals red, green, blue, extinction;
} Media;

// Bring lines of the cache close.
inline void fetch_lines(__global const ulong *words, OFFSET_T first, OFFSET_T end)
{
    for (OFFSET_T k = first; k < end; k += WORDS_PER_LINE)
        prefetch(words + k, 1);
}

#if defined(PACKED) && PACKED == 8
// The lists of a packet, lane by lane.
typedef struct {
    Ints counts; // supersegments; 0 beside the window
    int longest; // the most of them
    Ints first;  // behind `begin`; of a list that has none, another one's, if there is one
    OFFSET_T begin;
    Ints origin, stride; // see raycasting/supersegments.cl
    Reals per_code;
} Lists;

inline Lists lists_at(__global const HEADER_T *headers, SUPERSEGMENTS_PARAMETERS int i, int j, int lists_wide, int lists_high)
{
    Lists lists;
    lists.longest = 0;
    if (i < 0 || i >= lists_wide || j < 0 || j >= lists_high)
        return lists;
    const int wide = min(lists_wide - i, PACKET_WIDE);
    __global const HEADER_T *const begins = headers + ((size_t)j * lists_wide + i);
    lists.begin = begins[0];
    if (begins[wide] == lists.begin)
        return lists;
    int counts[LANES], firsts[LANES], origins[LANES], strides[LANES];
    float per_codes[LANES];
    int any_lane = 0;
    for (int lane = 0; lane < LANES; ++lane) {
        const int dx = X_OF(lane);
        const int first = dx < wide ? (int)(begins[dx] - lists.begin) + LIST_HEADER : 0;
        counts[lane] = dx < wide ? max((int)(begins[dx + 1] - lists.begin) - first, 0) : 0;
        firsts[lane] = first;
        any_lane = counts[lane] > 0 ? lane : any_lane;
        lists.longest = max(lists.longest, counts[lane]);
    }
    for (int lane = 0; lane < LANES; ++lane) {
        firsts[lane] = firsts[counts[lane] > 0 ? lane : any_lane];
        __global const uint2 *const scale = words + lists.begin + firsts[lane] - LIST_HEADER;
        origins[lane] = as_int(scale[0].x);
        strides[lane] = as_int(scale[0].y);
        per_codes[lane] = as_float(scale[1].x);
    }
    lists.counts = vload16(0, counts);
    lists.first = vload16(0, firsts);
    lists.origin = vload16(0, origins);
    lists.stride = vload16(0, strides);
    lists.per_code = vload16(0, per_codes);
    return lists;
}

// The first `depth` supersegments of all lists.
inline void fetch(SUPERSEGMENTS_PARAMETERS const Lists *lists, int depth)
{
    int firsts[LANES], ends[LANES];
    vstore16(lists->first, 0, firsts);
    vstore16(lists->first + min(lists->counts, depth), 0, ends);
    for (int lane = 0; lane < LANES; ++lane)
        fetch_lines((__global const ulong *)words, lists->begin + firsts[lane], lists->begin + ends[lane]);
}

// As depth_of_code.
inline Reals depths_of_codes(const Lists *lists, uint16 codes, float step, float nearest, float depth_origin)
{
    const Reals offsets = convert_float16(lists->origin + as_int16(codes) * lists->stride) * step;
#ifdef PARALLEL
    return offsets;
#else
    return depth_coordinate(fmax(offsets, nearest), depth_origin);
#endif
}

inline Faces faces_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, float depth_origin)
{
    int places[LANES];
    vstore16(lists->first + select((Ints)(0), (Ints)(k), k < lists->counts), 0, places);
    __global const ulong *const from = (__global const ulong *)words + lists->begin;
    const uint16 low_lanes = as_uint16((ulong8)(from[places[0]], from[places[1]], from[places[2]], from[places[3]],
                                                from[places[4]], from[places[5]], from[places[6]], from[places[7]]));
    const uint16 high_lanes = as_uint16((ulong8)(from[places[8]], from[places[9]], from[places[10]], from[places[11]],
                                                 from[places[12]], from[places[13]], from[places[14]], from[places[15]]));
    Faces at;
    at.words[0] = (uint16)(low_lanes.even, high_lanes.even);
    at.words[1] = (uint16)(low_lanes.odd, high_lanes.odd);
    at.front = depths_of_codes(lists, at.words[0] & DEPTH_CODES, constants[0], constants[1], depth_origin);
    at.back = depths_of_codes(lists, at.words[0] >> 14 & DEPTH_CODES, constants[0], constants[1], depth_origin);
    return at;
}

// As medium_of.
inline Media media_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, Faces at)
{
    const uint16 tau = at.words[0] >> 28 | (at.words[1] & 255) << 4;
    const uint16 thickness = (at.words[0] >> 14 & DEPTH_CODES) - (at.words[0] & DEPTH_CODES);
    const Reals optical_depth = select((Reals)(0.0f), as_float16((tau + TAU_BASE - 1) << 16), tau > 0);
    const Media media = {convert_float16(at.words[1] >> 8 & 255) * (1.0f / 255.0f),
                         convert_float16(at.words[1] >> 16 & 255) * (1.0f / 255.0f),
                         convert_float16(at.words[1] >> 24) * (1.0f / 255.0f),
                         fmin(optical_depth * lists->per_code / convert_float16(thickness), FLT_MAX)};
    return media;
}

#else
// The lists of a packet, tile by tile.
typedef struct {
    Ints counts;                  // entries of each lane's list; 0 beside the window
    int longest;                  // the most of them
    int tile_counts[PACKET_TILES];
    OFFSET_T first[PACKET_TILES]; // entry; of a tile that has none, another one's, if there is one
} Lists;

inline Lists lists_at(__global const HEADER_T *headers, SUPERSEGMENTS_PARAMETERS int i, int j, int lists_wide, int lists_high)
{
    Lists lists;
    lists.longest = 0;
    if (i < 0 || j < 0 || j >= lists_high)
        return lists;
    OFFSET_T any_first = 0;
    for (int n = 0; n < PACKET_TILES; ++n) {
        const int column = i + n * LIST_TILE;
        const ulong header = column < lists_wide ? headers[tile_of_list(column, j, lists_wide)] : 0;
        lists.first[n] = (OFFSET_T)(header & ((1UL << FIRST_BITS) - 1));
        lists.tile_counts[n] = (int)(header >> FIRST_BITS);
        lists.longest = max(lists.longest, lists.tile_counts[n]);
        any_first = lists.tile_counts[n] > 0 ? lists.first[n] : any_first;
    }
    for (int n = 0; n < PACKET_TILES; ++n)
        lists.first[n] = lists.tile_counts[n] > 0 ? lists.first[n] : any_first;
    const int4 counts = vload4(0, lists.tile_counts);
    lists.counts = (Ints)(counts, counts, counts, counts);
    return lists;
}

// The first `depth` supersegments of all lists.
inline void fetch(SUPERSEGMENTS_PARAMETERS const Lists *lists, int depth)
{
    for (int n = 0; n < PACKET_TILES; ++n) {
        const OFFSET_T first = lists->first[n];
        const OFFSET_T end = first + min(depth, lists->tile_counts[n]) * LISTS_PER_TILE;
#ifdef PACKED
        fetch_lines(supersegments, 2 * first, 2 * end);
#else
        fetch_lines(faces, first, end);
        fetch_lines(media, 2 * first, 2 * end);
#endif
    }
}

// Entry of the k-th supersegment of a tile's first list; of any, if the tile has no more.
inline OFFSET_T entry_at(const Lists *lists, int n, int k)
{
    return lists->first[n] + (k < lists->tile_counts[n] ? k * LISTS_PER_TILE : 0);
}

// `words` of 8 bytes, two of which an entry takes.
inline Quads quads_at(__global const ulong *words, const Lists *lists, int k)
{
    Quads of_tiles;
    for (int n = 0; n < PACKET_TILES; ++n)
        of_tiles.of[n] = vload16(0, (__global const float *)(words + 2 * entry_at(lists, n, k)));
    return transposed(of_tiles);
}

#ifdef PACKED
inline Faces faces_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, float depth_origin)
{
    const Quads quads = quads_at(supersegments, lists, k);
    const Faces at = {quads.of[0], quads.of[1], {as_uint16(quads.of[2]), as_uint16(quads.of[3])}};
    return at;
}

// As medium_of.
inline Media media_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, Faces at)
{
    const uint16 color = at.words[1];
    const Media media = {convert_float16(color & 2047) * (1.0f / 2047.0f),
                         convert_float16(color >> 11 & 2047) * (1.0f / 2047.0f),
                         convert_float16(color >> 22) * (1.0f / 1023.0f), as_float16(at.words[0])};
    return media;
}
#else
inline float8 faces_of_tile(__global const ulong *faces, const Lists *lists, int n, int k)
{
    return vload8(0, (__global const float *)(faces + entry_at(lists, n, k)));
}

inline Faces faces_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, float depth_origin)
{
    const Reals of_01 = (Reals)(faces_of_tile(faces, lists, 0, k), faces_of_tile(faces, lists, 1, k));
    const Reals of_23 = (Reals)(faces_of_tile(faces, lists, 2, k), faces_of_tile(faces, lists, 3, k));
    const Faces at = {((Reals)(of_01.even, of_23.even)).s048c159d26ae37bf, ((Reals)(of_01.odd, of_23.odd)).s048c159d26ae37bf};
    return at;
}

inline Media media_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, Faces at)
{
    const Quads quads = quads_at(media, lists, k);
    const Media result = {quads.of[0], quads.of[1], quads.of[2], quads.of[3]};
    return result;
}
#endif
#endif

__attribute__((vec_type_hint(float16)))
__kernel void raycast_own_lists(
    __global const HEADER_T *headers,   // of the tiles of lists, see raycasting/supersegments.cl
    SUPERSEGMENTS_PARAMETERS            // see raycasting/supersegments.cl
    int lists_wide, int lists_high,     // window of V_O
    float depth_origin,                 // world units
    __global const float *forms,        // list coordinates, model direction, then `planes` to clip to
    int planes,
    int width, int height,              // window of V_N
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    float transmittance_cutoff,         // the ray ends where less than this is left
    __global const ulong *masks,        // this one and the next two are not looked at: lists say by themselves what is empty
    float first_depth,
    float slabs_per_depth,
    int2 origin,                        // the pixel of list (0, 0); maybe beside the window
    __global float4 *image)             // premultiplied RGBA, top row first
{
    // Packets begin at multiples of their size, in lists
    const int first_i = -origin.x & -PACKET_WIDE, first_j = -origin.y & -TILE_HIGH;
    const int packets_wide = (width - origin.x - first_i + PACKET_WIDE - 1) / PACKET_WIDE;
    const int packet = (int)get_global_id(0);
    const int i = first_i + packet % packets_wide * PACKET_WIDE;
    const int j = first_j + packet / packets_wide * TILE_HIGH;
    const int x = i + origin.x, y = j + origin.y;
    if (y >= height)
        return;
    const bool whole = x >= 0 && x + PACKET_WIDE <= width && y >= 0 && y + TILE_HIGH <= height;
    const long place = (long)(height - 1 - y) * width + x; // of the first pixel; row y + 1 is a width before
// Whether a pixel of the packet is one of the window's
#define IS_IN_WINDOW(dx, dy) (x + (dx) >= 0 && x + (dx) < width && y + (dy) >= 0 && y + (dy) < height)

    Seen seen = nothing_seen();
    const Lists lists = lists_at(headers, SUPERSEGMENTS_ARGUMENTS i, j, lists_wide, lists_high);
    if (lists.longest > 0) {
        Reals t_end = INFINITY;
        if (has_opaque_depth) {
            float ends[LANES];
            for (int lane = 0; lane < LANES; ++lane) {
                const int dx = X_OF(lane), dy = Y_OF(lane);
                ends[lane] = whole || IS_IN_WINDOW(dx, dy) ? opaque_depth[place + dx - dy * width] : 0.0f;
            }
            t_end = vload16(0, ends);
        }
        const Reals a = convert_float16(x + LANE_X) + 0.5f - 0.5f * (float)width;
        const Reals b = convert_float16(y + LANE_Y) + 0.5f - 0.5f * (float)height;
        const Ints wanted = IS_IN_WINDOW(LANE_X, LANE_Y) && i + LANE_X < lists_wide && j + LANE_Y < lists_high &&
                            lists.counts > 0;
        Reals t0, t1;
        Ints going = clip_packet(forms, planes, a, b, t_end, wanted, &t0, &t1);
        const Reals begin = list_depths(forms, a, b, t0);
        const Reals end = list_depths(forms, a, b, t1);
        // Model length per unit of V_O's depth
        Reals scale = MODEL_SPEED(Reals, forms, a, b) / FORM_SLOPE(Reals, forms + Z_FORM * FORM_SIZE, a, b);
#ifdef SHIFTED
        scale *= depth_origin;
#endif
        int k = 0;
        for (; k < lists.longest; ++k) {
            const Faces at = faces_at(SUPERSEGMENTS_ARGUMENTS &lists, k, depth_origin);
            going = going && k < lists.counts && at.front < end && !(seen.transmittance < transmittance_cutoff);
            const Reals from = HIGHER_OF(at.front, begin);
            const Reals to = LOWER_OF(at.back, end);
            const Ints meet = going && from < to;
            if (!ANY(meet)) {
                if (!ANY(going))
                    break;
                continue;
            }
            const Media medium = media_at(SUPERSEGMENTS_ARGUMENTS &lists, k, at);
#ifdef PARALLEL
            const Reals lengths = scale * (to - from);
#else
            const Reals lengths = scale * (to - from) / (NEARNESS(from) * NEARNESS(to));
#endif
            composite_medium(&seen, medium.extinction * lengths, medium.red, medium.green, medium.blue, meet);
        }
        // The next packet, which comes to about the same depth: all at once, as loads in the loop are not
        const Lists next = lists_at(headers, SUPERSEGMENTS_ARGUMENTS i + PACKET_WIDE, j, lists_wide, lists_high);
        fetch(SUPERSEGMENTS_ARGUMENTS &next, k + 1);
        // The others have looked at what is not theirs, or lies beside V_O's window, where there may be anything
        seen.red = select((Reals)(0.0f), seen.red, wanted);
        seen.green = select((Reals)(0.0f), seen.green, wanted);
        seen.blue = select((Reals)(0.0f), seen.blue, wanted);
    }

    const Quads channels = {{seen.red, seen.green, seen.blue, alpha_seen(&seen)}};
    const Quads pixels = transposed(channels); // of each tile, row by row
    for (int n = 0; n < PACKET_TILES; ++n) {
        __global float4 *const target = image + place + n * TILE_WIDE;
        if (whole) {
#if TILE_HIGH == 1
            vstore16(pixels.of[n], 0, (__global float *)target);
#else
            vstore8(pixels.of[n].lo, 0, (__global float *)target);
            vstore8(pixels.of[n].hi, 0, (__global float *)(target - width));
#endif
            continue;
        }
        float4 colors[LISTS_OF_TILE];
        vstore16(pixels.of[n], 0, (float *)colors);
        for (int p = 0; p < LISTS_OF_TILE; ++p) {
            const int dx = p % TILE_WIDE, dy = p / TILE_WIDE;
            if (IS_IN_WINDOW(n * TILE_WIDE + dx, dy))
                target[dx - dy * width] = colors[p];
        }
    }
}
