// The pool in which the rays of a band keep what they cross of several VDIs: streams of segments,
// one stream per VDI.
//
// A segment is a piece of a ray in one supersegment: t where it begins and ends (view depth of V_N
// less the frame's reference depth, world units), optical depth, straight RGB. A ray's streams lie
// behind one another in its slots, a segment's numbers together, so that a vector's lanes are
// loaded and stored in whole rows.
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

#define BOX_PLANES 6            // of a VDI's bounds: the first of its planes to clip to
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
    return pool + (size_t)first_ray * (capacity + SPARE_SLOTS) * SEGMENT_SIZE;
}

#if LANES == 16
// Where the rays keep the segments of their slots.
#define ROWS_OF(slots, capacity)                                                                   \
    ((LANE_NUMBERS * ((capacity) + SPARE_SLOTS) + (slots)) * SEGMENT_SIZE)
#define HALF_ROW 4 // floats; a row's second half reaches into the next slot

// Store the segments of rays that are chosen in their slots. A ray has two slots to spare: what
// reaches beyond a slot may be stored over, by rays that are not chosen, too, and where there is no
// room is stored in the first of them.
inline void store_segments(__global float *rows, Int slots, int capacity, const Segments *segments,
                           Int chosen)
{
    const Places in_memory = {ROWS_OF(min(slots, capacity), capacity)};
    Place *at = in_memory.each;
    const Real4 first =
        transpose(REAL4(segments->from, segments->to, segments->optical_depth, segments->color.x));
    const Real4 second = transpose(
        REAL4(segments->color.y, segments->color.z, segments->color.y, segments->color.z));
#define STORE_ROWS(row, n)                                                                         \
    vstore4(first.row.s0123, 0, rows + at[n]);                                                     \
    vstore4(second.row.s0123, 0, rows + at[n] + HALF_ROW);                                         \
    vstore4(first.row.s4567, 0, rows + at[4 + n]);                                                 \
    vstore4(second.row.s4567, 0, rows + at[4 + n] + HALF_ROW);                                     \
    vstore4(first.row.s89ab, 0, rows + at[8 + n]);                                                 \
    vstore4(second.row.s89ab, 0, rows + at[8 + n] + HALF_ROW);                                     \
    vstore4(first.row.scdef, 0, rows + at[12 + n]);                                                \
    vstore4(second.row.scdef, 0, rows + at[12 + n] + HALF_ROW)
    STORE_ROWS(x, 0);
    STORE_ROWS(y, 1);
    STORE_ROWS(z, 2);
    STORE_ROWS(w, 3);
#undef STORE_ROWS
}

inline Segments load_segments(__global const float *rows, Int slots, int capacity)
{
    const Places in_memory = {ROWS_OF(slots, capacity)};
    Place *at = in_memory.each;
#define LOAD_ROWS(n, half)                                                                         \
    (Real)(vload4(0, rows + at[n] + (half)), vload4(0, rows + at[4 + (n)] + (half)),               \
           vload4(0, rows + at[8 + (n)] + (half)), vload4(0, rows + at[12 + (n)] + (half)))
    const Real4 first =
        transpose(REAL4(LOAD_ROWS(0, 0), LOAD_ROWS(1, 0), LOAD_ROWS(2, 0), LOAD_ROWS(3, 0)));
    const Real4 second = transpose(REAL4(LOAD_ROWS(0, HALF_ROW), LOAD_ROWS(1, HALF_ROW),
                                         LOAD_ROWS(2, HALF_ROW), LOAD_ROWS(3, HALF_ROW)));
#undef LOAD_ROWS
    const Segments segments = {first.x, first.y, first.z,
                               REAL4(first.w, second.x, second.y, (Real)(0.0f))};
    return segments;
}
#else
inline void store_segments(__global float *rows, int slot, int capacity, const Segments *segment,
                           bool chosen)
{
    __global float *const at = rows + slot * SEGMENT_SIZE;
    if (!chosen || slot >= capacity)
        return;
    vstore3((float3)(segment->from, segment->to, segment->optical_depth), 0, at);
    vstore3(segment->color.xyz, 1, at);
}

inline Segments load_segments(__global const float *rows, int slot, int capacity)
{
    __global const float *const at = rows + slot * SEGMENT_SIZE;
    const Segments segment = {at[0], at[1], at[2], (float4)(vload3(1, at), 0.0f)};
    return segment;
}
#endif
