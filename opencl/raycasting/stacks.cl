// Cells of the occupancy grid (paper, section 4): stacks of SLABS cells of equal view depth, each
// over STACK x STACK lists. One bit of a stack's mask for each slab says whether it is occupied.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#define STACKS_ALONG(lists) (((lists) + STACK - 1) >> STACK_SHIFT)
#define HALF_SLABS (SLABS / 2)

// Slab of a view depth less the VDI's depth origin. What lies before the first slab or behind the
// last one counts there.
inline Int slab_of(Real offset, float first_depth, float slabs_per_depth)
{
    return TO_INT(clamp((offset - first_depth) * slabs_per_depth, 0.0f, (float)(SLABS - 1)));
}

// The nearest occupied slab from `slab` on, in the rays' sense, of masks whose halves are `low` and
// `high`; *nothing: rays that have none ahead. By halves, as few processors count bits of 64-bit
// words in vectors.
inline Int nearest_slab(Uint low, Uint high, Int slab, bool away, Int *nothing)
{
    const Int in_high = slab >= HALF_SLABS;
    const Int bit = slab & (HALF_SLABS - 1);
    const Uint own =
        SELECT(low, high, in_high) &
        (away ? (Uint)(~0u) << AS_UINT(bit) : (Uint)(~0u) >> AS_UINT(HALF_SLABS - 1 - bit));
    const Uint behind = away ? SELECT(high, (Uint)(0u), in_high) : SELECT((Uint)(0u), low, in_high);
    const Int is_own = own != 0u;
    const Uint ahead = SELECT(behind, own, is_own);
    *nothing = ahead == 0u;
    const Uint nearest = away ? ahead & -ahead : ahead; // its first bit is
    const Int of_high = away ? in_high || !is_own : in_high && is_own;
    return HALF_SLABS - 1 - AS_INT(clz(nearest)) + SELECT((Int)(0), (Int)(HALF_SLABS), of_high);
}

// A ray that crosses no more lists than this does not look at the stack that it begins in: at V_O
// it stays in one list. docs/decisions/empty_space.md has all that decides about skipping.
#define FEW_LISTS 2.0f
// Turns of a loop from one look at the grid to the next: rays that come to a new stack one after
// another look together.
#define TURNS_PER_LOOK 4
