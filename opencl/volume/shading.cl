// Shading and gradient opacity, as VTK's GPU volume mapper computes them (docs/conventions.md, "Lighting").
//
// -D SHADED             samples are lit
// -D HEADLIGHT          by one headlight and nothing else, which VTK shades its own way
// -D POSITIONAL_LIGHTS  some of the lights shine from a position
// -D SHARP_HIGHLIGHTS   the specular power is so large that a cosine's rounding shows in its power
// -D GRADIENT_OPACITY   opacity depends on how fast the scalar changes
//
// Without SHADED and GRADIENT_OPACITY nothing of this is compiled. Lights are in a frame of their own, "the lights'
// frame", whose origin is the eye: the model frame's axes for a headlight, the view's otherwise.
#include "volume/sampling.cl"
#include "volume/occlusion.cl"
#include "volume/samples.cl"
#pragma OPENCL FP_CONTRACT OFF

// Of the structure Medium, of the kernels that take one, and of its initialiser: after `macrocells` in each
#define SHADING_FIELDS LIGHTING_FIELD GRADIENT_FIELD OCCLUSION_FIELD SAMPLES_FIELD
#define SHADING_PARAMETERS LIGHTING_PARAMETER GRADIENT_PARAMETER OCCLUSION_PARAMETER SAMPLES_PARAMETER
#define SHADING_ARGUMENTS LIGHTING_ARGUMENT GRADIENT_ARGUMENT OCCLUSION_ARGUMENT SAMPLES_ARGUMENT

#ifdef SHADED
#define LIGHTING_FIELD __global const float *lighting; // see lit
#define LIGHTING_PARAMETER __global const float *lighting,
#define LIGHTING_ARGUMENT , lighting
#else
#define LIGHTING_FIELD
#define LIGHTING_PARAMETER
#define LIGHTING_ARGUMENT
#endif

#ifdef GRADIENT_OPACITY
#define GRADIENT_FIELD __global const float *gradient; // see gradient_opacity
#define GRADIENT_PARAMETER __global const float *gradient,
#define GRADIENT_ARGUMENT , gradient
#else
#define GRADIENT_FIELD
#define GRADIENT_PARAMETER
#define GRADIENT_ARGUMENT
#endif

#if defined(SHADED) || defined(GRADIENT_OPACITY)
// Differences of the scalar between a voxel ahead and a voxel behind along each index axis; 0 where one is NaN.
inline float3 scalar_differences(__global const VOXEL_T *voxels, int4 size, float x, float y, float z)
{
    const float3 difference = (float3)(
        sample_volume(voxels, size, x + 1.0f, y, z) - sample_volume(voxels, size, x - 1.0f, y, z),
        sample_volume(voxels, size, x, y + 1.0f, z) - sample_volume(voxels, size, x, y - 1.0f, z),
        sample_volume(voxels, size, x, y, z + 1.0f) - sample_volume(voxels, size, x, y, z - 1.0f));
    return (float3)(isnan(difference.x) ? 0.0f : difference.x, isnan(difference.y) ? 0.0f : difference.y,
                    isnan(difference.z) ? 0.0f : difference.z);
}
#endif

#ifdef GRADIENT_OPACITY
// Places in `gradient`
#define TO_TABLE 0      // differences to table positions, per axis
#define LAST_POSITION 3 // beyond it the table is not looked up
#define TABLE_ENTRIES 4
#define FIRST_POSITION 5 // table position of no gradient: 0 or below
#define TABLE 6

// Factor of the opacity where the scalar has these differences.
inline float gradient_opacity(float3 differences, __global const float *gradient)
{
    const float3 along = differences * vload3(0, gradient + TO_TABLE);
    const float last = gradient[TABLE_ENTRIES] - 1.0f;
    const float x = clamp(fmin(length(along), gradient[LAST_POSITION]) + gradient[FIRST_POSITION], 0.0f, last);
    const int i = min((int)x, max((int)last - 1, 0));
    __global const float *table = gradient + TABLE;
    return mix(table[i], table[min(i + 1, (int)last)], x - (float)i);
}

// Optical depth of a step whose opacity is multiplied by `factor`, 0 to 1: VTK multiplies what the step has, not its
// extinction.
inline float scaled_optical_depth(float tau, float factor)
{
    return factor < 1.0f ? -log1p(factor * expm1(-tau)) : tau;
}
#endif

#ifdef SHADED
// Places in `lighting`
#define NORMAL 0        // rows of the matrix from differences along the index axes to the lights' frame
#define POSITION 9      // rows of the affine map from index positions to the lights' frame
#define AMBIENT 21
#define DIFFUSE 22
#define SPECULAR 23
#define SPECULAR_POWER 24
#define TWO_SIDED 25
#define LIGHT_COUNT 26
#define FIRST_LIGHT 27
// Places in a light
#define LIGHT_AMBIENT 0
#define LIGHT_DIFFUSE 3
#define LIGHT_SPECULAR 6
#define LIGHT_DIRECTION 9 // unit vector in which it shines
#define LIGHT_POSITIONAL 12
#define LIGHT_POSITION 13
#define LIGHT_ATTENUATION 16
#define LIGHT_CONE 19     // cosine of the cone's half angle; below -1 it shines everywhere
#define LIGHT_EXPONENT 20
#define LIGHT_SIZE 21

inline float3 unit_or_zero(float3 v)
{
    const float size = length(v);
    return size > 0.0f ? v / size : (float3)(0.0f);
}

// The power of a cosine, 0 < cosine. `lost`: 1 - cosine, which is right where the cosine has rounded it off.
inline float highlight(float cosine, float lost, float power)
{
#ifdef SHARP_HIGHLIGHTS
    return exp(power * log1p(-fmin(lost, 1.0f)));
#else
    return pow(cosine, power);
#endif
}

// Colour that a sample sends to the eye. `differences`: see scalar_differences. `x`, `y`, `z`: its index position.
// The normal points to where the scalar grows, so that it looks away from a light in front of a denser inside: vectors
// towards lights and eye are taken the other way round throughout.
inline float3 lit(float3 color, float3 differences, float x, float y, float z, __global const float *lighting)
{
    const float3 normal = unit_or_zero((float3)(dot(vload3(0, lighting + NORMAL), differences),
                                                dot(vload3(1, lighting + NORMAL), differences),
                                                dot(vload3(2, lighting + NORMAL), differences)));
    const float4 index = (float4)(x, y, z, 1.0f);
    const float3 position = (float3)(dot(vload4(0, lighting + POSITION), index), dot(vload4(1, lighting + POSITION), index),
                                     dot(vload4(2, lighting + POSITION), index));
    const float3 view = unit_or_zero(position); // from the eye
    const float power = lighting[SPECULAR_POWER];
    const bool two_sided = lighting[TWO_SIDED] != 0.0f;
#ifdef HEADLIGHT
    __global const float *light = lighting + FIRST_LIGHT;
    float facing = dot(normal, view);
    const float reflected = fmax(2.0f * facing * facing - 1.0f, 0.0f); // cosine between the reflected ray and the eye's
    if (two_sided)
        facing = fabs(facing);
    float3 sum = lighting[AMBIENT] * color; // the light's own ambient colour has no part in it
    if (facing > 0.0f) {
        const float3 across = cross(normal, view); // as long as the sine of half the angle to the reflected ray
        sum += facing * lighting[DIFFUSE] * vload3(0, light + LIGHT_DIFFUSE) * color +
               highlight(reflected, 2.0f * dot(across, across), power) * lighting[SPECULAR] *
                   vload3(0, light + LIGHT_SPECULAR);
    }
#else
    float3 ambient = (float3)(0.0f), diffuse = (float3)(0.0f), specular = (float3)(0.0f);
    const int count = (int)lighting[LIGHT_COUNT];
    for (int k = 0; k < count; ++k) {
        __global const float *light = lighting + FIRST_LIGHT + k * LIGHT_SIZE;
        float3 direction = vload3(0, light + LIGHT_DIRECTION);
        float strength = 1.0f;
        bool positional = false;
#ifdef POSITIONAL_LIGHTS
        positional = light[LIGHT_POSITIONAL] != 0.0f;
        if (positional) {
            const float3 from_light = position - vload3(0, light + LIGHT_POSITION);
            const float distance = length(from_light);
            const float3 axis = direction;
            direction = unit_or_zero(from_light);
            strength = 1.0f / (light[LIGHT_ATTENUATION] + light[LIGHT_ATTENUATION + 1] * distance +
                               light[LIGHT_ATTENUATION + 2] * distance * distance);
            if (light[LIGHT_CONE] >= -1.0f) {
                const float inside = dot(direction, axis);
                strength *= inside >= light[LIGHT_CONE] ? pow(fmax(inside, 0.0f), light[LIGHT_EXPONENT]) : 0.0f;
            }
        }
#endif
        float facing = dot(normal, direction);
        if (facing < 0.0f && two_sided)
            facing = -facing;
        if (facing > 0.0f) {
            diffuse += strength * facing * vload3(0, light + LIGHT_DIFFUSE);
            // VTK turns the cosine of a side that faces away, and not its normal: its highlights lie elsewhere
            float3 mirrored = unit_or_zero(2.0f * facing * normal - direction);
            float reflected = dot(view, mirrored);
            if (reflected < 0.0f && two_sided && positional) {
                reflected = -reflected;
                mirrored = -mirrored;
            }
            const float3 chord = view - mirrored;
            if (reflected > 0.0f)
                specular += strength * highlight(reflected, 0.5f * dot(chord, chord), power) *
                            vload3(0, light + LIGHT_SPECULAR);
        }
        ambient += vload3(0, light + LIGHT_AMBIENT);
    }
    // The lights' ambient colours are not multiplied by the sample's: so does VTK
    const float3 sum = lighting[AMBIENT] * ambient + lighting[DIFFUSE] * diffuse * color + lighting[SPECULAR] * specular;
#endif
    return clamp(sum, 0.0f, 1.0f);
}
#endif
