// The parts of a march along a volume's ray that cropping keeps.
//
// -D CROPPED  1: there are such, see lib/cropping.cl
#include "volume/march.cl"
#include "lib/cropping.cl"
#pragma OPENCL FP_CONTRACT OFF

// The kept parts of a ray, in t. `form`: the first of the planes of cropping.
inline Kept kept_march(const March *march, __global const float *form, Real a, Real b, uint regions)
{
    Real at_t0[CROPPING_PLANES], at_t1[CROPPING_PLANES];
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        const Real value = march_value(march, form, a, b);
        at_t0[k] = fma(march->t0, form_slope(form, a, b), value);
        at_t1[k] = fma(march->t1, form_slope(form, a, b), value);
    }
    return kept_parts(at_t0, at_t1, march->t0, march->t1, regions);
}

// The share of a step that is kept.
inline Real kept_share(const Kept *kept, Real front, Real back)
{
    Real sum = 0.0f;
    for (int n = 0; n < MOST_KEPT; ++n) {
        Real from = front, to = back;
        cut_to_part(kept, n, &from, &to);
        sum += fmax(to - from, 0.0f);
    }
    return sum / (back - front);
}
