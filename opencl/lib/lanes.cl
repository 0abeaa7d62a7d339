// What formulas are written of: the numbers of one ray, or of each of sixteen side by side.
//
// -D LANES  1 (default): a work-item follows one ray, and what vectors there are is the compiler's
// business
//           16: it follows that many together, in vectors that are written out, as CPUs do
// -D VECTOR_FUNCTIONS  0, or 1: the driver's functions round a vector as they round a number, as
// Intel's do: of sixteen they
//           are asked for vectors
//
// A formula is written once, of Real, Int and Uint; only loads, stores and transposes differ. Truth
// values are Int: 1 in one lane, all bits in a vector. They are joined by & or &&, | or || (of
// vectors, these evaluate both sides, too) and !, never by ~, and are not counted with: COUNT is.
// Functions that take a vector and a number (min, fmax, clamp) and operators take both forms; fma
// and SELECT want (Real)(x).
#pragma OPENCL FP_CONTRACT OFF

#ifndef LANES
#define LANES 1
#endif
#ifndef VECTOR_FUNCTIONS
#define VECTOR_FUNCTIONS 0
#endif

#if LANES == 16
typedef float16 Real;
typedef int16 Int;
typedef uint16 Uint;
typedef struct {
    Real x, y, z;
} Real3;
typedef struct {
    Real x, y, z, w;
} Real4;
#define REAL3(x, y, z) ((Real3){x, y, z})
#define REAL4(x, y, z, w) ((Real4){x, y, z, w})
#define SELECT(otherwise, then, condition) select(otherwise, then, condition)
#define ANY(condition)                                                                             \
    any((condition) < 0) // by the sign, which compilers know how to ask a mask for
#define COUNT(condition) (-(condition))
#define TO_REAL(x) convert_float16(x)
#define TO_INT(x) convert_int16(x)
#define TO_UCHAR(x) convert_uchar16(x)
#define AS_REAL(x) as_float16(x)
#define AS_INT(x) as_int16(x)
#define AS_UINT(x) as_uint16(x)
#define KERNEL_OF_LANES __attribute__((vec_type_hint(float16))) __kernel
#define LANE_NUMBERS (Int)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#define OF_LANES(TYPE, OF_LANE)                                                                    \
    (TYPE)(OF_LANE(0), OF_LANE(1), OF_LANE(2), OF_LANE(3), OF_LANE(4), OF_LANE(5), OF_LANE(6),     \
           OF_LANE(7), OF_LANE(8), OF_LANE(9), OF_LANE(10), OF_LANE(11), OF_LANE(12), OF_LANE(13), \
           OF_LANE(14), OF_LANE(15))
#define LOAD_LANES(k, from) vload16(k, from)
#define STORE_LANES(x, k, to) vstore16(x, k, to)

inline int least_lane(Int x)
{
    const int8 of_two = min(x.lo, x.hi);
    const int4 of_four = min(of_two.lo, of_two.hi);
    const int2 of_eight = min(of_four.lo, of_four.hi);
    return min(of_eight.x, of_eight.y);
}

inline int largest_lane(Int x)
{
    const int8 of_two = max(x.lo, x.hi);
    const int4 of_four = max(of_two.lo, of_two.hi);
    const int2 of_eight = max(of_four.lo, of_four.hi);
    return max(of_eight.x, of_eight.y);
}

// A number of each lane that is read one by one: of a vector from memory, as to take each out of a
// register costs two operations more.
typedef const volatile int Place;

// A function of the driver's, of each lane: by itself, if a vector's may be another one
#define FUNCTION_OF_LANES(name, of_number)                                                         \
    inline Real name(Real x)                                                                       \
    {                                                                                              \
        if (VECTOR_FUNCTIONS)                                                                      \
            return of_number(x);                                                                   \
        float each[LANES];                                                                         \
        vstore16(x, 0, each);                                                                      \
        for (int n = 0; n < LANES; ++n)                                                            \
            each[n] = of_number(each[n]);                                                          \
        return vload16(0, each);                                                                   \
    }
#else
typedef float Real;
typedef int Int;
typedef uint Uint;
typedef float3 Real3;
typedef float4 Real4;
#define REAL3(x, y, z) (float3)(x, y, z)
#define REAL4(x, y, z, w) (float4)(x, y, z, w)
#define SELECT(otherwise, then, condition) ((condition) ? (then) : (otherwise))
#define ANY(condition) (condition)   // whether it holds in any lane
#define COUNT(condition) (condition) // 1 where it holds, or 0
#define TO_REAL(x) ((float)(x))      // the value
#define TO_INT(x) ((int)(x))
#define TO_UCHAR(x) ((uchar)(x))
#define AS_REAL(x) as_float(x) // the bits
#define AS_INT(x) as_int(x)
#define AS_UINT(x) as_uint(x)
#define KERNEL_OF_LANES __kernel
#define LANE_NUMBERS 0
#define OF_LANES(TYPE, OF_LANE)                                                                    \
    (TYPE)(OF_LANE(0))                  // TYPE: Real, Int or Uint; OF_LANE(n): lane n's, a macro
#define LOAD_LANES(k, from) ((from)[k]) // the k-th row of LANES numbers
#define STORE_LANES(x, k, to) ((to)[k] = (x))

inline int least_lane(int x) { return x; }

inline int largest_lane(int x) { return x; }

typedef const int Place;

#define FUNCTION_OF_LANES(name, of_number)                                                         \
    inline Real name(Real x) { return of_number(x); }
#endif

typedef union {
    Int all;
    int each[LANES];
} Places;

// The lower and the higher of two numbers that are never NaN: one instruction each
#define LOWER_OF(x, y) SELECT(y, x, (x) < (y))
#define HIGHER_OF(x, y) SELECT(y, x, (x) > (y))
