// VDI to image by a given number of samples per ray: the paper's preview (section 5).
//
// The samples are shared among the non-empty cells of the occupancy grid in proportion to their counts: between two samples
// lies the same integral of (supersegments in the cell) along the ray. No supersegment is intersected; a sample finds its list
// and its supersegment by the same search as the raycaster's, and stands for the length of non-empty cells around it.
//
// -D OFFSET_T, PARALLEL, SHIFTED, PACKED, CROPPED, COMPENSATED   as in raycasting/raycast.cl
#include "raycasting/list_ray.cl"
#include "raycasting/lists.cl"
#include "lib/classification.cl"
#include "raycasting/tiles.cl"
#include "lib/compositing.cl"
#pragma OPENCL FP_CONTRACT OFF

// What a ray crosses of a cell.
typedef struct {
    float from, to;     // r
    float z_from, z_to; // depth coordinates there
    float length;       // model length
    float weight;       // length times supersegments in the cell
} Crossing;

// A walk along a ray from one non-empty cell to the next.
typedef struct {
    int tile_i, tile_j; // the tile that is being crossed
    float r, r_leave;   // where it is entered and left
    float z_leave;
    ulong left;         // its occupied slabs that the ray is still to cross
} Walk;

typedef struct {
    const ListRay *ray;
    __global const ulong *masks;
    __global const uint *counts;
    int tiles_wide, tiles_high;
    float half_wide, half_high;  // lists
    Depths depths;
    float first_depth, slabs_per_depth;
} Cells;

inline int slab_at(const Cells *cells, float z)
{
    return slab_of(depth_offset(z, cells->depths), cells->first_depth, cells->slabs_per_depth);
}

// r where the depth coordinate reaches the near face of a slab, or an end of the ray; the ray is not parallel to the slabs.
inline float reaches_slab(const Cells *cells, int slab)
{
    const float face = cells->first_depth + (float)slab / cells->slabs_per_depth;
    return (depth_coordinate(face, cells->depths) - cells->ray->deep.z) / cells->ray->along.z;
}

// Find where the ray leaves the walk's tile, and the occupied slabs that it crosses there.
inline void enter_tile(Walk *walk, const Cells *cells)
{
    const ListRay *ray = cells->ray;
    const float edge_u = (float)((walk->tile_i + (ray->along.x > 0.0f ? 1 : 0)) * TILE) - cells->half_wide;
    const float edge_v = (float)((walk->tile_j + (ray->along.y > 0.0f ? 1 : 0)) * TILE) - cells->half_high;
    const float r_u = ray->along.x != 0.0f ? (edge_u - ray->deep.x) / ray->along.x : INFINITY;
    const float r_v = ray->along.y != 0.0f ? (edge_v - ray->deep.y) / ray->along.y : INFINITY;
    walk->r_leave = fmax(walk->r, fmin(ray->r_begin + 1.0f, fmin(r_u, r_v)));
    walk->z_leave = fma(walk->r_leave, ray->along.z, ray->deep.z);
    const int enters = slab_at(cells, fma(walk->r, ray->along.z, ray->deep.z));
    const int leaves = slab_at(cells, walk->z_leave);
    walk->left = cells->masks[walk->tile_j * cells->tiles_wide + walk->tile_i]
               & slabs_from(min(enters, leaves)) & slabs_to(max(enters, leaves));
}

inline Walk begin_walk(const Cells *cells)
{
    const ListRay *ray = cells->ray;
    Walk walk;
    walk.tile_i = clamp((int)floor((ray->start.x + cells->half_wide) / TILE), 0, cells->tiles_wide - 1);
    walk.tile_j = clamp((int)floor((ray->start.y + cells->half_high) / TILE), 0, cells->tiles_high - 1);
    walk.r = ray->r_begin;
    enter_tile(&walk, cells);
    return walk;
}

// Step to the next non-empty cell; false at the end of the ray.
inline bool next_cell(Walk *walk, const Cells *cells, Crossing *crossing)
{
    const ListRay *ray = cells->ray;
    while (walk->left == 0) {
        if (walk->r_leave >= ray->r_begin + 1.0f)
            return false;
        const float edge_u = (float)((walk->tile_i + (ray->along.x > 0.0f ? 1 : 0)) * TILE) - cells->half_wide;
        const float r_u = ray->along.x != 0.0f ? (edge_u - ray->deep.x) / ray->along.x : INFINITY;
        if (r_u <= walk->r_leave)
            walk->tile_i += ray->along.x > 0.0f ? 1 : -1;
        else
            walk->tile_j += ray->along.y > 0.0f ? 1 : -1;
        if (walk->tile_i < 0 || walk->tile_i >= cells->tiles_wide || walk->tile_j < 0 || walk->tile_j >= cells->tiles_high)
            return false;
        walk->r = walk->r_leave;
        enter_tile(walk, cells);
    }
    const int slab = ray->away ? (int)popcount((walk->left & -walk->left) - 1) : SLABS - 1 - (int)clz(walk->left);
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
    crossing->z_from = fma(crossing->from, ray->along.z, ray->deep.z);
    crossing->z_to = fma(crossing->to, ray->along.z, ray->deep.z);
    crossing->length = model_length(ray->scale, crossing->from, crossing->z_from, crossing->to, crossing->z_to,
                                    cells->depths);
    crossing->weight = crossing->length
                     * (float)cells->counts[(walk->tile_j * cells->tiles_wide + walk->tile_i) * SLABS + slab];
    return true;
}

// r at a share of a crossing's length.
inline float r_at(const Crossing *crossing, float share, Depths depths)
{
#ifdef PARALLEL
    return mix(crossing->from, crossing->to, share);
#else
    // Linear in model space: projective here, weighted by the depths of the ends
    const float near_end = (1.0f - share) * reciprocal_depth(crossing->z_to, depths);
    const float far_end = share * reciprocal_depth(crossing->z_from, depths);
    return (near_end * crossing->from + far_end * crossing->to) / (near_end + far_end);
#endif
}

__kernel void preview(
    __global const HEADER_T *headers,   // of the tiles of lists, see raycasting/supersegments.cl
    SUPERSEGMENTS_PARAMETERS            // see raycasting/supersegments.cl
    int lists_wide, int lists_high,     // window of V_O
    float depth_origin,                 // world units
    __global const float *forms,        // list coordinates, model direction, then `planes` to clip to
    int planes,
    int width, int height,              // window of V_N
    __global const float *opaque_depth, // t at which each pixel's ray ends, top row first, if has_opaque_depth
    int has_opaque_depth,
    float transmittance_cutoff,         // the ray ends where less than this is left
    __global const ulong *masks,        // occupied slabs of each tile of lists
    float first_depth,                  // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth,
    CROPPING_PARAMETER                  // regions that are kept
    __global const uint *counts,        // supersegments in each cell: tiles_high, tiles_wide, SLABS
    int samples,                        // per ray
    __global float4 *image)             // premultiplied RGBA, top row first
{
    const int2 pixel = block_pixel((uint)get_global_id(0), width);
    if (pixel.x >= width || pixel.y >= height)
        return;
    const float a = (float)pixel.x + 0.5f - 0.5f * (float)width;
    const float b = (float)pixel.y + 0.5f - 0.5f * (float)height;
    const size_t place = (size_t)(height - 1 - pixel.y) * width + pixel.x;

    ListRay ray;
    if (!begin_list_ray(&ray, forms, planes, CROPPING_ARGUMENT a, b, has_opaque_depth ? opaque_depth[place] : INFINITY,
                        depth_origin)) {
        image[place] = (float4)(0.0f);
        return;
    }
    const Cells cells = {&ray, masks, counts, (lists_wide + TILE - 1) >> TILE_SHIFT, (lists_high + TILE - 1) >> TILE_SHIFT,
                         0.5f * (float)lists_wide, 0.5f * (float)lists_high, DEPTHS, first_depth, slabs_per_depth};

    float weight = 0.0f;
    Crossing crossing;
    Walk walk = begin_walk(&cells);
    while (next_cell(&walk, &cells, &crossing))
        weight += crossing.weight;

    // Weight from the ray's begin is cut into `samples` parts; each is looked up in its middle
    const float half_part = weight / (2.0f * (float)samples);
    float3 color = (float3)(0.0f);
    float transmittance = 1.0f;
    float4 rest = (float4)(0.0f);
    float4 medium = (float4)(0.0f);
    float weight_before = 0.0f, length_before = 0.0f; // of the cells passed
    float part_begins = 0.0f;                         // length
    int halves = 1;                                   // the next event: middle of a part where odd, its end where even
    int guess = 0;
    walk = begin_walk(&cells);
    while (weight > 0.0f && transmittance >= transmittance_cutoff) {
        const bool more = next_cell(&walk, &cells, &crossing);
        // What rounding left of the last part ends with the ray
        const float weight_until = more ? weight_before + crossing.weight : INFINITY;
        while (halves <= 2 * samples && (float)halves * half_part < weight_until) {
            const float share = more ? clamp(((float)halves * half_part - weight_before) / crossing.weight, 0.0f, 1.0f) : 0.0f;
            if (halves & 1) {
                const float r = r_at(&crossing, share, DEPTHS);
                const float z = fma(r, ray.along.z, ray.deep.z);
                const int i = clamp((int)floor(fma(r, ray.along.x, ray.deep.x) + cells.half_wide), 0, lists_wide - 1);
                const int j = clamp((int)floor(fma(r, ray.along.y, ray.deep.y) + cells.half_high), 0, lists_high - 1);
                const List list = LIST_AT(i, j);
                Search search = begin_search(guess);
                float2 face;
                while (!search_on(&search, list, SUPERSEGMENTS_ARGUMENTS z, true, &face))
                    ;
                guess = search.n;
                medium = (float4)(0.0f);
                if (face.x <= z)
                    medium = MEDIUM(list, guess);
#ifdef CROPPED
                if (!is_kept(&ray.kept, r))
                    medium = (float4)(0.0f);
#endif
            } else {
                const float ends = length_before + share * (more ? crossing.length : 0.0f);
                const float part = transmittance * opacity_of(medium.w * (ends - part_begins)); // over, front to back
                composite_over(&color, &transmittance, &rest, part, medium.xyz);
                part_begins = ends;
            }
            ++halves;
        }
        if (!more)
            break;
        weight_before = weight_until;
        length_before += crossing.length;
    }
    image[place] = composited(color, transmittance, rest);
}
