// Transposition of vectors, by which what lies together in memory for each lane becomes vectors of lanes.
#include "common/packet.cl"
#pragma OPENCL FP_CONTRACT OFF

// Four numbers of each lane of a packet (common/packet.cl): each vector has one of them, of all lanes; or vector n has all four
// of lanes n, 4 + n, 8 + n and 12 + n, in its four parts of 128 bits.
typedef struct {
    Reals of[4];
} Quads;

// The first halves, or the second ones, of each 128 bits of two vectors; and their numbers in turns, or half behind half.
// Swizzles of whole vectors: of vectors put together by single numbers a compiler makes as many instructions.
#define FIRST_HALVES(p, q) ((Reals)((p).s014589cd, (q).s014589cd))
#define SECOND_HALVES(p, q) ((Reals)((p).s2367abef, (q).s2367abef))
#define IN_TURNS s08192a3b4c5d6e7f
#define JOINED s018923ab45cd67ef

// From the one to the other: each 4 x 4 of a part.
inline Quads transposed(Quads x)
{
    const Reals first_01 = FIRST_HALVES(x.of[0], x.of[1]).IN_TURNS;
    const Reals first_23 = FIRST_HALVES(x.of[2], x.of[3]).IN_TURNS;
    const Reals second_01 = SECOND_HALVES(x.of[0], x.of[1]).IN_TURNS;
    const Reals second_23 = SECOND_HALVES(x.of[2], x.of[3]).IN_TURNS;
    const Quads result = {{FIRST_HALVES(first_01, first_23).JOINED, SECOND_HALVES(first_01, first_23).JOINED,
                           FIRST_HALVES(second_01, second_23).JOINED, SECOND_HALVES(second_01, second_23).JOINED}};
    return result;
}
