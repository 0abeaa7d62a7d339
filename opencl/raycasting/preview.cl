// VDI to image by a given number of samples per ray: the paper's preview (section 5).
//
// The samples are shared among the non-empty cells of the occupancy grid in proportion to their
// counts: between two samples lies the same integral of (supersegments in the cell) along the ray.
// No supersegment is intersected; a sample finds its list and its supersegment by Algorithm 1, and
// stands for the length of non-empty cells around it.
#include "raycasting/first_supersegment.cl"
#include "raycasting/ray.cl"
#include "raycasting/stacks.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

// What a ray crosses of a cell.
typedef struct {
    float from, to; // r
    float length;   // model length
    float weight;   // length times supersegments in the cell
} CellCrossing;

// A walk along a ray from one non-empty cell to the next.
typedef struct {
    int stack_i, stack_j; // the stack that is being crossed
    float r, r_leave;     // where it is entered and left
    float z_leave;
    ulong left; // its occupied slabs that the ray is still to cross
} Walk;

typedef struct {
    const ListRay *ray;
    const Lists *lists;
    __global const uint *counts; // supersegments in each cell: stacks_high, stacks_wide, SLABS
    int stacks_wide, stacks_high;
    float half_wide, half_high; // lists
} Cells;

inline int slab_at(const Cells *cells, float z)
{
    const Frame *frame = &cells->lists->frame;
    return slab_of(depth_offset(z, cells->ray->depths), frame->first_depth, frame->slabs_per_depth);
}

// r where the depth coordinate reaches the near face of a slab, or an end of the ray; the ray is
// not parallel to the slabs.
inline float reaches_slab(const Cells *cells, int slab)
{
    const Frame *frame = &cells->lists->frame;
    const float face = frame->first_depth + (float)slab / frame->slabs_per_depth;
    return (depth_coordinate(face, cells->ray->depths) - cells->ray->deep.z) / cells->ray->along.z;
}

// r where the ray leaves a stack along one axis of so many lists, of which this is half.
inline float leaves_stack(int stack, float along, float deep, float half_lists)
{
    const float edge = (float)((stack + (along > 0.0f ? 1 : 0)) * STACK) - half_lists;
    return along != 0.0f ? (edge - deep) / along : INFINITY;
}

// Find where the ray leaves the walk's stack, and the occupied slabs that it crosses there.
inline void enter_stack(Walk *walk, const Cells *cells)
{
    const ListRay *ray = cells->ray;
    const float r_u = leaves_stack(walk->stack_i, ray->along.x, ray->deep.x, cells->half_wide);
    const float r_v = leaves_stack(walk->stack_j, ray->along.y, ray->deep.y, cells->half_high);
    walk->r_leave = fmax(walk->r, fmin(ray->r_begin + 1.0f, fmin(r_u, r_v)));
    walk->z_leave = fma(walk->r_leave, ray->along.z, ray->deep.z);
    const int enters = slab_at(cells, fma(walk->r, ray->along.z, ray->deep.z));
    const int leaves = slab_at(cells, walk->z_leave);
    walk->left = cells->lists->masks[walk->stack_j * cells->stacks_wide + walk->stack_i] &
                 ~0UL << min(enters, leaves) & ~0UL >> (SLABS - 1 - max(enters, leaves));
}

inline Walk begin_walk(const Cells *cells)
{
    const ListRay *ray = cells->ray;
    Walk walk;
    walk.stack_i =
        clamp((int)floor((ray->start.x + cells->half_wide) / STACK), 0, cells->stacks_wide - 1);
    walk.stack_j =
        clamp((int)floor((ray->start.y + cells->half_high) / STACK), 0, cells->stacks_high - 1);
    walk.r = ray->r_begin;
    enter_stack(&walk, cells);
    return walk;
}

// Step to the next non-empty cell; false at the end of the ray.
inline bool next_cell(Walk *walk, const Cells *cells, CellCrossing *crossing)
{
    const ListRay *ray = cells->ray;
    while (walk->left == 0) {
        if (walk->r_leave >= ray->r_begin + 1.0f)
            return false;
        const float r_u = leaves_stack(walk->stack_i, ray->along.x, ray->deep.x, cells->half_wide);
        if (r_u <= walk->r_leave)
            walk->stack_i += ray->along.x > 0.0f ? 1 : -1;
        else
            walk->stack_j += ray->along.y > 0.0f ? 1 : -1;
        if (walk->stack_i < 0 || walk->stack_i >= cells->stacks_wide || walk->stack_j < 0 ||
            walk->stack_j >= cells->stacks_high)
            return false;
        walk->r = walk->r_leave;
        enter_stack(walk, cells);
    }
    const int slab = ray->away ? (int)popcount((walk->left & -walk->left) - 1)
                               : SLABS - 1 - (int)clz(walk->left);
    walk->left &= ~(1UL << slab);
    crossing->from = walk->r;
    crossing->to = walk->r_leave;
    if (ray->along.z != 0.0f) {
        // The first slab begins before, and the last one ends behind, whatever is looked up
        if (slab > 0) {
            const float r_near = reaches_slab(cells, slab);
            if (ray->away)
                crossing->from = clamp(r_near, walk->r, walk->r_leave);
            else
                crossing->to = clamp(r_near, walk->r, walk->r_leave);
        }
        if (slab < SLABS - 1) {
            const float r_far = reaches_slab(cells, slab + 1);
            if (ray->away)
                crossing->to = clamp(r_far, crossing->from, walk->r_leave);
            else
                crossing->from = clamp(r_far, walk->r, crossing->to);
        }
    }
    crossing->length = length_between(ray, crossing->from, crossing->to);
    crossing->weight =
        crossing->length *
        (float)cells->counts[(walk->stack_j * cells->stacks_wide + walk->stack_i) * SLABS + slab];
    return true;
}

// r at a share of a crossing's length.
inline float r_at(const CellCrossing *crossing, float share, const ListRay *ray)
{
    // Linear in model space: projective here, weighted by the depths of the ends
    const float near_end = (1.0f - share) * reciprocal_depth_at(ray, crossing->to);
    const float far_end = share * reciprocal_depth_at(ray, crossing->from);
    return (near_end * crossing->from + far_end * crossing->to) / (near_end + far_end);
}

// The medium at r, found from a guess.
inline float4 medium_at(const ListRay *ray, float r, const Lists *lists, int *guess)
{
    const float z = fma(r, ray->along.z, ray->deep.z);
    const float u = fma(r, ray->along.x, ray->deep.x), v = fma(r, ray->along.y, ray->deep.y);
    const int wide = lists->frame.lists_wide, high = lists->frame.lists_high;
    const int i = clamp((int)floor(u + 0.5f * (float)wide), 0, wide - 1);
    const int j = clamp((int)floor(v + 0.5f * (float)high), 0, high - 1);
    const List list = list_at(lists, i, j);
    Search search = begin_search(*guess);
    Faces face;
    while (!first_supersegment(&search, lists, list, z, true, true, ray->depths, &face))
        guess_again(&search, list, false);
    *guess = search.p;
    if (!(face.near <= z) || (CROPPED && !is_kept(&ray->kept, r)))
        return (float4)(0.0f);
    return medium_of(lists, list, search.p);
}

__kernel void
preview(VDI_PARAMETERS,
        __global const uint *counts, // supersegments in each cell: stacks_high, stacks_wide, SLABS
        int samples,                 // per ray
        __global float4 *image)      // premultiplied RGBA, top row first
{
    const Rays pixel =
        rays_at(block_pixel((uint)get_global_id(0), frame.width), frame.width, frame.height);
    if (!pixel.present)
        return;
    const int place = places_in_picture(pixel.x, pixel.y, true, frame.width, frame.height);
    ListRay ray;
    begin_ray(&ray, forms, &frame, pixel.a, pixel.b, opaque_ends(place, opaque_depth), true);
    if (!ray.present) {
        image[place] = (float4)(0.0f);
        return;
    }
    const Lists lists = LISTS_OF_PARAMETERS;
    const Cells cells = {&ray,
                         &lists,
                         counts,
                         STACKS_ALONG(frame.lists_wide),
                         STACKS_ALONG(frame.lists_high),
                         0.5f * (float)frame.lists_wide,
                         0.5f * (float)frame.lists_high};

    // Sum up the weight of all cells that the ray crosses
    float weight = 0.0f;
    CellCrossing crossing;
    Walk walk = begin_walk(&cells);
    while (next_cell(&walk, &cells, &crossing))
        weight += crossing.weight;

    // Cut it into `samples` parts; each is looked up in its middle, and composited where it ends
    const float half_part = weight / (2.0f * (float)samples);
    Seen seen = nothing_seen();
    float4 medium = (float4)(0.0f);
    float weight_before = 0.0f, length_before = 0.0f; // of the cells passed
    float part_begins = 0.0f;                         // length
    int halves = 1; // the next event: middle of a part where odd, its end where even
    int guess = 0;
    walk = begin_walk(&cells);
    while (weight > 0.0f && seen.sums.w >= frame.cutoff) {
        const bool more = next_cell(&walk, &cells, &crossing);
        // What rounding left of the last part ends with the ray
        const float weight_until = more ? weight_before + crossing.weight : INFINITY;
        for (; halves <= 2 * samples && (float)halves * half_part < weight_until; ++halves) {
            const float share =
                more ? clamp(((float)halves * half_part - weight_before) / crossing.weight, 0.0f,
                             1.0f)
                     : 0.0f;
            if (halves & 1) {
                medium = medium_at(&ray, r_at(&crossing, share, &ray), &lists, &guess);
            } else {
                const float ends = length_before + share * (more ? crossing.length : 0.0f);
                composite_medium(&seen, medium.w * (ends - part_begins), medium, true);
                part_begins = ends;
            }
        }
        if (!more)
            break;
        weight_before = weight_until;
        length_before += crossing.length;
    }
    image[place] = composited(&seen);
}
