// Lists of sixteen rays, each of which is in a list of its own, of supersegments of 24 bytes
// (raycasting/supersegments.cl), and the search of raycasting/first_supersegment.cl through them:
// Algorithm 1 of the paper. What one ray has, and sixteen:
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
#include "lib/transpose.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef cl_khr_fp64
typedef double Word;
typedef double8 Words8;
#else
typedef ulong Word;
typedef ulong8 Words8;
#endif

// Words in two halves. They are loaded in an order from which two shuffles within 128 bits make the
// halves of all.
typedef struct {
    Uint low, high;
} Words;

inline Words words_at(__global const ulong *words, Int places)
{
    const Places in_memory = {places};
    const volatile int *at = in_memory.each;
    __global const Word *of = (__global const Word *)words;
    const Real p = as_float16((Words8)(of[at[0]], of[at[1]], of[at[4]], of[at[5]], of[at[8]],
                                       of[at[9]], of[at[12]], of[at[13]]));
    const Real q = as_float16((Words8)(of[at[2]], of[at[3]], of[at[6]], of[at[7]], of[at[10]],
                                       of[at[11]], of[at[14]], of[at[15]]));
    Words halves;
    halves.low = as_uint16(((Real)(p.even, q.even)).JOINED);
    halves.high = as_uint16(((Real)(p.odd, q.odd)).JOINED);
    return halves;
}

// A list of each ray.
typedef struct {
    Int first, count;
} ListOfEach;

inline ListOfEach lists_at(const Lists *lists, Int i, Int j, Int asks)
{
    const Words header =
        words_at(lists->headers, select((Int)(0), BUNDLE_OF_LIST(i, j, lists->wide), asks));
    ListOfEach list;
    list.first = AS_INT(header.low) + PLACE_IN_BUNDLE(i, j);
    list.count = AS_INT(header.high >> (FIRST_BITS - 32));
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

inline FacesOfEach faces_met(const Lists *lists, const ListOfEach *list, Int n, Int asks, bool away)
{
    const Words face = words_at(lists->faces, entry_met(list, n, asks, away));
    FacesOfEach met;
    met.near = away ? AS_REAL(face.low) : -AS_REAL(face.high);
    met.far = away ? AS_REAL(face.high) : -AS_REAL(face.low);
    return met;
}

// Pairs of words, which compilers shuffle less than vectors of four floats.
inline Real4 medium_met(const Lists *lists, const ListOfEach *list, Int n, Int asks, bool away)
{
    const Places in_memory = {entry_met(list, n, asks, away)};
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
                     Int searching, bool away, FacesOfEach *face)
{
    const Int n = min(search->n, list->count);
    const Int there = searching && n < list->count;
    face->near = face->far = INFINITY;
    if (ANY(there)) {
        const FacesOfEach met = faces_met(lists, list, n, there, away);
        face->near = select(face->near, met.near, there);
        face->far = select(face->far, met.far, there);
    }
    search->n = n;
    search->passed = there && face->far <= depth;
    // The one before is loaded in any case, as a processor cannot foresee whether any ray asks
    const Int asks = searching && face->near > depth && n > search->low;
    search->beyond = asks && faces_met(lists, list, n - 1, asks, away).far > depth;
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
