// The pixels of a work-item's rays in pictures, whose top row comes first.
#include "lib/rays.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

// Places of pixels (x, y) of a window; -1 where there is none.
inline Int places_in_picture(Int x, Int y, Int in_window, int width, int height)
{
    return SELECT((Int)(-1), (height - 1 - y) * width + x, in_window);
}

// t at which the rays end, by pixel; without `opaque_depth` they do not.
inline Real opaque_ends(Int pixels, __global const float *opaque_depth)
{
    if (!opaque_depth)
        return (Real)(INFINITY);
    const Places places = {pixels};
    Place *place = places.each;
#define END(n) (place[n] < 0 ? 0.0f : opaque_depth[place[n]])
    return OF_LANES(Real, END);
#undef END
}
