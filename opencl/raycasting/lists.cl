// The lists that a work-item's rays are in, one or sixteen (lib/lanes.cl), and what is read of
// them. How they lie in memory says raycasting/supersegments.cl.
#include "lib/transpose.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// 64 bits of each ray, in two halves.
typedef struct {
    Uint low, high;
} Words;

// Where rays enter and leave supersegments, in their sense: depths are negated for a ray that comes
// back towards V_O, so that they grow along every ray.
typedef struct {
    Real near, far;
} Faces;

// Index in a list of the n-th supersegment that a ray comes to: from the front, or from the back.
#define INDEX_MET(list, n, away) ((away) ? (n) : (list).count - 1 - (n))

#if LANES == 16
// Words of 64 bits come by one load each, as gathers are slow where these kernels run: as doubles,
// which CPUs have, they take an instruction less.
typedef double Word;
typedef double8 Words8;

// They are loaded in an order from which two shuffles within 128 bits make the halves of all.
inline Words halves_of(Words8 first, Words8 second)
{
    const Real p = as_float16(first), q = as_float16(second);
    const Words halves = {as_uint16(((Real)(p.even, q.even)).JOINED),
                          as_uint16(((Real)(p.odd, q.odd)).JOINED)};
    return halves;
}

// OF(k): the k-th lane's word
#define WORDS_OF(OF)                                                                               \
    halves_of((Words8)(OF(0), OF(1), OF(4), OF(5), OF(8), OF(9), OF(12), OF(13)),                  \
              (Words8)(OF(2), OF(3), OF(6), OF(7), OF(10), OF(11), OF(14), OF(15)))

inline Words words_at(__global const ulong *words, Int places)
{
    const Places in_memory = {places};
    Place *at = in_memory.each;
    __global const Word *const of = (__global const Word *)words;
#define WORD(k) of[at[k]]
    return WORDS_OF(WORD);
#undef WORD
}

typedef struct {
    Int first, count;
    Int origin, stride; // if PACKED
} ListMet;

// The lists (i, j) of the rays that ask.
inline ListMet list_met(const Lists *lists, Int i, Int j, Int asks)
{
    const Words header = words_at(
        lists->headers, select((Int)(0), BUNDLE_OF_LIST(i, j, lists->frame.lists_wide), asks));
    ListMet list = {AS_INT(header.low) + PLACE_IN_BUNDLE(i, j),
                    AS_INT(header.high >> (FIRST_BITS - 32)), 0, 0};
    if (PACKED) { // any list's scales if it has none
        const Words scales =
            words_at(lists->faces, select((Int)(0), list.first - LIST_HEADER, list.count > 0));
        list.origin = AS_INT(scales.low);
        list.stride = AS_INT(scales.high);
    }
    return list;
}

// Entry of the n-th supersegment that they come to, if they ask; otherwise any.
inline Int entry_met(ListMet list, Int n, Int asks, bool away)
{
    return select((Int)(0), list.first + (INDEX_MET(list, n, away) << 2 * LIST_SHIFT), asks);
}

inline Faces faces_met(const Lists *lists, ListMet list, Int n, Int asks, bool away, Depths depths)
{
    const Words face = words_at(lists->faces, entry_met(list, n, asks, away));
    Real front = AS_REAL(face.low), back = AS_REAL(face.high);
    if (PACKED) {
        front = depths_of_codes(lists, list.origin, list.stride, face.low, depths);
        back = depths_of_codes(lists, list.origin, list.stride, face.low >> 14, depths);
    }
    const Faces met = {away ? front : -back, away ? back : -front};
    return met;
}

// Pairs of words, which compilers shuffle less than vectors of four floats.
inline Real4 medium_met(const Lists *lists, ListMet list, Int n, Int asks, bool away)
{
    const Int entry = entry_met(list, n, asks, away);
    if (PACKED) {
        const Words words = words_at(lists->faces, entry);
        const Real per_code =
            AS_REAL(words_at(lists->faces, select((Int)(0), list.first - 1, asks)).low);
        return media_of_words(words.low, words.high, per_code);
    }
    const Places in_memory = {entry};
    Place *at = in_memory.each;
    __global const ulong2 *of = (__global const ulong2 *)lists->media;
#define ROW(k) as_float16((ulong8)(of[at[k]], of[at[(k) + 4]], of[at[(k) + 8]], of[at[(k) + 12]]))
    return transpose(REAL4(ROW(0), ROW(1), ROW(2), ROW(3)));
#undef ROW
}
#else
typedef List ListMet;

inline Words words_at(__global const ulong *words, int place)
{
    const Words halves = {(uint)words[place], (uint)(words[place] >> 32)};
    return halves;
}

inline List list_met(const Lists *lists, int i, int j, int asks) { return list_at(lists, i, j); }

inline Faces faces_met(const Lists *lists, List list, int n, int asks, bool away, Depths depths)
{
    const float2 face = face_in_sense(lists, list, INDEX_MET(list, n, away), away, depths);
    const Faces met = {face.x, face.y};
    return met;
}

inline float4 medium_met(const Lists *lists, List list, int n, int asks, bool away)
{
    return medium_of(lists, list, INDEX_MET(list, n, away));
}
#endif
