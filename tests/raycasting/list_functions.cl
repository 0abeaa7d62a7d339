// Entry point to opencl/raycasting/lists.cl, one work-item per query.
//
// -D OFFSET_T   see raycasting/supersegments.cl
#include "raycasting/lists.cl"
#pragma OPENCL FP_CONTRACT OFF

// Query i asks list lists[i].x .. lists[i].x + lists[i].y; (direction, guess) = how[i]. Supersegment k is faces[k * stride],
// as in the first list of each bundle. Answered is how many supersegments of the list pass the depth: end before it or at it
// for a ray that goes away, begin before it for a ray that comes back.
__kernel void counts_passing(int count, __global const ulong *faces, __global const int2 *lists,
                             __global const float *depths, __global const int2 *how, __global int *results)
{
    __global const ulong *media = faces; // not read
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const List list = {lists[i].x * LISTS_PER_BUNDLE, lists[i].y};
    const bool away = how[i].x != 0;
    const int guess = min(how[i].y, list.count);
    Search search = begin_search(away ? how[i].y : list.count - guess);
    Faces face;
    int left = list.count + 3; // turns; more than any search takes
    while (!search_on(&search, &list, SUPERSEGMENTS_ARGUMENTS away ? depths[i] : -depths[i], true, away, &face) && --left > 0)
        guess_again(&search, &list, false);
    results[i] = left == 0 ? -1 : away ? search.n : list.count - search.n;
}

// Entries between supersegments of a list, for the caller.
__kernel void lists_per_bundle(int count, __global int *result)
{
    if (get_global_id(0) == 0)
        result[0] = LISTS_PER_BUNDLE;
}
