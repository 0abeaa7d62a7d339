// Runs of a block of 4 x 4 rays, in vectors that are written out: what generation/runs.cl says of a run holds for each lane.
#include "lib/transpose.cl"
#include "generation/runs.cl"
#pragma OPENCL FP_CONTRACT OFF

// A run of each ray.
typedef struct {
    Reals front, back, tau, transmittance, red, green, blue, opacity;
} Runs;

// The feature of each.
typedef struct {
    Reals red, green, blue, density;
} Features;

// In place, see lib/transpose.cl.
inline void transpose(Reals *a, Reals *b, Reals *c, Reals *d)
{
    const Quads rows = {{*a, *b, *c, *d}};
    const Quads columns = transposed(rows);
    *a = columns.of[0];
    *b = columns.of[1];
    *c = columns.of[2];
    *d = columns.of[3];
}

// The runs at some words of the records of a block.
inline Runs load_runs(__global const float *records, const volatile int *at)
{
// In one load each, which a compiler may not take apart to put the words where they go one by one
#define ROW(n) (*(__global const volatile float8 *)(records + at[n]))
#define ROWS(n) (Reals)(ROW(n), ROW((n) + 4))
    Reals a = ROWS(0), b = ROWS(1), c = ROWS(2), d = ROWS(3);
    Reals e = ROWS(8), f = ROWS(9), g = ROWS(10), h = ROWS(11);
    transpose(&a, &b, &c, &d);
    transpose(&e, &f, &g, &h);
#define EVEN_QUARTERS(x, y) (Reals)(x.s0123, x.s89ab, y.s0123, y.s89ab)
#define ODD_QUARTERS(x, y) (Reals)(x.s4567, x.scdef, y.s4567, y.scdef)
    const Runs runs = {EVEN_QUARTERS(a, e), EVEN_QUARTERS(b, f), EVEN_QUARTERS(c, g), EVEN_QUARTERS(d, h),
                       ODD_QUARTERS(a, e), ODD_QUARTERS(b, f), ODD_QUARTERS(c, g), ODD_QUARTERS(d, h)};
    return runs;
#undef ROW
#undef ROWS
#undef EVEN_QUARTERS
#undef ODD_QUARTERS
}

// The same back, but of rays whose place is negative.
inline void store_runs(__global float *records, const volatile int *at, Runs runs)
{
#define STORE(first, a, b, c, d)                                                                                      \
    transpose(&a, &b, &c, &d);                                                                                        \
    STORE_ROW(first, a)                                                                                               \
    STORE_ROW(first + 1, b)                                                                                           \
    STORE_ROW(first + 2, c)                                                                                           \
    STORE_ROW(first + 3, d)
#define STORE_ROW(n, row)                                                                                             \
    if (at[n] >= 0)                                                                                                   \
        vstore8((float8)(row.s0123, row.s89ab), 0, records + at[n]);                                                  \
    if (at[(n) + 4] >= 0)                                                                                             \
        vstore8((float8)(row.s4567, row.scdef), 0, records + at[(n) + 4]);
    Reals a = (Reals)(runs.front.lo, runs.red.lo), b = (Reals)(runs.back.lo, runs.green.lo);
    Reals c = (Reals)(runs.tau.lo, runs.blue.lo), d = (Reals)(runs.transmittance.lo, runs.opacity.lo);
    STORE(0, a, b, c, d)
    Reals e = (Reals)(runs.front.hi, runs.red.hi), f = (Reals)(runs.back.hi, runs.green.hi);
    Reals g = (Reals)(runs.tau.hi, runs.blue.hi), h = (Reals)(runs.transmittance.hi, runs.opacity.hi);
    STORE(8, e, f, g, h)
#undef STORE
#undef STORE_ROW
}

// run_feature of each ray.
inline Features features_of(Runs runs, Reals per_reference)
{
    const Reals lengths = (runs.back - runs.front) * per_reference;
    Features features;
    features.density = runs.tau / (runs.tau + lengths);
    const Reals per_color = features.density / runs.opacity;
    features.red = runs.red * per_color;
    features.green = runs.green * per_color;
    features.blue = runs.blue * per_color;
    return features;
}

// merged_runs of each ray.
inline Runs merged_of(Runs a, Runs b)
{
    Runs runs = a;
    const Reals through = 1.0f - a.opacity;
    runs.back = b.back;
    runs.tau = a.tau + b.tau;
    runs.red = a.red + through * b.red;
    runs.green = a.green + through * b.green;
    runs.blue = a.blue + through * b.blue;
    runs.opacity = a.opacity + through * b.opacity;
    return runs;
}

inline Reals squares_of(Reals red, Reals green, Reals blue, Reals density)
{
    return (red * red + green * green) + (blue * blue + density * density);
}
