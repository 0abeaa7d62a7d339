// The pool in which the rays of a band keep what they cross of several VDIs: streams of segments,
// one stream per VDI.
//
// A segment is a piece of a ray in one supersegment: t where it begins and ends (view depth of V_N
// less the frame's reference depth, world units), optical depth, straight RGB. A ray's streams lie
// behind one another in its slots, a segment's numbers together.
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

#define BOX_PLANES 6            // of a VDI's bounds: the first of its planes to clip to
#define MAX_OPTICAL_DEPTH 1e30f // more cannot be told from opaque, and a part of it is a number

// t behind which nothing is seen because of the VDIs before, as a VDI's own t: not less, by what
// `dark` and `depth_shift` are rounded
#define DARK_FROM(dark, depth_shift)                                                               \
    ((dark) - (depth_shift) + 5e-7f * (fabs(dark) + fabs(depth_shift)))

// Two vectors of four words, as they lie in the pool.
typedef struct {
    Real4 ends, color; // color: straight RGB
} Segments;
#define FROM ends.x // t
#define TO ends.y
#define OPTICAL_DEPTH ends.z

// The part of the pool that a work-item's rays have, from its first one on.
inline __global float4 *pool_of(__global float4 *pool, int first_ray, int capacity)
{
    return pool + (size_t)first_ray * (capacity + 1) * (SEGMENT_SIZE / 4);
}

// Where the segments of the rays' slots begin. What finds no room is stored in one slot more.
inline Int places_of_slots(Int slots, int capacity)
{
    return (LANE_NUMBERS * (capacity + 1) + min(slots, capacity)) * (SEGMENT_SIZE / 4);
}
