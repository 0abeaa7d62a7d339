// The first supersegment that a ray meets in a list: Algorithm 1 of the paper, by its intent
// (docs/dev/conventions.md, "The paper's pseudocode, and its replacement", lists the errata). Its
// lines are:
//
//   1, 2             begin_search: a ray's first list has the guess 0, whence close guesses and
//   then
//                    halving lead on, as from any other p
//   3 to 6, and 12   first_supersegment: is the guess the answer?
//   7 to 14          guess_again
//   16 to 20         crosses: the front lies before the exit, where the paper has f > i_exit, the
//                    wrong way round
//
// Faces are sorted and disjoint. A ray that comes back towards V_O meets them in reverse: all here
// is in the ray's sense (raycasting/lists.cl), in which it comes to the 0-th first. So p counts
// from where the ray comes from; the paper's counts from the front.
#include "raycasting/lists.cl"
#pragma OPENCL FP_CONTRACT OFF

// Guesses by one more or less before the rest is halved.
#define CLOSE_GUESSES 4

// A search through a list for the first supersegment that ends behind a depth.
typedef struct {
    Int p;         // the guess: at first Algorithm 1's p, the answer in the list before
    Int low, high; // all before `low` end before the depth; the answer is `high` at most
    Int missed;    // guesses that were wrong
    // Whether the last one ends before the depth, or the one before it ends behind it
    Int passed, beyond;
} Search;

inline Search begin_search(Int guess)
{
    const Search search = {guess, 0, INT_MAX, 0, 0, 0};
    return search;
}

// Begin again in another list, where `begins`.
inline void search_again(Search *search, Int begins)
{
    search->low = SELECT(search->low, (Int)(0), begins);
    search->high = SELECT(search->high, (Int)(INT_MAX), begins);
    search->missed = SELECT(search->missed, (Int)(0), begins);
}

// Compare the guesses of the rays that are `searching`, one a call, so that rays side by side need
// not wait for the one that searches longest. Returns for which search->p is the answer, list.count
// where all end before the depth; *face is its face, at infinity if there is none.
inline Int first_supersegment(Search *search, const Lists *lists, ListMet list, Real depth,
                              Int searching, bool away, Depths depths, Faces *face)
{
    // Lines 3 and 12: does the guess exist, and end behind the point of entry?
    const Int p = min(search->p, list.count);
    const Int exists = searching && p < list.count;
    face->near = face->far = INFINITY;
    if (ANY(exists)) {
        const Faces met = faces_met(lists, list, p, exists, away, depths);
        face->near = SELECT(face->near, met.near, exists);
        face->far = SELECT(face->far, met.far, exists);
    }
    search->p = p;
    search->passed = exists && face->far <= depth;
    // Lines 4 to 6: it is the answer if the one before ends before that; nothing is to be asked if
    // the guess holds the point. Of sixteen rays it is loaded in any case, as a processor cannot
    // foresee whether any asks
    const Int asks = searching && face->near > depth && p > search->low;
    search->beyond = asks && faces_met(lists, list, p - 1, asks, away, depths).far > depth;
    return searching && !search->passed && !search->beyond;
}

// Lines 7 to 14: guess the one before or behind, and after some of them BinS, the middle of the
// rest. Rays that go on `behind` the answer have nothing left to search for.
inline void guess_again(Search *search, ListMet list, Int behind)
{
    const Int wrong = search->passed || search->beyond;
    const Int onwards = search->passed || behind;
    search->low = SELECT(search->low, search->p + 1, onwards);
    search->high = SELECT(search->high, search->p - 1, search->beyond);
    search->missed += COUNT(wrong);
    search->p = SELECT(SELECT(search->p, search->p - 1, search->beyond), search->p + 1, onwards);
    search->p = SELECT(search->p, (search->low + min(search->high, list.count)) >> 1,
                       wrong && search->missed >= CLOSE_GUESSES);
}

// Lines 16 to 20: whether a ray crosses the supersegment of a face before it leaves the list.
inline Int crosses(Faces face, Real exit_depth) { return face.near <= exit_depth; }
