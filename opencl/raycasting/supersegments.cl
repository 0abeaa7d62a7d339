// How the supersegments of a list are read: their faces, (front, back) in the depth coordinate of
// V_O's list space, and their media, (straight RGB, extinction per model length).
//
// Lists lie in memory by bundles of BUNDLE x BUNDLE: the first supersegments of the bundle's lists,
// then the second ones, and so on, up to the longest list's last; a list that ends before is filled
// up with NO_FACE. So rays next to each other read what lies next to each other. A bundle's header
// is one word, of which FIRST_BITS say where its entries begin, the others how long its longest
// list is. Lists of 8-byte supersegments are bundles of one, which lie one behind the other; before
// one that is not empty lie LIST_HEADER words: (origin, stride), in steps of depth, and (1 over the
// model length of a code of depth, unused).
//
// -D OFFSET_T=int, long   type of an offset into the supersegments
// -D PACKED=0, 1          supersegments of 24 bytes, in two arrays; or of 8, in one
//                         (docs/dev/conventions.md, "Packed supersegments", has the bits)
#include "lib/list_space.cl"
#pragma OPENCL FP_CONTRACT OFF

#define LIST_SHIFT (PACKED ? 0 : BUNDLE_SHIFT)
#define LISTS_PER_BUNDLE (1 << 2 * LIST_SHIFT)
#define NO_FACE (float2)(INFINITY, INFINITY) // beyond every ray, from whichever side
#define WORDS_PER_LINE 8                     // of 8 bytes, in a line of the cache
#define TAU_BASE ((127 - 18) << 7)           // of an optical depth of 12 bits

// What every kernel takes that draws a frame (pyvista_vdi/raycasting/scene.py).
typedef struct {
    int lists_wide, lists_high;       // window of V_O
    int width, height;                // window of V_N
    int planes;                       // to clip to, of the forms
    int depth_kind, lists_near;       // see lib/list_space.cl; which end 1 / Z_deep is of
    float depth_origin;               // world units
    float cutoff;                     // a ray ends where less transmittance than this is left
    float first_depth;                // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth;            // per world unit
    float depth_step, nearest_offset; // of 8-byte lists: of depth; least in front of the eye
    uint regions;                     // of cropping that are kept, see lib/cropping.cl; 0: all
    int one_list;                     // whether a ray stays in a list
} Frame;

// The lists of a VDI, and the frame that is drawn of them.
typedef struct {
    __global const ulong *headers;
    __global const ulong *faces; // if packed, the supersegments
    __global const ulong *media; // straight RG, then B and extinction; none if packed
    __global const ulong *masks; // of the occupancy grid's stacks: occupied slabs; 0: not skipped
    Frame frame;
} Lists;

#define VDI_PARAMETERS                                                                             \
    __global const ulong *headers, __global const ulong *faces, __global const ulong *media,       \
        __global const ulong *masks, Frame frame, __global const float *forms, /* see begin_ray */ \
        __global const float *opaque_depth /* t at which each pixel's ray ends; 0: none does */
#define LISTS_OF_PARAMETERS {headers, faces, media, masks, frame}

typedef struct {
    OFFSET_T first;     // entry of its first supersegment
    int count;          // of its supersegments, with what it is filled up with
    int origin, stride; // if PACKED, and:
    float per_code;     // 1 over a code's model length
} List;

// Bundle of list (i, j) in a window of so many lists, and the list's place in it.
#define BUNDLE_OF_LIST(i, j, lists_wide)                                                           \
    (((j) >> LIST_SHIFT) * (((lists_wide) + (1 << LIST_SHIFT) - 1) >> LIST_SHIFT) +                \
     ((i) >> LIST_SHIFT))
#define PLACE_IN_BUNDLE(i, j)                                                                      \
    (((j) & ((1 << LIST_SHIFT) - 1)) << LIST_SHIFT | ((i) & ((1 << LIST_SHIFT) - 1)))

inline OFFSET_T first_of_header(ulong header)
{
    return (OFFSET_T)(header & ((1UL << FIRST_BITS) - 1));
}

inline int count_of_header(ulong header) { return (int)(header >> FIRST_BITS); }

inline OFFSET_T entry_of(List list, int k) { return list.first + ((OFFSET_T)k << 2 * LIST_SHIFT); }

// Two floats that were loaded as one word.
inline float2 two_floats(ulong word)
{
    return (float2)(as_float((uint)word), as_float((uint)(word >> 32)));
}

// List (i, j).
inline List list_at(const Lists *lists, int i, int j)
{
    const ulong header = lists->headers[BUNDLE_OF_LIST(i, j, lists->frame.lists_wide)];
    List list = {first_of_header(header) + PLACE_IN_BUNDLE(i, j), count_of_header(header), 0, 0};
    if (PACKED && list.count > 0) {
        const ulong scale = lists->faces[list.first - LIST_HEADER];
        list.origin = as_int((uint)scale);
        list.stride = as_int((uint)(scale >> 32));
        list.per_code = as_float((uint)lists->faces[list.first - 1]);
    }
    return list;
}

// The depth coordinate of a code of 14 bits. Whole steps stay below 2^24 and a step is a power of
// two: nothing is rounded before it.
inline float depth_of_code(const Lists *lists, List list, uint code, Depths depths)
{
    const float offset =
        (float)(list.origin + as_int(code & DEPTH_CODES) * list.stride) * lists->frame.depth_step;
    return depth_coordinate(fmax(offset, lists->frame.nearest_offset), depths);
}

// Front and back of supersegment k of a list, 0 <= k < list.count.
inline float2 face_of(const Lists *lists, List list, int k, Depths depths)
{
    const OFFSET_T entry = entry_of(list, k);
    const ulong word = lists->faces[entry];
    if (PACKED)
        return (float2)(depth_of_code(lists, list, (uint)word, depths),
                        depth_of_code(lists, list, (uint)word >> 14, depths));
    const float2 face = two_floats(word);
    if (!FACES_ARE_OFFSETS)
        return face;
    return face.x < INFINITY
               ? (float2)(depth_coordinate(face.x, depths), depth_coordinate(face.y, depths))
               : NO_FACE;
}

// Where a ray enters and leaves it, in its sense (raycasting/lists.cl).
inline float2 face_in_sense(const Lists *lists, List list, int k, bool away, Depths depths)
{
    const float2 face = face_of(lists, list, k, depths);
    return away ? face : -face.yx;
}

// Its medium; undefined for NO_FACE.
inline float4 medium_of(const Lists *lists, List list, int k)
{
    const OFFSET_T entry = entry_of(list, k);
    if (!PACKED)
        return (float4)(two_floats(lists->media[2 * entry]),
                        two_floats(lists->media[2 * entry + 1]));
    const ulong word = lists->faces[entry];
    const uint low = (uint)word, high = (uint)(word >> 32);
    const uint tau = low >> 28 | (high & 255) << 4;
    const uint thickness = (low >> 14 & DEPTH_CODES) - (low & DEPTH_CODES);
    const float optical_depth = tau > 0 ? as_float((tau + TAU_BASE - 1) << 16) : 0.0f;
    return (float4)((float)(high >> 8 & 255) * (1.0f / 255.0f),
                    (float)(high >> 16 & 255) * (1.0f / 255.0f),
                    (float)(high >> 24) * (1.0f / 255.0f),
                    fmin(optical_depth * list.per_code / (float)thickness, FLT_MAX));
}

#if LANES == 16
// Depth coordinates of codes of 14 bits, in lists of these origins and strides: depth_of_code.
inline Real depths_of_codes(const Lists *lists, Int origin, Int stride, Uint codes, Depths depths)
{
    const Real offset =
        TO_REAL(origin + AS_INT(codes & DEPTH_CODES) * stride) * lists->frame.depth_step;
    return depth_coordinate(fmax(offset, lists->frame.nearest_offset), depths);
}

// Media of supersegments by their words, in lists of these scales: medium_of.
inline Real4 media_of_words(Uint low, Uint high, Real per_code)
{
    const Uint tau = low >> 28 | (high & 255) << 4;
    const Uint thickness = (low >> 14 & DEPTH_CODES) - (low & DEPTH_CODES);
    const Real optical_depth = select((Real)(0.0f), AS_REAL((tau + TAU_BASE - 1) << 16), tau > 0);
    return REAL4(TO_REAL(high >> 8 & 255) * (1.0f / 255.0f),
                 TO_REAL(high >> 16 & 255) * (1.0f / 255.0f), TO_REAL(high >> 24) * (1.0f / 255.0f),
                 fmin(optical_depth * per_code / TO_REAL(thickness), FLT_MAX));
}
#endif

// A ray that crosses fewer lists than this goes through the whole depth of a list's neighbourhood:
// worth to be brought close at once.
#define LISTS_TO_PREFETCH 48.0f

// Prefetch every LISTS_PER_BUNDLE-th line of the cache of a list's bundle, whose entries take so
// many words, from the share-th line on.
inline void prefetch_share(__global const ulong *words, OFFSET_T first, int count,
                           int words_per_entry, int share)
{
    const OFFSET_T end = words_per_entry * (first + count * LISTS_PER_BUNDLE);
    for (OFFSET_T k = words_per_entry * first + share * WORDS_PER_LINE; k < end;
         k += LISTS_PER_BUNDLE * WORDS_PER_LINE)
        prefetch(words + k, 1);
}

// Bring list (i, j) close; each list of a bundle brings its share.
inline void prefetch_list(const Lists *lists, int i, int j)
{
    const ulong header = lists->headers[BUNDLE_OF_LIST(i, j, lists->frame.lists_wide)];
    const OFFSET_T first = first_of_header(header);
    const int count = count_of_header(header), share = PLACE_IN_BUNDLE(i, j);
    prefetch_share(lists->faces, first, count, 1, share);
    if (!PACKED)
        prefetch_share(lists->media, first, count, 2, share);
}
