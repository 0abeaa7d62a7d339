// How the supersegments of a list are read: their faces, (front, back) in the depth coordinate of V_O's list space, and
// their media, (straight RGB, extinction per model length). docs/conventions.md, "Packed supersegments", has the bits.
//
// -D PACKED=16, PACKED=8   supersegments of so many bytes; otherwise 24: two arrays of floats
//
//     SUPERSEGMENTS_PARAMETERS   of a kernel
//     LIST_LENGTH(begin, end)    supersegments in the list of these offsets
//     BEGIN_LIST(begin)          before its supersegments are read
//     LIST(begin)                the list, for common/lists.cl
//     FACE(k), MEDIUM(k)         of supersegment k, begin <= k < begin + LIST_LENGTH
#include "common/list_space.cl"
#pragma OPENCL FP_CONTRACT OFF

#if !defined(PACKED)

#define SUPERSEGMENTS_PARAMETERS                                                   \
    __global const float2 *faces, /* depth coordinates of front and back */        \
    __global const float4 *media, /* straight RGB, extinction per model length */
typedef __global const float2 *Stored;
#define STORED faces
#define LIST_LENGTH(begin, end) (int)((end) - (begin))
#define MEDIUM(k) media[k]

inline float2 stored_face(Stored list, int k)
{
    return list[k];
}

#elif PACKED == 16

// A supersegment is (front, back, extinction, colour), the first three as bits of floats.
#define SUPERSEGMENTS_PARAMETERS __global const uint4 *supersegments, __global const float *constants,
typedef __global const uint4 *Stored;
#define STORED supersegments
#define LIST_LENGTH(begin, end) (int)((end) - (begin))
#define MEDIUM(k) medium_of(supersegments[k])

inline float2 stored_face(Stored list, int k)
{
    return as_float2(list[k].xy);
}

inline float4 medium_of(uint4 supersegment)
{
    const uint color = supersegment.w;
    return (float4)((float)(color & 2047) * (1.0f / 2047.0f), (float)(color >> 11 & 2047) * (1.0f / 2047.0f),
                    (float)(color >> 22) * (1.0f / 1023.0f), as_float(supersegment.z));
}

#elif PACKED == 8

// A list that is not empty begins with LIST_HEADER pairs of words: (origin, stride), in steps of depth, and (1 over the
// model length of a code of depth, unused).
#define SUPERSEGMENTS_PARAMETERS                                                                        \
    __global const uint2 *words,                                                                        \
    __global const float *constants, /* step of depth, least offset in front of the eye; world units */
#define LIST_HEADER 2
#define DEPTH_CODES 16383
#define TAU_BASE ((127 - 18) << 7)
#define LIST_LENGTH(begin, end) max((int)((end) - (begin)) - LIST_HEADER, 0)
#define BEGIN_LIST(begin) const List here = list_at(words + (begin), constants, DEPTHS);
#define LIST(begin) here
#define FACE(k) (float2)(front_of(here, (int)((k) - begin)), back_of(here, (int)((k) - begin)))
#define MEDIUM(k) medium_of(here, (int)((k) - begin))

typedef struct {
    __global const uint2 *words; // behind the header
    int origin, stride;
    float per_code;              // 1 over a code's model length
    float step, nearest;
    Depths depths;
} List;

inline List list_at(__global const uint2 *words, __global const float *constants, Depths depths)
{
    const List list = {words + LIST_HEADER, as_int(words[0].x), as_int(words[0].y), as_float(words[1].x),
                       constants[0],        constants[1],       depths};
    return list;
}

// The depth coordinate of a code. Whole steps stay below 2^24 and a step is a power of two: nothing is rounded before it.
inline float face_of_code(const List *list, uint code)
{
    const float offset = (float)(list->origin + (int)code * list->stride) * list->step;
#ifdef PARALLEL
    return depth_coordinate(offset, list->depths);
#else
    return depth_coordinate(fmax(offset, list->nearest), list->depths);
#endif
}

inline float front_of(List list, int k)
{
    return face_of_code(&list, list.words[k].x & DEPTH_CODES);
}

inline float back_of(List list, int k)
{
    return face_of_code(&list, list.words[k].x >> 14 & DEPTH_CODES);
}

inline float4 medium_of(List list, int k)
{
    const uint2 word = list.words[k];
    const uint tau = word.x >> 28 | (word.y & 255) << 4;
    const uint thickness = (word.x >> 14 & DEPTH_CODES) - (word.x & DEPTH_CODES);
    const float optical_depth = tau > 0 ? as_float((tau + TAU_BASE - 1) << 16) : 0.0f;
    return (float4)((float)(word.y >> 8 & 255) * (1.0f / 255.0f), (float)(word.y >> 16 & 255) * (1.0f / 255.0f),
                    (float)(word.y >> 24) * (1.0f / 255.0f),
                    fmin(optical_depth * list.per_code / (float)thickness, FLT_MAX));
}

#endif

#if PACKED != 8
#ifdef FAR_ENTRIES
typedef struct {
    Stored faces; // offsets
    Depths depths;
} List;
#define BEGIN_LIST(begin) const List here = {STORED + (begin), DEPTHS};
#define LIST(begin) here
#define FACE(k) (float2)(front_of(here, (int)((k) - begin)), back_of(here, (int)((k) - begin)))

inline float front_of(List list, int k)
{
    return depth_coordinate(stored_face(list.faces, k).x, list.depths);
}

inline float back_of(List list, int k)
{
    return depth_coordinate(stored_face(list.faces, k).y, list.depths);
}
#else
typedef Stored List;
#define BEGIN_LIST(begin)
#define LIST(begin) STORED + (begin)
#define FACE(k) stored_face(STORED + k, 0)

inline float front_of(List list, int k)
{
    return stored_face(list, k).x;
}

inline float back_of(List list, int k)
{
    return stored_face(list, k).y;
}
#endif
#endif
