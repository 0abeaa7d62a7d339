// The runs of one ray, and the record in which they lie; of sixteen rays:
// cpu16/generation_records.cl.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

// Which compilers keep in registers where they put a structure into memory. It holds components
// together, and what is computed is computed from one component at a time: compilers that put
// work-items into the lanes of a vector then have nothing to take apart and to put together again.
typedef float8 Run;
#define FRONT s0 // t of the ray
#define BACK s1
#define TAU s2           // optical depth
#define TRANSMITTANCE s3 // from the eye to the front face
#define RED s4           // premultiplied by the run's opacity
#define GREEN s5
#define BLUE s6
#define COLOR s456
#define OPACITY s7 // 1 - exp(-tau), accumulated
#define RUN(front, back, tau, before, red, green, blue, opacity)                                   \
    (float8)(front, back, tau, before, red, green, blue, opacity)
#include "generation/runs.cl"

// merged_runs, where very many samples become one run: `compensation` is what the sums have rounded
// off so far (Kahan), see lib/compositing.cl.
inline Run merged_runs_compensated(Run a, Run b, Run *compensation)
{
    const float through = 1.0f - a.OPACITY;
    const Run term =
        (Run)(0.0f, 0.0f, b.TAU, 0.0f, through * b.COLOR, through * b.OPACITY) - *compensation;
    Run run = a + term;
    *compensation = (run - a) - term;
    run.FRONT = a.FRONT;
    run.BACK = b.BACK;
    run.TRANSMITTANCE = a.TRANSMITTANCE;
    return run;
}

// A run moves as four words of 8 bytes, because the number of loads and stores is what counts where
// a vector's lanes go to different places.
inline Run load_run(__global const float *records, int k)
{
    __global const ulong *words = (__global const ulong *)(records + k * RUN_WORDS);
    return (Run)(as_float2(words[0]), as_float2(words[1]), as_float2(words[2]),
                 as_float2(words[3]));
}

inline void store_run(__global float *records, int k, Run run)
{
    __global ulong *words = (__global ulong *)(records + k * RUN_WORDS);
    words[0] = as_ulong(run.s01);
    words[1] = as_ulong(run.s23);
    words[2] = as_ulong(run.s45);
    words[3] = as_ulong(run.s67);
}
