// VDI to image from any view: the paper's raycaster (section 3).
//
// In V_O's list space lists and supersegments are axis-aligned boxes and rays stay straight: a ray steps from list to list
// (Amanatides and Woo), finds the first supersegment of each by the index found in the last one, and composites, front to
// back, the length that it crosses of each (DESIGN section 3 "Lengths", "A supersegment is a homogeneous medium").
//
// -D OFFSET_T           type of an offset into the supersegments: uint or ulong
// -D PARALLEL, SHIFTED  the depth coordinate, see vdi/prepare.cl
//
// List coordinates are pixels of V_O's window from its centre; r runs along the ray over an interval of length 1 and is 0
// at the end that is deeper in V_O, where the interpolated 1/Z is smallest and its rounding matters most.
#include "common/rays.cl"
#include "common/lists.cl"
#include "common/classification.cl"
#pragma OPENCL FP_CONTRACT OFF

#define U_FORM 0
#define V_FORM 1
#define DEPTH_FORM 2
#define DENOMINATOR_FORM 3
#define MODEL_FORM 4
#define PLANE_FORMS 7

// Homogeneous list coordinates at t, divided out: (u, v, depth coordinate).
inline float3 list_point(__global const float *forms, float a, float b, float t)
{
    const float u = fma(t, form_slope(forms + U_FORM * FORM_SIZE, a, b), form_value(forms + U_FORM * FORM_SIZE, a, b));
    const float v = fma(t, form_slope(forms + V_FORM * FORM_SIZE, a, b), form_value(forms + V_FORM * FORM_SIZE, a, b));
    const float z = fma(t, form_slope(forms + DEPTH_FORM * FORM_SIZE, a, b),
                        form_value(forms + DEPTH_FORM * FORM_SIZE, a, b));
#ifdef PARALLEL
    return (float3)(u, v, z);
#else
    const float d = fma(t, form_slope(forms + DENOMINATOR_FORM * FORM_SIZE, a, b),
                        form_value(forms + DENOMINATOR_FORM * FORM_SIZE, a, b));
    return (float3)(u, v, z) / d;
#endif
}

// 1 / Z of a depth coordinate; `z_ref` is the VDI's depth origin. Not used in parallel projection.
inline float reciprocal_depth(float z, float z_ref)
{
#ifdef SHIFTED
    return (1.0f - z) / z_ref;
#else
    return -z;
#endif
}

__kernel void raycast(
    __global const OFFSET_T *offsets,   // lists_wide * lists_high + 1
    __global const float2 *faces,       // depth coordinates of front and back
    __global const float4 *media,       // straight RGB, extinction per model length
    int lists_wide, int lists_high,     // window of V_O
    float depth_origin,                 // world units
    __global const float *forms,        // list coordinates, model direction, then `planes` to clip to
    int planes,
    int width, int height,              // window of V_N
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    float transmittance_cutoff,         // the ray ends where less than this is left
    __global float4 *image)             // premultiplied RGBA, top row first
{
    const int2 pixel = block_pixel((uint)get_global_id(0), width);
    if (pixel.x >= width || pixel.y >= height)
        return;
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)pixel.y + 0.5f - 0.5f * (float)height;
    const size_t place = (size_t)(height - 1 - pixel.y) * width + pixel.x;

    float t0 = -INFINITY;
    float t1 = has_opaque_depth ? opaque_depth[place] : INFINITY;
    if (!clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, planes, a, b, &t0, &t1)) {
        image[place] = (float4)(0.0f);
        return;
    }

    // The ray in list space: point(r) = deep + r along, r from r_begin to r_begin + 1
    const float3 start = list_point(forms, a, b, t0);
    const float3 end = list_point(forms, a, b, t1);
    const float3 along = end - start;
    const bool away = along.z >= 0.0f; // from V_O: depth does not decrease along the ray
    const float3 deep = away ? end : start;
    const float r_begin = away ? -1.0f : 0.0f;
    const float r_end = r_begin + 1.0f;

    // Model length per unit of r, but for the division by w(r_a) w(r_b) in perspective
    const float3 direction = (float3)(form_slope(forms + MODEL_FORM * FORM_SIZE, a, b),
                                      form_slope(forms + (MODEL_FORM + 1) * FORM_SIZE, a, b),
                                      form_slope(forms + (MODEL_FORM + 2) * FORM_SIZE, a, b));
    float scale = (t1 - t0) * length(direction);
#ifndef PARALLEL
    scale *= reciprocal_depth(start.z, depth_origin) * reciprocal_depth(end.z, depth_origin);
#endif

    // Where planes u = const, v = const and z = const are crossed; a component that does not change crosses none
    const float inverse_u = along.x != 0.0f ? 1.0f / along.x : 0.0f;
    const float inverse_v = along.y != 0.0f ? 1.0f / along.y : 0.0f;
    const float inverse_z = along.z != 0.0f ? 1.0f / along.z : 0.0f;
    const float half_wide = 0.5f * (float)lists_wide;
    const float half_high = 0.5f * (float)lists_high;
    int i = clamp((int)floor(start.x + half_wide), 0, lists_wide - 1);
    int j = clamp((int)floor(start.y + half_high), 0, lists_high - 1);
    const int step_i = along.x > 0.0f ? 1 : -1;
    const int step_j = along.y > 0.0f ? 1 : -1;
    const float border_i = along.x > 0.0f ? 1.0f : 0.0f; // from a list's lower border to the one ahead
    const float border_j = along.y > 0.0f ? 1.0f : 0.0f;

    float3 color = (float3)(0.0f);
    float transmittance = 1.0f;
    float r = r_begin;
    float z = start.z;
    int passed = 0; // supersegments passed in the list before: the first guess in the next
    while (true) {
        // The ray crosses list (i, j) from r to r_next
        const float r_u = along.x != 0.0f ? ((float)i + border_i - half_wide - deep.x) * inverse_u : INFINITY;
        const float r_v = along.y != 0.0f ? ((float)j + border_j - half_high - deep.y) * inverse_v : INFINITY;
        const float r_next = fmax(r, fmin(r_end, fmin(r_u, r_v)));
        const float z_next = fma(r_next, along.z, deep.z);

        const size_t list = (size_t)j * (size_t)lists_wide + (size_t)i;
        const OFFSET_T begin = offsets[list];
        const int count = (int)(offsets[list + 1] - begin);
        if (count > 0) {
            passed = count_passing(faces + begin, count, z, away, passed);
            // Going away, supersegments passed, passed + 1 … follow; coming back, passed - 1, passed - 2 …
            while (away ? passed < count : passed > 0) {
                const OFFSET_T k = begin + (OFFSET_T)(away ? passed : passed - 1);
                const float2 face = faces[k];
                if (away ? face.x > z_next : face.y < z_next)
                    break;
                // Clip to the supersegment by interval: between two faces it never leaves [r, r_next]
                float from = r;
                float to = r_next;
                const float enters = away ? face.x : face.y;
                const float leaves = away ? face.y : face.x;
                if (away ? enters > z : enters < z)
                    from = clamp((enters - deep.z) * inverse_z, r, r_next);
                const bool ends_here = away ? leaves <= z_next : leaves >= z_next;
                if (away ? leaves < z_next : leaves > z_next)
                    to = clamp((leaves - deep.z) * inverse_z, from, r_next);
                const float4 medium = media[k];
                float length_crossed = scale * (to - from);
#ifndef PARALLEL
                length_crossed /= reciprocal_depth(fma(from, along.z, deep.z), depth_origin)
                                * reciprocal_depth(fma(to, along.z, deep.z), depth_origin);
#endif
                const float weight = transmittance * opacity_of(medium.w * length_crossed); // over, front to back
                color += weight * medium.xyz;
                transmittance -= weight;
                if (!ends_here)
                    break;
                passed += away ? 1 : -1;
            }
        }
        if (r_next >= r_end || transmittance < transmittance_cutoff)
            break;
        r = r_next;
        z = z_next;
        if (r_u <= r_v) {
            i += step_i;
            if (i < 0 || i >= lists_wide)
                break;
        } else {
            j += step_j;
            if (j < 0 || j >= lists_high)
                break;
        }
    }
    image[place] = (float4)(color, 1.0f - transmittance);
}
