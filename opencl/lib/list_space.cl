// V_O's list space, in which lists and supersegments are axis-aligned boxes and rays stay straight (docs/conventions.md).
//
// u and v are pixels of V_O's window from its centre. The depth coordinate z grows with depth and is projective:
//
//     -D PARALLEL      z = Z - Z_ref             1/Z is not needed
//     -D SHIFTED       z = (Z - Z_ref) / Z       long lens: what cancels in Z - Z_ref was taken out in float64 by the host
//     otherwise        z = -1 / Z                the same relative precision at every depth
//
// with Z view depth from V_O in world units and Z_ref the VDI's depth origin. An "offset" is Z - Z_ref.
//
//     -D DOUBLE_FLOAT_RAYS   lists hold so little of the depth that float32 has for all of it, that z is relative to Z_deep, where
//                      a ray is deepest: 1/Z_deep - 1/Z, or Z - Z_deep if PARALLEL; faces are kept as offsets, DEPTH_FORM
//                      is that of the offset (docs/numerics.md); 2: relative to where it is least deep
#include "lib/rays.cl"
#pragma OPENCL FP_CONTRACT OFF

#define U_FORM 0
#define V_FORM 1
#define DEPTH_FORM 2
#define DENOMINATOR_FORM 3
#define MODEL_FORM 4

#ifdef DOUBLE_FLOAT_RAYS
typedef struct {
    float2 deep;      // the offset of Z_deep, a pair of lib/double_float.cl
    float reciprocal; // 1 / Z_deep
    float depth_origin;
} Depths;
#define DEPTHS_OF(rays) (rays)->depths
#else
typedef float Depths; // the depth origin
#define DEPTHS_OF(rays) depth_origin
#endif
#define DEPTHS DEPTHS_OF(rays) // where `rays` are followed

#ifdef DOUBLE_FLOAT_RAYS
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

#ifndef DOUBLE_FLOAT_RAYS
inline Real list_form(__global const float *form, Real a, Real b, Real t)
{
    return fma(t, form_slope(form, a, b), form_value(form, a, b));
}

// Depth coordinate at t.
inline Real list_depth(__global const float *forms, Real a, Real b, Real t)
{
    const Real depth = list_form(forms + DEPTH_FORM * FORM_SIZE, a, b, t);
#ifdef PARALLEL
    return depth;
#else
    return depth / list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
#endif
}

// (u, v, depth coordinate) at t.
inline Real3 list_point(__global const float *forms, Real a, Real b, Real t)
{
    Real3 point;
    point.x = list_form(forms + U_FORM * FORM_SIZE, a, b, t);
    point.y = list_form(forms + V_FORM * FORM_SIZE, a, b, t);
    point.z = list_depth(forms, a, b, t);
#ifndef PARALLEL
    const Real denominator = list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
    point.x /= denominator;
    point.y /= denominator;
#endif
    return point;
}
#endif

inline Real squared_slope(__global const float *form, Real a, Real b)
{
    const Real slope = form_slope(form, a, b);
    return slope * slope;
}

// Model length per unit of t along the ray. The slopes of its forms are about 1, and in units of the value of the first: no
// square is lost, and `length`, which guards against that by doubles or by divisions, is not needed.
inline Real model_speed(__global const float *forms, Real a, Real b)
{
    __global const float *form = forms + MODEL_FORM * FORM_SIZE;
    return form[0] * sqrt(squared_slope(form, a, b) + squared_slope(form + FORM_SIZE, a, b) +
                          squared_slope(form + 2 * FORM_SIZE, a, b));
}
