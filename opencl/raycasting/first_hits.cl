// Where each ray of a view enters the first supersegment that reaches an opacity, a ray in a
// work-item.
#include "raycasting/ray.cl"
#pragma OPENCL FP_CONTRACT OFF

// What a ray has met.
typedef struct {
    float least_optical_depth; // a hit has some, and at least this much:
    int accumulated;           // by itself, or with all before it
    float optical_depth;
    bool hit;
    float r;
} Made;

inline bool are_done(const Made *met, const Lists *lists) { return met->hit; }

// Is what a ray crosses of a medium, from r = from to r = to, a hit?
inline void take_medium(Made *met, const ListRay *ray, float from, float to, float4 medium,
                        bool chosen)
{
    if (met->hit)
        return;
    const float optical_depth = medium.w * length_crossed(ray, from, to, true);
    met->optical_depth = met->accumulated ? met->optical_depth + optical_depth : optical_depth;
    met->hit = met->optical_depth > 0.0f && met->optical_depth >= met->least_optical_depth;
    met->r = from;
    for (int n = MOST_KEPT - 1; CROPPED && n >= 0; --n) // where it is first in what is kept
        met->r = from < ray->kept.to[n] ? fmax(from, ray->kept.from[n]) : met->r;
}

#include "raycasting/walk.cl"

__kernel void first_hits(VDI_PARAMETERS, int4 part, float least_optical_depth, int accumulated,
                         __global float *image) // t of the first hit, infinite where there is none
{
    const Rays pixel = rays_of_strips(part, frame.width, frame.height);
    if (!pixel.present)
        return;
    const Lists lists = LISTS_OF_PARAMETERS;
    const Int place = places_in_picture(pixel.x, pixel.y, true, frame.width, frame.height);
    Path path;
    begin_path(&path, forms, &frame, pixel.a, pixel.b, opaque_ends(place, opaque_depth), true);
    Made met = {least_optical_depth, accumulated, 0.0f, false, 0.0f};
    follow(&met, &path, &lists);
    const float passed_by = length_between(&path.ray, path.ray.r_begin, met.r);
    image[place] =
        met.hit ? path.ray.t_begin + passed_by / model_speed(forms, pixel.a, pixel.b) : INFINITY;
}
