// Where sixteen rays end in a scene, and where their colours lie in its picture.
#include "lib/rays.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

// Pixels of rays through a window, top row first; -1 where there is none.
inline Places places_in_picture(const Rays *rays, int width, int height)
{
    const Places places = {
        SELECT((Int)(-1), (height - 1 - rays->y) * width + rays->x, rays->present)};
    return places;
}

// t at which the rays end, by pixel; without `opaque_depth` they do not.
inline Real opaque_ends(const Places *places, __global const float *opaque_depth)
{
    if (!opaque_depth)
        return (Real)(INFINITY);
    Place *place = places->each;
#define END(n) (place[n] < 0 ? 0.0f : opaque_depth[place[n]])
    return OF_LANES(Real, END);
#undef END
}

inline void store_colors(__global float4 *image, const Places *places, Real4 rgba)
{
    Place *place = places->each;
    const Real4 rows = transpose(rgba);
#define STORE(n, c, four)                                                                          \
    if (place[n] >= 0)                                                                             \
        image[place[n]] = rows.c.four;
#define STORE_ROW(g, four)                                                                         \
    STORE(4 * g, x, four)                                                                          \
    STORE(4 * g + 1, y, four) STORE(4 * g + 2, z, four) STORE(4 * g + 3, w, four)
    STORE_ROW(0, s0123)
    STORE_ROW(1, s4567)
    STORE_ROW(2, s89ab)
    STORE_ROW(3, scdef)
#undef STORE
#undef STORE_ROW
}
