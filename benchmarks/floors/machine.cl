// What a device can do at best: streams, gathers, arithmetic. One kernel per figure of machine.py.
//
// Every result is kept: one word per work-item, so that nothing is optimised away.
//
// -D LANES=16       neighbouring work-items that gather near each other
// -D ELEMENT=uint4  what is gathered: uchar, uint, uint2 or uint4; -D COMPONENTS=4
#pragma OPENCL FP_CONTRACT OFF

// A group reads, or writes, one piece of the array; its work-items lie side by side.
__kernel void stream_read(__global const uint4 *array, uint per_item, __global uint *kept)
{
    const size_t local_size = get_local_size(0);
    __global const uint4 *piece = array + get_group_id(0) * local_size * per_item + get_local_id(0);
    uint4 sum = (uint4)(0);
    for (uint k = 0; k < per_item; ++k)
        sum += piece[k * local_size];
    kept[get_global_id(0)] = sum.x + sum.y + sum.z + sum.w;
}

__kernel void stream_write(__global uint4 *array, uint per_item, uint value)
{
    const size_t local_size = get_local_size(0);
    __global uint4 *piece = array + get_group_id(0) * local_size * per_item + get_local_id(0);
    for (uint k = 0; k < per_item; ++k)
        piece[k * local_size] = (uint4)(value + k);
}

#define NEXT(x) ((x) * 1664525u + 1013904223u) // Numerical Recipes' linear congruential generator

#ifdef ELEMENT
// Every component counts, so that none is left out of the load.
#if COMPONENTS == 4
#define WHOLE(e) ((e).x + (e).y + (e).z + (e).w)
#elif COMPONENTS == 2
#define WHOLE(e) ((e).x + (e).y)
#else
#define WHOLE(e) ((uint)(e))
#endif

// Elements at random places of the first 2^bits. `near`: the lanes of a block of 4 x 4 gather around one place, 4 elements
// from each of 4 rows of `row` elements, as the rays of neighbouring pixels do; otherwise each by itself. `chained`: the next
// place is known when the element is there.
__kernel void gather(__global const ELEMENT *array, uint bits, uint count, int near, int chained, uint row, __global uint *kept)
{
    const uint item = (uint)get_global_id(0);
    const uint lane = item % LANES;
    uint x = NEXT((near ? item / LANES : item) * 2654435761u + 12345u);
    const uint beside = near ? (lane & 3) + (lane >> 2) * row : 0;
    const uint mask = (1u << bits) - 1;
    uint sum = 0;
    for (uint k = 0; k < count; ++k) {
        const ELEMENT element = array[((x >> (32 - bits)) + beside) & mask];
        const uint value = WHOLE(element);
        sum += value;
        x = NEXT(chained ? x + value : x); // the array holds zeros
    }
    kept[item] = sum;
}
#endif

// Eight chains in each work-item, which hide each other's latency.
#define CHAINS(NAME, START, STEP) \
    __kernel void NAME(uint count, float a, float b, __global float *kept) \
    { \
        const float first = (float)get_global_id(0) * 1e-9f; \
        float x0 = START(0), x1 = START(1), x2 = START(2), x3 = START(3); \
        float x4 = START(4), x5 = START(5), x6 = START(6), x7 = START(7); \
        for (uint k = 0; k < count; ++k) { \
            x0 = STEP(x0); x1 = STEP(x1); x2 = STEP(x2); x3 = STEP(x3); \
            x4 = STEP(x4); x5 = STEP(x5); x6 = STEP(x6); x7 = STEP(x7); \
        } \
        kept[get_global_id(0)] = x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7; \
    }
#define BEGIN(n) (first + 0.1f * (float)(n) + 0.5f)
#define FMA(x) fma(x, a, b)
#define DIVIDE(x) (a / x)
#define EXPONENTIAL(x) (-expm1(-x)) // as the kernels turn optical depth into opacity
CHAINS(multiply_add, BEGIN, FMA)
CHAINS(divide, BEGIN, DIVIDE)
CHAINS(exponential, BEGIN, EXPONENTIAL)

__kernel void nothing(__global uint *kept)
{
    if (get_global_id(0) == 0)
        kept[0] = 1;
}
