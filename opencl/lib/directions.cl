// Lengths and products of vectors in space, one or one of each lane (lib/lanes.cl), rounded as
// drivers' functions of one are.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#if LANES == 1
#define dot_of(a, b) dot(a, b)
#define length_of(v) length(v)
#define pow_of(x, power) pow(x, power)
#define cross_of(a, b) cross(a, b)
#define dot_with(row, v) dot(vload3(0, row), v)
#define affine_with(row, x, y, z) dot(vload4(0, row), (float4)(x, y, z, 1.0f))
#else
inline Real dot_of(Real3 a, Real3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

inline Real dot_with(__global const float *row, Real3 v)
{
    return row[0] * v.x + row[1] * v.y + row[2] * v.z;
}

inline Real affine_with(__global const float *row, Real x, Real y, Real z)
{
    return (row[0] * x + row[1] * y) + (row[2] * z + row[3]);
}

// Of one, drivers have ways of their own: Intel's sums up squares in double.
inline Real length_of(Real3 v)
{
    if (VECTOR_FUNCTIONS) {
#define IN_DOUBLE(c) convert_double8(v.c)
#define LENGTHS(half)                                                                              \
    convert_float8(sqrt(IN_DOUBLE(x.half) * IN_DOUBLE(x.half) +                                    \
                        IN_DOUBLE(y.half) * IN_DOUBLE(y.half) +                                    \
                        IN_DOUBLE(z.half) * IN_DOUBLE(z.half)))
        return (Real)(LENGTHS(lo), LENGTHS(hi));
#undef LENGTHS
#undef IN_DOUBLE
    }
    const float *of_x = (const float *)&v.x, *of_y = (const float *)&v.y,
                *of_z = (const float *)&v.z;
#define LENGTH(n) length((float3)(of_x[n], of_y[n], of_z[n]))
    return OF_LANES(Real, LENGTH);
#undef LENGTH
}

// A power of 0 or more.
inline Real pow_of(Real x, float power)
{
    if (VECTOR_FUNCTIONS)
        return pow(x, (Real)(power));
    const float *of_x = (const float *)&x;
#define POWER(n) (of_x[n] > 0.0f || power <= 0.0f ? pow(of_x[n], power) : 0.0f)
    return OF_LANES(Real, POWER);
#undef POWER
}

inline Real3 cross_of(Real3 a, Real3 b)
{
    return REAL3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
#endif
