// The runs of one ray, or of sixteen (lib/lanes.cl), and the records in which they lie. A run is a
// supersegment while it is being made.
#include "lib/lanes.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

// FRONT, BACK: t of the ray; TAU: optical depth; TRANSMITTANCE: from the eye to the front face;
// RED, GREEN, BLUE: premultiplied by OPACITY, which is 1 - exp(-tau), accumulated.
#if LANES == 16
typedef struct {
    Real FRONT, BACK, TAU, TRANSMITTANCE, RED, GREEN, BLUE, OPACITY;
} Run;
#define RUN(front, back, tau, before, red, green, blue, opacity)                                   \
    ((Run){front, back, tau, before, red, green, blue, opacity})

// Runs whose words begin at these places. In one load each, which a compiler may not take apart to
// put the words where they go one by one.
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
    return RUN(EVEN_QUARTERS(x), EVEN_QUARTERS(y), EVEN_QUARTERS(z), EVEN_QUARTERS(w),
               ODD_QUARTERS(x), ODD_QUARTERS(y), ODD_QUARTERS(z), ODD_QUARTERS(w));
#undef EVEN_QUARTERS
#undef ODD_QUARTERS
}

// Store runs, but of rays whose place is negative.
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
#else
// A vector, which compilers keep in registers where they put a structure into memory.
typedef float8 Run;
#define FRONT s0
#define BACK s1
#define TAU s2
#define TRANSMITTANCE s3
#define RED s4
#define GREEN s5
#define BLUE s6
#define COLOR s456
#define OPACITY s7
#define RUN(front, back, tau, before, red, green, blue, opacity)                                   \
    (float8)(front, back, tau, before, red, green, blue, opacity)

// A run moves as four words of 8 bytes, because the number of loads and stores is what counts where
// a vector's lanes go to different places.
inline Run load_run_at(__global const float *records, Place *at)
{
    __global const ulong *words = (__global const ulong *)(records + at[0]);
    return (Run)(as_float2(words[0]), as_float2(words[1]), as_float2(words[2]),
                 as_float2(words[3]));
}

inline void store_run_at(__global float *records, Place *at, Run run)
{
    __global ulong *words = (__global ulong *)(records + at[0]);
    if (at[0] < 0)
        return;
    words[0] = as_ulong(run.s01);
    words[1] = as_ulong(run.s23);
    words[2] = as_ulong(run.s45);
    words[3] = as_ulong(run.s67);
}
#endif

// The k-th runs from `records` on.
inline Run load_run(__global const float *records, Int k)
{
    const Places places = {k * RUN_WORDS};
    return load_run_at(records, places.each);
}

inline void store_run(__global float *records, Int k, Run run)
{
    const Places places = {k * RUN_WORDS};
    store_run_at(records, places.each, run);
}

// The numbers of records.
typedef struct {
    int capacity;   // runs that a record has room for
    int limit;      // that are to be left of one
    int grain;      // steps in a voxel
    int window_row; // the first row of rays of which it is known how much light enters a part of a
                    // grid
    float finest;   // threshold of rays whose record has never been full
    float reference_length; // model units
    float hidden_weight;    // weight of what the view from V_O cannot see, 0 to 1
} Recording;

// A ray's runs lie one behind the other, `capacity` of them: what shortens them goes from run to
// run, and rays whose records grow at different places write to one line of the cache each.
inline size_t record_start(uint ray, int capacity)
{
    return (size_t)ray * (size_t)(capacity * RUN_WORDS);
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
