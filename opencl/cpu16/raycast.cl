// The picture of raycasting/raycast.cl, a block of 4 x 4 rays in a work-item
// (docs/decisions/blocks.md).
#define LANES 16
#define PACKED 0
#define OFFSET_T int
#include "cpu16/walk.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

// Model lengths of what is kept of the rays from r = from to r = to.
inline Real lengths_crossed(const ListRays *rays, Real from, Real to, Int chosen)
{
    if (!CROPPED)
        return lengths_between(rays, from, to);
    Real length = 0.0f;
    for (int n = 0; n < MOST_KEPT; ++n) { // not to an end of each ray's own, see lib/cropping.cl
        if (!ANY(chosen && rays->kept.count > n))
            break;
        Real kept_from = from, kept_to = to;
        cut_to_part(&rays->kept, n, &kept_from, &kept_to);
        length +=
            select((Real)(0.0f), lengths_between(rays, kept_from, kept_to), kept_from < kept_to);
    }
    return length;
}

// Follow the rays that are `active`, of which all go away or come back.
__attribute__((always_inline)) inline void follow(Seen *seen, const Paths *paths, Int active,
                                                  bool away, const Lists *lists, const Grid *grid,
                                                  const Frame *frame)
{
    const Sense sense = sense_of(paths->rays.along.z, paths->rays.deep.z, away);
    Cursors at = begin_walk(paths, &sense, active);
    for (int turn = 0; ANY(at.active); ++turn) {
        if (SKIP_EMPTY && turn % TURNS_PER_LOOK == 0 && ANY(at.new_stack && at.active)) {
            skip_empty_cells(&at, at.new_stack && at.active, paths, &sense, grid,
                             frame->depth_origin);
            at.new_stack = 0;
            if (!ANY(at.active))
                break;
        }
        Crossings crossing = next_crossings(&at, paths, &sense, lists);
        if (ANY(crossing.meets)) {
            Real from, to;
            const Real4 medium = media_crossed(&at, &crossing, &sense, lists, &from, &to);
            const Real length = lengths_crossed(&paths->rays, from, to, crossing.meets);
            composite_medium(seen, medium.w * length, medium, crossing.meets);
        }
        step_on(&at, &crossing, paths, seen->sums.w < frame->cutoff);
    }
}

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
    if (ANY(paths.rays.present)) {
        prefetch_ends(&paths, &lists, frame.height);
        const Int away = paths.rays.present && paths.rays.away;
        const Int back = paths.rays.present && !paths.rays.away;
        if (ANY(away))
            follow(&seen, &paths, away, true, &lists, &grid, &frame);
        if (ANY(back))
            follow(&seen, &paths, back, false, &lists, &grid, &frame);
    }
    write_pixels(image, &pixels, composited(&seen));
}
