// Where each ray of a view enters the first supersegment that reaches an opacity, a ray in a
// work-item.
#include "raycasting/walk.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void
first_hits(__global const HEADER_T *headers, // these as of raycasting/raycast.cl
           __global const ulong *faces, __global const ulong *media, __global const float *forms,
           __global const float *opaque_depth, __global const ulong *masks, Frame frame, int4 part,
           float least_optical_depth, // a hit has some, and at least this much:
           int accumulated,           // by itself, or with all before it
           __global float *image) // t of the first hit, infinite where there is none, top row first
{
    const int item = (int)get_local_id(0);
    const int2 xy = part_pixel(((int)get_global_id(0) - item) / COLUMN_ITEMS, item, part);
    const Ray pixel = ray_of_pixel(xy, frame.width, frame.height);
    if (!pixel.present)
        return;
    const Lists lists = LISTS_OF(frame);
    const Grid grid = GRID_OF(frame);
    const float t_end = frame.has_opaque_depth ? opaque_depth[pixel.place] : INFINITY;
    Path path;
    begin_path(&path, forms, &frame, pixel.a, pixel.b, t_end);
    const ListRay *ray = &path.ray;
    float met = 0.0f; // optical depth
    float r_hit = 0.0f;
    bool hit = false;
    if (!ray->present) {
        image[pixel.place] = INFINITY;
        return;
    }
    prefetch_ends(&path, &lists, frame.height);
    Cursor at = begin_walk(&path);
    for (int turn = 0; at.active; ++turn) {
        if (SKIP_EMPTY && at.new_stack && turn % TURNS_PER_LOOK == 0) {
            skip_empty_cells(&at, &path, &grid);
            if (!at.active)
                break;
        }
        Crossing crossing = next_crossing(&at, &path, &lists);
        for (bool meets = crossing.meets; meets;
             meets = ONE_LIST && next_in_list(&at, &crossing, &path, &lists)) {
            // Is it a hit?
            const float2 ends = ends_inside(&at, &crossing, &path);
            const float crossed = length_crossed(ray, ends.x, ends.y, true);
            const float optical_depth = medium_met(&at, &crossing, &path, &lists).w * crossed;
            met = accumulated ? met + optical_depth : optical_depth;
            hit = met > 0.0f && met >= least_optical_depth;
            r_hit = ends.x;
            for (int n = MOST_KEPT - 1; CROPPED && n >= 0; --n) // where it is first in what is kept
                r_hit = ends.x < ray->kept.to[n] ? fmax(ends.x, ray->kept.from[n]) : r_hit;
            crossing.stays = crossing.stays && !hit;
        }
        step_on(&at, &crossing, &path, hit);
    }
    // From r to t
    float passed_by = ray->scale * (r_hit - ray->r_begin);
    if (DEPTH != PARALLEL)
        passed_by /= reciprocal_depth(ray->start.z, ray->depths) * reciprocal_depth_at(ray, r_hit);
    image[pixel.place] =
        hit ? ray->t_begin + passed_by / model_speed(forms, pixel.a, pixel.b) : INFINITY;
}
