// Scalar to colour and extinction (DESIGN section 3, "From volume to medium").
//
// The table holds `entries` (R, G, B, opacity) at equidistant scalars; opacity is that of a slab of one opacity unit
// distance. It is interpolated first and converted to optical depth then, as VTK does.
#include "lib/opacity.cl"
#pragma OPENCL FP_CONTRACT OFF

// Optical depth of a step through an opaque sample, whatever the unit distance: exp(-30) is 1e-13.
#define OPAQUE_OPTICAL_DEPTH 30.0f

// Colour (rgb) and opacity (w) of a scalar; NaN is transparent.
inline float4 classify(float scalar, __global const float4 *table, int entries, float low, float per_scalar)
{
    if (isnan(scalar))
        return (float4)(0.0f);
    // per_scalar: (entries - 1) / (high - low), or a huge number where the range is a single scalar
    const float x = clamp((scalar - low) * per_scalar, 0.0f, (float)(entries - 1));
    const int i = min((int)x, max(entries - 2, 0));
    const float4 here = table[i];
    const float4 next = table[min(i + 1, entries - 1)];
    return mix(here, next, x - (float)i);
}

// Optical depth of one opacity unit distance of opacity a: -log1p(-a), INFINITY where it is opaque.
inline Real unit_optical_depth(Real opacity)
{
    return SELECT((Real)(INFINITY), -log1p(-opacity), opacity < 1.0f);
}

// Optical depth of a step of `units` opacity unit distances, of which one has the optical depth `of_unit`.
inline Real scaled_to_step(Real of_unit, Real units)
{
    return SELECT(fmax(units, OPAQUE_OPTICAL_DEPTH), of_unit * units, of_unit < INFINITY);
}

// Optical depth of a step of `units` opacity unit distances through opacity a.
inline Real step_optical_depth(Real opacity, Real units)
{
    return scaled_to_step(unit_optical_depth(opacity), units);
}
