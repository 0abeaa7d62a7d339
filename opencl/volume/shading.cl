// Shading and gradient opacity, as VTK's GPU volume mapper computes them (docs/dev/conventions.md,
// "Lighting").
//
// -D SHADED  0: samples are not lit; 1: they are; 2: by one headlight and nothing else, which VTK
// shades its own way
//
// Lights are in a frame of their own, "the lights' frame", whose origin is the eye: the model
// frame's axes for a headlight, the view's otherwise.
#include "lib/classification.cl"
#include "lib/directions.cl"
#include "volume/sampling.cl"
#pragma OPENCL FP_CONTRACT OFF

// Differences of the scalar between a voxel ahead and a voxel behind along each index axis; 0 where
// one is NaN.
inline Real3 scalar_differences(__global const VOXEL_T *voxels, const Points *points, Real x,
                                Real y, Real z)
{
    const Real along_x = sample_volume(voxels, points, x + 1.0f, y, z) -
                         sample_volume(voxels, points, x - 1.0f, y, z);
    const Real along_y = sample_volume(voxels, points, x, y + 1.0f, z) -
                         sample_volume(voxels, points, x, y - 1.0f, z);
    const Real along_z = sample_volume(voxels, points, x, y, z + 1.0f) -
                         sample_volume(voxels, points, x, y, z - 1.0f);
    return REAL3(SELECT(along_x, (Real)(0.0f), isnan(along_x)),
                 SELECT(along_y, (Real)(0.0f), isnan(along_y)),
                 SELECT(along_z, (Real)(0.0f), isnan(along_z)));
}

// Places in `gradient`
#define TO_TABLE 0      // differences to table positions, per axis
#define LAST_POSITION 3 // beyond it the table is not looked up
#define TABLE_ENTRIES 4
#define FIRST_POSITION 5 // table position of no gradient: 0 or below
#define TABLE 6

// Factor of the opacity where the scalar has these differences.
inline Real gradient_opacity(Real3 differences, __global const float *gradient)
{
    const Real3 along =
        REAL3(differences.x * gradient[TO_TABLE], differences.y * gradient[TO_TABLE + 1],
              differences.z * gradient[TO_TABLE + 2]);
    const float last = gradient[TABLE_ENTRIES] - 1.0f;
    const Real x = clamp(fmin(length_of(along), gradient[LAST_POSITION]) + gradient[FIRST_POSITION],
                         0.0f, last);
    const Int i = min(TO_INT(x), max((int)last - 1, 0));
    __global const float *table = gradient + TABLE;
    const Places here = {i}, next = {min(i + 1, (int)last)};
    Place *at_here = here.each, *at_next = next.each;
#define HERE(n) table[at_here[n]]
#define NEXT(n) table[at_next[n]]
    return mix(OF_LANES(Real, HERE), OF_LANES(Real, NEXT), x - TO_REAL(i));
#undef HERE
#undef NEXT
}

FUNCTION_OF_LANES(expm1_of, expm1)

// Optical depth of a step whose opacity is multiplied by `factor`, 0 to 1: VTK multiplies what the
// step has, not its extinction.
inline Real scaled_optical_depth(Real tau, Real factor)
{
    return SELECT(tau, -log1p_of(factor * expm1_of(-tau)), factor < 1.0f);
}

// Places in `lighting`
#define NORMAL 0   // rows of the matrix from differences along the index axes to the lights' frame
#define POSITION 9 // rows of the affine map from index positions to the lights' frame
#define AMBIENT 21
#define DIFFUSE 22
#define SPECULAR 23
#define SPECULAR_POWER 24
#define TWO_SIDED 25
#define SHARP 26 // the specular power is so large that a cosine's rounding shows in its power
#define LIGHT_COUNT 27
#define FIRST_LIGHT 28
// Places in a light
#define LIGHT_AMBIENT 0
#define LIGHT_DIFFUSE 3
#define LIGHT_SPECULAR 6
#define LIGHT_DIRECTION 9 // unit vector in which it shines
#define LIGHT_POSITIONAL 12
#define LIGHT_POSITION 13
#define LIGHT_ATTENUATION 16
#define LIGHT_CONE 19 // cosine of the cone's half angle; below -1 it shines everywhere
#define LIGHT_EXPONENT 20
#define LIGHT_SIZE 21

// The same for each component of a vector
#define OF_AXES(OF_AXIS) REAL3(OF_AXIS(x, 0), OF_AXIS(y, 1), OF_AXIS(z, 2))

inline Real3 unit_or_zero(Real3 v)
{
    const Real size = length_of(v);
#define UNIT(c, n) SELECT((Real)(0.0f), v.c / size, size > 0.0f)
    return OF_AXES(UNIT);
#undef UNIT
}

// A power of 1 - lost, where the cosine itself has rounded `lost` off.
inline Real sharp_highlight(Real lost, float power)
{
    return exp(power * log1p_of(-fmin(lost, 1.0f)));
}

// Colour that a sample sends to the eye. `differences`: see scalar_differences. `x`, `y`, `z`: its
// index position. The normal points to where the scalar grows, so that it looks away from a light
// in front of a denser inside: vectors towards lights and eye are taken the other way round
// throughout.
inline Real3 lit(Real3 color, Real3 differences, Real x, Real y, Real z,
                 __global const float *lighting)
{
#define NORMAL_ALONG(c, n) dot_with(lighting + NORMAL + 3 * n, differences)
    const Real3 normal = unit_or_zero(OF_AXES(NORMAL_ALONG));
#undef NORMAL_ALONG
#define POSITION_ALONG(c, n) affine_with(lighting + POSITION + 4 * n, x, y, z)
    const Real3 position = OF_AXES(POSITION_ALONG);
#undef POSITION_ALONG
    const Real3 view = unit_or_zero(position); // from the eye
    const float power = lighting[SPECULAR_POWER];
    const bool two_sided = lighting[TWO_SIDED] != 0.0f, sharp = lighting[SHARP] != 0.0f;
    if (SHADED == 2) {
        __global const float *light = lighting + FIRST_LIGHT;
        Real facing = dot_of(normal, view);
        const Real reflected = fmax(2.0f * facing * facing - 1.0f,
                                    0.0f); // cosine between the reflected ray and the eye's
        if (two_sided)
            facing = fabs(facing);
        Real specular;
        if (sharp) {
            const Real3 across = cross_of(
                normal, view); // as long as the sine of half the angle to the reflected ray
            specular = sharp_highlight(2.0f * dot_of(across, across), power);
        } else {
            specular = pow_of(reflected, power);
        }
        // The light's own ambient colour has no part in it
#define LIT(c, n)                                                                                  \
    clamp(lighting[AMBIENT] * color.c +                                                            \
              SELECT((Real)(0.0f),                                                                 \
                     facing * lighting[DIFFUSE] * light[LIGHT_DIFFUSE + n] * color.c +             \
                         specular * lighting[SPECULAR] * light[LIGHT_SPECULAR + n],                \
                     facing > 0.0f),                                                               \
          0.0f, 1.0f)
        return OF_AXES(LIT);
#undef LIT
    }
    float3 ambient = (float3)(0.0f);
    Real3 diffuse = REAL3((Real)(0.0f), (Real)(0.0f), (Real)(0.0f)), specular = diffuse;
    const int count = (int)lighting[LIGHT_COUNT];
    for (int k = 0; k < count; ++k) {
        __global const float *light = lighting + FIRST_LIGHT + k * LIGHT_SIZE;
#define SHINES(c, n) (Real)(light[LIGHT_DIRECTION + n])
        Real3 direction = OF_AXES(SHINES);
#undef SHINES
        Real strength = 1.0f;
        const bool positional = light[LIGHT_POSITIONAL] != 0.0f;
        if (positional) {
#define FROM_LIGHT(c, n) (position.c - light[LIGHT_POSITION + n])
            const Real3 from_light = OF_AXES(FROM_LIGHT);
#undef FROM_LIGHT
            const Real distance = length_of(from_light);
            const Real3 axis = direction;
            direction = unit_or_zero(from_light);
            strength = 1.0f / (light[LIGHT_ATTENUATION] + light[LIGHT_ATTENUATION + 1] * distance +
                               light[LIGHT_ATTENUATION + 2] * distance * distance);
            if (light[LIGHT_CONE] >= -1.0f) {
                const Real inside = dot_of(direction, axis);
                strength *= SELECT((Real)(0.0f), pow_of(fmax(inside, 0.0f), light[LIGHT_EXPONENT]),
                                   inside >= light[LIGHT_CONE]);
            }
        }
        Real facing = dot_of(normal, direction);
        if (two_sided)
            facing = SELECT(facing, -facing, facing < 0.0f);
        const Int faces = facing > 0.0f;
#define DIFFUSE_OF(c, n)                                                                           \
    SELECT(diffuse.c, diffuse.c + strength * facing * light[LIGHT_DIFFUSE + n], faces)
        diffuse = OF_AXES(DIFFUSE_OF);
#undef DIFFUSE_OF
        // VTK turns the cosine of a side that faces away, and not its normal: its highlights lie
        // elsewhere
#define MIRRORED(c, n) (2.0f * facing * normal.c - direction.c)
        const Real3 mirrored = unit_or_zero(OF_AXES(MIRRORED));
#undef MIRRORED
        Real reflected = dot_of(view, mirrored);
        const Int turned = two_sided && positional ? reflected < 0.0f : (Int)(0);
        reflected = SELECT(reflected, -reflected, turned);
        Real shines;
        if (sharp) {
#define CHORD(c, n) (view.c - SELECT(mirrored.c, -mirrored.c, turned))
            const Real3 chord = OF_AXES(CHORD);
#undef CHORD
            shines = strength * sharp_highlight(0.5f * dot_of(chord, chord), power);
        } else {
            shines = strength * pow_of(reflected, power);
        }
#define SPECULAR_OF(c, n)                                                                          \
    SELECT(specular.c, specular.c + shines * light[LIGHT_SPECULAR + n], faces & (reflected > 0.0f))
        specular = OF_AXES(SPECULAR_OF);
#undef SPECULAR_OF
        ambient += vload3(0, light + LIGHT_AMBIENT);
    }
    // The lights' ambient colours are not multiplied by the sample's: so does VTK
#define LIT(c, n)                                                                                  \
    clamp(lighting[AMBIENT] * ambient.c + lighting[DIFFUSE] * diffuse.c * color.c +                \
              lighting[SPECULAR] * specular.c,                                                     \
          0.0f, 1.0f)
    return OF_AXES(LIT);
#undef LIT
}
