// Entry point to opencl/raycasting/first_supersegment.cl, one work-item per query.
#define OFFSET_T int
#define PACKED 0
#include "raycasting/first_supersegment.cl"
#pragma OPENCL FP_CONTRACT OFF

// Query i asks list lists[i].x .. lists[i].x + lists[i].y; (direction, guess) = how[i]. Supersegment k is faces[k * stride],
// as in the first list of each bundle. Answered is how many supersegments of the list pass the depth: end before it or at it
// for a ray that goes away, begin before it for a ray that comes back.
__kernel void counts_passing(int count, __global const ulong *faces, __global const int2 *lists,
                             __global const float *depths, __global const int2 *how, __global int *results)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Lists all = {0, faces, faces, 0};
    const ListMet list = {lists[i].x * LISTS_PER_BUNDLE, lists[i].y, 0, 0, 0.0f};
    const bool away = how[i].x != 0;
    const int guess = min(how[i].y, list.count);
    const float depth = away ? depths[i] : -depths[i];
    const Depths coordinate = {RECIPROCAL, 0.0f};
    Search search = begin_search(away ? how[i].y : list.count - guess);
    Faces face;
    int left = list.count + 3; // comparisons; more than any search takes
    while (!first_supersegment(&search, &all, list, depth, true, away, coordinate, &face) && --left > 0)
        guess_again(&search, list, false);
    results[i] = left == 0 ? -1 : away ? search.p : list.count - search.p;
}

// Entries between supersegments of a list, for the caller.
__kernel void lists_per_bundle(int count, __global int *result)
{
    if (get_global_id(0) == 0)
        result[0] = LISTS_PER_BUNDLE;
}

// Where the members of a frame lie, and how large it is.
#define OFFSET(member) (int)((const char *)&frame.member - (const char *)&frame)
__kernel void frame_layout(int count, __global int *result)
{
    Frame frame;
    const int found[] = {OFFSET(lists_wide), OFFSET(lists_high), OFFSET(width), OFFSET(height), OFFSET(planes),
                         OFFSET(depth_kind), OFFSET(lists_near), OFFSET(depth_origin), OFFSET(cutoff), OFFSET(first_depth), OFFSET(slabs_per_depth),
                         OFFSET(depth_step), OFFSET(nearest_offset), OFFSET(regions),
                         OFFSET(one_list), sizeof(Frame)};
    if (get_global_id(0) == 0) {
        for (int n = 0; n < count; ++n)
            result[n] = found[n];
    }
}
