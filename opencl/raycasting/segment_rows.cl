// Segments of the pool (raycasting/segments.cl, SEGMENTS=2) for LANES rays side by side (raycasting/packet.cl), in whole rows.
#include "lib/transpose.cl"
#include "raycasting/segments.cl"
#pragma OPENCL FP_CONTRACT OFF

#if SEGMENTS == 2
#define HALF_ROW 4 // floats; a row's second half reaches into the next slot

typedef struct {
    Reals from, to, optical_depth, red, green, blue;
} Segments;

// Where, in their part of the pool, rays keep the segments of their slots.
#define ROWS_OF(slots, capacity) ((NUMBERS * ((capacity) + SPARE_SLOTS) + (slots)) * SEGMENT_SIZE)

// The part of the pool that a packet of rays has, from its first one on.
#define POOL_OF(pool, first_ray, capacity) ((pool) + segment_place(first_ray, 0, capacity))

// Store the segment of each ray in its slot. A ray has two slots to spare: what reaches beyond a slot may be stored over, and
// where there is no room is stored in the first of them.
inline void store_segments(__global float *rows, Ints slots, int capacity, const Segments *segments)
{
    const Places in_memory = {ROWS_OF(min(slots, capacity), capacity)};
    const volatile int *at = in_memory.each;
    const Quads first = {{segments->from, segments->to, segments->optical_depth, segments->red}};
    const Quads second = {{segments->green, segments->blue, segments->green, segments->blue}};
    const Quads of_first = transposed(first);
    const Quads of_second = transposed(second);
#define STORE_ROWS(n)                                                     \
    vstore4(of_first.of[n].s0123, 0, rows + at[n]);                       \
    vstore4(of_second.of[n].s0123, 0, rows + at[n] + HALF_ROW);           \
    vstore4(of_first.of[n].s4567, 0, rows + at[4 + n]);                   \
    vstore4(of_second.of[n].s4567, 0, rows + at[4 + n] + HALF_ROW);       \
    vstore4(of_first.of[n].s89ab, 0, rows + at[8 + n]);                   \
    vstore4(of_second.of[n].s89ab, 0, rows + at[8 + n] + HALF_ROW);       \
    vstore4(of_first.of[n].scdef, 0, rows + at[12 + n]);                  \
    vstore4(of_second.of[n].scdef, 0, rows + at[12 + n] + HALF_ROW)
    STORE_ROWS(0);
    STORE_ROWS(1);
    STORE_ROWS(2);
    STORE_ROWS(3);
#undef STORE_ROWS
}

// The segment of each ray in its slot, which is below the capacity.
inline Segments load_segments(__global const float *rows, Ints slots, int capacity)
{
    const Places in_memory = {ROWS_OF(slots, capacity)};
    const volatile int *at = in_memory.each;
#define LOAD_ROWS(n, half)                                                                        \
    (Reals)(vload4(0, rows + at[n] + (half)), vload4(0, rows + at[4 + (n)] + (half)),             \
            vload4(0, rows + at[8 + (n)] + (half)), vload4(0, rows + at[12 + (n)] + (half)))
    const Quads first = {{LOAD_ROWS(0, 0), LOAD_ROWS(1, 0), LOAD_ROWS(2, 0), LOAD_ROWS(3, 0)}};
    const Quads second = {{LOAD_ROWS(0, HALF_ROW), LOAD_ROWS(1, HALF_ROW), LOAD_ROWS(2, HALF_ROW), LOAD_ROWS(3, HALF_ROW)}};
#undef LOAD_ROWS
    const Quads of_first = transposed(first);
    const Quads of_second = transposed(second);
    const Segments segments = {of_first.of[0], of_first.of[1], of_first.of[2], of_first.of[3], of_second.of[0],
                               of_second.of[1]};
    return segments;
}
#endif
