// What every kernel takes that draws a frame of a VDI (pyvista_vdi/raycasting/frame.py).
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    int lists_wide, lists_high;       // window of V_O
    int width, height;                // window of V_N
    int planes;                       // to clip to, of the forms
    float depth_origin;               // world units
    float cutoff;                     // a ray ends where less transmittance than this is left
    float first_depth;                // where slab 0 begins, view depth less depth_origin
    float slabs_per_depth;            // per world unit
    float depth_step, nearest_offset; // of 8-byte lists: of depth; least in front of the eye
    uint regions;                     // of cropping that are kept, see lib/cropping.cl
} Frame;

#define BLOCK 4 // rays along each edge of a block, in which pixels are dealt to work-items
