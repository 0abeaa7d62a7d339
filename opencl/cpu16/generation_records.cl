// The runs of sixteen rays, and the records in which they lie: one run of each is loaded or stored
// in one piece and transposed.
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    Real FRONT, BACK, TAU, TRANSMITTANCE, RED, GREEN, BLUE, OPACITY;
} Run;
#define RUN(front, back, tau, before, red, green, blue, opacity)                                   \
    ((Run){front, back, tau, before, red, green, blue, opacity})
#include "generation/runs.cl"

// In one load each, which a compiler may not take apart to put the words where they go one by one.
inline Run load_run_at(__global const float *records, Place *at)
{
#define ROW(n) (*(__global const volatile float8 *)(records + at[n]))
#define ROWS(n) (Real)(ROW(n), ROW((n) + 4))
    const Real4 low = transpose(REAL4(ROWS(0), ROWS(1), ROWS(2), ROWS(3)));
    const Real4 high = transpose(REAL4(ROWS(8), ROWS(9), ROWS(10), ROWS(11)));
#undef ROW
#undef ROWS
#define EVEN_QUARTERS(word) (Real)(low.word.s0123, low.word.s89ab, high.word.s0123, high.word.s89ab)
#define ODD_QUARTERS(word) (Real)(low.word.s4567, low.word.scdef, high.word.s4567, high.word.scdef)
    const Run run = {EVEN_QUARTERS(x), EVEN_QUARTERS(y), EVEN_QUARTERS(z), EVEN_QUARTERS(w),
                     ODD_QUARTERS(x),  ODD_QUARTERS(y),  ODD_QUARTERS(z),  ODD_QUARTERS(w)};
#undef EVEN_QUARTERS
#undef ODD_QUARTERS
    return run;
}

// But of rays whose place is negative.
inline void store_run_at(__global float *records, Place *at, Run run)
{
#define STORE_ROW(n, row)                                                                          \
    if (at[n] >= 0)                                                                                \
        vstore8((float8)(row.s0123, row.s89ab), 0, records + at[n]);                               \
    if (at[(n) + 4] >= 0)                                                                          \
        vstore8((float8)(row.s4567, row.scdef), 0, records + at[(n) + 4]);
#define STORE_HALF(first, half)                                                                    \
    {                                                                                              \
        const Real4 rows = transpose(REAL4((Real)(run.FRONT.half, run.RED.half),                   \
                                           (Real)(run.BACK.half, run.GREEN.half),                  \
                                           (Real)(run.TAU.half, run.BLUE.half),                    \
                                           (Real)(run.TRANSMITTANCE.half, run.OPACITY.half)));     \
        STORE_ROW(first, rows.x)                                                                   \
        STORE_ROW(first + 1, rows.y)                                                               \
        STORE_ROW(first + 2, rows.z)                                                               \
        STORE_ROW(first + 3, rows.w)                                                               \
    }
    STORE_HALF(0, lo)
    STORE_HALF(8, hi)
#undef STORE_HALF
#undef STORE_ROW
}

// How many runs there are of each ray that is in the window, from `counts` by list; the others have
// none.
inline Int load_counts(__global const uint *counts, Int lists, Int in_window)
{
    const Places places = {lists}, wanted = {in_window};
    Places runs = {(Int)(0)};
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            runs.each[lane] = (int)counts[places.each[lane]];
    return runs.all;
}

inline void store_counts(__global uint *counts, Int lists, Int in_window, Int runs)
{
    const Places places = {lists}, wanted = {in_window}, many = {runs};
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            counts[places.each[lane]] = (uint)many.each[lane];
}
