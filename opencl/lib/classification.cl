// Scalar to colour and extinction (docs/dev/conventions.md, "From a volume to the medium").
//
// The table holds `entries` (R, G, B, opacity) at equidistant scalars; opacity is that of a slab of
// one opacity unit distance. It is interpolated first and converted to optical depth then, as VTK
// does.
#include "lib/opacity.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

// Optical depth of a step through an opaque sample, whatever the unit distance: exp(-30) is 1e-13.
#define OPAQUE_OPTICAL_DEPTH 30.0f

// Colour (rgb) and opacity (w) of a scalar; NaN is transparent. per_scalar: (entries - 1) / (high -
// low), or a huge number where the range is a single scalar.
inline Real4 classify(Real scalar, __global const float4 *table, int entries, float low,
                      float per_scalar)
{
    const Int known = isnan(scalar) == 0;
    const Real x = clamp((scalar - low) * per_scalar, 0.0f, (float)(entries - 1));
    const Int entry = SELECT((Int)(0), min(TO_INT(x), max(entries - 2, 0)), known);
    const Real4 here = load_fours(table, entry);
    const Real4 next = load_fours(table + min(1, entries - 1), entry);
    const Real share = x - TO_REAL(entry);
#define BETWEEN(c) SELECT((Real)(0.0f), mix(here.c, next.c, share), known)
    return REAL4(BETWEEN(x), BETWEEN(y), BETWEEN(z), BETWEEN(w));
#undef BETWEEN
}

FUNCTION_OF_LANES(log1p_of, log1p)

// Optical depth of one opacity unit distance of opacity a: -log1p(-a), INFINITY where it is opaque.
inline Real unit_optical_depth(Real opacity)
{
    return SELECT((Real)(INFINITY), -log1p_of(-opacity), opacity < 1.0f);
}

// Optical depth of a step of `units` opacity unit distances, of which one has the optical depth
// `of_unit`.
inline Real scaled_to_step(Real of_unit, Real units)
{
    return SELECT(fmax(units, OPAQUE_OPTICAL_DEPTH), of_unit * units, of_unit < INFINITY);
}

// Optical depth of a step of `units` opacity unit distances through opacity a.
inline Real step_optical_depth(Real opacity, Real units)
{
    return scaled_to_step(unit_optical_depth(opacity), units);
}
