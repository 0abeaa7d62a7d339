// Ambient occlusion at a sample, from the grid that volume/ambient_occlusion.cl fills
// (docs/dev/conventions.md).
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

// Trilinear between (0, 0, 0) and (1, 1, 1) of eight values, `row` and `plane` apart.
inline Real trilinear(__global const float *values, Int first, int row, int plane, Real fx, Real fy,
                      Real fz)
{
    const Places places = {first};
    Place *at = places.each;
#define VALUE(n) v[at[n]]
    Real corners[8];
    for (int k = 0; k < 8; ++k) {
        __global const float *v = values + (k >> 2) * plane + (k >> 1 & 1) * row + (k & 1);
        corners[k] = OF_LANES(Real, VALUE);
    }
#undef VALUE
    const Real near = mix(mix(corners[0], corners[1], fx), mix(corners[2], corners[3], fx), fy);
    const Real far = mix(mix(corners[4], corners[5], fx), mix(corners[6], corners[7], fx), fy);
    return mix(near, far, fz);
}

// Factor of the colour at index position (x, y, z). `ambient`: mean transmittance around each of
// `nodes` along x, y, z. `to_nodes`: nodes per voxel along x, y, z, and the strength.
inline Real ambient_factor(__global const float *ambient, int4 nodes, float4 to_nodes, Real x,
                           Real y, Real z)
{
    const Real at_x = x * to_nodes.x, at_y = y * to_nodes.y, at_z = z * to_nodes.z;
    const Int i = clamp(TO_INT(at_x), 0, nodes.x - 2);
    const Int j = clamp(TO_INT(at_y), 0, nodes.y - 2);
    const Int k = clamp(TO_INT(at_z), 0, nodes.z - 2);
    const int plane = nodes.x * nodes.y;
    const Real open = trilinear(
        ambient, k * plane + j * nodes.x + i, nodes.x, plane, clamp(at_x - TO_REAL(i), 0.0f, 1.0f),
        clamp(at_y - TO_REAL(j), 0.0f, 1.0f), clamp(at_z - TO_REAL(k), 0.0f, 1.0f));
    return open /
           fma((Real)(to_nodes.w), 1.0f - open, open); // exactly 1 where all the light arrives
}
