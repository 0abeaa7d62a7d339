// V_O's list space, in which lists and supersegments are axis-aligned boxes and rays stay straight
// (docs/dev/conventions.md, "List coordinates").
//
// u and v are pixels of V_O's window from its centre. The depth coordinate z grows with depth, and
// is of one of these kinds:
//
//     RECIPROCAL   z = -1 / Z            as many digits at every depth
//     SHIFTED      z = (Z - Z_ref) / Z   long lens: what cancels in Z - Z_ref was taken out in
//                                        float64 by the host
//     PARALLEL     z = Z - Z_ref         parallel projection: in place of 1 / Z stands 1
//
// with Z view depth from V_O in world units and Z_ref the VDI's depth origin. An "offset" is
// Z - Z_ref.
//
// -D DOUBLE_FLOAT_RAYS=1   lists hold so little of the depth that float32 has too few digits for
//     all of it: z is relative to Z_deep, where a ray is deepest, or least deep (Frame), 1 / Z_deep
//     - 1 / Z, or Z - Z_deep if PARALLEL. Faces are kept as offsets (docs/dev/numerics.md).
#include "lib/rays.cl"
#pragma OPENCL FP_CONTRACT OFF

#define U_FORM 0
#define V_FORM 1
#define DEPTH_FORM 2 // of the offset, with DOUBLE_FLOAT_RAYS
#define DENOMINATOR_FORM 3
#define MODEL_FORM 4

// What depths are relative to; the depth coordinate of an offset, its offset, and 1 / Z there.
#ifdef DOUBLE_FLOAT_RAYS
#define FACES_ARE_OFFSETS 1

typedef struct {
    int kind;
    float origin;
    float2 deep;      // the offset of Z_deep, a pair of lib/double_float.cl
    float reciprocal; // 1 / Z_deep
} Depths;

inline float depth_coordinate(float offset, Depths depths)
{
    const float beyond = (offset - depths.deep.x) - depths.deep.y;
    return beyond * depths.reciprocal / (depths.kind == PARALLEL ? 1.0f : offset + depths.origin);
}

inline float depth_offset(float z, Depths depths)
{
    if (depths.kind == PARALLEL)
        return depths.deep.x + z;
    return depths.deep.x + z / (depths.reciprocal * (depths.reciprocal - z));
}

inline float reciprocal_depth(float z, Depths depths)
{
    return depths.kind == PARALLEL ? 1.0f : depths.reciprocal - z;
}
#else
#define FACES_ARE_OFFSETS 0

typedef struct {
    int kind;
    float origin; // the depth origin
} Depths;

// Of one number or of a vector of them
#define depth_coordinate(offset, depths)                                                           \
    ((depths).kind == PARALLEL  ? (offset)                                                         \
     : (depths).kind == SHIFTED ? (offset) / ((offset) + (depths).origin)                          \
                                : -1.0f / ((offset) + (depths).origin))

inline Real depth_offset(Real z, Depths depths)
{
    if (depths.kind == PARALLEL)
        return z;
    if (depths.kind == SHIFTED)
        return z * depths.origin / (1.0f - z);
    return -1.0f / z - depths.origin;
}

inline Real reciprocal_depth(Real z, Depths depths)
{
    if (depths.kind == PARALLEL)
        return 1.0f;
    return depths.kind == SHIFTED ? (1.0f - z) / depths.origin : -z;
}
#endif

// Value of a form at t.
inline Real list_form(__global const float *form, Real a, Real b, Real t)
{
    return fma(t, form_slope(form, a, b), form_value(form, a, b));
}

// Depth coordinate at t.
inline Real list_depth(__global const float *forms, Real a, Real b, Real t)
{
    return list_form(forms + DEPTH_FORM * FORM_SIZE, a, b, t) /
           list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
}

// (u, v, depth coordinate) at t.
inline Real3 list_point(__global const float *forms, Real a, Real b, Real t)
{
    const Real denominator = list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
    return REAL3(list_form(forms + U_FORM * FORM_SIZE, a, b, t) / denominator,
                 list_form(forms + V_FORM * FORM_SIZE, a, b, t) / denominator,
                 list_depth(forms, a, b, t));
}

inline Real squared_slope(__global const float *form, Real a, Real b)
{
    const Real slope = form_slope(form, a, b);
    return slope * slope;
}

// Model length per unit of t along the ray. The slopes of its forms are about 1, and in units of
// the value of the first: no square is lost, and `length`, which guards against that by doubles or
// by divisions, is not needed.
inline Real model_speed(__global const float *forms, Real a, Real b)
{
    __global const float *form = forms + MODEL_FORM * FORM_SIZE;
    return form[0] * sqrt(squared_slope(form, a, b) + squared_slope(form + FORM_SIZE, a, b) +
                          squared_slope(form + 2 * FORM_SIZE, a, b));
}
