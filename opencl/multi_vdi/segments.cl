// What a ray crosses of one of several VDIs, as segments in a pool (multi_vdi/pool.cl), a ray of a
// band in a work-item; multi_vdi/merge.cl composites them together.
#define ONE_LIST 0
#include "raycasting/walk.cl"
#include "multi_vdi/pool.cl"
#pragma OPENCL FP_CONTRACT OFF

// What is written of a ray.
typedef struct {
    __global float *rows;
    int capacity;   // slots
    int slot;       // behind the last segment; beyond the capacity where there is no room
    float reached;  // t, so that rounding puts no segment before the end of another
    float absorbed; // optical depth
} Stream;

// Append what the ray crosses of a medium, from r = from to r = to.
inline void append_segment(Stream *stream, const ListRay *ray, float from, float to, float4 medium,
                           float depth_shift)
{
    const float optical_depth = fmin(medium.w * length_between(ray, from, to), MAX_OPTICAL_DEPTH);
    if (!(from < to && optical_depth > 0.0f))
        return;
    const float t_from = HIGHER_OF(ray_time(ray, from) + depth_shift, stream->reached);
    const float t_to = HIGHER_OF(ray_time(ray, to) + depth_shift, t_from);
    if (stream->slot < stream->capacity) {
        __global float *const at = stream->rows + SLOT(stream->slot);
        at[0] = t_from;
        at[FLOATS_APART] = t_to;
        at[2 * FLOATS_APART] = optical_depth;
        at[3 * FLOATS_APART] = medium.x;
        at[4 * FLOATS_APART] = medium.y;
        at[5 * FLOATS_APART] = medium.z;
    }
    stream->reached = t_to;
    stream->absorbed += optical_depth;
    ++stream->slot;
}

// Whether rays `margin` pixels to each side of (a, b) would meet the VDI's bounds, too.
inline bool surely_covered(__global const float *forms, float a, float b, float margin)
{
    bool covered = true;
    for (int corner = 0; corner < 4 && margin != 0.0f; ++corner) {
        float t0 = -INFINITY, t1 = INFINITY;
        covered = clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, BOX_PLANES,
                                 a + (corner & 1 ? margin : -margin),
                                 b + (corner & 2 ? margin : -margin), &t0, &t1) &&
                  covered;
    }
    return covered;
}

__kernel void
segments(__global const HEADER_T *headers, // these as of raycasting/raycast.cl
         __global const ulong *faces, __global const ulong *media, __global const float *forms,
         __global const float *opaque_depth, __global const ulong *masks,
         Frame frame,                 // its cutoff is the optical depth behind which rays end
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
    const int place = (int)get_global_id(0);
    const Ray pixel =
        ray_of_pixel(cell_pixel(cells + first_cell, place), frame.width, frame.height);
    if (!pixel.present)
        return;
    const Lists lists = LISTS_OF(frame);
    const Grid grid = GRID_OF(frame);
    float t_end = frame.has_opaque_depth ? opaque_depth[pixel.place] : INFINITY;
    // Light may have ended in a VDI before
    const float dark_before = number > 0 ? dark[place] : INFINITY;
    if (dark_before < INFINITY)
        t_end = fmin(t_end, DARK_FROM(dark_before, depth_shift));
    const int first_slot = number > 0 ? ends[(number - 1) * band_rays + place] : 0;
    Stream stream = {pool_of(pool, place, capacity), capacity, first_slot, -INFINITY, 0.0f};
    Path path;
    begin_path(&path, forms, &frame, pixel.a, pixel.b, t_end);
    if (path.ray.present)
        prefetch_ends(&path, &lists, frame.height);
    Cursor at = begin_walk(&path);
    for (int turn = 0; at.active; ++turn) {
        if (SKIP_EMPTY && at.new_stack && turn % TURNS_PER_LOOK == 0) {
            skip_empty_cells(&at, &path, &grid);
            if (!at.active)
                break;
        }
        const Crossing crossing = next_crossing(&at, &path, &lists);
        if (crossing.meets) {
            const float4 medium = medium_met(&at, &crossing, &path, &lists);
            for (int n = 0; n < (CROPPED ? MOST_KEPT : 1); ++n) {
                float2 r = ends_inside(&at, &crossing, &path);
                if (CROPPED)
                    r = (float2)(fmax(r.x, path.ray.kept.from[n]), fmin(r.y, path.ray.kept.to[n]));
                append_segment(&stream, &path.ray, r.x, r.y, medium, depth_shift);
            }
        }
        step_on(&at, &crossing, &path, stream.absorbed > frame.cutoff);
    }
    const bool meets = stream.slot > first_slot;
    ends[number * band_rays + place] = stream.slot;
    dark[place] = stream.absorbed > frame.cutoff ? fmin(dark_before, stream.reached) : dark_before;
    contributes[number * band_rays + place] =
        meets + (meets && surely_covered(forms, pixel.a, pixel.b, margin));
}
