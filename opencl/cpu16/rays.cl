// Sixteen rays in V_O's list space, as one is in raycasting/ray.cl.
//
// 1 / Z along a ray is w_deep + r w_along here: fewer operations; with DEPTH=SHIFTED it is rounded
// otherwise.
//
// -D CROPPED=0, 1   only parts of them are drawn, see lib/cropping.cl
#include "lib/list_space.cl"
#include "lib/cropping.cl"
#include "raycasting/frame.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    Int present;       // those that meet what they are clipped to, and of which something is kept
    Real3 start;       // where they enter it: u, v, depth coordinate
    Real3 deep, along; // point(r) = deep + r along
    Int away;          // from V_O: depth does not decrease along the ray
    Real r_begin;      // 0 or -1; they end at r_begin + 1
    Real scale;        // model length per unit of r, but for the division by w(r_a) w(r_b)
    Real w_deep, w_along;
    Real t_deep;  // t where r is 0
    Real t_scale; // t per unit of r, but for the division by w(r) in perspective
    Kept kept;    // parts of them, in r
} ListRay;

// 1 / Z at r. Not used in parallel projection.
inline Real reciprocal_depth_at(const ListRay *rays, Real r)
{
    return fma(r, rays->w_along, rays->w_deep);
}

typedef Real Time;
#define form_on_ray(form, a, b, t) list_form(form, a, b, t)
#include "raycasting/lengths.cl"

// Begin the rays of pixel offsets (a, b) that are `wanted`, which end at `t_end`; `forms` as for
// begin_ray of raycasting/ray.cl.
inline ListRay begin_rays(__global const float *forms, const Frame *frame, Real a, Real b,
                          Real t_end, Int wanted)
{
    ListRay rays;
    Real t0 = -INFINITY;
    Real t1 = t_end;
    rays.present =
        clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, frame->planes, a, b, &t0, &t1) && wanted;
    // Where nothing is to be drawn, anything finite
    t0 = select((Real)(0.0f), t0, rays.present);
    t1 = select((Real)(1.0f), t1, rays.present);
    const Real t_length = t1 - t0;
    rays.start = list_point(forms, a, b, t0);
    const Real3 end = list_point(forms, a, b, t1);
    rays.along.x = end.x - rays.start.x;
    rays.along.y = end.y - rays.start.y;
    rays.along.z = end.z - rays.start.z;
    rays.along.x = select(rays.along.x, (Real)(0.0f), fabs(rays.along.x) < FLT_MIN);
    rays.along.y = select(rays.along.y, (Real)(0.0f), fabs(rays.along.y) < FLT_MIN);
    rays.away = rays.along.z >= 0.0f;
    rays.deep.x = select(rays.start.x, end.x, rays.away);
    rays.deep.y = select(rays.start.y, end.y, rays.away);
    rays.deep.z = select(rays.start.z, end.z, rays.away);
    rays.r_begin = select((Real)(0.0f), (Real)(-1.0f), rays.away);
    rays.t_deep = select(t0, t1, rays.away);
    rays.t_scale = t_length;
    rays.scale = t_length * model_speed(forms, a, b);
    rays.w_deep = rays.w_along = 0.0f;
    const Real r_other = select((Real)(1.0f), (Real)(-1.0f), rays.away);
    if (DEPTH != PARALLEL) {
        rays.scale *= reciprocal_depth(rays.start.z, frame->depth_origin) *
                      reciprocal_depth(end.z, frame->depth_origin);
        rays.w_deep = reciprocal_depth(rays.deep.z, frame->depth_origin);
        rays.w_along = -rays.along.z;
        if (DEPTH == SHIFTED)
            rays.w_along /= frame->depth_origin;
        rays.t_scale *= reciprocal_depth_at(&rays, r_other); // rounded as along the ray
    }
    if (CROPPED) {
        const Real t_other = select(t1, t0, rays.away);
        rays.kept = kept_parts_of_ray(forms, frame->planes, a, b, rays.t_deep, t_other, r_other,
                                      frame->regions);
        rays.present = rays.present && rays.kept.count > 0;
    }
    return rays;
}
