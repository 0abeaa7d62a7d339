// Rays through a window, and their clipping to a convex region.
//
// A "form" is an affine function along the ray of pixel (x, y), six floats (c0, c1, c2, d0, d1, d2):
//
//     value(t) = (c0 + a c1 + b c2) + t (d0 + a d1 + b d2),   a = x + 1/2 - W/2,  b = y + 1/2 - H/2
//
// with t the view depth of the ray's own camera less a reference depth (world units). The host forms all six in float64
// about a reference depth near the data, so that float32 is enough here however far away the eye or the origin is
// (docs/conventions.md, "Rays"). y = 0 is the bottom row.
#pragma OPENCL FP_CONTRACT OFF

#define FORM_SIZE 6

// Value of a form at t = 0 for pixel offsets (a, b).
inline float form_value(__global const float *form, float a, float b)
{
    return fma(b, form[2], fma(a, form[1], form[0]));
}

// Slope of a form along the ray, per unit of t.
inline float form_slope(__global const float *form, float a, float b)
{
    return fma(b, form[5], fma(a, form[4], form[3]));
}

// Clip [*t0, *t1] to where each of `count` forms is >= 0. Returns whether anything is left.
inline bool clip_to_planes(__global const float *planes, int count, float a, float b, float *t0, float *t1)
{
    for (int k = 0; k < count; ++k) {
        const float value = form_value(planes + k * FORM_SIZE, a, b);
        const float slope = form_slope(planes + k * FORM_SIZE, a, b);
        if (slope > 0.0f)
            *t0 = fmax(*t0, -value / slope);
        else if (slope < 0.0f)
            *t1 = fmin(*t1, -value / slope);
        else if (value < 0.0f)  // parallel to the plane and outside it
            *t1 = -INFINITY;
    }
    return *t0 < *t1;
}

// Pixel of a work-item: blocks of 4 x 4 pixels, so that neighbouring items walk through the same lists and voxels.
inline int2 block_pixel(uint item, int width)
{
    const uint block = item >> 4;
    const uint columns = (uint)(width + 3) >> 2;
    return (int2)((int)((block % columns) << 2 | (item & 3)), (int)((block / columns) << 2 | (item >> 2 & 3)));
}

// The same in strips STRIP blocks high, each from left to right, so that one work-item's lists are still cached when those
// above and below come to them.
#define STRIP 4
inline int2 strip_pixel(uint item, int width, int height)
{
    const uint block = item >> 4;
    const uint columns = (uint)(width + 3) >> 2;
    const uint rows = (uint)(height + 3) >> 2;
    const uint strip = block / (STRIP * columns);
    const uint place = block - strip * STRIP * columns;
    const uint high = clamp((int)rows - (int)(strip * STRIP), 1, STRIP); // blocks; the last strip may be lower
    const uint column = place / high;
    const uint row = strip * STRIP + place - column * high;
    return (int2)((int)(column << 2 | (item & 3)), (int)(row << 2 | (item >> 2 & 3)));
}
