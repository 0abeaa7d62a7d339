// That nothing is met, to all pixels of an image of which rays are cast in a part. A driver's own
// fill of a buffer may run on one core.

// The picture.
__kernel void clear_image(ulong pixels, __global float4 *image)
{
    const size_t place = get_global_id(
        0); // in all its bits: a compiler sees that work-items write next to each other
    if (place < pixels)
        image[place] = (float4)(0.0f);
}

// t of first hits.
__kernel void clear_hits(ulong pixels, __global float *image)
{
    const size_t place = get_global_id(0);
    if (place < pixels)
        image[place] = INFINITY;
}
