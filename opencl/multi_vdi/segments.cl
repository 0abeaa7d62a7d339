// What rays cross of one of several VDIs, as segments in a pool (multi_vdi/pool.cl), a ray of a
// band or a block of 4 x 4 in a work-item (lib/lanes.cl); multi_vdi/merge.cl composites them
// together.
#include "raycasting/ray.cl"
#include "multi_vdi/pool.cl"
#pragma OPENCL FP_CONTRACT OFF

// What is written of rays.
typedef struct {
    __global float *rows;
    int capacity;      // slots of a ray
    Int slots;         // behind the last segments; beyond the capacity where there is no room
    Real reached;      // t, so that rounding puts no segment before the end of another
    Real absorbed;     // optical depth
    float depth_shift; // this VDI's reference depth less the frame's
} Made;

inline Int are_done(const Made *streams, const Lists *lists)
{
    return streams->absorbed > lists->frame.cutoff;
}

// Append what the rays that are chosen cross of a medium, from r = from to r = to.
inline void take_medium(Made *streams, const ListRay *ray, Real from, Real to, Real4 medium,
                        Int chosen)
{
    for (int n = 0; n < (CROPPED ? MOST_KEPT : 1); ++n) {
        if (CROPPED && LANES > 1 && !ANY(chosen && ray->kept.count > n))
            break;
        Real kept_from = from, kept_to = to;
        if (CROPPED)
            cut_to_part(&ray->kept, n, &kept_from, &kept_to);
        Segments segments;
        segments.color = medium;
        segments.optical_depth =
            fmin(medium.w * length_between(ray, kept_from, kept_to), MAX_OPTICAL_DEPTH);
        const Int appended = chosen && kept_from < kept_to && segments.optical_depth > 0.0f;
        segments.from =
            HIGHER_OF(ray_time(ray, kept_from) + streams->depth_shift, streams->reached);
        segments.to = HIGHER_OF(ray_time(ray, kept_to) + streams->depth_shift, segments.from);
        store_segments(streams->rows, streams->slots, streams->capacity, &segments, appended);
        streams->reached = SELECT(streams->reached, segments.to, appended);
        streams->absorbed += SELECT((Real)(0.0f), segments.optical_depth, appended);
        streams->slots += COUNT(appended);
    }
}

#include "raycasting/walk.cl"

// Which of the rays that meet the VDI would meet its bounds, too, `margin` pixels to each side.
inline Int surely_covered(__global const float *forms, Real a, Real b, float margin, Int meet)
{
    for (int corner = 0; corner < 4 && margin != 0.0f; ++corner) {
        Real t0 = -INFINITY, t1 = INFINITY;
        meet = clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, BOX_PLANES,
                              a + (corner & 1 ? margin : -margin),
                              b + (corner & 2 ? margin : -margin), &t0, &t1) &&
               meet;
    }
    return meet;
}

KERNEL_OF_LANES void
segments(VDI_PARAMETERS,              // its cutoff is the optical depth behind which rays end
         __global const int2 *cells,  // see lib/rays.cl
         int first_cell,              // the band's
         int number,                  // of this VDI's stream
         int band_rays,               // how many
         float depth_shift,           // this VDI's reference depth less the frame's
         float margin,                // pixels; see `contributes`
         int capacity,                // slots of a ray
         __global float *pool,        // see multi_vdi/pool.cl
         __global int *ends,          // (streams, rays): slot behind each stream's last
         __global uchar *contributes, // (streams, rays): 1 if a ray meets the VDI, 2 if its
                                      // neighbours at `margin` pixels meet its bounds, too
         __global float *dark)        // (rays): t where light has ended in one of the VDIs so far
{
    const int first = (int)get_global_id(0) * LANES;
    const Rays pixel = rays_at(cell_pixel(cells + first_cell, first), frame.width, frame.height);
    if (!ANY(pixel.present))
        return;
    const Lists lists = LISTS_OF_PARAMETERS;
    const Int place = places_in_picture(pixel.x, pixel.y, pixel.present, frame.width, frame.height);
    // Light may have ended in a VDI before
    const Real dark_before = number > 0 ? LOAD_LANES(0, dark + first) : (Real)(INFINITY);
    Real t_end = opaque_ends(place, opaque_depth);
    t_end = SELECT(t_end, fmin(t_end, DARK_FROM(dark_before, depth_shift)), dark_before < INFINITY);
    const Int first_slots =
        number > 0 ? LOAD_LANES(0, ends + (number - 1) * band_rays + first) : (Int)(0);
    Made streams = {
        pool_of(pool, first, capacity), capacity, first_slots, -INFINITY, 0.0f, depth_shift};
    Path path;
    begin_path(&path, forms, &frame, pixel.a, pixel.b, t_end, pixel.present);
    follow(&streams, &path, &lists);
    STORE_LANES(streams.slots, 0, ends + number * band_rays + first);
    const Real reached = fmin(dark_before, streams.reached);
    STORE_LANES(SELECT(dark_before, reached, streams.absorbed > frame.cutoff), 0, dark + first);
    const Int meets = streams.slots > first_slots;
    const Int covered =
        ANY(meets) ? surely_covered(forms, pixel.a, pixel.b, margin, meets) : (Int)(0);
    STORE_LANES(TO_UCHAR(COUNT(meets) + COUNT(covered)), 0,
                contributes + number * band_rays + first);
}
