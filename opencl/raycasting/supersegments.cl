// How the supersegments of a list are read: their faces, (front, back) in the depth coordinate of V_O's list space, and
// their media, (straight RGB, extinction per model length). docs/conventions.md, "Packed supersegments", has the bits.
//
// Lists lie in memory by bundles of BUNDLE x BUNDLE: the first supersegments of the bundle's lists, then the second ones, and so
// on, up to the longest list's last; a list that ends before is filled up with NO_FACE. So rays next to each other read what
// lies next to each other. A bundle's header says where its entries begin and how long its longest list is, in one word: what
// lanes gather is the dearest part of a visit. (Lists of 8-byte supersegments lie one behind the other.)
//
// -D OFFSET_T              type of an offset into the supersegments: int or long
// -D PACKED=16, PACKED=8   supersegments of so many bytes; otherwise 24: two arrays of floats
// -D SHARED_LISTS          all rays of a work-item are in the same list; otherwise each lane (lib/lanes.cl) has one of its own
//
//     SUPERSEGMENTS_PARAMETERS, SUPERSEGMENTS_ARGUMENTS   of a kernel or function that reads them
//     LIST_AT(i, j)     the list, from `headers`, in a window `lists_wide` lists wide; list.count: its supersegments, with
//                       what it is filled up with
//     FACE(list, k)     of supersegment k, 0 <= k < list.count
//     FRONT(list, k), BACK(list, k)   one of its faces by itself
//     MEDIUM(list, k)   likewise; undefined for NO_FACE
//     prefetch_list(headers, ..., i, j, lists_wide)   bring list (i, j) close; each list of a bundle brings its share
//
// Each lane's own are read by those who know how they lie: what is here then is how they are decoded.
#include "lib/lanes.cl"
#include "lib/list_space.cl"
#pragma OPENCL FP_CONTRACT OFF

#if defined(PACKED) && PACKED == 8
#define LIST_SHIFT 0
#define HEADER_T OFFSET_T // where the list begins; the next one's is where it ends
#else
#define LIST_SHIFT BUNDLE_SHIFT
#define HEADER_T ulong    // FIRST_BITS say where the entries begin, the others how many there are of each list
#endif
#define LISTS_PER_BUNDLE (1 << 2 * LIST_SHIFT)
#define NO_FACE (float2)(INFINITY, INFINITY) // beyond every ray, from whichever side
#define WORDS_PER_LINE 8                     // of 8 bytes, in a line of the cache

#if LANES > 1 && defined(SHARED_LISTS)
typedef float ListReal;
typedef int ListInt;
typedef uint ListUint;
typedef float4 ListReal4;
#define LIST_REAL4(x, y, z, w) (float4)(x, y, z, w)
#define LIST_SELECT(otherwise, then, condition) ((condition) ? (then) : (otherwise))
#define LIST_TO_REAL(x) ((float)(x))
#define LIST_AS_REAL(x) as_float(x)
#define LIST_AS_INT(x) as_int(x)
#else
typedef Real ListReal;
typedef Int ListInt;
typedef Uint ListUint;
typedef Real4 ListReal4;
#define LIST_REAL4(x, y, z, w) REAL4(x, y, z, w)
#define LIST_SELECT(otherwise, then, condition) SELECT(otherwise, then, condition)
#define LIST_TO_REAL(x) TO_REAL(x)
#define LIST_AS_REAL(x) AS_REAL(x)
#define LIST_AS_INT(x) AS_INT(x)
#endif
#if LANES == 1 || defined(SHARED_LISTS)
typedef OFFSET_T ListOffset;
#else
typedef Int ListOffset;
#endif

typedef struct {
    ListOffset first; // entry of its first supersegment
    ListInt count;
#if defined(PACKED) && PACKED == 8
    ListInt origin, stride;
    ListReal per_code; // 1 over a code's model length
    float step, nearest;
#endif
#if defined(DOUBLE_FLOAT_RAYS) || (defined(PACKED) && PACKED == 8)
    Depths depths;
#endif
} List;

// Bundle of list (i, j) in a window of so many lists, and the list's place in it.
#define BUNDLE_OF_LIST(i, j, lists_wide) \
    (((j) >> LIST_SHIFT) * (((lists_wide) + (1 << LIST_SHIFT) - 1) >> LIST_SHIFT) + ((i) >> LIST_SHIFT))
#define PLACE_IN_BUNDLE(i, j) \
    (((j) & ((1 << LIST_SHIFT) - 1)) << LIST_SHIFT | ((i) & ((1 << LIST_SHIFT) - 1)))

inline ListOffset entry_of(const List *list, ListInt k)
{
    return list->first + ((ListOffset)k << 2 * LIST_SHIFT);
}

// Two floats that were loaded as one word.
inline float2 two_floats(ulong word)
{
    return (float2)(as_float((uint)word), as_float((uint)(word >> 32)));
}

// A ray that crosses fewer lists than this goes through the whole depth of a list's neighbourhood: worth to be brought close
// at once.
#define LISTS_TO_PREFETCH 48.0f

// Prefetch every LISTS_PER_BUNDLE-th cache line of a list's bundle, whose entries take so many words, from the share-th line on.
inline void prefetch_share(__global const ulong *words, OFFSET_T first, int count, int words_per_entry, int share)
{
    const OFFSET_T end = words_per_entry * (first + count * LISTS_PER_BUNDLE);
    for (OFFSET_T k = words_per_entry * first + share * WORDS_PER_LINE; k < end; k += LISTS_PER_BUNDLE * WORDS_PER_LINE)
        prefetch(words + k, 1);
}

#if !defined(PACKED) || PACKED == 16
inline OFFSET_T first_of_header(ulong header)
{
    return (OFFSET_T)(header & ((1UL << FIRST_BITS) - 1));
}

inline int count_of_header(ulong header)
{
    return (int)(header >> FIRST_BITS);
}

#if LANES == 1 || defined(SHARED_LISTS)
inline List list_at(__global const ulong *headers, int i, int j, int lists_wide)
{
    const ulong header = headers[BUNDLE_OF_LIST(i, j, lists_wide)];
    List list;
    list.first = first_of_header(header) + PLACE_IN_BUNDLE(i, j);
    list.count = count_of_header(header);
    return list;
}

#ifdef DOUBLE_FLOAT_RAYS
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
#else
#define LIST_AT(i, j) list_at(headers, i, j, lists_wide)
#define face_on_ray(list, face) (face)
#endif
#endif
#endif

#if !defined(PACKED)

#define SUPERSEGMENTS_PARAMETERS                                                    \
    __global const ulong *faces, /* depth coordinates of front and back */          \
    __global const ulong *media, /* straight RG, then B and extinction per length */
#define SUPERSEGMENTS_ARGUMENTS faces, media,
#define FACE(list, k) face_on_ray(&(list), two_floats(faces[entry_of(&(list), k)]))
#ifndef DOUBLE_FLOAT_RAYS
#define FRONT(list, k) ((__global const float *)faces)[2 * entry_of(&(list), k)]
#define BACK(list, k) ((__global const float *)faces)[2 * entry_of(&(list), k) + 1]
#endif
#define MEDIUM(list, k) medium_at(media, entry_of(&(list), k))

inline float4 medium_at(__global const ulong *media, OFFSET_T entry)
{
    return (float4)(two_floats(media[2 * entry]), two_floats(media[2 * entry + 1]));
}

#elif PACKED == 16

// A supersegment is (front, back), then (extinction, colour), the first three as bits of floats.
#define SUPERSEGMENTS_PARAMETERS __global const ulong *supersegments, __global const float *constants,
#define SUPERSEGMENTS_ARGUMENTS supersegments, constants,
#define FACE(list, k) face_on_ray(&(list), two_floats(supersegments[2 * entry_of(&(list), k)]))
#define MEDIUM(list, k) medium_at(supersegments[2 * entry_of(&(list), k) + 1])

inline ListReal4 medium_of(ListUint extinction, ListUint color)
{
    return LIST_REAL4(LIST_TO_REAL(color & 2047) * (1.0f / 2047.0f), LIST_TO_REAL(color >> 11 & 2047) * (1.0f / 2047.0f),
                      LIST_TO_REAL(color >> 22) * (1.0f / 1023.0f), LIST_AS_REAL(extinction));
}

#if LANES == 1 || defined(SHARED_LISTS)
inline float4 medium_at(ulong word)
{
    return medium_of((uint)word, (uint)(word >> 32));
}
#endif

#elif PACKED == 8

// A list that is not empty begins with LIST_HEADER pairs of words: (origin, stride), in steps of depth, and (1 over the
// model length of a code of depth, unused).
#define SUPERSEGMENTS_PARAMETERS                                                                        \
    __global const uint2 *words,                                                                        \
    __global const float *constants, /* step of depth, least offset in front of the eye; world units */
#define SUPERSEGMENTS_ARGUMENTS words, constants,
#define TAU_BASE ((127 - 18) << 7)

// The depth coordinate of a code. Whole steps stay below 2^24 and a step is a power of two: nothing is rounded before it.
inline ListReal depth_of_code(const List *list, ListUint code)
{
    const ListReal offset = LIST_TO_REAL(list->origin + LIST_AS_INT(code) * list->stride) * list->step;
#ifdef PARALLEL
    return depth_coordinate(offset, list->depths);
#else
    return depth_coordinate(fmax(offset, list->nearest), list->depths);
#endif
}

// Front and back of the first word of a supersegment.
#define FRONT_OF_WORD(list, first) depth_of_code(list, (first) & DEPTH_CODES)
#define BACK_OF_WORD(list, first) depth_of_code(list, (first) >> 14 & DEPTH_CODES)

inline ListReal4 medium_of(const List *list, ListUint first, ListUint second)
{
    const ListUint tau = first >> 28 | (second & 255) << 4;
    const ListUint thickness = (first >> 14 & DEPTH_CODES) - (first & DEPTH_CODES);
    const ListReal optical_depth = LIST_SELECT((ListReal)(0.0f), LIST_AS_REAL((tau + TAU_BASE - 1) << 16), tau > 0);
    return LIST_REAL4(LIST_TO_REAL(second >> 8 & 255) * (1.0f / 255.0f), LIST_TO_REAL(second >> 16 & 255) * (1.0f / 255.0f),
                      LIST_TO_REAL(second >> 24) * (1.0f / 255.0f),
                      fmin(optical_depth * list->per_code / LIST_TO_REAL(thickness), FLT_MAX));
}

#if LANES == 1 || defined(SHARED_LISTS)
#define LIST_AT(i, j) packed_list_at(headers, words, constants, i, j, lists_wide, DEPTHS)
#define FACE(list, k) face_of(&(list), words[entry_of(&(list), k)].x)
#define MEDIUM(list, k) medium_at(&(list), words[entry_of(&(list), k)])

inline List packed_list_at(__global const OFFSET_T *offsets, __global const uint2 *words, __global const float *constants,
                           int i, int j, int lists_wide, Depths depths)
{
    const int place = BUNDLE_OF_LIST(i, j, lists_wide);
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

inline float2 face_of(const List *list, uint first)
{
    return (float2)(FRONT_OF_WORD(list, first), BACK_OF_WORD(list, first));
}

inline float4 medium_at(const List *list, uint2 word)
{
    return medium_of(list, word.x, word.y);
}
#endif

#endif

#ifndef FRONT
#define FRONT(list, k) FACE(list, k).x
#define BACK(list, k) FACE(list, k).y
#endif

inline void prefetch_list(__global const HEADER_T *headers, SUPERSEGMENTS_PARAMETERS int i, int j, int lists_wide)
{
    const int bundle = BUNDLE_OF_LIST(i, j, lists_wide);
#if defined(PACKED) && PACKED == 8
    prefetch_share((__global const ulong *)words, headers[bundle], (int)(headers[bundle + 1] - headers[bundle]), 1, 0);
#else
    const OFFSET_T first = first_of_header(headers[bundle]);
    const int count = count_of_header(headers[bundle]), share = PLACE_IN_BUNDLE(i, j);
#ifdef PACKED
    prefetch_share(supersegments, first, count, 2, share);
#else
    prefetch_share(faces, first, count, 1, share);
    prefetch_share(media, first, count, 2, share);
#endif
#endif
}
