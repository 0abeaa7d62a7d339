// Where each list begins: the running sum of the lists' lengths, from slice to slice.
//
// A block is what one work-group takes, whatever its size: LISTS_PER_ITEM lists for each of its
// work-items. sum_lengths sums up each block; list_offsets adds what lies before a block to the
// running sum within it.

// Sum of the values of the work-group's items before this one. `sums`: an element for each item;
// afterwards the last one's is the sum of all.
inline ulong sum_before(ulong value, __local ulong *sums)
{
    const int item = (int)get_local_id(0);
    const int items = (int)get_local_size(0);
    sums[item] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int distance = 1; distance < items; distance *= 2) {
        const ulong left = item >= distance ? sums[item - distance] : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        sums[item] += left;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    return sums[item] - value;
}

inline ulong sum_of_lists(__global const uint *lengths, uint first, uint end)
{
    ulong sum = 0;
    for (uint list = first; list < end; ++list)
        sum += lengths[list];
    return sum;
}

// Sum of each block of lists.
__kernel void sum_lengths(uint lists, __global const uint *lengths,
                          __local ulong *partial, // an element for each work-item
                          __global ulong *sums)   // of the blocks
{
    const uint item = (uint)get_global_id(0);
    const uint first = min(item * LISTS_PER_ITEM, lists);
    const ulong value = sum_of_lists(lengths, first, min(first + LISTS_PER_ITEM, lists));
    const ulong before = sum_before(value, partial);
    if (get_local_id(0) + 1 == get_local_size(0))
        sums[item / (uint)get_local_size(0)] = before + value;
}

// Offsets of a slice of lists behind those made before: offsets[0] is where its first list begins,
// and the others follow.
__kernel void list_offsets(
    uint lists, __global const uint *lengths,
    __local ulong *partial, // as above
    __global const ulong *sums,
    uint made,                   // lists that have their offsets already
    __global ulong *all_offsets) // that of list `made` is there; as many as there are lists follow
{
    __global ulong *offsets = all_offsets + made;
    const uint item = (uint)get_global_id(0);
    const uint local_item = (uint)get_local_id(0);
    const uint items = (uint)get_local_size(0);
    ulong of_blocks = 0;
    for (uint block = local_item; block < item / items; block += items)
        of_blocks += sums[block];
    sum_before(of_blocks, partial);
    const ulong begin = offsets[0] + partial[items - 1];
    barrier(CLK_LOCAL_MEM_FENCE); // all have read it
    const uint first = min(item * LISTS_PER_ITEM, lists);
    const uint end = min(first + LISTS_PER_ITEM, lists);
    ulong offset = begin + sum_before(sum_of_lists(lengths, first, end), partial);
    for (uint list = first; list < end; ++list) {
        offset += lengths[list];
        offsets[list + 1] = offset;
    }
}
