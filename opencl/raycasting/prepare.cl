// A VDI's arrays to what the raycaster reads: faces in list space and extinction in place of optical depth.
// The arrays hold offsets, see lib/list_space.cl, whose -D names hold here. They are brought into bundles, see
// raycasting/supersegments.cl.
//
// -D PACKED=16   both in one array, see raycasting/supersegments.cl; the form of 8 bytes is made by the host
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// What is kept of a face
#ifdef DOUBLE_FLOAT_RAYS
#define FACE_OF(offset) (offset)
#else
#define FACE_OF(offset) depth_coordinate(offset, depth_origin)
#endif

// One work-item per list.
__kernel void prepare_lists(
    __global const OFFSET_T *starts,      // of the lists in the arrays, width * height + 1
    __global const ulong *headers,        // of the bundles of lists, see raycasting/supersegments.cl
    __global const float *fronts,         // view depth less depth_origin
    __global const float *backs,
#ifdef PACKED
    __global const uint *colors,          // 11, 11 and 10 bits
#else
    __global const float *colors,         // straight RGB, 3 per supersegment
#endif
    __global const float *optical_depths,
    float depth_origin,                   // world units
    float nearest,                        // least view depth that is in front of the eye, world units
    int width, int height,
    __global const float *centre_ray,     // 9: model-frame direction of the ray of pixel offsets (a, b), rows 1, a, b
#ifdef PACKED
    __global uint4 *supersegments)
#else
    __global float2 *faces,
    __global float4 *media)               // straight RGB, extinction per model length
#endif
{
    const size_t list = get_global_id(0);
    if (list >= (size_t)width * (size_t)height)
        return;
    const float a = (float)(list % (size_t)width) + 0.5f - 0.5f * (float)width;
    const float b = (float)(list / (size_t)width) + 0.5f - 0.5f * (float)height;
    const float3 direction = fma(b, vload3(2, centre_ray), fma(a, vload3(1, centre_ray), vload3(0, centre_ray)));
    const float per_depth = length(direction); // model length per unit of view depth
    const List target = list_at(headers, (int)(list % (size_t)width), (int)(list / (size_t)width), width);
    const OFFSET_T start = starts[list];
    const int count = (int)(starts[list + 1] - start);
    for (int n = 0; n < target.count; ++n) {
        const OFFSET_T entry = entry_of(&target, n);
        if (n >= count) {
#ifdef PACKED
            supersegments[entry] = (uint4)(as_uint2(NO_FACE), 0, 0);
#else
            faces[entry] = NO_FACE;
            media[entry] = (float4)(0.0f);
#endif
            continue;
        }
        const OFFSET_T k = start + n;
        const float front = fronts[k];
        const float back = backs[k];
#ifdef PARALLEL
        const float z0 = front, z1 = back;
#else
        // A face on the eye's plane has no list coordinate; nothing nearer than `nearest` is ever looked up
        const float z0 = FACE_OF(fmax(front, nearest - depth_origin));
        const float z1 = FACE_OF(fmax(back, nearest - depth_origin));
#endif
        // Finite however thin: nothing or everything of such a supersegment is crossed
        const float length = fmax((back - front) * per_depth, FLT_MIN);
        const float extinction = fmin(optical_depths[k] / length, FLT_MAX);
#ifdef PACKED
        supersegments[entry] = (uint4)(as_uint(z0), as_uint(z1), as_uint(extinction), colors[k]);
#else
        faces[entry] = (float2)(z0, z1);
        media[entry] = (float4)(vload3(k, colors), extinction);
#endif
    }
}
