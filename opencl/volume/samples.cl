// Steps that were sampled before they are composited (volume/bricks.cl): of a volume that is on the device brick by brick.
//
// -D SAMPLED  the march takes its steps' media from a buffer; without it nothing of this is compiled
//
// Rays are stored in blocks of 16, step by step, so that neighbouring work-items touch neighbouring words.
#pragma OPENCL FP_CONTRACT OFF

#define SAMPLE_LANES 16

// Where the samples of a work-item begin, of which there is room for `held`.
inline size_t samples_start(uint item, int held)
{
    return (size_t)(item / SAMPLE_LANES) * (size_t)held * SAMPLE_LANES + item % SAMPLE_LANES;
}

// Of the structure Medium, of the kernels that take one, and of its initialiser: see volume/shading.cl
#ifdef SAMPLED
#define SAMPLES_FIELD                                                                          \
    __global const float4 *samples; /* of this ray: colour, optical depth */                   \
    int first_sample;               /* step that the first of them belongs to */
#define SAMPLES_PARAMETER __global const float4 *samples, int held_samples, int first_sample,
#define SAMPLES_ARGUMENT , samples + samples_start((uint)get_global_id(0), held_samples), first_sample
#else
#define SAMPLES_FIELD
#define SAMPLES_PARAMETER
#define SAMPLES_ARGUMENT
#endif
