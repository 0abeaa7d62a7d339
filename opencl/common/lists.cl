// Lists of supersegments: where a ray first meets one (paper Algorithm 1, its intent; docs/conventions.md lists the errata).
//
// Faces are (front, back) in the depth coordinate of V_O's list space, which grows with depth; sorted and disjoint.
#include "common/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Whether supersegment k lies wholly before `depth` as seen by a ray that goes away from V_O (its back face decides), or
// begins before it, for a ray that comes towards V_O (its front face decides).
inline bool passes(List list, int k, float depth, bool away)
{
    return away ? back_of(list, k) <= depth : front_of(list, k) < depth;
}

// How many of the `count` supersegments pass `depth`: they are the first ones, since lists are sorted. `guess` is the
// answer for the neighbouring list, which is mostly right or off by one; otherwise a binary search finds it.
inline int count_passing(List list, int count, float depth, bool away, int guess)
{
    int low = 0;
    int high = count; // the answer lies in [low, high]
    guess = min(guess, count);
    if (guess < count && passes(list, guess, depth, away)) {
        // The next index first, then everything behind it
        if (guess + 1 == count || !passes(list, guess + 1, depth, away))
            return guess + 1;
        low = guess + 2;
    } else {
        if (guess == 0 || passes(list, guess - 1, depth, away))
            return guess;
        // The preceding index, then everything before it
        if (guess == 1 || passes(list, guess - 2, depth, away))
            return guess - 1;
        high = guess - 2;
    }
    while (low < high) {
        const int middle = (low + high) >> 1;
        if (passes(list, middle, depth, away))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}
