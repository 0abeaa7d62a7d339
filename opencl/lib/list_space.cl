// V_O's list space, in which lists and supersegments are axis-aligned boxes and rays stay straight
// (docs/dev/conventions.md, "List coordinates").
//
// u and v are pixels of V_O's window from its centre. The depth coordinate z grows with depth:
//
//     -D DEPTH=RECIPROCAL   z = -1 / Z            as many digits at every depth
//     -D DEPTH=SHIFTED      z = (Z - Z_ref) / Z   long lens: what cancels in Z - Z_ref was taken
//                                                 out in float64 by the host
//     -D DEPTH=PARALLEL     z = Z - Z_ref         1 / Z is not needed
//
// with Z view depth from V_O in world units and Z_ref the VDI's depth origin. An "offset" is
// Z - Z_ref.
//
// -D DOUBLE_FLOAT_RAYS=1, 2   lists hold so little of the depth that float32 has too few digits
//     for all of it: z is relative to Z_deep, where a ray is deepest (2: least deep), 1 / Z_deep -
//     1 / Z, or Z - Z_deep if PARALLEL. Faces are kept as offsets (docs/dev/numerics.md).
#include "lib/rays.cl"
#pragma OPENCL FP_CONTRACT OFF

enum { RECIPROCAL, SHIFTED, PARALLEL };

#define U_FORM 0
#define V_FORM 1
#define DEPTH_FORM 2 // of the offset, with DOUBLE_FLOAT_RAYS
#define DENOMINATOR_FORM 3
#define MODEL_FORM 4

// What depths are relative to; the depth coordinate of an offset, its offset, and 1 / Z there; and
// what is kept of a face.
#ifdef DOUBLE_FLOAT_RAYS
#define FACES_ARE_OFFSETS 1
#define KEPT_FACE(offset, depth_origin) (offset)

typedef struct {
    float2 deep;      // the offset of Z_deep, a pair of lib/double_float.cl
    float reciprocal; // 1 / Z_deep
    float depth_origin;
} Depths;

inline float depth_coordinate(float offset, Depths depths)
{
    const float beyond = (offset - depths.deep.x) - depths.deep.y;
    if (DEPTH == PARALLEL)
        return beyond;
    return beyond * depths.reciprocal / (offset + depths.depth_origin);
}

inline float depth_offset(float z, Depths depths)
{
    if (DEPTH == PARALLEL)
        return depths.deep.x + z;
    return depths.deep.x + z / (depths.reciprocal * (depths.reciprocal - z));
}

inline float reciprocal_depth(float z, Depths depths) { return depths.reciprocal - z; }
#else
#define FACES_ARE_OFFSETS 0
#define KEPT_FACE(offset, depth_origin) depth_coordinate(offset, depth_origin)

typedef float Depths; // the depth origin

// Of one number or of a vector of them
#define depth_coordinate(offset, depth_origin)                                                     \
    (DEPTH == PARALLEL  ? (offset)                                                                 \
     : DEPTH == SHIFTED ? (offset) / ((offset) + (depth_origin))                                   \
                        : -1.0f / ((offset) + (depth_origin)))
#define depth_offset(z, depth_origin)                                                              \
    (DEPTH == PARALLEL  ? (z)                                                                      \
     : DEPTH == SHIFTED ? (z) * (depth_origin) / (1.0f - (z))                                      \
                        : -1.0f / (z) - (depth_origin))
#define reciprocal_depth(z, depth_origin) (DEPTH == SHIFTED ? (1.0f - (z)) / (depth_origin) : -(z))
#endif

// Value of a form at t.
inline Real list_form(__global const float *form, Real a, Real b, Real t)
{
    return fma(t, form_slope(form, a, b), form_value(form, a, b));
}

// Depth coordinate at t.
inline Real list_depth(__global const float *forms, Real a, Real b, Real t)
{
    const Real depth = list_form(forms + DEPTH_FORM * FORM_SIZE, a, b, t);
    if (DEPTH == PARALLEL)
        return depth;
    return depth / list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
}

// (u, v, depth coordinate) at t.
inline Real3 list_point(__global const float *forms, Real a, Real b, Real t)
{
    Real3 point;
    point.x = list_form(forms + U_FORM * FORM_SIZE, a, b, t);
    point.y = list_form(forms + V_FORM * FORM_SIZE, a, b, t);
    point.z = list_depth(forms, a, b, t);
    if (DEPTH != PARALLEL) {
        const Real denominator = list_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
        point.x /= denominator;
        point.y /= denominator;
    }
    return point;
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
