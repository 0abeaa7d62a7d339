// Values to media: what a transfer function makes of a supersegment that keeps values
// (docs/dev/conventions.md, "Values in place of colours").
#pragma OPENCL FP_CONTRACT OFF

#define ROOT_OF_3 1.7320508f
#define BITS_OF_ROOT_OF_HALF 0x3f3504f3
#define OPAQUE_OPTICAL_DEPTH 30.0f // of a step: volume/medium.cl

// -log of what passes, 0 to 1, within 2 ulp, where opacity is what does not; log1p takes as long as
// all the rest here. With passes = 2^e (1 + f), |f| <= .415, it is -e log(2) - 2 atanh(f / (2 +
// f)); f is -opacity where e is 0.
inline float optical_depth_of(float opacity, float passes)
{
    const int bits = as_int(passes) - BITS_OF_ROOT_OF_HALF;
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

// The mean over what lies between two places, 0 to 1, which are widened to a cell's distance, times
// a share, and how much of the share passes: 1 - opacity, which is 0 where all are opaque.
inline float4 mean_between(__global const float4 *integrals, int cells, float low, float high,
                           float share, float *passes)
{
    const float middle = 0.5f * (low + high), half_width = fmax(0.5f * (high - low), 0.5f / cells);
    const float first = clamp((middle - half_width) * cells, 0.0f, (float)cells);
    const float last = clamp((middle + half_width) * cells, 0.0f, (float)cells);
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
    const float4 mean = sum / width;
    *passes += share * (1.0f - mean.w);
    return share * mean;
}

// Straight RGB and the optical depth of values of this mean and spread, in so many steps of the
// march. `integrals` are of the low end, and those up to each cell: 1 + `cells` + 1 pairs.
inline float4 classified(__global const float4 *integrals, int cells, float mean, float spread,
                         float steps)
{
    // How the values lie: a share from low to high, one from there to 1, and the others at 0
    const float rest = 1.0f - mean, square = spread * spread, reach = ROOT_OF_3 * spread;
    float low = mean - reach, high = mean + reach, share = 1.0f, above = 0.0f;
    if (reach >= fmin(mean, rest)) {
        if (mean <= 0.5f) {
            low = 0.0f;
            high = mean > 0.0f ? fmin(1.5f * (square / mean + mean), 1.0f) : 1.0f;
            share = 2.0f * mean / high;
        } else {
            const float below = rest > 0.0f ? fmin(3.0f * square / rest, mean) : mean;
            low = mean - below;
            high = mean;
            share = rest / (rest + below);
            above = 1.0f - share;
        }
    }
    float passes = 0.0f;
    float4 sum = mean_between(integrals + 2, cells, low, high, share, &passes);
    if (above > 0.0f)
        sum += mean_between(integrals + 2, cells, high, 1.0f, above, &passes);
    const float empty = 1.0f - share - above;
    if (empty > 0.0f) {
        const float4 at_low = integrals[0] + integrals[1];
        passes += empty * (1.0f - at_low.w);
        sum += empty * at_low;
    }
    if (!(sum.w > 0.0f))
        return (float4)(0.0f);
    const float of_step = passes > 0.0f
                              ? fmin(optical_depth_of(sum.w, passes), OPAQUE_OPTICAL_DEPTH)
                              : OPAQUE_OPTICAL_DEPTH;
    return (float4)(clamp(sum.xyz / sum.w, 0.0f, 1.0f), of_step * steps);
}
