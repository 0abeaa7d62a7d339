// Formulas of a ray in V_O's list space, or of sixteen (lib/lanes.cl): what cropping keeps of it,
// t, and model lengths.
//
// Who includes this says before what a ListRay is, with its reciprocal_depth_at, of which type t is
// (Time), and form_on_ray, the value of a form at t.
#include "lib/cropping.cl"
#pragma OPENCL FP_CONTRACT OFF

// The kept parts of a ray from t_deep, where r is 0, to t_other. Over the homogeneous denominator,
// what is affine in t is linear in r.
inline Kept kept_parts_of_ray(__global const float *forms, int planes, Real a, Real b, Time t_deep,
                              Time t_other, Real r_other, uint regions)
{
    __global const float *form = forms + (PLANE_FORMS + planes) * FORM_SIZE;
    Real at_deep[CROPPING_PLANES], at_other[CROPPING_PLANES];
    Real w_deep = 1.0f, w_other = 1.0f;
    if (DEPTH != PARALLEL) {
        w_deep = 1.0f / form_on_ray(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_deep);
        w_other = 1.0f / form_on_ray(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_other);
    }
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        at_deep[k] = form_on_ray(form, a, b, t_deep) * w_deep;
        at_other[k] = form_on_ray(form, a, b, t_other) * w_other;
    }
    return kept_parts(at_deep, at_other, (Real)(0.0f), r_other, regions);
}

// t at r. With w = 1/Z linear in r and Z linear in t, the share of the ray between r and its deep
// end is r w_shallow / w(r): small where r is, so that nothing cancels there.
inline Real ray_time(const ListRay *ray, Real r)
{
    if (DEPTH == PARALLEL)
        return fma(r, ray->t_scale, ray->t_deep);
    return ray->t_deep + r * ray->t_scale / reciprocal_depth_at(ray, r);
}

// Model length from r = from to r = to.
inline Real length_between(const ListRay *ray, Real from, Real to)
{
    if (DEPTH == PARALLEL)
        return ray->scale * (to - from);
    return ray->scale * (to - from) /
           (reciprocal_depth_at(ray, from) * reciprocal_depth_at(ray, to));
}

// The same of what is kept between them, of the rays that are chosen.
inline Real length_crossed(const ListRay *ray, Real from, Real to, Int chosen)
{
    if (!CROPPED)
        return length_between(ray, from, to);
    Real length = 0.0f;
    for (int n = 0; n < MOST_KEPT; ++n) { // not to an end of each ray's own, see lib/cropping.cl
        if (LANES > 1 && !ANY(chosen && ray->kept.count > n))
            break;
        Real kept_from = from, kept_to = to;
        cut_to_part(&ray->kept, n, &kept_from, &kept_to);
        length +=
            SELECT((Real)(0.0f), length_between(ray, kept_from, kept_to), kept_from < kept_to);
    }
    return length;
}
