// Segments of sixteen rays, in whole rows of the pool (multi_vdi/pool.cl).
#include "lib/transpose.cl"
#include "multi_vdi/pool.cl"
#pragma OPENCL FP_CONTRACT OFF

// Where the rays keep the segments of their slots.
#define ROWS_OF(slots, capacity)                                                                   \
    ((LANE_NUMBERS * ((capacity) + SPARE_SLOTS) + (slots)) * SEGMENT_SIZE)
#define HALF_ROW 4 // floats; a row's second half reaches into the next slot

// A ray has two slots to spare: what reaches beyond a slot may be stored over, by rays that are not
// chosen, too, and where there is no room is stored in the first of them.
inline void store_segments(__global float *rows, Int slots, int capacity, const Segments *segments)
{
    const Places in_memory = {ROWS_OF(min(slots, capacity), capacity)};
    const volatile int *at = in_memory.each;
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
    const volatile int *at = in_memory.each;
#define LOAD_ROWS(n, half)                                                                         \
    (Real)(vload4(0, rows + at[n] + (half)), vload4(0, rows + at[4 + (n)] + (half)),               \
           vload4(0, rows + at[8 + (n)] + (half)), vload4(0, rows + at[12 + (n)] + (half)))
    const Real4 first =
        transpose(REAL4(LOAD_ROWS(0, 0), LOAD_ROWS(1, 0), LOAD_ROWS(2, 0), LOAD_ROWS(3, 0)));
    const Real4 second = transpose(REAL4(LOAD_ROWS(0, HALF_ROW), LOAD_ROWS(1, HALF_ROW),
                                         LOAD_ROWS(2, HALF_ROW), LOAD_ROWS(3, HALF_ROW)));
#undef LOAD_ROWS
    Segments segments;
    segments.from = first.x;
    segments.to = first.y;
    segments.optical_depth = first.z;
    segments.color = REAL4(first.w, second.x, second.y, (Real)(0.0f));
    return segments;
}
