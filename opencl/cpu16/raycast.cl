// The picture of raycasting/raycast.cl, a block of 4 x 4 rays in a work-item
// (docs/decisions/blocks.md).
#define LANES 16
#define OFFSET_T int
#include "cpu16/walk.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef Seen Made;

inline Int are_done(const Seen *seen, const Frame *frame) { return seen->sums.w < frame->cutoff; }

// Composite what the rays that are chosen cross of a medium, from r = from to r = to.
inline void take_medium(Seen *seen, const ListRay *rays, Real from, Real to, Real4 medium,
                        Int chosen)
{
    composite_medium(seen, medium.w * length_crossed(rays, from, to, chosen), medium, chosen);
}

#include "cpu16/follow.cl"

KERNEL_OF_LANES void
raycast_blocks(__global const HEADER_T *headers, // these as of raycasting/raycast.cl
               __global const ulong *faces, __global const ulong *media,
               __global const float *forms, __global const float *opaque_depth,
               __global const ulong *masks, Frame frame, int4 part, __global float4 *image)
{
    // By what a work-group has in common, so that it divides once
    const int item = (int)get_local_id(0) * LANES;
    const int2 corner =
        part_pixel(((int)get_global_id(0) * LANES - item) / COLUMN_ITEMS, item, part);
    const Int x = X_OF_BLOCK(corner), y = Y_OF_BLOCK(corner);
    const Int in_window = x < frame.width && y < frame.height;
    if (!ANY(in_window))
        return;
    const Pixels pixels = pixels_at(x, y, in_window, frame.width, frame.height);
    const Real t_end = frame.has_opaque_depth ? ends_at(&pixels, opaque_depth) : (Real)(INFINITY);
    const Lists lists = LISTS_OF(frame);
    const Grid grid = GRID_OF(frame);
    Seen seen = nothing_seen();
    const Paths paths = begin_paths(forms, &frame, offsets_from_middle(x, frame.width),
                                    offsets_from_middle(y, frame.height), t_end, in_window);
    follow_all(&seen, &paths, &lists, &grid, &frame);
    write_pixels(image, &pixels, composited(&seen));
}
