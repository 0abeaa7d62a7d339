// Ambient occlusion at a sample, from the grid that volume/ambient_occlusion.cl fills (docs/conventions.md).
//
// -D OCCLUSION  samples are darkened by what stands around them; without it nothing of this is compiled (what fills the
//               grid defines OCCLUSION_GRID)
#pragma OPENCL FP_CONTRACT OFF

// Of the structure Medium, of the kernels that take one, and of its initialiser: see volume/shading.cl
#ifdef OCCLUSION
#define OCCLUSION_FIELD                                                                        \
    __global const float *ambient; /* mean transmittance around each node */                   \
    int4 nodes;                    /* along x, y, z */                                         \
    float4 to_nodes;               /* nodes per voxel along x, y, z; strength */
#define OCCLUSION_PARAMETER __global const float *ambient, int4 nodes, float4 to_nodes,
#define OCCLUSION_ARGUMENT , ambient, nodes, to_nodes
#else
#define OCCLUSION_FIELD
#define OCCLUSION_PARAMETER
#define OCCLUSION_ARGUMENT
#endif

#if defined(OCCLUSION) || defined(OCCLUSION_GRID)
// Trilinear between (0, 0, 0) and (1, 1, 1) of eight values, `row` and `plane` apart.
inline float trilinear(__global const float *v, int row, int plane, float fx, float fy, float fz)
{
    const float near = mix(mix(v[0], v[1], fx), mix(v[row], v[row + 1], fx), fy);
    v += plane;
    const float far = mix(mix(v[0], v[1], fx), mix(v[row], v[row + 1], fx), fy);
    return mix(near, far, fz);
}
#endif

#ifdef OCCLUSION
// Factor of the colour at index position (x, y, z).
inline float ambient_factor(__global const float *ambient, int4 nodes, float4 to_nodes, float x, float y, float z)
{
    const float3 at = (float3)(x, y, z) * to_nodes.xyz;
    const int3 node = clamp(convert_int3(at), (int3)(0), nodes.xyz - 2);
    const float3 share = clamp(at - convert_float3(node), 0.0f, 1.0f);
    const int plane = nodes.x * nodes.y;
    __global const float *v = ambient + node.z * plane + node.y * nodes.x + node.x;
    const float open = trilinear(v, nodes.x, plane, share.x, share.y, share.z);
    return open / fma(to_nodes.w, 1.0f - open, open); // exactly 1 where all the light arrives
}
#endif
