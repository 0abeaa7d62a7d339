// That nothing is met, to all pixels of an image of which rays are cast in a part. A driver's own fill of a buffer may run on
// one core.
//
// -D FIRST_HIT  as in raycasting/raycast.cl
#ifdef FIRST_HIT
#define IMAGE_T float
#define NOTHING INFINITY
#else
#define IMAGE_T float4
#define NOTHING (float4)(0.0f)
#endif

__kernel void clear_image(ulong pixels, __global IMAGE_T *image)
{
    const size_t place = get_global_id(0); // in all its bits: a compiler sees that work-items write next to each other
    if (place < pixels)
        image[place] = NOTHING;
}
