// Ambient occlusion of a classified volume: the mean transmittance around each node of a coarse
// grid.
//
// -D: see volume/medium.cl
//
// Node (i, j, k) lies at the volume's index position (i, j, k) * cell. step_opacities gives each
// node the mean opacity, over a step of the marches to come, of the box of one cell around it. All
// nodes march in the same directions by the same steps, so ambient_transmittances reads the
// opacities at offsets that are the same for every node: places and weights come in a table. Around
// the nodes lies a margin of zeros, as wide as the marches reach.
#include "volume/medium.cl"
#pragma OPENCL FP_CONTRACT OFF

// Whether any macrocell between two index positions may hold something visible.
inline bool any_visible(__global const uchar *visible, int4 macrocells, float3 low, float3 high)
{
    const int3 last = macrocells.xyz - 1;
    const int3 a = clamp(convert_int3(fmax(low, 0.0f)) >> MACROCELL_SHIFT, (int3)(0), last);
    const int3 b = clamp(convert_int3(fmax(high, 0.0f)) >> MACROCELL_SHIFT, (int3)(0), last);
    for (int z = a.z; z <= b.z; ++z)
        for (int y = a.y; y <= b.y; ++y)
            for (int x = a.x; x <= b.x; ++x)
                if (visible[((size_t)z * macrocells.y + y) * macrocells.x + x])
                    return true;
    return false;
}

__kernel void
step_opacities(const Classified classified, __global const VOXEL_T *voxels,
               __global const float4 *table, __global const uchar *blanked,
               __global const float *gradient, __global const uchar *visible,
               int4 nodes,               // along x, y, z
               int4 cell,                // voxels from node to node
               int4 samples,             // along each edge of a cell
               int4 margin, int4 padded, // nodes around the nodes, and in all
               float units, // opacity unit distances per step of the volume's own marches
               float steps, // such steps in a step of the marches to come
               __global float *opacities) // padded
{
    const int3 node = (int3)((int)get_global_id(0), (int)get_global_id(1), (int)get_global_id(2));
    if (node.x >= nodes.x)
        return;
    const Medium medium = {classified, voxels, table, 0, blanked, gradient, 0, 0};
    const float3 edge = convert_float3(cell.xyz);
    const float3 centre = convert_float3(node * cell.xyz);
    const float3 apart = edge / convert_float3(samples.xyz);
    float sum = 0.0f;
    const int4 points = classified.points.size;
    if (any_visible(visible, classified.macrocells, centre - 0.5f * edge, centre + 0.5f * edge))
        for (int k = 0; k < samples.z; ++k)
            for (int j = 0; j < samples.y; ++j)
                for (int i = 0; i < samples.x; ++i) {
                    const float x = centre.x + (((float)i + 0.5f) * apart.x - 0.5f * edge.x);
                    const float y = centre.y + (((float)j + 0.5f) * apart.y - 0.5f * edge.y);
                    const float z = centre.z + (((float)k + 0.5f) * apart.z - 0.5f * edge.z);
                    // Beyond the volume there is nothing
                    if (x >= 0.0f && y >= 0.0f && z >= 0.0f && x <= (float)(points.x - 1) &&
                        y <= (float)(points.y - 1) && z <= (float)(points.z - 1))
                        sum += opacity_of(medium_at(&medium, x, y, z, units).w * steps);
                }
    const int3 place = node + margin.xyz;
    opacities[(place.z * padded.y + place.y) * padded.x + place.x] =
        sum / (float)(samples.x * samples.y * samples.z);
}

__kernel void ambient_transmittances(
    __global const float *opacities, // padded
    int4 nodes, int4 cell, int4 margin, int4 padded, __global const uchar *visible, int4 macrocells,
    __global const int
        *places, // of the first of eight opacities around each step's midpoint, from the node's own
    __global const float *shares, // weights of the second along x, y, z
    int directions, int steps, __global float *ambient)
{
    const int3 node = (int3)((int)get_global_id(0), (int)get_global_id(1), (int)get_global_id(2));
    if (node.x >= nodes.x)
        return;
    const int3 place = node + margin.xyz;
    const int plane = padded.x * padded.y;
    __global const float *own = opacities + (place.z * plane + place.y * padded.x + place.x);
    const float3 centre = convert_float3(node * cell.xyz);
    const float3 edge = convert_float3(cell.xyz);
    float mean = 1.0f;
    // Nobody asks for a node around which nothing is to be seen
    if (any_visible(visible, macrocells, centre - edge, centre + edge)) {
        float sum = 0.0f;
        for (int d = 0; d < directions; ++d) {
            float transmittance = 1.0f;
            for (int k = d * steps; k < (d + 1) * steps; ++k)
                transmittance *= 1.0f - trilinear(own, places[k], padded.x, plane, shares[3 * k],
                                                  shares[3 * k + 1], shares[3 * k + 2]);
            sum += transmittance;
        }
        mean = sum / (float)directions;
    }
    ambient[(node.z * nodes.y + node.y) * nodes.x + node.x] = mean;
}
