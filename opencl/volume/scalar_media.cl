// The medium of each scalar that a volume of integers may hold, so that marches look it up in place
// of computing it.
#include "lib/classification.cl"
#pragma OPENCL FP_CONTRACT OFF

// Straight colour (rgb) and optical depth of one opacity unit distance (w) of the scalars `first`,
// `first` + 1, ...
__kernel void scalar_media(__global const float4 *table, int entries, float low,
                           float per_scalar, // see lib/classification.cl
                           int first, int count, __global float4 *media)
{
    const int i = (int)get_global_id(0);
    if (i >= count)
        return;
    float4 medium = classify((float)(first + i), table, entries, low, per_scalar);
    medium.w = unit_optical_depth(medium.w);
    media[i] = medium;
}
