// A volume that is on the device brick by brick: the steps of rays are sampled before they are
// composited.
//
// -D: see volume/march.cl
//
// A step belongs to the brick of the cell that its midpoint lies in. That position is the one which
// the step is sampled at in one piece, computed by the same operations, so every step belongs to
// exactly one brick and its sample is the same to the last bit: bricks may come in any order. A
// brick holds what the samples in its cells read, which is one point behind its last cell, and for
// gradients a margin of one before and three behind (a position that 1 is added to may round up to
// the cell after the next).
//
#include "volume/march.cl"
#pragma OPENCL FP_CONTRACT OFF

// Steps of one chunk.
typedef struct {
    March march;
    int k, end;
} Walk;

// The bricks of a volume.
typedef struct {
    int4 counts; // along x, y, z
    int shift;   // logarithm to base 2 of a brick's cells along each edge
    int points;  // along each edge that a brick in memory holds
    int margin;  // points of them that lie before its own cells
} Bricks;

// Begin the walk of a work-item; false where it has no steps.
inline bool begin_walk(Walk *walk, uint item, const RaysOfView *view, const Classified *of,
                       __global const float *forms, __global const float *opaque_depth)
{
    const Rays ray = rays_of_view(view, item);
    if (!ray.present)
        return false;
    const size_t place =
        (size_t)(view->height - 1 - (view->first_row + ray.y)) * view->width + ray.x;
    if (!begin_march(&walk->march, view, of, forms, ray.a, ray.b,
                     opaque_depth ? opaque_depth[place] : INFINITY))
        return false;
    walk->k = view->first_step;
    walk->end = min(view->first_step + view->steps, walk->march.steps);
    return walk->k < walk->end;
}

// The cell that the midpoint of step k is sampled in.
inline int3 cell_of_step(const March *march, const Classified *of, int k)
{
    const float t = 0.5f * (step_face(march, k) + step_face(march, k + 1));
    const float3 position =
        (float3)(fma(t, march->slope.x, march->start.x), fma(t, march->slope.y, march->start.y),
                 fma(t, march->slope.z, march->start.z));
    return clamp(convert_int3(position), (int3)(0), of->points.size.xyz - 2);
}

// Steps that follow each other in the same macrocell, and so in the same brick.
typedef struct {
    int3 cell; // of the first of them
    int end;   // the step behind the last
    int brick; // number of the brick, x fastest
    bool transparent;
} Stretch;

inline Stretch next_stretch(const Walk *walk, const Classified *of, __global const uchar *visible,
                            const Bricks *bricks)
{
    const March *march = &walk->march;
    Stretch stretch;
    stretch.cell = cell_of_step(march, of, walk->k);
    const int3 macrocell = stretch.cell >> MACROCELL_SHIFT;
    const int3 brick = stretch.cell >> bricks->shift;
    stretch.brick = (brick.z * bricks->counts.y + brick.y) * bricks->counts.x + brick.x;
    stretch.transparent =
        !visible[((size_t)macrocell.z * of->macrocells.y + macrocell.y) * of->macrocells.x +
                 macrocell.x];
    // Positions never turn back: where the last step is in the macrocell as well, all between are
    const int3 first = macrocell << MACROCELL_SHIFT, last = first + (1 << MACROCELL_SHIFT);
    const int outside = first_step_outside(march, (float)first.x, (float)first.y, (float)first.z,
                                           (float)last.x, (float)last.y, (float)last.z);
    stretch.end = max(min(outside, walk->end), walk->k + 1);
    if (any((cell_of_step(march, of, stretch.end - 1) >> MACROCELL_SHIFT) != macrocell))
        stretch.end = walk->k + 1;
    return stretch;
}

// Say which bricks the steps of a chunk lie in, but for those that are transparent, whose samples
// are set to nothing; or sample the steps that lie in bricks which are on the device.
__kernel void sample_steps(
    MEDIUM_PARAMETERS, // voxels: slots of points cubed, each with a brick or not
    const RaysOfView view, __global const float *forms,
    __global const float
        *opaque_depth,             // t at which each pixel's ray ends, top row first; 0: none does
    __global const uchar *visible, // whether a macrocell holds anything that is not transparent
    const Bricks bricks,
    __global const int *slots, // of each brick; negative where its steps are not to be sampled now
    __global uint *wanted,     // per brick; set to 1; 0: steps are sampled
    __global float4 *samples)  // see volume/rays_of_view.cl; room for `steps` of each ray
{
    const uint item = (uint)get_global_id(0);
    Medium medium = MEDIUM_OF_PARAMETERS;
    Walk walk;
    if (!begin_walk(&walk, item, &view, &classified, forms, opaque_depth))
        return;
    __global float4 *sample = samples + samples_start(item, view.steps);
    while (walk.k < walk.end) {
        const Stretch stretch = next_stretch(&walk, &classified, visible, &bricks);
        const int slot = stretch.transparent || wanted ? -1 : slots[stretch.brick];
        if (slot >= 0) {
            const int3 first = ((stretch.cell >> bricks.shift) << bricks.shift) - bricks.margin;
            const uint points = (uint)bricks.points;
            medium.voxels = voxels + (size_t)slot * (points * points * points * COMPONENTS);
            medium.numbers.points.held =
                (int4)(bricks.points, bricks.points, bricks.points,
                       (int)(((uint)first.z * points + (uint)first.y) * points + (uint)first.x));
            for (int k = walk.k; k < stretch.end; ++k)
                sample[(k - view.first_step) * SAMPLE_LANES] = step_medium(
                    &walk.march, &medium, step_face(&walk.march, k), step_face(&walk.march, k + 1));
        } else if (wanted && stretch.transparent) {
            for (int k = walk.k; k < stretch.end; ++k)
                sample[(k - view.first_step) * SAMPLE_LANES] = (float4)(0.0f);
        } else if (wanted) {
            wanted[stretch.brick] = 1;
        }
        walk.k = stretch.end;
    }
}
