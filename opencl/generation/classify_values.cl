// Values to media: a transfer function applied to the supersegments of a deferred VDI
// (docs/conventions.md, "Values in place of colours"); in float64: model/classify_values.py.
#pragma OPENCL FP_CONTRACT OFF

#define PER_UNIT 9.094947e-13f // 2^-40
#define ROOT_OF_3 1.7320508f
#define OPAQUE_OPTICAL_DEPTH 30.0f // of a step: volume/medium.cl

// What lies in cells from one to before another: step opacities times colours, and step opacities.
// Integrals are whole numbers of 2^-40, so that differences of large ones are exact.
inline float4 between_cells(__global const long4 *integrals, int first, int last)
{
    return convert_float4(integrals[last] - integrals[first]) * PER_UNIT;
}

// The mean over what lies between two places, 0 to 1, which are widened to a cell's distance, times
// a share, and how much of the share passes: 1 - opacity, which is 0 where all are opaque.
inline float4 mean_between(__global const long4 *integrals, int cells, float low, float high,
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

__kernel void classify_values(uint count, int cells, __global const float *means,
                              __global const float *spreads,
                              __global const float *steps,     // of the march, in each supersegment
                              __global const long4 *integrals, // of the low end, and up to cells
                              __global float *colors,          // straight RGB, 3 per supersegment
                              __global float *optical_depths)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count)
        return;
    // How the values lie: a share from low to high, one from there to 1, and the others at 0
    const float mean = means[i], rest = 1.0f - mean, square = spreads[i] * spreads[i];
    const float reach = ROOT_OF_3 * spreads[i];
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
    const float empty = fmax(1.0f - share - above, 0.0f);
    const float4 at_low = between_cells(integrals, 0, 1);
    float passes = empty * (1.0f - at_low.w);
    float4 sum = empty * at_low;
    sum += mean_between(integrals + 1, cells, low, high, share, &passes);
    if (above > 0.0f)
        sum += mean_between(integrals + 1, cells, high, 1.0f, above, &passes);
    const float of_step = passes > 0.5f ? -log1p(-sum.w) : -log(passes);
    optical_depths[i] = fmin(of_step, OPAQUE_OPTICAL_DEPTH) * steps[i];
    const float3 color = sum.w > 0.0f ? sum.xyz / sum.w : (float3)(0.0f);
    vstore3(clamp(color, 0.0f, 1.0f), i, colors);
}
