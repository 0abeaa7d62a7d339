// The pool in which the rays of a band keep what they cross of several VDIs: streams of segments, one stream per VDI.
//
// A segment is a piece of a ray in one supersegment: t where it begins and ends (view depth of V_N less the frame's
// reference depth, world units), optical depth, straight RGB. A ray's streams lie behind one another in its slots; rays are
// kept in blocks of 16, component by component, so that neighbouring work-items touch neighbouring words.
#pragma OPENCL FP_CONTRACT OFF

#define SEGMENT_SIZE 6 // floats
#define RAY_BLOCK 16

#define SEGMENT_FROM 0
#define SEGMENT_TO 1
#define SEGMENT_OPTICAL_DEPTH 2
#define SEGMENT_COLOR 3

// Index of a component of the segment in a ray's slot.
inline size_t segment_place(int ray, int slot, int capacity, int component)
{
    return (((size_t)(ray / RAY_BLOCK) * capacity + slot) * SEGMENT_SIZE + component) * RAY_BLOCK + ray % RAY_BLOCK;
}
