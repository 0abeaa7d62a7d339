// Lists of supersegments: where a ray first meets one (paper Algorithm 1, its intent; docs/conventions.md lists the errata).
//
// Faces are (front, back) in the depth coordinate of V_O's list space, which grows with depth; sorted and disjoint. A ray
// that comes back towards V_O meets them in reverse: all here is in the ray's sense, in which it comes to the 0-th first, and
// depths are negated for a ray that comes back, so that they grow along every ray.
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Where the ray enters and leaves the n-th supersegment that it comes to, in its sense.
inline float2 face_met(List list, SUPERSEGMENTS_PARAMETERS int n, bool away)
{
    const float2 face = FACE(list, away ? n : list.count - 1 - n);
    return (float2)(away ? face.x : -face.y, away ? face.y : -face.x);
}

// Each of them by itself.
inline float near_face(List list, SUPERSEGMENTS_PARAMETERS int n, bool away)
{
    return away ? FRONT(list, n) : -BACK(list, list.count - 1 - n);
}

inline float far_face(List list, SUPERSEGMENTS_PARAMETERS int n, bool away)
{
    return away ? BACK(list, n) : -FRONT(list, list.count - 1 - n);
}

// Guesses by one more or less before the rest is halved.
#define CLOSE_GUESSES 4

// The search for the first supersegment that ends behind a depth. It begins with a guess, the answer for the neighbouring
// list, which is mostly right or off by one; so its neighbours come next.
typedef struct {
    int n;      // the guess
    int low;    // all before this one end before the depth
    int missed; // guesses that were wrong
} Search;

inline Search begin_search(int guess)
{
    const Search search = {guess, 0, 0};
    return search;
}

// Compare the guess. Returns whether it is the answer, search->n: list.count if all end before; *face is its face, infinite if
// there is none. Otherwise there is another guess.
inline bool search_on(Search *search, List list, SUPERSEGMENTS_PARAMETERS float depth, bool away, float2 *face)
{
    int n = min(search->n, list.count);
    if (search->missed >= CLOSE_GUESSES) {
        n = search->low;
        for (int high = list.count; n < high;) {
            const int middle = (n + high) >> 1;
            const bool before = face_met(list, SUPERSEGMENTS_ARGUMENTS middle, away).y <= depth;
            n = before ? middle + 1 : n;
            high = before ? high : middle;
        }
        search->low = n;
    }
    *face = NO_FACE;
    if (n < list.count)
        *face = face_met(list, SUPERSEGMENTS_ARGUMENTS n, away);
    const bool passed = n < list.count && face->y <= depth;
    // Nothing is left to ask about what lies before if the guess holds `depth`
    bool beyond = face->x > depth && n > search->low;
    if (beyond)
        beyond = face_met(list, SUPERSEGMENTS_ARGUMENTS n - 1, away).y > depth;
    const bool wrong = passed || beyond;
    search->n = passed ? n + 1 : beyond ? n - 1 : n;
    search->low = passed ? n + 1 : search->low;
    search->missed += wrong ? 1 : 0;
    return !wrong;
}
