// The nearest occupied slab of the occupancy grid ahead of each of LANES rays (raycasting/packet.cl).
#include "raycasting/tiles.cl"
#include "raycasting/packet.cl"
#pragma OPENCL FP_CONTRACT OFF

#define HALF_SLABS (SLABS / 2)

// From `slab` on, in the rays' sense, among the slabs of masks whose halves are `low` and `high`; *nothing: rays that have
// none ahead. By halves, as few processors count bits of 64-bit words in vectors.
inline Ints nearest_slabs(uint16 low, uint16 high, Ints slab, bool away, Ints *nothing)
{
    const Ints in_high = slab >= HALF_SLABS;
    const Ints bit = slab & (HALF_SLABS - 1);
    const uint16 own = select(low, high, in_high) &
                       (away ? (uint16)(~0u) << as_uint16(bit) : (uint16)(~0u) >> as_uint16(HALF_SLABS - 1 - bit));
    const uint16 behind = away ? select(high, (uint16)(0u), in_high) : select((uint16)(0u), low, in_high);
    const Ints is_own = own != 0u;
    const uint16 ahead = select(behind, own, is_own);
    *nothing = ahead == 0u;
    const uint16 nearest = away ? ahead & -ahead : ahead; // its first bit is
    const Ints of_high = away ? in_high || !is_own : in_high && is_own;
    return HALF_SLABS - 1 - as_int16(clz(nearest)) + (of_high & HALF_SLABS);
}
