// Lists of supersegments: where a ray first meets one (paper Algorithm 1, its intent; docs/conventions.md lists the errata).
//
// Faces are (front, back) in the depth coordinate of V_O's list space, which grows with depth; sorted and disjoint. A ray
// that comes back towards V_O meets them in reverse: all here is in the ray's sense, in which it comes to the 0-th first, and
// depths are negated for a ray that comes back, so that they grow along every ray.
#include "lib/transpose.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef SHARED_LISTS
// Where rays enter and leave the n-th supersegment that they come to, in their sense.
inline float near_face(List list, SUPERSEGMENTS_PARAMETERS int n, bool away)
{
    return away ? FRONT(list, n) : -BACK(list, list.count - 1 - n);
}

inline float far_face(List list, SUPERSEGMENTS_PARAMETERS int n, bool away)
{
    return away ? BACK(list, n) : -FRONT(list, list.count - 1 - n);
}
#else
// Where rays enter and leave a supersegment, in their sense.
typedef struct {
    Real near, far;
} Faces;

#if LANES == 1
#define LISTS_AT(i, j, asks) LIST_AT(i, j)

// The n-th supersegment that they come to, if they ask; otherwise anything.
inline Faces faces_met(const List *list, SUPERSEGMENTS_PARAMETERS Int n, Int asks, bool away)
{
    const float2 face = asks ? FACE(*list, away ? n : list->count - 1 - n) : NO_FACE;
    const Faces met = {away ? face.x : -face.y, away ? face.y : -face.x};
    return met;
}

inline Real4 medium_met(const List *list, SUPERSEGMENTS_PARAMETERS Int n, Int asks, bool away)
{
    return asks ? MEDIUM(*list, away ? n : list->count - 1 - n) : (float4)(0.0f);
}
#else
// Words of 64 bits, in two halves, one load each, as gathers are slow where these kernels run: as doubles, where there are any,
// they take an instruction less. They come in an order from which two shuffles within 128 bits make the halves of all.
typedef struct {
    Uint low, high;
} Words;

#ifdef cl_khr_fp64
typedef double Word;
typedef double8 Words8;
#else
typedef ulong Word;
typedef ulong8 Words8;
#endif

inline Words words_at(__global const ulong *words, Int places)
{
    const Places in_memory = {places};
    const volatile int *at = in_memory.each;
    __global const Word *of = (__global const Word *)words;
    const Real p = as_float16((Words8)(of[at[0]], of[at[1]], of[at[4]], of[at[5]], of[at[8]], of[at[9]], of[at[12]], of[at[13]]));
    const Real q = as_float16((Words8)(of[at[2]], of[at[3]], of[at[6]], of[at[7]], of[at[10]], of[at[11]], of[at[14]], of[at[15]]));
    Words halves;
    halves.low = as_uint16(((Real)(p.even, q.even)).JOINED);
    halves.high = as_uint16(((Real)(p.odd, q.odd)).JOINED);
    return halves;
}

#define LISTS_AT(i, j, asks) lists_at(headers, i, j, asks, lists_wide)
inline List lists_at(__global const ulong *headers, Int i, Int j, Int asks, int lists_wide)
{
    const Words header = words_at(headers, SELECT((Int)(0), BUNDLE_OF_LIST(i, j, lists_wide), asks));
    List list;
    list.first = AS_INT(header.low) + PLACE_IN_BUNDLE(i, j);
    list.count = AS_INT(header.high >> (FIRST_BITS - 32));
    return list;
}

inline Int entry_met(const List *list, Int n, Int asks, bool away)
{
    return SELECT((Int)(0), entry_of(list, away ? n : list->count - 1 - n), asks);
}

inline Faces faces_met(const List *list, SUPERSEGMENTS_PARAMETERS Int n, Int asks, bool away)
{
    const Words face = words_at(faces, entry_met(list, n, asks, away));
    Faces met;
    met.near = away ? AS_REAL(face.low) : -AS_REAL(face.high);
    met.far = away ? AS_REAL(face.high) : -AS_REAL(face.low);
    return met;
}

// Pairs of words, which compilers shuffle less than vectors of four floats.
inline Real4 medium_met(const List *list, SUPERSEGMENTS_PARAMETERS Int n, Int asks, bool away)
{
    const Places in_memory = {entry_met(list, n, asks, away)};
    const volatile int *at = in_memory.each;
    __global const ulong2 *of = (__global const ulong2 *)media;
#define ROW(k) as_float16((ulong8)(of[at[k]], of[at[(k) + 4]], of[at[(k) + 8]], of[at[(k) + 12]]))
    return transpose(REAL4(ROW(0), ROW(1), ROW(2), ROW(3)));
#undef ROW
}
#endif

// Guesses by one more or less before the rest is halved.
#define CLOSE_GUESSES 4

// The search for the first supersegment that ends behind a depth. It begins with a guess, the answer for the neighbouring
// list, which is mostly right or off by one; so its neighbours come next.
typedef struct {
    Int n;              // the guess
    Int low, high;      // all before `low` end before the depth; the answer is `high` at most
    Int missed;         // guesses that were wrong
    Int passed, beyond; // whether the last one ends before the depth, or the one before it ends behind it
} Search;

inline Search begin_search(Int guess)
{
    Search search;
    search.n = guess;
    search.low = search.missed = search.passed = search.beyond = 0;
    search.high = INT_MAX;
    return search;
}

// Compare the guesses of those that are `searching`. Returns for which it is the answer, search->n: list.count if all end before;
// *face is its face, infinite if there is none.
inline Int search_on(Search *search, const List *list, SUPERSEGMENTS_PARAMETERS Real depth, Int searching, bool away, Faces *face)
{
    const Int n = min(search->n, list->count);
    const Int there = searching && n < list->count;
    face->near = face->far = INFINITY;
    if (ANY(there)) {
        const Faces met = faces_met(list, SUPERSEGMENTS_ARGUMENTS n, there, away);
        face->near = SELECT(face->near, met.near, there);
        face->far = SELECT(face->far, met.far, there);
    }
    search->n = n;
    search->passed = there && face->far <= depth;
    // Nothing is left to ask about what lies before if the guess holds `depth`. Vectors load it in any case, as a processor
    // cannot foresee whether any ray asks
    const Int asks = searching && face->near > depth && n > search->low;
    search->beyond = asks && faces_met(list, SUPERSEGMENTS_ARGUMENTS n - 1, asks, away).far > depth;
    return searching && !search->passed && !search->beyond;
}

// Have another guess: the next supersegment for those that are `behind` the answer, too, as nothing is left to search for.
inline void guess_again(Search *search, const List *list, Int behind)
{
    const Int wrong = search->passed || search->beyond;
    const Int onwards = search->passed || behind;
    search->low = SELECT(search->low, search->n + 1, onwards);
    search->high = SELECT(search->high, search->n - 1, search->beyond);
    search->missed += COUNT(wrong);
    search->n = SELECT(SELECT(search->n, search->n - 1, search->beyond), search->n + 1, onwards);
    search->n = SELECT(search->n, (search->low + min(search->high, list->count)) >> 1,
                       wrong && search->missed >= CLOSE_GUESSES);
}

// Begin again in another list, where `begins`.
inline void search_again(Search *search, Int begins)
{
    search->low = SELECT(search->low, (Int)(0), begins);
    search->high = SELECT(search->high, (Int)(INT_MAX), begins);
    search->missed = SELECT(search->missed, (Int)(0), begins);
}
#endif
