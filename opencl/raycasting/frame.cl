// What each kernel takes first that draws a frame of a VDI; raycasting/scene.py hands it over.
#include "raycasting/supersegments.cl"

#define FRAME_PARAMETERS                                                                                         \
    __global const HEADER_T *headers,   /* of the bundles of lists, see raycasting/supersegments.cl */           \
    SUPERSEGMENTS_PARAMETERS            /* see raycasting/supersegments.cl */                                    \
    int lists_wide, int lists_high,     /* window of V_O */                                                      \
    float depth_origin,                 /* world units */                                                        \
    __global const float *forms,        /* list coordinates, model direction, then `planes` to clip to */        \
    int planes,                                                                                                  \
    int width, int height,              /* window of V_N */                                                      \
    __global const float *opaque_depth, /* t at which each pixel's ray ends, top row first, if has_opaque_depth */ \
    int has_opaque_depth,                                                                                        \
    float cutoff,                       /* the ray ends where less transmittance than this is left */            \
    __global const ulong *masks,        /* occupied slabs of each stack, if SKIP_EMPTY */                        \
    float first_depth,                  /* where slab 0 begins, view depth less depth_origin */                  \
    float slabs_per_depth,
