// A volume that is on the device brick by brick: the steps of rays are sampled before they are composited.
//
// -D VOXEL_T, INDEX_T, RGBA, NEAREST, MACROCELL_SHIFT: see volume/sampling.cl and volume/march.cl
// -D SHADED, HEADLIGHT, POSITIONAL_LIGHTS, GRADIENT_OPACITY: see volume/shading.cl
// -D BRICK_SHIFT   logarithm to base 2 of a brick's cells along each edge
// -D BRICK_POINTS  points along each edge that a brick in memory holds
// -D BRICK_MARGIN  points of them that lie before its own cells
//
// A step belongs to the brick of the cell that its midpoint lies in. That position is the one which the step is sampled at
// in one piece, computed by the same operations, so every step belongs to exactly one brick and its sample is the same to
// the last bit: bricks may come in any order. A brick holds what the samples in its cells read, which is one point behind
// its last cell, and for gradients a margin of one before and three behind (a position that 1 is added to may round up to
// the cell after the next).
//
// Work-items are pixels in rows first_row .. first_row + rows - 1, in blocks of 4 x 4, as in generation/march_lists.cl.
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

// Steps of one chunk that both kernels walk along, in the same way.
typedef struct {
    March march;
    int k, end;
} Walk;

// What both kernels take of the rays, and the walk of a work-item; false where it has no steps
#define WALK_PARAMETERS                                                                                                   \
    __global const float *forms, int planes, float sample_distance, float unit_distance, int width, int height,           \
        int first_row, int rows, int first_step, int steps, /* of this chunk */                                           \
        __global const float *opaque_depth, /* where each ray ends in t, top row first */                                 \
        int has_opaque_depth
#define WALK_ARGUMENTS                                                                                                    \
    forms, planes, sample_distance, unit_distance, width, height, first_row, rows, first_step, steps, opaque_depth,       \
        has_opaque_depth

inline bool begin_walk(Walk *walk, uint item, WALK_PARAMETERS)
{
    const Rays rays = rays_of_block(item, width, height, first_row, rows);
    if (!rays.present)
        return false;
    const size_t place = (size_t)(height - 1 - (first_row + rays.y)) * width + rays.x;
    const float t_end = has_opaque_depth ? opaque_depth[place] : INFINITY;
    if (!begin_march(&walk->march, forms, planes, rays.a, rays.b, sample_distance, unit_distance, t_end))
        return false;
    walk->k = first_step;
    walk->end = min(first_step + steps, walk->march.steps);
    return walk->k < walk->end;
}

// The cell that the midpoint of step k is sampled in.
inline int3 cell_of_step(const March *march, const Medium *medium, int k)
{
    const float t = 0.5f * (step_face(march, k) + step_face(march, k + 1));
    const float3 position = (float3)(fma(t, march->slope.x, march->start.x), fma(t, march->slope.y, march->start.y),
                                     fma(t, march->slope.z, march->start.z));
    return clamp(convert_int3(position), (int3)(0), medium->size.xyz - 2);
}

// Steps that follow each other in the same macrocell, and so in the same brick.
typedef struct {
    int3 cell; // of the first of them
    int end;   // the step behind the last
    int brick; // number of the brick, x fastest
    bool transparent;
} Stretch;

inline Stretch next_stretch(const Walk *walk, const Medium *medium, __global const uchar *seen, int4 bricks)
{
    const March *march = &walk->march;
    Stretch stretch;
    stretch.cell = cell_of_step(march, medium, walk->k);
    const int3 macrocell = stretch.cell >> MACROCELL_SHIFT;
    const int3 brick = stretch.cell >> BRICK_SHIFT;
    stretch.brick = (brick.z * bricks.y + brick.y) * bricks.x + brick.x;
    stretch.transparent = !seen[((size_t)macrocell.z * medium->macrocells.y + macrocell.y) * medium->macrocells.x + macrocell.x];
    // Positions never turn back: where the last step is in the macrocell as well, all between are
    const int3 first = macrocell << MACROCELL_SHIFT, last = first + MACROCELL;
    const int outside = first_step_outside(march, (float)first.x, (float)first.y, (float)first.z, (float)last.x,
                                           (float)last.y, (float)last.z);
    stretch.end = max(min(outside, walk->end), walk->k + 1);
    if (any((cell_of_step(march, medium, stretch.end - 1) >> MACROCELL_SHIFT) != macrocell))
        stretch.end = walk->k + 1;
    return stretch;
}

// Which bricks the steps of a chunk lie in, but for those that are transparent: their samples are set to nothing here.
__kernel void want_bricks(
    MEDIUM_PARAMETERS
    WALK_PARAMETERS,
    __global const uchar *seen,    // whether a macrocell holds anything that is not transparent
    int4 bricks,                   // along x, y, z
    __global uint *wanted,         // per brick; set to 1
    __global float4 *samples)      // see volume/samples.cl; room for `steps` of each ray
{
    const uint item = (uint)get_global_id(0);
    const Medium medium = MEDIUM;
    Walk walk;
    if (!begin_walk(&walk, item, WALK_ARGUMENTS))
        return;
    __global float4 *sample = samples + samples_start(item, steps);
    while (walk.k < walk.end) {
        const Stretch stretch = next_stretch(&walk, &medium, seen, bricks);
        if (stretch.transparent)
            for (int k = walk.k; k < stretch.end; ++k)
                sample[(k - first_step) * SAMPLE_LANES] = (float4)(0.0f);
        else
            wanted[stretch.brick] = 1;
        walk.k = stretch.end;
    }
}

// Sample the steps of a chunk that lie in bricks which are on the device.
__kernel void sample_steps(
    MEDIUM_PARAMETERS              // `voxels`: slots of BRICK_POINTS cubed points, each with a brick or not
    WALK_PARAMETERS,
    __global const uchar *seen,
    int4 bricks,
    __global const int *slots,     // of each brick; negative where its steps are not to be sampled now
    __global float4 *samples)
{
    const uint item = (uint)get_global_id(0);
    Medium medium = MEDIUM;
    Walk walk;
    if (!begin_walk(&walk, item, WALK_ARGUMENTS))
        return;
    __global float4 *sample = samples + samples_start(item, steps);
    while (walk.k < walk.end) {
        const Stretch stretch = next_stretch(&walk, &medium, seen, bricks);
        const int slot = stretch.transparent ? -1 : slots[stretch.brick];
        if (slot >= 0) {
            const int3 first = ((stretch.cell >> BRICK_SHIFT) << BRICK_SHIFT) - BRICK_MARGIN;
            medium.voxels = voxels + (size_t)slot * (BRICK_POINTS * BRICK_POINTS * BRICK_POINTS * COMPONENTS);
            medium.size.w = (int)(((uint)first.z * BRICK_POINTS + (uint)first.y) * BRICK_POINTS + (uint)first.x);
            for (int k = walk.k; k < stretch.end; ++k)
                sample[(k - first_step) * SAMPLE_LANES] = step_medium(&walk.march, &medium, k, step_face(&walk.march, k),
                                                                      step_face(&walk.march, k + 1));
        }
        walk.k = stretch.end;
    }
}
