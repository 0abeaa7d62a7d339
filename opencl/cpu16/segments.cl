// The segments of multi_vdi/segments.cl, a block of 4 x 4 rays in a work-item.
#define LANES 16
#define OFFSET_T int
#define SEGMENT_ROWS 1
#include "cpu16/walk.cl"
#include "cpu16/pool.cl"
#pragma OPENCL FP_CONTRACT OFF

// What is written of the rays.
typedef struct {
    __global float *rows;
    int capacity;      // slots of a ray
    Int slots;         // behind the last segments
    Real reached;      // t, so that rounding puts no segment before the end of another
    Real absorbed;     // optical depth
    float depth_shift; // see multi_vdi/segments.cl
} Streams;

typedef Streams Made;

inline Int are_done(const Streams *streams, const Frame *frame)
{
    return streams->absorbed > frame->cutoff;
}

// Append what the rays that are chosen cross of a medium, from r = from to r = to.
inline void take_medium(Streams *streams, const ListRay *rays, Real from, Real to, Real4 medium,
                        Int chosen)
{
    for (int n = 0; n < (CROPPED ? MOST_KEPT : 1); ++n) {
        if (CROPPED && !ANY(chosen && rays->kept.count > n))
            break;
        Real kept_from = from, kept_to = to;
        if (CROPPED)
            cut_to_part(&rays->kept, n, &kept_from, &kept_to);
        Segments segments;
        segments.color = medium;
        segments.optical_depth =
            fmin(medium.w * length_between(rays, kept_from, kept_to), MAX_OPTICAL_DEPTH);
        const Int appended = chosen && kept_from < kept_to && segments.optical_depth > 0.0f;
        segments.from =
            HIGHER_OF(ray_time(rays, kept_from) + streams->depth_shift, streams->reached);
        segments.to = HIGHER_OF(ray_time(rays, kept_to) + streams->depth_shift, segments.from);
        store_segments(streams->rows, streams->slots, streams->capacity, &segments);
        streams->reached = select(streams->reached, segments.to, appended);
        streams->absorbed += select((Real)(0.0f), segments.optical_depth, appended);
        streams->slots += COUNT(appended);
    }
}

#include "cpu16/follow.cl"

// Which of the rays that meet the VDI would meet its bounds, too, `margin` pixels to each side.
inline Int surely_covered(__global const float *forms, Real a, Real b, float margin, Int meet)
{
    __global const float *const bounds = forms + PLANE_FORMS * FORM_SIZE;
    Real t0 = -INFINITY, t1 = INFINITY;
    if (margin == 0.0f)
        return meet;
    // The bounds' image is convex: mostly the block's corners speak for all
    const Real corners_a =
        select((Real)(a.s0 - margin), (Real)(a.sf + margin), (LANE_NUMBERS & 1) != 0);
    const Real corners_b =
        select((Real)(b.s0 - margin), (Real)(b.sf + margin), (LANE_NUMBERS & 2) != 0);
    if (ALL(clip_to_planes(bounds, BOX_PLANES, corners_a, corners_b, &t0, &t1)))
        return meet;
    for (int corner = 0; corner < 4; ++corner) {
        t0 = -INFINITY;
        t1 = INFINITY;
        meet = clip_to_planes(bounds, BOX_PLANES, a + (corner & 1 ? margin : -margin),
                              b + (corner & 2 ? margin : -margin), &t0, &t1) &&
               meet;
    }
    return meet;
}

KERNEL_OF_LANES void
segments_of_blocks(__global const HEADER_T *headers, // these as of multi_vdi/segments.cl
                   __global const ulong *faces, __global const ulong *media,
                   __global const float *forms, __global const float *opaque_depth,
                   __global const ulong *masks, Frame frame, __global const int2 *cells,
                   int first_cell, int number, int band_rays, float depth_shift, float margin,
                   int capacity, __global float *pool, __global int *ends,
                   __global uchar *contributes, __global float *dark)
{
    const int first_ray = (int)get_global_id(0) * LANES;
    const int2 corner = cell_pixel(cells + first_cell, first_ray);
    const Int x = X_OF_BLOCK(corner), y = Y_OF_BLOCK(corner);
    const Int in_window = x < frame.width && y < frame.height;
    if (!ANY(in_window))
        return;
    const Pixels pixels = pixels_at(x, y, in_window, frame.width, frame.height);
    Real t_end = frame.has_opaque_depth ? ends_at(&pixels, opaque_depth) : (Real)(INFINITY);
    const Real dark_before = number > 0 ? vload16(0, dark + first_ray) : (Real)(INFINITY);
    t_end = select(t_end, fmin(t_end, DARK_FROM(dark_before, depth_shift)), dark_before < INFINITY);
    const Int first_slots =
        number > 0 ? vload16(0, ends + (number - 1) * band_rays + first_ray) : (Int)(0);
    Streams streams = {
        pool_of(pool, first_ray, capacity), capacity, first_slots, -INFINITY, 0.0f, depth_shift};
    const Lists lists = LISTS_OF(frame);
    const Grid grid = GRID_OF(frame);
    const Real a = offsets_from_middle(x, frame.width), b = offsets_from_middle(y, frame.height);
    const Paths paths = begin_paths(forms, &frame, a, b, t_end, in_window);
    follow_all(&streams, &paths, &lists, &grid, &frame);
    vstore16(streams.slots, 0, ends + number * band_rays + first_ray);
    const Real reached = fmin(dark_before, streams.reached);
    vstore16(select(dark_before, reached, streams.absorbed > frame.cutoff), 0, dark + first_ray);
    const Int meets = streams.slots > first_slots;
    const Int covered = ANY(meets) ? surely_covered(forms, a, b, margin, meets) : (Int)(0);
    vstore16(TO_UCHAR(COUNT(meets) + COUNT(covered)), 0,
             contributes + number * band_rays + first_ray);
}
