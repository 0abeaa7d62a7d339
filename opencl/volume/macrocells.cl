// Macrocells of a volume that a transfer function makes transparent, so that marches can skip them.
//
// -D VOXEL_T, INDEX_T, COMPONENTS: see volume/sampling.cl
//
// Macrocell (i, j, k) covers the index positions from MACROCELL i to MACROCELL (i + 1) along x,
// both included, and likewise along y and z: every point that a sample between them reads, whatever
// the interpolation.
#include "volume/sampling.cl"
#pragma OPENCL FP_CONTRACT OFF

#define MACROCELL (1 << MACROCELL_SHIFT) // points along each axis

// Least and largest scalar of each macrocell, NaN left out (it is transparent); (INFINITY,
// -INFINITY) where all is NaN.
__kernel void macrocell_ranges(__global const VOXEL_T *voxels, int4 size, int4 macrocells,
                               __global float2 *ranges)
{
    const uint item = (uint)get_global_id(0);
    if (item >= (uint)macrocells.x * (uint)macrocells.y * (uint)macrocells.z)
        return;
    const int i = (int)(item % (uint)macrocells.x) * MACROCELL;
    const int j = (int)(item / (uint)macrocells.x % (uint)macrocells.y) * MACROCELL;
    const int k = (int)(item / ((uint)macrocells.x * (uint)macrocells.y)) * MACROCELL;
    float least = INFINITY;
    float largest = -INFINITY;
    for (int z = k; z <= min(k + MACROCELL, size.z - 1); ++z)
        for (int y = j; y <= min(j + MACROCELL, size.y - 1); ++y) {
            __global const VOXEL_T *row =
                voxels + ((INDEX_T)z * (INDEX_T)size.y + (INDEX_T)y) * (INDEX_T)size.x * COMPONENTS;
            for (int x = i; x <= min(i + MACROCELL, size.x - 1); ++x) {
                const float value = (float)row[x * COMPONENTS + SCALAR];
                least = fmin(least, value);
                largest = fmax(largest, value);
            }
        }
    ranges[item] = (float2)(least, largest);
}

// The distance field of macrocells: how far each is from one that may be visible, in macrocells
// along the axis on which that is most; 0 where it is one itself, `most` where there is none
// nearer. One axis at a time: `along` macrocells are on it, their numbers `apart`.
__kernel void macrocell_distances(__global const uchar *before, uint macrocells, uint apart,
                                  int along, int most, __global uchar *distances)
{
    const uint item = (uint)get_global_id(0);
    if (item >= macrocells)
        return;
    const int place = (int)(item / apart % (uint)along);
    int distance = before[item];
    for (int d = 1; d < distance; ++d) {
        const int low = place >= d ? before[item - (uint)d * apart] : most;
        const int high = place + d < along ? before[item + (uint)d * apart] : most;
        distance = min(distance, max(d, min(low, high)));
    }
    distances[item] = (uchar)distance;
}

// Whether anything in a macrocell may be visible. visible_before[e]: how many of the table's
// entries 0 to e - 1 are not transparent.
__kernel void macrocell_visibility(__global const float2 *ranges, uint macrocells,
                                   __global const uint *visible_before, int entries, float low,
                                   float per_scalar, __global uchar *visible)
{
    const uint item = (uint)get_global_id(0);
    if (item >= macrocells)
        return;
    const float2 range = ranges[item];
    if (range.x > range.y) {
        visible[item] = 0;
        return;
    }
    // So much of an entry on either side covers the rounding of scalars between two different ones,
    // and of their places
    const float margin = range.x < range.y ? fmax(1e-3f, 2.4e-7f * (float)entries) : 0.0f;
    const float last = (float)(entries - 1);
    const int first_entry = (int)floor(clamp((range.x - low) * per_scalar - margin, 0.0f, last));
    const int last_entry = (int)ceil(clamp((range.y - low) * per_scalar + margin, 0.0f, last));
    visible[item] = visible_before[last_entry + 1] > visible_before[first_entry] ? 1 : 0;
}
