// Samples of a uniform grid, between its points.
//
// -D VOXEL_T  type of a voxel: uchar, char, ushort, short or float
// -D INDEX_T  type of a voxel's address: uint, or ulong where the grid has 2^32 points or more
// -D RGBA     a voxel is four of them: colours, and the scalar last; otherwise it is the scalar alone
// -D NEAREST  the nearest point's value (VTK's nearest interpolation); otherwise trilinear
// -D BRICK_POINTS  `voxels` is a brick of the grid with so many points along each edge, see volume/bricks.cl
//
// Positions are in index space: point (i, j, k) lies at (i, j, k); x is fastest in memory.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef BRICK_POINTS
// Positions and points are the whole grid's; addresses alone are the brick's, whose first point has the address size.w in a
// grid of its rows and planes. Unsigned, so that what wraps in the parts is right in the difference.
#define POINTS_X(size) BRICK_POINTS
#define POINTS_Y(size) BRICK_POINTS
#define FIRST_POINT(size) (INDEX_T)(size).w
#else
#define POINTS_X(size) (size).x
#define POINTS_Y(size) (size).y
#define FIRST_POINT(size) (INDEX_T)0
#endif

#ifdef RGBA
#define COMPONENTS 4
#else
#define COMPONENTS 1
#endif
#define SCALAR (COMPONENTS - 1) // which of them classification sees

// Addresses: of one ray's point, or of a vector of them, where INDEX_T is uint.
#if LANES == 1
typedef INDEX_T Index;
#define TO_INDEX(x) ((INDEX_T)(x))
#else
typedef Uint Index;
#define TO_INDEX(x) AS_UINT(x)
#define NAME_JOINED(a, b) a##b
#define VECTOR_OF(type, n) NAME_JOINED(type, n)
typedef VECTOR_OF(VOXEL_T, 16) Voxels;
#define TO_REALS(x) convert_float16(x)
#endif

#ifdef NEAREST
// Address of the point nearest to a position.
inline Index nearest_point(int4 size, Real x, Real y, Real z)
{
    // What is below 0 is clamped, so that TO_INT rounds down
    const Int i = clamp(TO_INT(x + 0.5f), 0, size.x - 1);
    const Int j = clamp(TO_INT(y + 0.5f), 0, size.y - 1);
    const Int k = clamp(TO_INT(z + 0.5f), 0, size.z - 1);
    return (TO_INDEX(k) * (INDEX_T)POINTS_Y(size) + TO_INDEX(j)) * (INDEX_T)POINTS_X(size) + TO_INDEX(i) - FIRST_POINT(size);
}

// A component of that point; of a vector of points that have one component.
#if LANES == 1
inline VOXEL_T nearest_component(__global const VOXEL_T *voxels, int4 size, float x, float y, float z, int component)
{
    return voxels[nearest_point(size, x, y, z) * COMPONENTS + component];
}
#else
inline Voxels nearest_component(__global const VOXEL_T *voxels, int4 size, Real x, Real y, Real z, int component)
{
    const Places places = {AS_INT(nearest_point(size, x, y, z))};
    const volatile uint *at = (const volatile uint *)places.each;
#define VOXEL(n) voxels[at[n]]
    return OF_LANES(Voxels, VOXEL);
#undef VOXEL
}
#endif
#else
// Between a point and the next one along x.
#if LANES == 1
inline float along_x(__global const VOXEL_T *voxels, const Index *at, float share)
{
    return mix((float)voxels[*at], (float)voxels[*at + COMPONENTS], share);
}
#else
inline Real along_x(__global const VOXEL_T *voxels, const volatile uint *at, Real share)
{
#define PAIR(n) vload2(0, voxels + at[n])
    const Voxels first = (Voxels)(PAIR(0), PAIR(1), PAIR(2), PAIR(3), PAIR(4), PAIR(5), PAIR(6), PAIR(7));
    const Voxels last = (Voxels)(PAIR(8), PAIR(9), PAIR(10), PAIR(11), PAIR(12), PAIR(13), PAIR(14), PAIR(15));
#undef PAIR
    return mix(TO_REALS((Voxels)(first.even, last.even)), TO_REALS((Voxels)(first.odd, last.odd)), share);
}
#endif
#endif

inline Real sample_component(__global const VOXEL_T *voxels, int4 size, Real x, Real y, Real z, int component)
{
#ifdef NEAREST
    return TO_REAL(nearest_component(voxels, size, x, y, z, component));
#else
    // Rounding can put a position on the far face a hair outside: clamp the cell, keep the weight in [0, 1]
    const Int i = clamp(TO_INT(x), 0, size.x - 2);
    const Int j = clamp(TO_INT(y), 0, size.y - 2);
    const Int k = clamp(TO_INT(z), 0, size.z - 2);
    const Real fx = clamp(x - TO_REAL(i), 0.0f, 1.0f);
    const Real fy = clamp(y - TO_REAL(j), 0.0f, 1.0f);
    const Real fz = clamp(z - TO_REAL(k), 0.0f, 1.0f);
    const INDEX_T row = (INDEX_T)POINTS_X(size) * COMPONENTS;
    const INDEX_T plane = row * (INDEX_T)POINTS_Y(size);
    const Index first = TO_INDEX(k) * plane + TO_INDEX(j) * row + TO_INDEX(i) * COMPONENTS + component -
                        FIRST_POINT(size) * COMPONENTS;
#if LANES == 1
    const Index *at = &first;
#else
    const Places places = {AS_INT(first)};
    const volatile uint *at = (const volatile uint *)places.each;
#endif
    const Real c00 = along_x(voxels, at, fx);
    const Real c10 = along_x(voxels + row, at, fx);
    const Real c01 = along_x(voxels + plane, at, fx);
    const Real c11 = along_x(voxels + plane + row, at, fx);
    return mix(mix(c00, c10, fy), mix(c01, c11, fy), fz);
#endif
}

inline Real sample_volume(__global const VOXEL_T *voxels, int4 size, Real x, Real y, Real z)
{
    return sample_component(voxels, size, x, y, z, SCALAR);
}

#ifdef RGBA
// Straight colour of a volume of bytes, 0 to 1.
inline float3 sample_color(__global const VOXEL_T *voxels, int4 size, float x, float y, float z)
{
    return (float3)(sample_component(voxels, size, x, y, z, 0), sample_component(voxels, size, x, y, z, 1),
                    sample_component(voxels, size, x, y, z, 2)) /
           255.0f;
}
#endif
