// The pixels of a work-item's sixteen rays.
#include "lib/rays.cl"
#include "raycasting/frame.cl"
#pragma OPENCL FP_CONTRACT OFF

// Those of the block that begins at a corner.
#define X_OF_BLOCK(corner) ((corner).x + (LANE_NUMBERS & (BLOCK - 1)))
#define Y_OF_BLOCK(corner) ((corner).y + (LANE_NUMBERS / BLOCK))

typedef struct {
    int places[LANES]; // in the image
    int wanted[LANES]; // lanes that have one
} Pixels;

inline Pixels pixels_at(Int x, Int y, Int in_window, int width, int height)
{
    Pixels pixels;
    STORE_LANES((height - 1 - y) * width + x, 0, pixels.places);
    STORE_LANES(in_window, 0, pixels.wanted);
    return pixels;
}

// t at which the rays end.
inline Real ends_at(const Pixels *pixels, __global const float *opaque_depth)
{
    float ends[LANES];
    for (int k = 0; k < LANES; ++k)
        ends[k] = pixels->wanted[k] ? opaque_depth[pixels->places[k]] : 0.0f;
    return LOAD_LANES(0, ends);
}

inline void write_pixels(__global float4 *image, const Pixels *pixels, Real4 rgba)
{
    float channels[4][LANES];
    STORE_LANES(rgba.x, 0, channels[0]);
    STORE_LANES(rgba.y, 0, channels[1]);
    STORE_LANES(rgba.z, 0, channels[2]);
    STORE_LANES(rgba.w, 0, channels[3]);
    for (int k = 0; k < LANES; ++k) {
        if (pixels->wanted[k])
            image[pixels->places[k]] =
                (float4)(channels[0][k], channels[1][k], channels[2][k], channels[3][k]);
    }
}
