// The parts of a march along a volume's ray that cropping keeps.
//
// -D CROPPED: see lib/cropping.cl
#include "volume/march.cl"
#include "lib/cropping.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef CROPPED
// The kept parts of a ray, in t.
inline Kept kept_march(const March *march, __global const float *form, float a, float b, uint regions)
{
    float at_t0[CROPPING_PLANES], at_t1[CROPPING_PLANES];
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        const float value = march_value(march, form, a, b);
        at_t0[k] = fma(march->t0, form_slope(form, a, b), value);
        at_t1[k] = fma(march->t1, form_slope(form, a, b), value);
    }
    return kept_parts(at_t0, at_t1, march->t0, march->t1, regions);
}

// The share of a step that is kept.
inline float kept_share(const Kept *kept, float front, float back)
{
    float sum = 0.0f;
    for (int n = 0; n < MOST_KEPT; ++n) {
        float from = front, to = back;
        cut_to_part(kept, n, &from, &to);
        sum += fmax(to - from, 0.0f);
    }
    return sum / (back - front);
}
#endif
