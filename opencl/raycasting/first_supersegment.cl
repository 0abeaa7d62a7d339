// The first supersegment that a ray meets in a list: Algorithm 1 of the paper, by its intent
// (docs/conventions.md, "The paper's pseudocode, and its replacement", lists the errata).
// Where its lines are:
//
//   1, 2      BinS in a ray's first list: begin_walk (walk.cl) begins at guess 0 instead, whence
//             close guesses and then halving lead on, as from any other p
//   3 to 14   first_supersegment
//   16 to 20  note_face (walk.cl): the front lies before the exit, where the paper has f > i_exit,
//             the wrong way round
//
// Faces are sorted and disjoint. A ray that comes back towards V_O meets them in reverse: all here
// is in the ray's sense, in which it comes to the 0-th first, and depths are negated for a ray that
// comes back, so that they grow along every ray. So p counts from where the ray comes from; the
// paper's counts from the front.
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Where a ray enters and leaves a supersegment, in its sense.
typedef struct {
    float near, far;
} Faces;

// Index in the list of the n-th supersegment that a ray comes to: from the front, or from the back.
inline int index_met(List list, int n, bool away) { return away ? n : list.count - 1 - n; }

inline Faces faces_met(const Lists *lists, List list, int n, bool away, Depths depths)
{
    const float2 face = face_of(lists, list, index_met(list, n, away), depths);
    const Faces met = {away ? face.x : -face.y, away ? face.y : -face.x};
    return met;
}

// Guesses by one more or less before the rest is halved.
#define CLOSE_GUESSES 4

// A search through a list for the first supersegment that ends behind a depth.
typedef struct {
    int p;         // the guess: at first Algorithm 1's p, the answer in the list before
    int low, high; // all before `low` end before the depth; the answer is `high` at most
    int missed;    // guesses that were wrong
} Search;

inline Search begin_search(int guess)
{
    const Search search = {guess, 0, INT_MAX, 0};
    return search;
}

// Compare one guess: Algorithm 1, a comparison a call, so that rays side by side need not wait for
// the one that searches longest. Returns whether search->p is the answer, list.count where all end
// before the depth; *face is its face then, at infinity if there is none.
inline bool first_supersegment(Search *search, const Lists *lists, List list, float depth,
                               bool away, Depths depths, Faces *face)
{
    // Lines 3 and 12: does the guess exist, and end behind the point of entry?
    const int p = min(search->p, list.count);
    face->near = face->far = INFINITY;
    const bool exists = p < list.count;
    if (exists)
        *face = faces_met(lists, list, p, away, depths);
    search->p = p;
    const bool passed = exists && face->far <= depth;
    // Lines 4 to 6: it is the answer if the one before ends before that; nothing is to be asked if
    // the guess holds the point
    const bool asks = face->near > depth && p > search->low;
    const bool beyond = asks && faces_met(lists, list, p - 1, away, depths).far > depth;
    if (!passed && !beyond)
        return true;

    // Lines 7 to 14: the one before or behind, and after some of them BinS, the middle of the rest
    search->low = passed ? p + 1 : search->low;
    search->high = beyond ? p - 1 : search->high;
    search->p = passed ? p + 1 : p - 1;
    if (++search->missed >= CLOSE_GUESSES)
        search->p = (search->low + min(search->high, list.count)) >> 1;
    return false;
}
