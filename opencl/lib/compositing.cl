// Front-to-back compositing by "over" (docs/dev/conventions.md, "A supersegment is a homogeneous
// medium").
//
// -D COMPENSATED  for rays that may meet so many media that their roundings add up to what one sees
//                 (docs/dev/numerics.md, "Accumulated rounding"):
//                     0  no (default)
//                     1  opacity is summed up from 0, so that what is nearly transparent keeps its
//                        digits
//                     2  every sum carries what it rounds off (Kahan)
#include "lib/lanes.cl"
#include "lib/opacity.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifndef COMPENSATED
#define COMPENSATED 0
#endif

typedef struct {
    Real4 sums;         // premultiplied red, green and blue; transmittance
    Real4 compensation; // 1: w is the opacity; 2: what each sum was rounded up by
} Seen;

inline Seen nothing_seen()
{
    Seen seen;
    seen.sums.x = seen.sums.y = seen.sums.z = 0.0f;
    seen.sums.w = 1.0f;
    seen.compensation.x = seen.compensation.y = seen.compensation.z = seen.compensation.w = 0.0f;
    return seen;
}

// A sum, and what it was rounded up by.
typedef struct {
    Real value, rounded_up;
} Sum;

inline Sum sum_of(Real value, Real rounded_up, Real summand)
{
    Sum sum = {value + summand, rounded_up};
    if (COMPENSATED == 2) {
        const Real term = summand - rounded_up;
        sum.value = value + term;
        sum.rounded_up = (sum.value - value) - term;
    }
    return sum;
}

// Composite a medium of straight colour (xyz) behind what has been seen, for the rays that are
// chosen.
inline void composite_medium(Seen *seen, Real optical_depth, Real4 color, Int chosen)
{
    const Real weight = SELECT((Real)(0.0f), seen->sums.w * opacity_of(optical_depth), chosen);
    const Sum red = sum_of(seen->sums.x, seen->compensation.x, weight * color.x);
    const Sum green = sum_of(seen->sums.y, seen->compensation.y, weight * color.y);
    const Sum blue = sum_of(seen->sums.z, seen->compensation.z, weight * color.z);
    seen->sums.x = red.value;
    seen->sums.y = green.value;
    seen->sums.z = blue.value;
    seen->compensation.x = red.rounded_up;
    seen->compensation.y = green.rounded_up;
    seen->compensation.z = blue.rounded_up;
    if (COMPENSATED == 1) {
        seen->compensation.w += weight;
        seen->sums.w = 1.0f - seen->compensation.w;
    } else {
        const Sum transmittance = sum_of(seen->sums.w, seen->compensation.w, -weight);
        seen->sums.w = transmittance.value;
        seen->compensation.w = transmittance.rounded_up;
    }
}

// Premultiplied RGBA of what was composited.
inline Real4 composited(const Seen *seen)
{
    Real4 rgba = seen->sums;
    rgba.w = 1.0f - seen->sums.w;
    if (COMPENSATED == 1)
        rgba.w = fmin(seen->compensation.w, 1.0f);
    if (COMPENSATED == 2)
        rgba.w += seen->compensation.w;
    return rgba;
}
