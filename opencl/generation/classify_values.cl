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

__kernel void classify_values(uint count, int cells, __global const float *means,
                              __global const float *spreads,
                              __global const float *steps,     // of the march, in each supersegment
                              __global const long4 *integrals, // of the low end, cells, high end
                              __global float *colors,          // straight RGB, 3 per supersegment
                              __global float *optical_depths)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count)
        return;
    // Values from 0 to 1, seen from the end that their mean is nearer to: evenly spread, and where
    // that would leave the range, from its end on, with the others at the ends
    const float mean = means[i], nearer = fmin(mean, 1.0f - mean), reach = ROOT_OF_3 * spreads[i];
    float low = nearer - reach, high = nearer + reach, even = 1.0f, at_near = 0.0f, at_far = 0.0f;
    if (low <= 0.0f) {
        const float square = fmin(spreads[i] * spreads[i] + nearer * nearer, nearer);
        low = 0.0f;
        high = nearer > 0.0f ? fmin(1.5f * square / nearer, 1.0f) : 1.0f;
        even = high < 1.0f ? 2.0f * nearer / high : 6.0f * (nearer - square);
        at_far = fmax(nearer - 0.5f * even * high, 0.0f);
        at_near = fmax(1.0f - even - at_far, 0.0f);
    }
    const bool turned = mean > 0.5f;
    const float middle = 0.5f * (low + high), half_width = fmax(0.5f * (high - low), 0.5f / cells);
    const float from = (turned ? 1.0f - middle : middle) * cells, wide = half_width * cells;
    const float first = clamp(from - wide, 0.0f, (float)cells);
    const float last = clamp(from + wide, 0.0f, (float)cells);
    const int a = min((int)first, cells - 1), b = min((int)last, cells - 1);
    const float into_a = first - (float)a, into_b = last - (float)b;
    __global const long4 *inner = integrals + 1; // up to each cell of the range
    // The width is summed up as the opacities are: where all are 1, their mean is
    float4 sum;
    float width;
    if (a == b) {
        width = into_b - into_a;
        sum = width * between_cells(inner, a, a + 1);
    } else {
        width = (1.0f - into_a) + (float)(b - a - 1) + into_b;
        sum = (1.0f - into_a) * between_cells(inner, a, a + 1) + between_cells(inner, a + 1, b) +
              into_b * between_cells(inner, b, b + 1);
    }
    const float4 at_low = between_cells(integrals, 0, 1);
    const float4 at_high = between_cells(integrals, cells + 1, cells + 2);
    const float share_low = turned ? at_far : at_near, share_high = turned ? at_near : at_far;
    const float4 of_all = even * (sum / width) + share_low * at_low + share_high * at_high;
    // What passes a step is summed up by itself: where all are opaque, it is 0
    const float passes = even * (1.0f - sum.w / width) + share_low * (1.0f - at_low.w) +
                         share_high * (1.0f - at_high.w);
    const float of_step = passes > 0.5f ? -log1p(-of_all.w) : -log(passes);
    optical_depths[i] = fmin(of_step, OPAQUE_OPTICAL_DEPTH) * steps[i];
    const float3 color = of_all.w > 0.0f ? of_all.xyz / of_all.w : (float3)(0.0f);
    vstore3(clamp(color, 0.0f, 1.0f), i, colors);
}
