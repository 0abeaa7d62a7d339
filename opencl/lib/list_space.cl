// V_O's list space, in which lists and supersegments are axis-aligned boxes and rays stay straight (DESIGN section 3).
//
// u and v are pixels of V_O's window from its centre. The depth coordinate z grows with depth and is projective:
//
//     -D PARALLEL      z = Z - Z_ref             1/Z is not needed
//     -D SHIFTED       z = (Z - Z_ref) / Z       long lens: what cancels in Z - Z_ref was taken out in float64 by the host
//     otherwise        z = -1 / Z                the same relative precision at every depth
//
// with Z view depth from V_O in world units and Z_ref the VDI's depth origin. An "offset" is Z - Z_ref.
//
//     -D FAR_ENTRIES   lists hold so little of the depth that float32 has for all of it, that z is relative to Z_deep, where
//                      a ray is deepest: 1/Z_deep - 1/Z, or Z - Z_deep if PARALLEL; faces are kept as offsets, DEPTH_FORM
//                      is that of the offset (docs/numerics.md); 2: relative to where it is least deep
#include "lib/rays.cl"
#pragma OPENCL FP_CONTRACT OFF

#define U_FORM 0
#define V_FORM 1
#define DEPTH_FORM 2
#define DENOMINATOR_FORM 3
#define MODEL_FORM 4
#define PLANE_FORMS 7

#ifdef FAR_ENTRIES
typedef struct {
    float2 deep;      // the offset of Z_deep, a pair of lib/double_float.cl
    float reciprocal; // 1 / Z_deep
    float depth_origin;
} Depths;
#define DEPTHS ray.depths // of a kernel whose ray is `ray`
#else
typedef float Depths; // the depth origin
#define DEPTHS depth_origin
#endif

#ifdef FAR_ENTRIES
inline float depth_coordinate(float offset, Depths depths)
{
    const float beyond = (offset - depths.deep.x) - depths.deep.y;
#ifdef PARALLEL
    return beyond;
#else
    return beyond * depths.reciprocal / (offset + depths.depth_origin);
#endif
}

inline float depth_offset(float z, Depths depths)
{
#ifdef PARALLEL
    return depths.deep.x + z;
#else
    return depths.deep.x + z / (depths.reciprocal * (depths.reciprocal - z));
#endif
}

// 1 / Z of a depth coordinate. Not used in parallel projection.
inline float reciprocal_depth(float z, Depths depths)
{
    return depths.reciprocal - z;
}
#else
// The same for one ray or for a vector of them
#if defined(PARALLEL)
#define depth_coordinate(offset, depths) (offset)
#define depth_offset(z, depths) (z)
#elif defined(SHIFTED)
#define depth_coordinate(offset, depths) ((offset) / ((offset) + (depths)))
#define depth_offset(z, depths) ((z) * (depths) / (1.0f - (z)))
#else
#define depth_coordinate(offset, depths) (-1.0f / ((offset) + (depths)))
#define depth_offset(z, depths) (-1.0f / (z) - (depths))
#endif
#ifdef SHIFTED
#define reciprocal_depth(z, depths) ((1.0f - (z)) / (depths))
#else
#define reciprocal_depth(z, depths) (-(z))
#endif
#endif

#ifndef FAR_ENTRIES
// Homogeneous list coordinates at t, divided out: (u, v, depth coordinate).
inline float3 list_point(__global const float *forms, float a, float b, float t)
{
    const float u = fma(t, form_slope(forms + U_FORM * FORM_SIZE, a, b), form_value(forms + U_FORM * FORM_SIZE, a, b));
    const float v = fma(t, form_slope(forms + V_FORM * FORM_SIZE, a, b), form_value(forms + V_FORM * FORM_SIZE, a, b));
    const float z = fma(t, form_slope(forms + DEPTH_FORM * FORM_SIZE, a, b),
                        form_value(forms + DEPTH_FORM * FORM_SIZE, a, b));
#ifdef PARALLEL
    return (float3)(u, v, z);
#else
    const float d = fma(t, form_slope(forms + DENOMINATOR_FORM * FORM_SIZE, a, b),
                        form_value(forms + DENOMINATOR_FORM * FORM_SIZE, a, b));
    return (float3)(u, v, z) / d;
#endif
}
#endif

// Model length per unit of t along the ray. The slopes of its forms are about 1, and in units of the value of the first: no
// square is lost, and `length`, which guards against that by doubles or by divisions, is not needed. TYPE: of a and b.
#define MODEL_SPEED(TYPE, forms, a, b)                                                    \
    ((forms)[MODEL_FORM * FORM_SIZE] *                                                    \
     sqrt(SQUARED_SLOPE(TYPE, (forms) + MODEL_FORM * FORM_SIZE, a, b) +                   \
          SQUARED_SLOPE(TYPE, (forms) + (MODEL_FORM + 1) * FORM_SIZE, a, b) +             \
          SQUARED_SLOPE(TYPE, (forms) + (MODEL_FORM + 2) * FORM_SIZE, a, b)))
#define SQUARED_SLOPE(TYPE, form, a, b) (FORM_SLOPE(TYPE, form, a, b) * FORM_SLOPE(TYPE, form, a, b))

inline float model_speed(__global const float *forms, float a, float b)
{
    return MODEL_SPEED(float, forms, a, b);
}
