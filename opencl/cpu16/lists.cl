// Lists of sixteen rays, each of which is in a list of its own (raycasting/supersegments.cl), and
// the search of raycasting/first_supersegment.cl through them: Algorithm 1 of the paper. What one
// ray has, and sixteen:
//
//   raycasting/                here
//   Search, p                  Searches, n
//   first_supersegment         search_on (lines 3 to 6 and 12), guess_again (7 to 14)
//   begin_search               search_again
//   List, list_at              ListOfEach, lists_at
//   Faces, faces_met           FacesOfEach, faces_met
//   index_met                  entry_met
//   medium_of                  medium_met
//
// Words of 64 bits come by one load each, as gathers are slow where these kernels run: as doubles,
// where there are any, they take an instruction less.
#include "cpu16/codes.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef cl_khr_fp64
typedef double Word;
typedef double8 Words8;
#define AS_WORD as_double
#else
typedef ulong Word;
typedef ulong8 Words8;
#define AS_WORD as_ulong
#endif

// Words in two halves. They are loaded in an order from which two shuffles within 128 bits make the
// halves of all.
typedef struct {
    Uint low, high;
} Words;

inline Words halves_of(Words8 first, Words8 second)
{
    const Real p = as_float16(first), q = as_float16(second);
    Words halves;
    halves.low = as_uint16(((Real)(p.even, q.even)).JOINED);
    halves.high = as_uint16(((Real)(p.odd, q.odd)).JOINED);
    return halves;
}

// OF(k): the k-th lane's word
#define WORDS_OF(OF)                                                                               \
    halves_of((Words8)(OF(0), OF(1), OF(4), OF(5), OF(8), OF(9), OF(12), OF(13)),                  \
              (Words8)(OF(2), OF(3), OF(6), OF(7), OF(10), OF(11), OF(14), OF(15)))

inline Words words_at(__global const ulong *words, Int places)
{
    const Places in_memory = {places};
    const volatile int *at = in_memory.each;
    __global const Word *const of = (__global const Word *)words;
#define WORD(k) of[at[k]]
    return WORDS_OF(WORD);
#undef WORD
}

// A list of each ray.
typedef struct {
    Int first, count;
    Int origin, stride; // if PACKED
} ListOfEach;

inline ListOfEach lists_at(const Lists *lists, Int i, Int j, Int asks)
{
    const Int bundle = select((Int)(0), BUNDLE_OF_LIST(i, j, lists->wide), asks);
    ListOfEach list;
    list.origin = list.stride = 0;
#if PACKED
    // Where it begins and ends, two numbers side by side
    const Places in_memory = {bundle};
    const volatile int *at = in_memory.each;
#define ENDS(k) AS_WORD(vload2(0, lists->headers + at[k]))
    const Words ends = WORDS_OF(ENDS);
#undef ENDS
    list.first = AS_INT(ends.low) + LIST_HEADER;
    list.count = max(AS_INT(ends.high) - list.first, 0);
    // Any list's scales if it has none
    const Words scales = words_at(lists->faces, select((Int)(0), AS_INT(ends.low), list.count > 0));
    list.origin = AS_INT(scales.low);
    list.stride = AS_INT(scales.high);
#else
    const Words header = words_at(lists->headers, bundle);
    list.first = AS_INT(header.low) + PLACE_IN_BUNDLE(i, j);
    list.count = AS_INT(header.high >> (FIRST_BITS - 32));
#endif
    return list;
}

// Where rays enter and leave a supersegment, in their sense.
typedef struct {
    Real near, far;
} FacesOfEach;

// Entry of the n-th supersegment that they come to, if they ask; otherwise any.
inline Int entry_met(const ListOfEach *list, Int n, Int asks, bool away)
{
    const Int k = away ? n : list->count - 1 - n;
    return select((Int)(0), list->first + (k << 2 * LIST_SHIFT), asks);
}

inline FacesOfEach faces_met(const Lists *lists, const ListOfEach *list, Int n, Int asks, bool away,
                             float depth_origin)
{
    const Int entry = entry_met(list, n, asks, away);
    const Words face = words_at(lists->faces, entry);
    Real front = AS_REAL(face.low), back = AS_REAL(face.high);
    if (PACKED) {
        front = depths_of_codes(lists, list->origin, list->stride, face.low, depth_origin);
        back = depths_of_codes(lists, list->origin, list->stride, face.low >> 14, depth_origin);
    }
    FacesOfEach met;
    met.near = away ? front : -back;
    met.far = away ? back : -front;
    return met;
}

// Pairs of words, which compilers shuffle less than vectors of four floats.
inline Real4 medium_met(const Lists *lists, const ListOfEach *list, Int n, Int asks, bool away)
{
    const Int entry = entry_met(list, n, asks, away);
    if (PACKED) {
        const Words words = words_at(lists->faces, entry);
        const Real per_code =
            AS_REAL(words_at(lists->faces, select((Int)(0), list->first - 1, asks)).low);
        return media_of_words(words.low, words.high, per_code);
    }
    const Places in_memory = {entry};
    const volatile int *at = in_memory.each;
    __global const ulong2 *of = (__global const ulong2 *)lists->media;
#define ROW(k) as_float16((ulong8)(of[at[k]], of[at[(k) + 4]], of[at[(k) + 8]], of[at[(k) + 12]]))
    return transpose(REAL4(ROW(0), ROW(1), ROW(2), ROW(3)));
#undef ROW
}

// Guesses by one more or less before the rest is halved.
#define CLOSE_GUESSES 4

typedef struct {
    Int n;         // the guess, p of one ray's search
    Int low, high; // all before `low` end before the depth; the answer is `high` at most
    Int missed;    // guesses that were wrong
    Int passed,
        beyond; // whether the last one ends before the depth, or the one before it ends behind it
} Searches;

// Compare the guesses of those that are `searching`. Returns for which it is the answer, search->n:
// list.count if all end before; *face is its face, infinite if there is none.
inline Int search_on(Searches *search, const Lists *lists, const ListOfEach *list, Real depth,
                     Int searching, bool away, float depth_origin, FacesOfEach *face)
{
    const Int n = min(search->n, list->count);
    const Int there = searching && n < list->count;
    face->near = face->far = INFINITY;
    if (ANY(there)) {
        const FacesOfEach met = faces_met(lists, list, n, there, away, depth_origin);
        face->near = select(face->near, met.near, there);
        face->far = select(face->far, met.far, there);
    }
    search->n = n;
    search->passed = there && face->far <= depth;
    // The one before is loaded in any case, as a processor cannot foresee whether any ray asks
    const Int asks = searching && face->near > depth && n > search->low;
    search->beyond = asks && faces_met(lists, list, n - 1, asks, away, depth_origin).far > depth;
    return searching && !search->passed && !search->beyond;
}

// Guess again, if it was wrong: the next supersegment for those that are `behind` the answer, too,
// as nothing is left to search for.
inline void guess_again(Searches *search, const ListOfEach *list, Int behind)
{
    const Int wrong = search->passed || search->beyond;
    const Int onwards = search->passed || behind;
    search->low = select(search->low, search->n + 1, onwards);
    search->high = select(search->high, search->n - 1, search->beyond);
    search->missed += COUNT(wrong);
    search->n = select(select(search->n, search->n - 1, search->beyond), search->n + 1, onwards);
    search->n = select(search->n, (search->low + min(search->high, list->count)) >> 1,
                       wrong && search->missed >= CLOSE_GUESSES);
}

// Begin again in another list, where `begins`.
inline void search_again(Searches *search, Int begins)
{
    search->low = select(search->low, (Int)(0), begins);
    search->high = select(search->high, (Int)(INT_MAX), begins);
    search->missed = select(search->missed, (Int)(0), begins);
}
