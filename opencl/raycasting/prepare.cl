// A VDI's arrays to what the raycaster reads: faces in list space and extinction in place of
// optical depth, by bundles of lists (raycasting/supersegments.cl, whose -D names hold here).
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Model length per unit of view depth along the centre ray of a list.
inline float length_per_depth(__global const float *centre_ray, int i, int j, int width, int height)
{
    const float a = (float)i + 0.5f - 0.5f * (float)width;
    const float b = (float)j + 0.5f - 0.5f * (float)height;
    return length(
        fma(b, vload3(2, centre_ray), fma(a, vload3(1, centre_ray), vload3(0, centre_ray))));
}

// A supersegment's faces in list space, of offsets from depth_origin. A face on the eye's plane has
// no list coordinate; nothing nearer than `nearest` is ever looked up.
inline float2 prepared_face(float front, float back, float depth_origin, float nearest)
{
    const float least = DEPTH == PARALLEL ? -INFINITY : nearest - depth_origin;
    return (float2)(KEPT_FACE(fmax(front, least), depth_origin),
                    KEPT_FACE(fmax(back, least), depth_origin));
}

// Its extinction, finite however thin: nothing or everything of such a supersegment is crossed.
inline float prepared_extinction(float front, float back, float optical_depth, float per_depth)
{
    return fmin(optical_depth / fmax((back - front) * per_depth, FLT_MIN), FLT_MAX);
}

// One work-item per list.
__kernel void prepare_lists(
    __global const ulong *starts,     // of the lists in the arrays, width * height + 1
    __global const HEADER_T *headers, // of the bundles of lists
    __global const float *fronts,     // view depth less depth_origin
    __global const float *backs,
    __global const float *colors, // straight RGB
    __global const float *optical_depths,
    float depth_origin, // world units
    float nearest,      // least view depth that is in front of the eye, world units
    int width, int height,
    __global const float
        *centre_ray, // 9: model-frame direction of the ray of pixel offsets (a, b), rows 1, a, b
    __global float2 *faces, // (front, back)
    __global float4 *media) // straight RGB, extinction per model length
{
    const size_t place = get_global_id(0);
    if (place >= (size_t)width * (size_t)height)
        return;
    const int i = (int)(place % (size_t)width), j = (int)(place / (size_t)width);
    const float per_depth = length_per_depth(centre_ray, i, j, width, height);
    const Lists lists = {headers, 0, 0, width, height, 0.0f, 0.0f};
    const List list = list_at(&lists, i, j);
    const ulong start = starts[place];
    const int count = (int)(starts[place + 1] - start);
    for (int n = 0; n < list.count; ++n) {
        const OFFSET_T entry = entry_of(list, n);
        const ulong k = start + n;
        float2 face = NO_FACE; // of what the list is filled up with
        float3 color = (float3)(0.0f);
        float extinction = 0.0f;
        if (n < count) {
            face = prepared_face(fronts[k], backs[k], depth_origin, nearest);
            extinction = prepared_extinction(fronts[k], backs[k], optical_depths[k], per_depth);
            color = vload3(k, colors);
        }
        faces[entry] = face;
        media[entry] = (float4)(color, extinction);
    }
}

// Lists of 8-byte supersegments: each begins with its scales. One work-item per list; the hint
// keeps Intel's compiler from copying lists in vectors, as long as their longest.
__attribute__((vec_type_hint(float16))) __kernel void prepare_packed(
    __global const ulong *starts,     // of the lists in `stored`, width * height + 1
    __global const OFFSET_T *headers, // the same in `words`
    __global const int *origins,      // of the lists' depths, steps
    __global const ushort *strides,   // steps per code
    __global const uint2 *stored,
    float step, // of depth, world units
    int width, int height,
    __global const float
        *centre_ray, // 9: model-frame direction of the ray of pixel offsets (a, b), rows 1, a, b
    __global uint2 *words)
{
    const size_t list = get_global_id(0);
    if (list >= (size_t)width * (size_t)height)
        return;
    const ulong begin = starts[list], end = starts[list + 1];
    if (begin == end)
        return;
    const int i = (int)(list % (size_t)width), j = (int)(list / (size_t)width);
    const float per_depth = length_per_depth(centre_ray, i, j, width, height);
    const int origin = origins[list], stride = strides[list];
    __global uint2 *target = words + headers[list];
    target[0] = (uint2)(as_uint(origin), (uint)stride);
    target[1] = (uint2)(as_uint(1.0f / (per_depth * (float)stride * step)), 0);
    for (ulong k = begin; k < end; ++k)
        target[LIST_HEADER + k - begin] = stored[k];
}
