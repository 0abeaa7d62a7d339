// The medium around a sample of a classified volume: colour and optical depth
// (docs/dev/conventions.md).
//
// -D BY_SCALAR  1: with NEAREST and voxels of integers, the table holds the medium of each scalar
// from `low` on, of which no
//               voxel is outside (volume/scalar_media.cl); 0: it is classified at each sample
// -D VOXEL_T, INDEX_T, COMPONENTS, NEAREST: see volume/sampling.cl; SHADED: see volume/shading.cl
#include "lib/transpose.cl"
#include "lib/classification.cl"
#include "volume/sampling.cl"
#include "volume/shading.cl"
#pragma OPENCL FP_CONTRACT OFF

// The numbers of a classified volume.
typedef struct {
    Points points;
    int4 macrocells; // along x, y, z
    int4 part_first; // the first point of a part of a grid (large/blocks.py); w: whether it is one
    float4 part_lower,
        part_upper;        // of its own cells, the upper ones excluded; infinite at the grid's ends
    int4 nodes;            // of ambient occlusion, along x, y, z
    float4 to_nodes;       // nodes per voxel along x, y, z; strength
    int entries;           // of the table
    float low, per_scalar; // scalar to table position
} Classified;

typedef struct {
    Classified numbers;
    __global const VOXEL_T *voxels;
    __global const float4 *table;    // transfer function, or the media of scalars
    __global const uchar *distances; // of the macrocells from visible ones, see
                                     // volume/macrocells.cl; 0: nothing is empty
    __global const uchar *blanked;   // see is_blank; 0: nothing is
    __global const float *gradient;  // see gradient_opacity; 0: opacity does not depend on it
    __global const float *lighting;  // see lit
    __global const float *ambient;   // see ambient_factor; 0: there is none
} Medium;

// A kernel's parameters that are a classified volume, and the medium of them.
#define MEDIUM_PARAMETERS                                                                          \
    const Classified classified, __global const VOXEL_T *voxels, __global const float4 *table,     \
        __global const uchar *distances, __global const uchar *blanked,                            \
        __global const float *gradient, __global const float *lighting,                            \
        __global const float *ambient
#define MEDIUM_OF_PARAMETERS                                                                       \
    {classified, voxels, table, distances, blanked, gradient, lighting, ambient}

// An index position of the grid in the part of it that is at hand, which rounds nothing. Marches
// keep the whole grid's, so that no step is taken twice or left out.
#define IN_PART(numbers, position, axis) ((position) - (float)(numbers).part_first.axis)

// Trilinear between (0, 0, 0) and (1, 1, 1) of eight values, `row` and `plane` apart.
inline Real trilinear(__global const float *values, Int first, int row, int plane, Real fx, Real fy,
                      Real fz)
{
    const Places places = {first};
    Place *at = places.each;
#define VALUE(n) v[at[n]]
    Real corners[8];
    for (int k = 0; k < 8; ++k) {
        __global const float *v = values + (k >> 2) * plane + (k >> 1 & 1) * row + (k & 1);
        corners[k] = OF_LANES(Real, VALUE);
    }
#undef VALUE
    const Real near = mix(mix(corners[0], corners[1], fx), mix(corners[2], corners[3], fx), fy);
    const Real far = mix(mix(corners[4], corners[5], fx), mix(corners[6], corners[7], fx), fy);
    return mix(near, far, fz);
}

// Factor of the colour at index position (x, y, z) by ambient occlusion
// (volume/ambient_occlusion.cl). `ambient`: mean transmittance around each of
// `nodes` along x, y, z. `to_nodes`: nodes per voxel along x, y, z, and the strength.
inline Real ambient_factor(__global const float *ambient, int4 nodes, float4 to_nodes, Real x,
                           Real y, Real z)
{
    const Real at_x = x * to_nodes.x, at_y = y * to_nodes.y, at_z = z * to_nodes.z;
    const Int i = clamp(TO_INT(at_x), 0, nodes.x - 2);
    const Int j = clamp(TO_INT(at_y), 0, nodes.y - 2);
    const Int k = clamp(TO_INT(at_z), 0, nodes.z - 2);
    const int plane = nodes.x * nodes.y;
    const Real open = trilinear(
        ambient, k * plane + j * nodes.x + i, nodes.x, plane, clamp(at_x - TO_REAL(i), 0.0f, 1.0f),
        clamp(at_y - TO_REAL(j), 0.0f, 1.0f), clamp(at_z - TO_REAL(k), 0.0f, 1.0f));
    return open /
           fma((Real)(to_nodes.w), 1.0f - open, open); // exactly 1 where all the light arrives
}

// Whether index position (x, y, z), of the whole grid, lies in a blank octant of the point nearest
// to it. `blanked`: of each point, a bit for each octant around it, half a voxel long.
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

// Colour (rgb) and optical depth (w) of a step of `units` opacity unit distances around a position
// of the voxels at hand.
inline Real4 classified_at(const Medium *medium, Real x, Real y, Real z, Real units)
{
    const Classified *of = &medium->numbers;
    if (BY_SCALAR) {
        const Int scalar = TO_INT(nearest_component(medium->voxels, &of->points, x, y, z, SCALAR));
        Real4 known = load_fours(
            medium->table, AS_INT(min(AS_UINT(scalar - (int)of->low), (uint)(of->entries - 1))));
        known.w = scaled_to_step(known.w, units);
        return known;
    }
    const Real scalar = sample_volume(medium->voxels, &of->points, x, y, z);
    Real4 sample = classify(scalar, medium->table, of->entries, of->low, of->per_scalar);
    const Int some = sample.w > 0.0f;
    if (ANY(some))
        sample.w = SELECT((Real)(0.0f), step_optical_depth(sample.w, units), some);
    return sample;
}

// Colour (rgb) and optical depth (w) of a step of `units` opacity unit distances around index
// position (x, y, z).
inline Real4 medium_at(const Medium *medium, Real x, Real y, Real z, Real units)
{
    const Classified *of = &medium->numbers;
    const Real at_x = IN_PART(*of, x, x), at_y = IN_PART(*of, y, y), at_z = IN_PART(*of, z, z);

    // Sample the scalar and classify it
    Real4 sample = classified_at(medium, at_x, at_y, at_z, units);
    if (medium->blanked)
        sample.w =
            SELECT(sample.w, (Real)(0.0f), is_blank(medium->blanked, of->points.size, x, y, z));
    const Int visible = sample.w > 0.0f;
    if (!(COMPONENTS > 1 || SHADED || medium->gradient || medium->ambient) || !ANY(visible))
        return sample;
    Real3 color = REAL3(sample.x, sample.y, sample.z);
    if (COMPONENTS > 1)
        color = sample_color(medium->voxels, &of->points, at_x, at_y, at_z);

    // Shade it
    if (SHADED || medium->gradient) {
        const Real3 differences = scalar_differences(medium->voxels, &of->points, at_x, at_y, at_z);
        if (medium->gradient) {
            const Real scaled =
                scaled_optical_depth(sample.w, gradient_opacity(differences, medium->gradient));
            sample.w = SELECT(sample.w, scaled, visible);
        }
        if (SHADED)
            color = lit(color, differences, x, y, z, medium->lighting);
    }
    if (medium->ambient) {
        const Real factor = ambient_factor(medium->ambient, of->nodes, of->to_nodes, x, y, z);
        color = REAL3(color.x * factor, color.y * factor, color.z * factor);
    }
    return REAL4(SELECT(sample.x, color.x, visible), SELECT(sample.y, color.y, visible),
                 SELECT(sample.z, color.z, visible), sample.w);
}
