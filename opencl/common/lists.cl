// Lists of supersegments: where a ray first meets one (paper Algorithm 1, its intent; docs/conventions.md lists the errata).
//
// Faces are (front, back) in the depth coordinate of V_O's list space, which grows with depth; sorted and disjoint.
#pragma OPENCL FP_CONTRACT OFF

// Whether supersegment k lies wholly before `depth` as seen by a ray that goes away from V_O (its back face decides), or
// begins before it, for a ray that comes towards V_O (its front face decides).
inline bool passes(__global const float2 *faces, int k, float depth, bool away)
{
    return away ? faces[k].y <= depth : faces[k].x < depth;
}

// How many of the `count` supersegments pass `depth`: they are the first ones, since lists are sorted. `guess` is the
// answer for the neighbouring list, which is mostly right or off by one; otherwise a binary search finds it.
inline int count_passing(__global const float2 *faces, int count, float depth, bool away, int guess)
{
    int low = 0;
    int high = count; // the answer lies in [low, high]
    guess = min(guess, count);
    if (guess < count && passes(faces, guess, depth, away)) {
        // The next index first, then everything behind it
        if (guess + 1 == count || !passes(faces, guess + 1, depth, away))
            return guess + 1;
        low = guess + 2;
    } else {
        if (guess == 0 || passes(faces, guess - 1, depth, away))
            return guess;
        // The preceding index, then everything before it
        if (guess == 1 || passes(faces, guess - 2, depth, away))
            return guess - 1;
        high = guess - 2;
    }
    while (low < high) {
        const int middle = (low + high) >> 1;
        if (passes(faces, middle, depth, away))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}
