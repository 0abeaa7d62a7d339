// Rays through a window, and their clipping to a convex region.
//
// A "form" is an affine function along the ray of pixel (x, y), six floats (c0, c1, c2, d0, d1,
// d2):
//
//     value(t) = (c0 + a c1 + b c2) + t (d0 + a d1 + b d2),   a = x + 1/2 - W/2,  b = y + 1/2 - H/2
//
// with t the view depth of the ray's own camera less a reference depth (world units). The host
// forms all six in float64 about a reference depth near the data, so that float32 is enough here
// however far the eye or the origin is (docs/dev/conventions.md, "Rays"). y = 0 is the bottom row.
//
// Six more floats are what float32 has rounded off the first six, for rays that may enter the data
// so far from there that it is not enough for the positions of samples (-D DOUBLE_FLOAT_RAYS,
// docs/dev/numerics.md).
#include "lib/double_float.cl"
#include "lib/directions.cl"
#pragma OPENCL FP_CONTRACT OFF

// Value of a form at t = 0 for pixel offsets (a, b), and its slope along the ray, per unit of t.
inline Real form_value(__global const float *form, Real a, Real b)
{
    return fma(b, (Real)(form[2]), fma(a, (Real)(form[1]), (Real)(form[0])));
}

inline Real form_slope(__global const float *form, Real a, Real b)
{
    return form_value(form + 3, a, b);
}

// Model units per unit of t along a ray that is marched. `forms`: 3 index positions, then 3 model
// directions.
inline Real march_speed(__global const float *forms, Real a, Real b)
{
    return length_of(REAL3(form_slope(forms + 3 * FORM_SIZE, a, b),
                           form_slope(forms + 4 * FORM_SIZE, a, b),
                           form_slope(forms + 5 * FORM_SIZE, a, b)));
}

// Clip [*t0, *t1] to where each of `count` forms is >= 0. Returns whether anything is left.
inline Int clip_to_planes(__global const float *planes, int count, Real a, Real b, Real *t0,
                          Real *t1)
{
    for (int k = 0; k < count; ++k) {
        const Real value = form_value(planes + k * FORM_SIZE, a, b);
        const Real slope = form_slope(planes + k * FORM_SIZE, a, b);
        const Real t = -value / slope;
        *t0 = SELECT(*t0, fmax(*t0, t), slope > 0.0f);
        *t1 = SELECT(*t1, fmin(*t1, t), slope < 0.0f);
        *t1 = SELECT(*t1, (Real)(-INFINITY),
                     slope == 0.0f && value < 0.0f); // parallel to the plane and outside it
    }
    return *t0 < *t1;
}

// Three coefficients of a form, and their rests, at pixel offsets (a, b), which are exact.
inline float2 double_float_of_form(__global const float *c, float a, float b)
{
    const float2 of_a = double_float_product((float2)(c[1], c[7]), (float2)(a, 0.0f));
    const float2 of_b = double_float_product((float2)(c[2], c[8]), (float2)(b, 0.0f));
    return double_float_sum(double_float_sum((float2)(c[0], c[6]), of_a), of_b);
}

// Value of a form at t.
inline float2 form_at(__global const float *form, float a, float b, float2 t)
{
    return double_float_sum(double_float_of_form(form, a, b),
                            double_float_product(t, double_float_of_form(form + 3, a, b)));
}

// clip_to_planes, and what is left as its entry and its length.
inline bool clip_from_entry(__global const float *planes, int count, float a, float b, float t_end,
                            float2 *entry, float *length)
{
    float2 t0 = (float2)(-INFINITY, 0.0f);
    float2 t1 = (float2)(t_end, 0.0f);
    for (int k = 0; k < count; ++k) {
        const float2 value = double_float_of_form(planes + k * FORM_SIZE, a, b);
        const float2 slope = double_float_of_form(planes + k * FORM_SIZE + 3, a, b);
        if (slope.x == 0.0f) {
            if (value.x < 0.0f) // parallel to the plane and outside it
                return false;
            continue;
        }
        const float2 t = double_float_quotient(-value, slope);
        if (slope.x > 0.0f)
            t0 = double_float_less(t0, t) ? t : t0;
        else
            t1 = double_float_less(t, t1) ? t : t1;
    }
    if (!double_float_less(t0, t1))
        return false;
    *entry = t0;
    *length = double_float_sum(t1, -t0).x;
    return *length < INFINITY; // not so where every slope has become 0
}

// Offsets of pixels from the middle of so many.
inline Real offsets_from_middle(Int pixels, int count)
{
    return TO_REAL(pixels) + 0.5f - 0.5f * (float)count;
}

// Pixel of a work-item: blocks of 4 x 4 pixels, so that neighbouring items walk through the same
// lists and voxels.
inline int2 block_pixel(uint item, int width)
{
    const uint block = item >> 4;
    const uint columns = (uint)(width + 3) >> 2;
    return (int2)((int)((block % columns) << 2 | (item & 3)),
                  (int)((block / columns) << 2 | (item >> 2 & 3)));
}

// The rays of a work-item: one, or those of a block.
typedef struct {
    Int x, y;    // pixels, of the window or of a part of it
    Int present; // those in it
    Real a, b;   // pixel offsets
} Rays;

// Those from a pixel of a window on.
inline Rays rays_at(int2 corner, int width, int height)
{
    Rays rays;
    rays.x = corner.x + (LANE_NUMBERS & 3);
    rays.y = corner.y + (LANE_NUMBERS >> 2);
    rays.present = (rays.x < width) & (rays.y < height);
    rays.a = offsets_from_middle(rays.x, width);
    rays.b = offsets_from_middle(rays.y, height);
    return rays;
}

// The rays of a work-item for part of a window, in strips STRIP blocks high, each from left to
// right, so that one work-item's lists are still cached when those above and below come to them:
// whole columns of strips, a work-group each. `part` is its first column and strip, in columns and
// strips of the window, how many columns it has in each strip, and how many strips.
inline Rays rays_of_strips(int4 part, int width, int height)
{
    const int item = (int)get_local_id(0) * LANES;
    const int group = ((int)get_global_id(0) * LANES - item) / COLUMN_ITEMS;
    const int strip = group / part.z, column = group - strip * part.z;
    return rays_at(
        (int2)((part.x + column) << 2 | (item & 3), (part.y + strip) * (4 * STRIP) + (item >> 2)),
        width, height);
}

// Pixel of a work-item for some of a window's cells, squares of STRIP x STRIP blocks; `cells` are
// their columns and rows.
inline int2 cell_pixel(__global const int2 *cells, int item)
{
    const int2 cell = cells[item / CELL_ITEMS];
    const int place = item % CELL_ITEMS;
    return (int2)((cell.x * STRIP + place / COLUMN_ITEMS) << 2 | (place & 3),
                  cell.y * (4 * STRIP) + (place % COLUMN_ITEMS >> 2));
}

// Places of pixels (x, y) of a window in its picture, whose top row comes first; -1 where there is
// none.
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
