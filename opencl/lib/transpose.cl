// Four numbers for each lane (lib/lanes.cl): as they lie in memory, and as one vector of each
// number.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#if LANES == 16
// The first halves, or the second ones, of each 128 bits of two vectors; and their numbers in
// turns, or half behind half. Swizzles of whole vectors: of vectors put together by single numbers
// a compiler makes as many instructions.
#define FIRST_HALVES(p, q) ((Real)((p).s014589cd, (q).s014589cd))
#define SECOND_HALVES(p, q) ((Real)((p).s2367abef, (q).s2367abef))
#define IN_TURNS s08192a3b4c5d6e7f
#define JOINED s018923ab45cd67ef

// From one to the other: in the g-th 128 bits of the n-th vector stand the numbers of lane 4 g + n,
// and the other way round.
inline Real4 transpose(Real4 rows)
{
    const Real first_01 = FIRST_HALVES(rows.x, rows.y).IN_TURNS;
    const Real first_23 = FIRST_HALVES(rows.z, rows.w).IN_TURNS;
    const Real second_01 = SECOND_HALVES(rows.x, rows.y).IN_TURNS;
    const Real second_23 = SECOND_HALVES(rows.z, rows.w).IN_TURNS;
    return REAL4(FIRST_HALVES(first_01, first_23).JOINED, SECOND_HALVES(first_01, first_23).JOINED,
                 FIRST_HALVES(second_01, second_23).JOINED,
                 SECOND_HALVES(second_01, second_23).JOINED);
}

// Four numbers of each lane, from the `at`-th four on.
inline Real4 load_fours(__global const float4 *from, Int at)
{
    const Places places = {at};
    Place *each = places.each;
#define FOUR(n) (*((__global const volatile float4 *)from + each[n]))
#define FOURS(n) (Real)(FOUR(n), FOUR((n) + 4), FOUR((n) + 8), FOUR((n) + 12))
    return transpose(REAL4(FOURS(0), FOURS(1), FOURS(2), FOURS(3)));
#undef FOUR
#undef FOURS
}

// Store four numbers of each lane as the `at`-th four, but of lanes whose place is negative.
inline void store_fours(__global float4 *to, Int at, Real4 fours)
{
    const Places places = {at};
    Place *each = places.each;
    const Real4 rows = transpose(fours);
#define STORE(n, c, four)                                                                          \
    if (each[n] >= 0)                                                                              \
        to[each[n]] = rows.c.four;
#define STORE_ROW(g, four)                                                                         \
    STORE(4 * g, x, four)                                                                          \
    STORE(4 * g + 1, y, four) STORE(4 * g + 2, z, four) STORE(4 * g + 3, w, four)
    STORE_ROW(0, s0123)
    STORE_ROW(1, s4567)
    STORE_ROW(2, s89ab)
    STORE_ROW(3, scdef)
#undef STORE
#undef STORE_ROW
}
#else
#define load_fours(from, at) ((from)[at])

inline void store_fours(__global float4 *to, int at, float4 four)
{
    if (at >= 0)
        to[at] = four;
}
#endif
