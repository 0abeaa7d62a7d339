// That nothing is met, to all pixels of an image of which rays are cast in a part: 0, or INFINITY
// to t of first hits. A driver's own fill of a buffer may run on one core.
__kernel void clear_image(ulong numbers, float nothing, __global float *image)
{
    // In all its bits: a compiler sees that work-items write next to each other
    const size_t place = get_global_id(0);
    if (place < numbers)
        image[place] = nothing;
}
