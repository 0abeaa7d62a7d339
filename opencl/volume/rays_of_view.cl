// The rays of a view, or of part of its window, that kernels follow.
#include "lib/rays.cl"
#pragma OPENCL FP_CONTRACT OFF

// The numbers of rays. Work-items are the pixels in columns
// first_column .. first_column + columns - 1 of rows first_row .. first_row + rows - 1, in blocks
// of 4 x 4.
typedef struct {
    int width, height; // of the window
    int first_column, columns, first_row, rows;
    int first_step, steps;                // to be taken of each ray
    int planes;                           // forms that clip
    float sample_distance, unit_distance; // model units
} RaysOfView;

// The rays of a part from work-item `first` on; x and y are of the part.
inline Rays rays_of_view(const RaysOfView *view, uint first)
{
    Rays rays = rays_at(block_pixel(first, view->columns), view->columns, view->rows);
    rays.a = offsets_from_middle(view->first_column + rays.x, view->width);
    rays.b = offsets_from_middle(view->first_row + rays.y, view->height);
    return rays;
}

// The samples of steps that are taken before they are composited (volume/bricks.cl), of a volume
// that is on the device brick by brick, are stored for rays in blocks of 16, step by step, so that
// neighbouring work-items touch neighbouring words.
#define SAMPLE_LANES 16

// Where the samples of a work-item begin, of which there is room for `held`.
inline size_t samples_start(uint item, int held)
{
    return (size_t)(item / SAMPLE_LANES) * (size_t)held * SAMPLE_LANES + item % SAMPLE_LANES;
}
