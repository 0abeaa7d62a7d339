// What of a volume is left out though its grid has it: blank points, cells
// (docs/dev/conventions.md, "From a volume to the medium"). Positions are the whole grid's: a part
// of a grid has none.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

// Whether index position (x, y, z) lies in a blank octant of the point nearest to it. `blanked`: of
// each point, a bit for each octant around it, half a voxel long.
inline Int is_blank(__global const uchar *blanked, int4 size, Real x, Real y, Real z)
{
    const Int i = clamp(TO_INT(x + 0.5f), 0, size.x - 1);
    const Int j = clamp(TO_INT(y + 0.5f), 0, size.y - 1);
    const Int k = clamp(TO_INT(z + 0.5f), 0, size.z - 1);
    const Int octant =
        COUNT(x >= TO_REAL(i)) + 2 * COUNT(y >= TO_REAL(j)) + 4 * COUNT(z >= TO_REAL(k));
    const Places in_x = {i}, in_y = {j}, in_z = {k}, bits = {octant};
    Place *at_x = in_x.each, *at_y = in_y.each, *at_z = in_z.each, *bit = bits.each;
#define BLANK(n) (blanked[((size_t)at_z[n] * size.y + at_y[n]) * size.x + at_x[n]] >> bit[n] & 1)
    return OF_LANES(Int, BLANK) != 0;
#undef BLANK
}
