// The runs of one ray, or of sixteen (lib/lanes.cl), and the records in which they lie. A run is a
// supersegment while it is being made.
#include "lib/lanes.cl"
#include "lib/transpose.cl"
#pragma OPENCL FP_CONTRACT OFF

// Two vectors of four words, as they lie in a record.
typedef struct {
    Real4 ends, light;
} Run;
#define FRONT ends.x // t of the ray
#define BACK ends.y
#define TAU ends.z           // optical depth
#define TRANSMITTANCE ends.w // from the eye to the front face
#define RED light.x          // premultiplied by OPACITY
#define GREEN light.y
#define BLUE light.z
#define OPACITY light.w // 1 - exp(-tau), accumulated
#define RUN(front, back, tau, before, red, green, blue, opacity)                                   \
    ((Run){REAL4(front, back, tau, before), REAL4(red, green, blue, opacity)})

// Runs whose words begin at these places.
inline Run load_run_at(__global const float *records, Int at)
{
    __global const float4 *fours = (__global const float4 *)records;
    const Run run = {load_fours(fours, at >> 2), load_fours(fours + 1, at >> 2)};
    return run;
}

// Store runs, but of rays whose place is negative.
inline void store_run_at(__global float *records, Int at, Run run)
{
    __global float4 *fours = (__global float4 *)records;
    store_fours(fours, at >> 2, run.ends);
    store_fours(fours + 1, at >> 2, run.light);
}

// The k-th runs from `records` on.
inline Run load_run(__global const float *records, Int k)
{
    return load_run_at(records, k * RUN_WORDS);
}

inline void store_run(__global float *records, Int k, Run run)
{
    store_run_at(records, k * RUN_WORDS, run);
}

// The numbers of records.
typedef struct {
    int capacity;   // runs that a record has room for
    int limit;      // that are to be left of one
    int grain;      // steps in a voxel
    int window_row; // the first row of rays of which it is known how much light enters a part of a
                    // grid
    float finest;   // threshold of rays whose record has never been full
    float reference_length; // model units
    float hidden_weight;    // weight of what the view from V_O cannot see, 0 to 1
} Recording;

// A ray's runs lie one behind the other, `capacity` of them: what shortens them goes from run to
// run, and rays whose records grow at different places write to one line of the cache each.
inline size_t record_start(uint ray, int capacity)
{
    return (size_t)ray * (size_t)(capacity * RUN_WORDS);
}

// How many runs there are of each ray that is in the window, from `counts` by list; the others have
// none.
inline Int load_counts(__global const uint *counts, Int lists, Int in_window)
{
    const Places places = {lists}, wanted = {in_window};
    Places runs = {(Int)(0)};
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            runs.each[lane] = (int)counts[places.each[lane]];
    return runs.all;
}

inline void store_counts(__global uint *counts, Int lists, Int in_window, Int runs)
{
    const Places places = {lists}, wanted = {in_window}, many = {runs};
    for (int lane = 0; lane < LANES; ++lane)
        if (wanted.each[lane])
            counts[places.each[lane]] = (uint)many.each[lane];
}
