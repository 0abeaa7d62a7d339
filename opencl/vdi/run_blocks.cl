// Runs of a block of 4 x 4 rays, in vectors that are written out: what vdi/runs.cl says of a run holds for each lane.
#include "vdi/runs.cl"
#pragma OPENCL FP_CONTRACT OFF

#define LANES 16 // rays of a block
typedef float16 Reals;
typedef int16 Ints; // also truth values: all bits or none
#define NUMBERS (Ints)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
// Whether a truth value is true in any lane. By the sign, which compilers know how to ask a mask for.
#define ANY(chosen) any((chosen) < 0)

// Sixteen numbers that are read one by one: from memory, as to take each out of a register costs more.
typedef union {
    Ints all;
    int each[LANES];
} Places;

// A run of each ray.
typedef struct {
    Reals front, back, tau, transmittance, red, green, blue, opacity;
} Runs;

// The feature of each.
typedef struct {
    Reals red, green, blue, density;
} Features;

// In each quarter of four vectors four rows of four words: rows become columns, and columns rows.
inline void transpose(Reals *a, Reals *b, Reals *c, Reals *d)
{
#define LOWER(x, y)                                                                                                   \
    (Reals)(x.s0, y.s0, x.s1, y.s1, x.s4, y.s4, x.s5, y.s5, x.s8, y.s8, x.s9, y.s9, x.sc, y.sc, x.sd, y.sd)
#define UPPER(x, y)                                                                                                   \
    (Reals)(x.s2, y.s2, x.s3, y.s3, x.s6, y.s6, x.s7, y.s7, x.sa, y.sa, x.sb, y.sb, x.se, y.se, x.sf, y.sf)
#define FIRST_PAIRS(x, y) (Reals)(x.s01, y.s01, x.s45, y.s45, x.s89, y.s89, x.scd, y.scd)
#define SECOND_PAIRS(x, y) (Reals)(x.s23, y.s23, x.s67, y.s67, x.sab, y.sab, x.sef, y.sef)
    const Reals lower_ab = LOWER((*a), (*b)), upper_ab = UPPER((*a), (*b));
    const Reals lower_cd = LOWER((*c), (*d)), upper_cd = UPPER((*c), (*d));
    *a = FIRST_PAIRS(lower_ab, lower_cd);
    *b = SECOND_PAIRS(lower_ab, lower_cd);
    *c = FIRST_PAIRS(upper_ab, upper_cd);
    *d = SECOND_PAIRS(upper_ab, upper_cd);
#undef LOWER
#undef UPPER
#undef FIRST_PAIRS
#undef SECOND_PAIRS
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

inline void store_runs(__global float *records, const volatile int *at, Runs runs)
{
#define STORE(first, a, b, c, d)                                                                                      \
    transpose(&a, &b, &c, &d);                                                                                        \
    STORE_ROW(first, a)                                                                                               \
    STORE_ROW(first + 1, b)                                                                                           \
    STORE_ROW(first + 2, c)                                                                                           \
    STORE_ROW(first + 3, d)
#define STORE_ROW(n, row)                                                                                             \
    vstore8((float8)(row.s0123, row.s89ab), 0, records + at[n]);                                                      \
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
