// Samples of a uniform grid, between its points.
//
// -D VOXEL_T     type of a voxel's component: uchar, char, ushort, short or float
// -D INDEX_T     type of a voxel's address: uint, or ulong where the grid has 2^32 points or more
// -D COMPONENTS  1: a voxel is the scalar alone; 4: colours, and the scalar last
// -D NEAREST     1: the nearest point's value (VTK's nearest interpolation); 0: trilinear
//
// Positions are in index space: point (i, j, k) lies at (i, j, k); x is fastest in memory. They are
// the whole grid's, and addresses alone are those of the points that are at hand (Held). Unsigned,
// so that what wraps in the parts is right in the difference.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#define SCALAR (COMPONENTS - 1) // the component that classification sees

#if LANES == 16
typedef Uint Index; // where INDEX_T is uint
#define TO_INDEX(x) AS_UINT(x)
#define NAME_JOINED(a, b) a##b
#define VECTOR_OF(type, n) NAME_JOINED(type, n)
typedef VECTOR_OF(VOXEL_T, 16) Voxels;
#define VOXELS_TO_REAL(x) convert_float16(x)

// The voxels' components at these addresses.
inline Voxels load_voxels(__global const VOXEL_T *voxels, Index first)
{
    const Places places = {AS_INT(first)};
    const volatile uint *at = (const volatile uint *)places.each;
#define VOXEL(n) voxels[at[n]]
    return OF_LANES(Voxels, VOXEL);
#undef VOXEL
}

// Between a point and the next one along x, of points that have one component.
#define ADDRESSES(at, first)                                                                       \
    const Places places = {AS_INT(first)};                                                         \
    const volatile uint *at = (const volatile uint *)places.each
inline Real along_x(__global const VOXEL_T *voxels, const volatile uint *at, Real share)
{
#define PAIR(n) vload2(0, voxels + at[n])
    const Voxels first =
        (Voxels)(PAIR(0), PAIR(1), PAIR(2), PAIR(3), PAIR(4), PAIR(5), PAIR(6), PAIR(7));
    const Voxels last =
        (Voxels)(PAIR(8), PAIR(9), PAIR(10), PAIR(11), PAIR(12), PAIR(13), PAIR(14), PAIR(15));
#undef PAIR
    return mix(convert_float16((Voxels)(first.even, last.even)),
               convert_float16((Voxels)(first.odd, last.odd)), share);
}
#else
typedef INDEX_T Index;
#define TO_INDEX(x) ((INDEX_T)(x))
typedef VOXEL_T Voxels;
#define VOXELS_TO_REAL(x) ((float)(x))
#define load_voxels(voxels, at) ((voxels)[at])
#define ADDRESSES(at, first) const Index at = first

inline float along_x(__global const VOXEL_T *voxels, Index at, float share)
{
    return mix((float)voxels[at], (float)voxels[at + COMPONENTS], share);
}
#endif

// The points of a grid, and those of them that are in memory: a brick, or all.
typedef struct {
    int4 size; // points along x, y, z
    int4 held; // the same of those in memory; w: address that the first of them has in a grid of
               // their rows and planes
} Points;

// A component of the point nearest to a position.
inline Voxels nearest_component(__global const VOXEL_T *voxels, const Points *points, Real x,
                                Real y, Real z, int component)
{
    // What is below 0 is clamped, so that TO_INT rounds down
    const Int i = clamp(TO_INT(x + 0.5f), 0, points->size.x - 1);
    const Int j = clamp(TO_INT(y + 0.5f), 0, points->size.y - 1);
    const Int k = clamp(TO_INT(z + 0.5f), 0, points->size.z - 1);
    const Index point =
        (TO_INDEX(k) * (INDEX_T)points->held.y + TO_INDEX(j)) * (INDEX_T)points->held.x +
        TO_INDEX(i) - (INDEX_T)points->held.w;
    return load_voxels(voxels, point * (INDEX_T)COMPONENTS + (INDEX_T)component);
}

inline Real linear_component(__global const VOXEL_T *voxels, const Points *points, Real x, Real y,
                             Real z, int component)
{
    // Rounding can put a position on the far face a hair outside: clamp the cell, keep the weight
    // in [0, 1]
    const Int i = clamp(TO_INT(x), 0, points->size.x - 2);
    const Int j = clamp(TO_INT(y), 0, points->size.y - 2);
    const Int k = clamp(TO_INT(z), 0, points->size.z - 2);
    const Real fx = clamp(x - TO_REAL(i), 0.0f, 1.0f);
    const Real fy = clamp(y - TO_REAL(j), 0.0f, 1.0f);
    const Real fz = clamp(z - TO_REAL(k), 0.0f, 1.0f);
    const INDEX_T row = (INDEX_T)points->held.x * COMPONENTS;
    const INDEX_T plane = row * (INDEX_T)points->held.y;
    const Index first = TO_INDEX(k) * plane + TO_INDEX(j) * row +
                        TO_INDEX(i) * (INDEX_T)COMPONENTS + (INDEX_T)component -
                        (INDEX_T)points->held.w * COMPONENTS;
    ADDRESSES(at, first);
    const Real c00 = along_x(voxels, at, fx);
    const Real c10 = along_x(voxels + row, at, fx);
    const Real c01 = along_x(voxels + plane, at, fx);
    const Real c11 = along_x(voxels + plane + row, at, fx);
    return mix(mix(c00, c10, fy), mix(c01, c11, fy), fz);
}

inline Real sample_component(__global const VOXEL_T *voxels, const Points *points, Real x, Real y,
                             Real z, int component)
{
    if (NEAREST)
        return VOXELS_TO_REAL(nearest_component(voxels, points, x, y, z, component));
    return linear_component(voxels, points, x, y, z, component);
}

inline Real sample_volume(__global const VOXEL_T *voxels, const Points *points, Real x, Real y,
                          Real z)
{
    return sample_component(voxels, points, x, y, z, SCALAR);
}

// Straight colour of a volume of bytes, 0 to 1.
inline Real3 sample_color(__global const VOXEL_T *voxels, const Points *points, Real x, Real y,
                          Real z)
{
    return REAL3(sample_component(voxels, points, x, y, z, 0) / 255.0f,
                 sample_component(voxels, points, x, y, z, 1) / 255.0f,
                 sample_component(voxels, points, x, y, z, 2) / 255.0f);
}
