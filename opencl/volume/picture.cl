// Where the rays of a block, or one, end in a scene, and where their colours lie in its picture.
#include "lib/rays.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

// What kernels that draw volumes take behind the view: t at which each pixel's ray ends, top row first, if has_opaque_depth
#define OPAQUE_DEPTH_PARAMETERS __global const float *opaque_depth, int has_opaque_depth,

// Pixels of rays through rows from `first_row` on, top row first; -1 where there is none.
inline Places places_in_picture(const Rays *rays, int width, int height, int first_row)
{
    const Places places = {SELECT((Int)(-1), (height - 1 - first_row - rays->y) * width + rays->x, rays->present)};
    return places;
}

inline Real opaque_ends(const Places *places, __global const float *opaque_depth, int has_opaque_depth)
{
    if (!has_opaque_depth)
        return (Real)(INFINITY);
    Place *place = places->each;
#define END(n) (place[n] < 0 ? 0.0f : opaque_depth[place[n]])
    return OF_LANES(Real, END);
#undef END
}

inline void store_colors(__global float4 *image, const Places *places, Real4 rgba)
{
    Place *place = places->each;
#if LANES == 1
    image[*place] = rgba;
#else
    const Real4 rows = transpose(rgba);
#define STORE(n, c, four)   \
    if (place[n] >= 0)      \
        image[place[n]] = rows.c.four;
#define STORE_ROW(g, four) STORE(4 * g, x, four) STORE(4 * g + 1, y, four) STORE(4 * g + 2, z, four) STORE(4 * g + 3, w, four)
    STORE_ROW(0, s0123)
    STORE_ROW(1, s4567)
    STORE_ROW(2, s89ab)
    STORE_ROW(3, scdef)
#undef STORE
#undef STORE_ROW
#endif
}
