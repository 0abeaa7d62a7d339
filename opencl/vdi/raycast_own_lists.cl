// VDI to image at V_O, in a picture of the VDI's own size: what vdi/raycast.cl does, where the ray of each pixel is the
// centre ray of the pixel's own list, which it goes through from front to back.
//
// A work-item draws a packet (common/packet.cl) of LANES pixels: those of PACKET_TILES tiles of lists side by side. What
// these hold lies in one piece of memory (common/supersegments.cl), and one packet's behind the other's; so it is loaded in
// whole vectors, and nothing is gathered or searched for. Only depth matters: a supersegment is clipped to the ray in the
// depth coordinate, and a length is a difference of it over the reciprocal depths at both ends.
//
// -D OFFSET_T, PARALLEL, SHIFTED, PACKED (16), COMPENSATED (1)    as in vdi/raycast.cl
#include "common/opacity.cl"
#include "common/packet.cl"
#include "common/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

DEFINE_OPACITY_OF(opacities_of, 16)

#define PACKET_TILES (LANES / LISTS_PER_TILE)
#define PACKET_WIDE (PACKET_TILES * LIST_TILE) // pixels; LIST_TILE high. That of pyvista_vdi/packets.py.
// Lane p * PACKET_TILES + n has place p in the n-th tile: vectors of tiles become vectors of lanes within each 128 bits
#define LANE_X (Ints)(0, 2, 4, 6, 1, 3, 5, 7, 0, 2, 4, 6, 1, 3, 5, 7)
#define LANE_Y (Ints)(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1)

// Reciprocal depth at a depth coordinate; times the depth origin if SHIFTED
#ifdef SHIFTED
#define NEARNESS(z) (1.0f - (z))
#else
#define NEARNESS(z) (-(z))
#endif

// Four numbers of each list, or pixel: each vector has those of one tile, or each has one of all lanes.
typedef struct {
    Reals of[4];
} Quads;

// The first halves, or the second ones, of each 128 bits of two vectors; and their numbers in turns, or half behind half.
// Swizzles of whole vectors: of vectors put together by single numbers a compiler makes as many instructions.
#define FIRST_HALVES(p, q) ((Reals)((p).s014589cd, (q).s014589cd))
#define SECOND_HALVES(p, q) ((Reals)((p).s2367abef, (q).s2367abef))
#define IN_TURNS s08192a3b4c5d6e7f
#define JOINED s018923ab45cd67ef

// From tiles to lanes, or back: each 4 x 4 of a place in the tiles.
inline Quads transposed(Quads x)
{
    const Reals first_01 = FIRST_HALVES(x.of[0], x.of[1]).IN_TURNS;
    const Reals first_23 = FIRST_HALVES(x.of[2], x.of[3]).IN_TURNS;
    const Reals second_01 = SECOND_HALVES(x.of[0], x.of[1]).IN_TURNS;
    const Reals second_23 = SECOND_HALVES(x.of[2], x.of[3]).IN_TURNS;
    const Quads result = {{FIRST_HALVES(first_01, first_23).JOINED, SECOND_HALVES(first_01, first_23).JOINED,
                           FIRST_HALVES(second_01, second_23).JOINED, SECOND_HALVES(second_01, second_23).JOINED}};
    return result;
}

// Supersegments of all lanes. `entries` are those of the tiles' first lists.
typedef struct {
    Reals front, back; // depth coordinates
#ifdef PACKED
    Reals extinction, color; // as loaded with them
#endif
} Faces;

typedef struct {
    Reals red, green, blue, extinction;
} Media;

// `words` of 8 bytes, two of which an entry takes.
inline Quads quads_of(__global const ulong *words, const OFFSET_T *entries)
{
    Quads of_tiles;
    for (int n = 0; n < PACKET_TILES; ++n)
        of_tiles.of[n] = vload16(0, (__global const float *)(words + 2 * entries[n]));
    return transposed(of_tiles);
}

#ifdef PACKED
inline Faces faces_of(SUPERSEGMENTS_PARAMETERS const OFFSET_T *entries)
{
    const Quads quads = quads_of(supersegments, entries);
    const Faces result = {quads.of[0], quads.of[1], quads.of[2], quads.of[3]};
    return result;
}

inline Media media_of(SUPERSEGMENTS_PARAMETERS const OFFSET_T *entries, Faces at)
{
    const uint16 color = as_uint16(at.color);
    const Media result = {convert_float16(color & 2047) * (1.0f / 2047.0f),
                          convert_float16(color >> 11 & 2047) * (1.0f / 2047.0f),
                          convert_float16(color >> 22) * (1.0f / 1023.0f), at.extinction};
    return result;
}
#else
inline float8 faces_of_tile(__global const ulong *faces, OFFSET_T entry)
{
    return vload8(0, (__global const float *)(faces + entry));
}

inline Faces faces_of(SUPERSEGMENTS_PARAMETERS const OFFSET_T *entries)
{
    const Reals of_01 = (Reals)(faces_of_tile(faces, entries[0]), faces_of_tile(faces, entries[1]));
    const Reals of_23 = (Reals)(faces_of_tile(faces, entries[2]), faces_of_tile(faces, entries[3]));
    const Faces result = {((Reals)(of_01.even, of_23.even)).s048c159d26ae37bf,
                          ((Reals)(of_01.odd, of_23.odd)).s048c159d26ae37bf};
    return result;
}

inline Media media_of(SUPERSEGMENTS_PARAMETERS const OFFSET_T *entries, Faces at)
{
    const Quads quads = quads_of(media, entries);
    const Media result = {quads.of[0], quads.of[1], quads.of[2], quads.of[3]};
    return result;
}
#endif

// The tiles of a packet.
typedef struct {
    OFFSET_T first[PACKET_TILES]; // entry; of a tile that has none, another one's, if there is one
    int count[PACKET_TILES];      // entries of each of its lists; 0 beside the window
    int longest;                  // the most of them
} Tiles;

inline Tiles tiles_at(__global const ulong *headers, int x, int y, int lists_wide)
{
    Tiles tiles;
    tiles.longest = 0;
    OFFSET_T any_first = 0;
    for (int n = 0; n < PACKET_TILES; ++n) {
        const int i = x + n * LIST_TILE;
        const ulong header = i < lists_wide ? headers[tile_of_list(i, y, lists_wide)] : 0;
        tiles.first[n] = (OFFSET_T)(header & ((1UL << FIRST_BITS) - 1));
        tiles.count[n] = (int)(header >> FIRST_BITS);
        tiles.longest = max(tiles.longest, tiles.count[n]);
        any_first = tiles.count[n] > 0 ? tiles.first[n] : any_first;
    }
    for (int n = 0; n < PACKET_TILES; ++n)
        tiles.first[n] = tiles.count[n] > 0 ? tiles.first[n] : any_first;
    return tiles;
}

// Bring lines of the cache close.
inline void fetch_lines(__global const ulong *words, OFFSET_T first, OFFSET_T end)
{
    for (OFFSET_T k = first; k < end; k += WORDS_PER_LINE)
        prefetch(words + k, 1);
}

// The first `depth` supersegments of all lists.
inline void fetch(SUPERSEGMENTS_PARAMETERS const Tiles *tiles, int depth)
{
    for (int n = 0; n < PACKET_TILES; ++n) {
        const OFFSET_T first = tiles->first[n];
        const OFFSET_T end = first + min(depth, tiles->count[n]) * LISTS_PER_TILE;
#ifdef PACKED
        fetch_lines(supersegments, 2 * first, 2 * end);
#else
        fetch_lines(faces, first, end);
        fetch_lines(media, 2 * first, 2 * end);
#endif
    }
}

// How many each lane's tile has.
inline Ints counts_of(const Tiles *tiles)
{
    const int4 counts = vload4(0, tiles->count);
    return (Ints)(counts, counts, counts, counts);
}

__attribute__((vec_type_hint(float16)))
__kernel void raycast_own_lists(
    __global const ulong *headers,      // of the tiles of lists, see common/supersegments.cl
    SUPERSEGMENTS_PARAMETERS            // see common/supersegments.cl
    int lists_wide, int lists_high,     // window of V_O, and of V_N
    float depth_origin,                 // world units
    __global const float *forms,        // list coordinates, model direction, then `planes` to clip to
    int planes,
    int width, int height,              // the same as lists_wide and lists_high
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    float transmittance_cutoff,         // the ray ends where less than this is left
    __global const ulong *masks,        // this one and the next two are not looked at: lists say by themselves what is empty
    float first_depth,
    float slabs_per_depth,
    __global float4 *image)             // premultiplied RGBA, top row first
{
    const int packets_wide = (width + PACKET_WIDE - 1) / PACKET_WIDE;
    const int packet = (int)get_global_id(0);
    const int x = packet % packets_wide * PACKET_WIDE;
    const int y = packet / packets_wide * LIST_TILE;
    if (y >= height)
        return;
    const bool whole = x + PACKET_WIDE <= width && y + LIST_TILE <= height;
    const size_t place = (size_t)(height - 1 - y) * width + x; // of the first pixel; row y + 1 is a width before

    Reals red = 0.0f, green = 0.0f, blue = 0.0f, alpha = 0.0f;
    const Tiles tiles = tiles_at(headers, x, y, lists_wide);
    if (tiles.longest > 0) {
        Reals t_end = INFINITY;
        if (has_opaque_depth) {
            float ends[LANES]; // row by row
            for (int n = 0; n < LANES; ++n) {
                const int dx = n % PACKET_WIDE, dy = n / PACKET_WIDE;
                ends[n] = whole || (x + dx < width && y + dy < height) ? opaque_depth[place + dx - dy * width] : 0.0f;
            }
            const Reals rows = vload16(0, ends);
            t_end = (Reals)(rows.lo.even, rows.lo.odd, rows.hi.even, rows.hi.odd);
        }
        const Reals a = convert_float16(x + LANE_X) + 0.5f - 0.5f * (float)width;
        const Reals b = convert_float16(y + LANE_Y) + 0.5f - 0.5f * (float)height;
        const Ints counts = counts_of(&tiles);
        const Ints wanted = x + LANE_X < width && y + LANE_Y < height && counts > 0;
        Reals t0, t1;
        Ints going = clip_packet(forms, planes, a, b, t_end, wanted, &t0, &t1);
        const Reals begin = list_depths(forms, a, b, t0);
        const Reals end = list_depths(forms, a, b, t1);
        Reals scale = MODEL_SPEED(Reals, forms, a, b);
#ifdef SHIFTED
        scale *= depth_origin;
#endif

        Reals transmittance = 1.0f;
#ifdef COMPENSATED
        Reals opacity = 0.0f; // see common/over.cl
#endif
        int k = 0;
        for (; k < tiles.longest; ++k) {
            OFFSET_T entries[PACKET_TILES];
            for (int n = 0; n < PACKET_TILES; ++n)
                entries[n] = tiles.first[n] + (k < tiles.count[n] ? k * LISTS_PER_TILE : 0);
            const Faces at = faces_of(SUPERSEGMENTS_ARGUMENTS entries);
            going = going && k < counts && at.front < end && !(transmittance < transmittance_cutoff);
            const Reals from = HIGHER_OF(at.front, begin);
            const Reals to = LOWER_OF(at.back, end);
            const Ints meet = going && from < to;
            if (!any(meet)) {
                if (!any(going))
                    break;
                continue;
            }
            const Media medium = media_of(SUPERSEGMENTS_ARGUMENTS entries, at);
#ifdef PARALLEL
            const Reals lengths = scale * (to - from);
#else
            const Reals lengths = scale * (to - from) / (NEARNESS(from) * NEARNESS(to));
#endif
            const Reals weight = select((Reals)(0.0f), transmittance * opacities_of(medium.extinction * lengths), meet);
            red += weight * medium.red;
            green += weight * medium.green;
            blue += weight * medium.blue;
#ifdef COMPENSATED
            opacity += weight;
            transmittance = 1.0f - opacity;
#else
            transmittance -= weight;
#endif
        }
#ifdef COMPENSATED
        alpha = fmin(opacity, 1.0f);
#else
        alpha = 1.0f - transmittance;
#endif
        // The next packet, which comes to about the same depth: all at once, as loads in the loop are not
        const Tiles next = tiles_at(headers, x + PACKET_WIDE, y, lists_wide);
        fetch(SUPERSEGMENTS_ARGUMENTS &next, k + 1);
        // Lanes of a tile without entries have looked at another one's; beside the window there may be anything
        red = select((Reals)(0.0f), red, counts > 0);
        green = select((Reals)(0.0f), green, counts > 0);
        blue = select((Reals)(0.0f), blue, counts > 0);
    }

    const Quads channels = {{red, green, blue, alpha}};
    const Quads pixels = transposed(channels); // of each tile: its lower row, then its upper one
    for (int n = 0; n < PACKET_TILES; ++n) {
        __global float4 *const target = image + place + n * LIST_TILE;
        if (whole) {
            vstore8(pixels.of[n].lo, 0, (__global float *)target);
            vstore8(pixels.of[n].hi, 0, (__global float *)(target - width));
            continue;
        }
        float4 colors[LISTS_PER_TILE];
        vstore16(pixels.of[n], 0, (float *)colors);
        for (int p = 0; p < LISTS_PER_TILE; ++p) {
            const int dx = p % LIST_TILE, dy = p / LIST_TILE;
            if (x + n * LIST_TILE + dx < width && y + dy < height)
                target[dx - dy * width] = colors[p];
        }
    }
}
