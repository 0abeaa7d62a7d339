// The picture of a VDI from any view, a ray in a work-item: the paper's raycaster (section 3).
#include "raycasting/walk.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

__kernel void raycast(
    __global const HEADER_T *headers, // of the lists, see raycasting/supersegments.cl
    __global const ulong *faces, __global const ulong *media,
    __global const float *forms,        // see begin_ray
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if any
    __global const ulong *masks,        // of the occupancy grid: occupied slabs of each stack
    Frame frame,
    int4 part,              // of the window, see lib/rays.cl
    __global float4 *image) // premultiplied RGBA, top row first
{
    const int item = (int)get_local_id(0); // a work-group divides once, by what it has in common
    const int2 xy = part_pixel(((int)get_global_id(0) - item) / COLUMN_ITEMS, item, part);
    const Ray pixel = ray_of_pixel(xy, frame.width, frame.height);
    if (!pixel.present)
        return;
    const Lists lists = LISTS_OF(frame);
    const Grid grid = GRID_OF(frame);
    const float t_end = frame.has_opaque_depth ? opaque_depth[pixel.place] : INFINITY;
    Path path;
    begin_path(&path, forms, &frame, pixel.a, pixel.b, t_end);
    Seen seen = nothing_seen();
    if (path.ray.present)
        prefetch_ends(&path, &lists, frame.height);
    Cursor at = begin_walk(&path);
    for (int turn = 0; at.active; ++turn) {
        // Skip cells of the occupancy grid that no supersegment reaches (section 4)
        if (SKIP_EMPTY && at.new_stack && turn % TURNS_PER_LOOK == 0) {
            skip_empty_cells(&at, &path, &grid);
            if (!at.active)
                break;
        }
        // Find the first supersegment that ends behind the point of entry (Algorithm 1)
        Crossing crossing = next_crossing(&at, &path, &lists);
        // Composite what the ray crosses of it
        for (bool meets = crossing.meets; meets;
             meets = ONE_LIST && next_in_list(&at, &crossing, &path, &lists)) {
            const float4 medium = medium_met(&at, &crossing, &path, &lists);
            const float2 ends = ends_inside(&at, &crossing, &path);
            // medium.w is the extinction: optical depth for each unit of model length
            composite_medium(&seen, medium.w * length_crossed(&path.ray, ends.x, ends.y, true),
                             medium, true);
            crossing.stays = crossing.stays && !(ONE_LIST && seen.sums.w < frame.cutoff);
        }
        // Step on (Amanatides and Woo)
        step_on(&at, &crossing, &path, seen.sums.w < frame.cutoff);
    }
    image[pixel.place] = composited(&seen);
}
