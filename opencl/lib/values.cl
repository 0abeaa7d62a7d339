// Values to media: what a transfer function makes of a supersegment of a deferred VDI
// (docs/conventions.md, "Values in place of colours"); in float64: model/classify_values.py.
#pragma OPENCL FP_CONTRACT OFF

#define ROOT_OF_3 1.7320508f
#define BITS_OF_ROOT_OF_HALF 0x3f3504f3
#define OPAQUE_OPTICAL_DEPTH 30.0f // of a step: volume/medium.cl

// -log(1 - a) of an opacity of 0 to below 1, within 2 ulp; log1p takes as long as all the rest
// here. With 1 - a = 2^e (1 + f), |f| <= .415, it is -e log(2) - 2 atanh(f / (2 + f)); f is -a
// where e is 0.
inline float optical_depth_of(float opacity)
{
    const int bits = as_int(1.0f - opacity) - BITS_OF_ROOT_OF_HALF;
    const int exponent = bits >> 23;
    const float above = as_float((bits & 0x7fffff) + BITS_OF_ROOT_OF_HALF) - 1.0f;
    const float f = exponent == 0 ? -opacity : above;
    const float s = f / (2.0f + f), z = s * s;
    const float series =
        fma(z, fma(z, fma(z, fma(z, 0.11111111f, 0.14285714f), 0.2f), 0.33333333f), 1.0f);
    return fma((float)exponent, -0.69314718f, -2.0f * s * series);
}

// What lies in cells from one to before another: step opacities times colours, and step opacities.
// Integrals are pairs of floats, a large part and what it leaves, so that differences keep their
// digits.
inline float4 between_cells(__global const float4 *integrals, int first, int last)
{
    return (integrals[2 * last] - integrals[2 * first]) +
           (integrals[2 * last + 1] - integrals[2 * first + 1]);
}

// Straight RGB and the optical depth of values of this mean and spread, in so many steps of the
// march. `integrals` are those up to each cell, `cells` + 1.
inline float4 classified(__global const float4 *integrals, int cells, float mean, float spread,
                         float steps)
{
    const float middle = mean * cells;
    const float reach = fmax(ROOT_OF_3 * spread * cells, 0.5f); // at least a cell
    const float first = clamp(middle - reach, 0.0f, (float)cells);
    const float last = clamp(middle + reach, 0.0f, (float)cells);
    const int a = min((int)first, cells - 1), b = min((int)last, cells - 1);
    const float into_a = first - (float)a, into_b = last - (float)b;
    // The width is summed up as the opacities are: where all are 1, their mean is
    float4 sum;
    float width;
    if (a == b) {
        width = into_b - into_a;
        sum = width * between_cells(integrals, a, a + 1);
    } else {
        width = (1.0f - into_a) + (float)(b - a - 1) + into_b;
        sum = (1.0f - into_a) * between_cells(integrals, a, a + 1) +
              between_cells(integrals, a + 1, b) + into_b * between_cells(integrals, b, b + 1);
    }
    if (!(sum.w > 0.0f))
        return (float4)(0.0f);
    const float opacity = sum.w / width;
    const float of_step = opacity < 1.0f ? fmin(optical_depth_of(opacity), OPAQUE_OPTICAL_DEPTH)
                                         : OPAQUE_OPTICAL_DEPTH;
    return (float4)(clamp(sum.xyz / sum.w, 0.0f, 1.0f), of_step * steps);
}
