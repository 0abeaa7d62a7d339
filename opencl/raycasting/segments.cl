// The pool in which the rays of a band keep what they cross of several VDIs: streams of segments, one stream per VDI.
//
// A segment is a piece of a ray in one supersegment: t where it begins and ends (view depth of V_N less the frame's
// reference depth, world units), optical depth, straight RGB. A ray's streams lie behind one another in its slots.
//
// -D SEGMENTS  how they lie:
//                  1  rays in blocks of 16, component by component, so that neighbouring work-items touch neighbouring words
//                  2  ray by ray, a segment's components together, so that a vector's lanes are loaded and stored in whole
//                     rows, see raycasting/segment_rows.cl
#pragma OPENCL FP_CONTRACT OFF

#define BOX_PLANES 6 // of a VDI's bounds: the first of its planes to clip to
#define SEGMENT_SIZE 6 // floats
#define RAY_BLOCK 16
// More cannot be told from opaque, and a part of it is still a number
#define MAX_OPTICAL_DEPTH 1e30f

// t behind which nothing is seen because of the VDIs before, as a VDI's own t: not less, by what `dark` and `depth_shift` are
// rounded
#define DARK_FROM(dark, depth_shift) ((dark) - (depth_shift) + 5e-7f * (fabs(dark) + fabs(depth_shift)))

#define SEGMENT_FROM 0
#define SEGMENT_TO 1
#define SEGMENT_OPTICAL_DEPTH 2
#define SEGMENT_COLOR 3

#if SEGMENTS == 2
#define COMPONENTS_APART 1 // floats
#define SPARE_SLOTS 2      // of each ray: those of pyvista_vdi/joint.py

inline size_t segment_place(int ray, int slot, int capacity)
{
    return ((size_t)ray * (capacity + SPARE_SLOTS) + slot) * SEGMENT_SIZE;
}
#else
#define COMPONENTS_APART RAY_BLOCK

inline size_t segment_place(int ray, int slot, int capacity)
{
    return ((size_t)(ray / RAY_BLOCK) * capacity + slot) * (SEGMENT_SIZE * RAY_BLOCK) + ray % RAY_BLOCK;
}
#endif

// A component of the segment in a ray's slot.
#define SEGMENT(pool, ray, slot, capacity, component) \
    (pool)[segment_place(ray, slot, capacity) + (component) * COMPONENTS_APART]
