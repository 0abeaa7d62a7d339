// Front-to-back compositing by "over" (docs/conventions.md, "A supersegment is a homogeneous medium").
//
// -D COMPENSATED  not 0: for rays that may meet so many media that their roundings add up to what one sees (docs/numerics.md,
//                 "Accumulated rounding"):
//                     1  opacity is summed up from 0, so that what is nearly transparent keeps its digits
//                     2  and every sum carries what it rounds off (Kahan)
#include "lib/lanes.cl"
#include "lib/opacity.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifndef COMPENSATED
#define COMPENSATED 0
#endif

typedef struct {
    Real4 sums;         // premultiplied red, green and blue; transmittance
    Real4 compensation; // if COMPENSATED: w is the opacity, or each is what the sum was rounded up by
} Seen;

inline Seen nothing_seen()
{
    Seen seen;
    seen.sums.x = seen.sums.y = seen.sums.z = 0.0f;
    seen.sums.w = 1.0f;
    seen.compensation.x = seen.compensation.y = seen.compensation.z = seen.compensation.w = 0.0f;
    return seen;
}

// Add to a sum, and carry what is rounded off.
#define ADD_COMPENSATED(component, summand)                                      \
    {                                                                            \
        const Real sum = seen->sums.component;                                   \
        const Real term = (summand) - seen->compensation.component;              \
        seen->sums.component = sum + term;                                       \
        seen->compensation.component = (seen->sums.component - sum) - term;      \
    }

// Composite straight `color` (xyz) behind what has been seen; `weight` is its opacity times the transmittance before it.
inline void composite_over(Seen *seen, Real weight, Real4 color)
{
    if (COMPENSATED == 2) {
        ADD_COMPENSATED(x, weight * color.x)
        ADD_COMPENSATED(y, weight * color.y)
        ADD_COMPENSATED(z, weight * color.z)
        ADD_COMPENSATED(w, -weight)
        return;
    }
    seen->sums.x += weight * color.x;
    seen->sums.y += weight * color.y;
    seen->sums.z += weight * color.z;
    if (COMPENSATED == 1) {
        seen->compensation.w += weight;
        seen->sums.w = 1.0f - seen->compensation.w;
    } else {
        seen->sums.w -= weight;
    }
}

// Composite a medium of straight colour for the rays that are chosen.
inline void composite_medium(Seen *seen, Real optical_depth, Real4 color, Int chosen)
{
    composite_over(seen, SELECT((Real)(0.0f), seen->sums.w * opacity_of(optical_depth), chosen), color);
}

inline Real alpha_seen(const Seen *seen)
{
    if (COMPENSATED == 1)
        return fmin(seen->compensation.w, 1.0f);
    return COMPENSATED == 2 ? (1.0f - seen->sums.w) + seen->compensation.w : 1.0f - seen->sums.w;
}

// Premultiplied RGBA of what was composited.
inline Real4 composited(const Seen *seen)
{
    Real4 rgba = seen->sums;
    rgba.w = alpha_seen(seen);
    return rgba;
}
