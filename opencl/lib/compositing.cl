// Front-to-back compositing by "over" (docs/conventions.md, "A supersegment is a homogeneous medium").
//
// -D COMPENSATED  for rays that may meet so many media that their roundings add up to what one sees (docs/numerics.md,
//                 "Accumulated rounding"):
//                     1  opacity is summed up from 0, so that what is nearly transparent keeps its digits
//                     2  and every sum carries what it rounds off (Kahan)
#pragma OPENCL FP_CONTRACT OFF

// Composite straight `color` behind what has been seen; `weight` is its opacity times the transmittance before it. `rest` is
// what the form needs besides: 0 at first.
inline void composite_over(float3 *seen, float *transmittance, float4 *rest, float weight, float3 color)
{
#if !defined(COMPENSATED)
    *seen += weight * color;
    *transmittance -= weight;
#elif COMPENSATED == 1
    *seen += weight * color;
    rest->w += weight; // opacity
    *transmittance = 1.0f - rest->w;
#else
    // The sums are seen - rest.xyz and transmittance - rest.w
    const float4 sum = (float4)(*seen, *transmittance);
    const float4 term = (float4)(weight * color, -weight) - *rest;
    const float4 next = sum + term;
    *rest = (next - sum) - term;
    *seen = next.xyz;
    *transmittance = next.w;
#endif
}

// Premultiplied RGBA of what was composited.
inline float4 composited(float3 seen, float transmittance, float4 rest)
{
#if !defined(COMPENSATED)
    return (float4)(seen, 1.0f - transmittance);
#elif COMPENSATED == 1
    return (float4)(seen, fmin(rest.w, 1.0f));
#else
    return (float4)(seen, (1.0f - transmittance) + rest.w);
#endif
}
