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
                              __global const long4 *integrals, // up to each cell, `cells` + 1
                              __global float *colors,          // straight RGB, 3 per supersegment
                              __global float *optical_depths)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count)
        return;
    const float middle = means[i] * cells;
    const float reach = fmax(ROOT_OF_3 * spreads[i] * cells, 0.5f); // at least a cell
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
    const float opacity = sum.w / width;
    const float of_step =
        opacity < 1.0f ? fmin(-log1p(-opacity), OPAQUE_OPTICAL_DEPTH) : OPAQUE_OPTICAL_DEPTH;
    optical_depths[i] = of_step * steps[i];
    const float3 color = sum.w > 0.0f ? sum.xyz / sum.w : (float3)(0.0f);
    vstore3(clamp(color, 0.0f, 1.0f), i, colors);
}
