// How the supersegments of a list are read: their faces, (front, back) in the depth coordinate of V_O's list space, and
// their media, (straight RGB, extinction per model length). docs/conventions.md, "Packed supersegments", has the bits.
//
// Lists lie in memory by tiles of LIST_TILE x LIST_TILE: the first supersegments of the tile's lists, then the second ones,
// and so on, up to the longest list's last; a list that ends before is filled up with NO_FACE. So rays next to each other
// read what lies next to each other. A tile's header says where its entries begin and how long its longest list is, in
// one word: what lanes gather is the dearest part of a visit. (Lists of 8-byte supersegments lie one behind the other.)
//
// -D OFFSET_T              type of an offset into the supersegments: int or long
// -D PACKED=16, PACKED=8   supersegments of so many bytes; otherwise 24: two arrays of floats
//
//     SUPERSEGMENTS_PARAMETERS, SUPERSEGMENTS_ARGUMENTS   of a kernel or function that reads them
//     LIST_AT(i, j)     the list, from `headers`, in a window `lists_wide` lists wide; list.count: its supersegments, with
//                       what it is filled up with
//     FACE(list, k)     of supersegment k, 0 <= k < list.count
//     FRONT(list, k), BACK(list, k)   one of its faces by itself
//     MEDIUM(list, k)   likewise; undefined for NO_FACE
//     PREFETCH(list, i, j)   bring list (i, j) close; each list of a tile brings its share
#include "lib/list_space.cl"
#pragma OPENCL FP_CONTRACT OFF

#if !defined(PACKED) || PACKED == 16
#define LIST_TILE_SHIFT 1
#define HEADER_T ulong
#define FIRST_BITS 36 // of a header, that say where its entries begin; the others say how many there are of each list
#else
#define LIST_TILE_SHIFT 0
#define HEADER_T OFFSET_T // where the list begins; the next one's is where it ends
#endif
#define LIST_TILE (1 << LIST_TILE_SHIFT) // that of pyvista_vdi/raycast.py
#define LISTS_PER_TILE (LIST_TILE * LIST_TILE)
#define NO_FACE (float2)(INFINITY, INFINITY) // beyond every ray, from whichever side
#define WORDS_PER_LINE 8                     // of 8 bytes, in a line of the cache

typedef struct {
    OFFSET_T first; // entry of its first supersegment
    int count;
#if defined(PACKED) && PACKED == 8
    int origin, stride;
    float per_code; // 1 over a code's model length
    float step, nearest;
#endif
#if defined(FAR_ENTRIES) || (defined(PACKED) && PACKED == 8)
    Depths depths;
#endif
} List;

// Tile of list (i, j) in a window of so many lists, and the list's place in it.
inline int tile_of_list(int i, int j, int lists_wide)
{
    return (j >> LIST_TILE_SHIFT) * ((lists_wide + LIST_TILE - 1) >> LIST_TILE_SHIFT) + (i >> LIST_TILE_SHIFT);
}

inline int place_in_tile(int i, int j)
{
    return (j & (LIST_TILE - 1)) << LIST_TILE_SHIFT | (i & (LIST_TILE - 1));
}

inline OFFSET_T entry_of(const List *list, int k)
{
    return list->first + ((OFFSET_T)k << 2 * LIST_TILE_SHIFT);
}

// Two floats that were loaded as one word.
inline float2 two_floats(ulong word)
{
    return (float2)(as_float((uint)word), as_float((uint)(word >> 32)));
}

#if !defined(PACKED) || PACKED == 16
inline List list_at(__global const ulong *headers, int i, int j, int lists_wide)
{
    const ulong header = headers[tile_of_list(i, j, lists_wide)];
    List list;
    list.first = (OFFSET_T)(header & ((1UL << FIRST_BITS) - 1)) + place_in_tile(i, j);
    list.count = (int)(header >> FIRST_BITS);
    return list;
}
#endif

#if defined(FAR_ENTRIES) && (!defined(PACKED) || PACKED == 16)
// Faces are kept as offsets, and are brought to the depth coordinate of the ray; NO_FACE stays what it is.
inline List list_on_ray(List list, Depths depths)
{
    list.depths = depths;
    return list;
}

inline float2 face_on_ray(const List *list, float2 offsets)
{
    return offsets.x < INFINITY ? (float2)(depth_coordinate(offsets.x, list->depths),
                                           depth_coordinate(offsets.y, list->depths))
                                : NO_FACE;
}
#define LIST_AT(i, j) list_on_ray(list_at(headers, i, j, lists_wide), DEPTHS)
#elif !defined(PACKED) || PACKED == 16
#define LIST_AT(i, j) list_at(headers, i, j, lists_wide)
#define face_on_ray(list, face) (face)
#endif

// A ray that crosses fewer lists than this goes through the whole depth of a list's neighbourhood: worth to be brought close
// at once.
#define LISTS_TO_PREFETCH 48.0f

// Prefetch every LISTS_PER_TILE-th cache line of a list's tile, whose entries take so many words, from the share-th line on.
inline void prefetch_share(__global const ulong *words, List list, int words_per_entry, int share)
{
    const OFFSET_T first = list.first - share;
    const OFFSET_T end = words_per_entry * (first + list.count * LISTS_PER_TILE);
    for (OFFSET_T k = words_per_entry * first + share * WORDS_PER_LINE; k < end; k += LISTS_PER_TILE * WORDS_PER_LINE)
        prefetch(words + k, 1);
}

#if !defined(PACKED)

#define SUPERSEGMENTS_PARAMETERS                                                    \
    __global const ulong *faces, /* depth coordinates of front and back */          \
    __global const ulong *media, /* straight RG, then B and extinction per length */
#define SUPERSEGMENTS_ARGUMENTS faces, media,
#define FACE(list, k) face_on_ray(&(list), two_floats(faces[entry_of(&(list), k)]))
#ifndef FAR_ENTRIES
#define FRONT(list, k) ((__global const float *)faces)[2 * entry_of(&(list), k)]
#define BACK(list, k) ((__global const float *)faces)[2 * entry_of(&(list), k) + 1]
#endif
#define MEDIUM(list, k) medium_at(media, entry_of(&(list), k))
#define PREFETCH(list, i, j)                              \
    prefetch_share(faces, list, 1, place_in_tile(i, j));  \
    prefetch_share(media, list, 2, place_in_tile(i, j))

inline float4 medium_at(__global const ulong *media, OFFSET_T entry)
{
    return (float4)(two_floats(media[2 * entry]), two_floats(media[2 * entry + 1]));
}

#elif PACKED == 16

// A supersegment is (front, back), then (extinction, colour), the first three as bits of floats.
#define SUPERSEGMENTS_PARAMETERS __global const ulong *supersegments, __global const float *constants,
#define SUPERSEGMENTS_ARGUMENTS supersegments, constants,
#define FACE(list, k) face_on_ray(&(list), two_floats(supersegments[2 * entry_of(&(list), k)]))
#define MEDIUM(list, k) medium_of(supersegments[2 * entry_of(&(list), k) + 1])
#define PREFETCH(list, i, j) prefetch_share(supersegments, list, 2, place_in_tile(i, j))

inline float4 medium_of(ulong word)
{
    const uint color = (uint)(word >> 32);
    return (float4)((float)(color & 2047) * (1.0f / 2047.0f), (float)(color >> 11 & 2047) * (1.0f / 2047.0f),
                    (float)(color >> 22) * (1.0f / 1023.0f), as_float((uint)word));
}

#elif PACKED == 8

// A list that is not empty begins with LIST_HEADER pairs of words: (origin, stride), in steps of depth, and (1 over the
// model length of a code of depth, unused).
#define SUPERSEGMENTS_PARAMETERS                                                                        \
    __global const uint2 *words,                                                                        \
    __global const float *constants, /* step of depth, least offset in front of the eye; world units */
#define SUPERSEGMENTS_ARGUMENTS words, constants,
#define LIST_HEADER 2
#define DEPTH_CODES 16383
#define TAU_BASE ((127 - 18) << 7)
#define LIST_AT(i, j) packed_list_at(headers, words, constants, i, j, lists_wide, DEPTHS)
#define FACE(list, k) face_of(&(list), words[entry_of(&(list), k)].x)
#define MEDIUM(list, k) medium_of(&(list), words[entry_of(&(list), k)])
#define PREFETCH(list, i, j) prefetch_share((__global const ulong *)words, list, 1, 0)

inline List packed_list_at(__global const OFFSET_T *offsets, __global const uint2 *words, __global const float *constants,
                           int i, int j, int lists_wide, Depths depths)
{
    const int place = tile_of_list(i, j, lists_wide);
    const OFFSET_T begin = offsets[place];
    List list;
    list.first = begin + LIST_HEADER;
    list.count = (int)(offsets[place + 1] - list.first);
    if (list.count > 0) {
        const uint2 scale = words[begin];
        list.origin = as_int(scale.x);
        list.stride = as_int(scale.y);
        list.per_code = as_float(words[begin + 1].x);
    } else {
        list.count = 0;
    }
    list.step = constants[0];
    list.nearest = constants[1];
    list.depths = depths;
    return list;
}

// The depth coordinate of a code. Whole steps stay below 2^24 and a step is a power of two: nothing is rounded before it.
inline float depth_of_code(const List *list, uint code)
{
    const float offset = (float)(list->origin + (int)code * list->stride) * list->step;
#ifdef PARALLEL
    return depth_coordinate(offset, list->depths);
#else
    return depth_coordinate(fmax(offset, list->nearest), list->depths);
#endif
}

inline float2 face_of(const List *list, uint codes)
{
    return (float2)(depth_of_code(list, codes & DEPTH_CODES), depth_of_code(list, codes >> 14 & DEPTH_CODES));
}

inline float4 medium_of(const List *list, uint2 word)
{
    const uint tau = word.x >> 28 | (word.y & 255) << 4;
    const uint thickness = (word.x >> 14 & DEPTH_CODES) - (word.x & DEPTH_CODES);
    const float optical_depth = tau > 0 ? as_float((tau + TAU_BASE - 1) << 16) : 0.0f;
    return (float4)((float)(word.y >> 8 & 255) * (1.0f / 255.0f), (float)(word.y >> 16 & 255) * (1.0f / 255.0f),
                    (float)(word.y >> 24) * (1.0f / 255.0f),
                    fmin(optical_depth * list->per_code / (float)thickness, FLT_MAX));
}

#endif

#ifndef FRONT
#define FRONT(list, k) FACE(list, k).x
#define BACK(list, k) FACE(list, k).y
#endif
