// The pool in which the rays of a band keep what they cross of several VDIs: streams of segments,
// one stream per VDI.
//
// A segment is a piece of a ray in one supersegment: t where it begins and ends (view depth of V_N
// less the frame's reference depth, world units), optical depth, straight RGB. A ray's streams lie
// behind one another in its slots.
//
// -D SEGMENT_ROWS=0, 1  how they lie: rays in blocks of 16, component by component, so that
//                       neighbouring work-items touch neighbouring words; or ray by ray, a
//                       segment's components together, so that a vector's lanes are loaded and
//                       stored in whole rows (opencl/cpu16/pool.cl): a ray then has SPARE_SLOTS
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#define BOX_PLANES 6 // of a VDI's bounds: the first of its planes to clip to
#define RAY_BLOCK 16
#define MAX_OPTICAL_DEPTH 1e30f // more cannot be told from opaque, and a part of it is a number

// t behind which nothing is seen because of the VDIs before, as a VDI's own t: not less, by what
// `dark` and `depth_shift` are rounded
#define DARK_FROM(dark, depth_shift)                                                               \
    ((dark) - (depth_shift) + 5e-7f * (fabs(dark) + fabs(depth_shift)))

typedef struct {
    Real from, to, optical_depth;
    Real4 color; // straight RGB
} Segments;

// The part of the pool that a work-item's rays have, from its first one on.
inline __global float *pool_of(__global float *pool, int first_ray, int capacity)
{
    if (SEGMENT_ROWS)
        return pool + (size_t)first_ray * (capacity + SPARE_SLOTS) * SEGMENT_SIZE;
    return pool + (size_t)(first_ray / RAY_BLOCK) * capacity * (SEGMENT_SIZE * RAY_BLOCK) +
           first_ray % RAY_BLOCK;
}

// In that part, where a ray's segment in a slot begins, and its components are.
#define FLOATS_APART (SEGMENT_ROWS ? 1 : RAY_BLOCK)
#define SLOT(slot) ((slot) * (SEGMENT_SIZE * FLOATS_APART))
