// What the words of sixteen packed supersegments hold, as depth_of_code and medium_of of
// raycasting/supersegments.cl have it for one.
#include "lib/list_space.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Depth coordinates of codes of 14 bits, in lists of these origins and strides.
inline Real depths_of_codes(const Lists *lists, Int origin, Int stride, Uint codes,
                            float depth_origin)
{
    const Real offset = TO_REAL(origin + AS_INT(codes & DEPTH_CODES) * stride) * lists->depth_step;
    const Real before = DEPTH == PARALLEL ? offset : fmax(offset, lists->nearest_offset);
    return depth_coordinate(before, depth_origin);
}

// Media of supersegments by their words, in lists of these scales.
inline Real4 media_of_words(Uint low, Uint high, Real per_code)
{
    const Uint tau = low >> 28 | (high & 255) << 4;
    const Uint thickness = (low >> 14 & DEPTH_CODES) - (low & DEPTH_CODES);
    const Real optical_depth = select((Real)(0.0f), AS_REAL((tau + TAU_BASE - 1) << 16), tau > 0);
    return REAL4(TO_REAL(high >> 8 & 255) * (1.0f / 255.0f),
                 TO_REAL(high >> 16 & 255) * (1.0f / 255.0f), TO_REAL(high >> 24) * (1.0f / 255.0f),
                 fmin(optical_depth * per_code / TO_REAL(thickness), FLT_MAX));
}
