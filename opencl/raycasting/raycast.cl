// The picture of a VDI from any view: the paper's raycaster (section 3). A ray or a block of 4 x 4
// in a work-item (lib/lanes.cl).
#include "lib/compositing.cl"
#include "raycasting/ray.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef Seen Made;

inline Int are_done(const Seen *seen, const Lists *lists)
{
    return seen->sums.w < lists->frame.cutoff;
}

// Composite what the rays that are chosen cross of a medium, from r = from to r = to. medium.w is
// the extinction: optical depth for each unit of model length.
inline void take_medium(Seen *seen, const ListRay *ray, Real from, Real to, Real4 medium,
                        Int chosen)
{
    composite_medium(seen, medium.w * length_crossed(ray, from, to, chosen), medium, chosen);
}

#include "raycasting/walk.cl"

KERNEL_OF_LANES void raycast(VDI_PARAMETERS,
                             int4 part,              // of the window, see lib/rays.cl
                             __global float4 *image) // premultiplied RGBA, top row first
{
    const Rays pixel = rays_of_strips(part, frame.width, frame.height);
    if (!ANY(pixel.present))
        return;
    const Lists lists = LISTS_OF_PARAMETERS;
    const Int place = places_in_picture(pixel.x, pixel.y, pixel.present, frame.width, frame.height);
    Path path;
    begin_path(&path, forms, &frame, pixel.a, pixel.b, opaque_ends(place, opaque_depth),
               pixel.present);
    Seen seen = nothing_seen();
    follow(&seen, &path, &lists);
    store_fours(image, place, composited(&seen));
}
