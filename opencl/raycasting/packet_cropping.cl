// Cropping (lib/cropping.cl) for the rays of a packet (raycasting/packet.cl).
//
// -D CROPPED   as there
#include "lib/cropping.cl"
#include "raycasting/packet.cl"
#pragma OPENCL FP_CONTRACT OFF

#ifdef CROPPED
#define PARTS (CROPPING_PLANES + 1)

typedef struct {
    Ints counts;
    Reals from[MOST_KEPT], to[MOST_KEPT]; // ascending; those that a ray does not have are empty
} KeptOfRays;

// As kept_list_parts, for rays from t0 to t1.
inline KeptOfRays kept_of_rays(const Packet *packet, __global const float *forms, int planes, Reals a, Reals b, Reals t0,
                               Reals t1, uint regions)
{
    __global const float *form = forms + (PLANE_FORMS + planes) * FORM_SIZE;
    const Reals t_deep = select(t0, t1, packet->away);
    const Reals t_other = select(t1, t0, packet->away);
    const Reals r_other = select((Reals)(1.0f), (Reals)(-1.0f), packet->away);
    const Reals begin = packet->r_begin;
    const Reals end = packet->r_begin + 1.0f;
    Reals w_deep = 1.0f, w_other = 1.0f;
#ifndef PARALLEL
    w_deep = 1.0f / values_of_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_deep);
    w_other = 1.0f / values_of_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t_other);
#endif
    Reals at_deep[CROPPING_PLANES], rises[CROPPING_PLANES], cuts[PARTS + 1];
    cuts[0] = begin;
    cuts[PARTS] = end;
    for (int k = 0; k < CROPPING_PLANES; ++k, form += FORM_SIZE) {
        at_deep[k] = values_of_form(form, a, b, t_deep) * w_deep;
        rises[k] = values_of_form(form, a, b, t_other) * w_other - at_deep[k];
        Reals r = select(begin, clamp(-r_other * (at_deep[k] / rises[k]), begin, end), rises[k] != 0.0f);
        for (int place = 1; place <= k; ++place) {
            const Reals before = fmin(cuts[place], r);
            r = fmax(cuts[place], r);
            cuts[place] = before;
        }
        cuts[k + 1] = r;
    }

    KeptOfRays kept;
    kept.counts = 0;
    for (int n = 0; n < MOST_KEPT; ++n) {
        kept.from[n] = INFINITY;
        kept.to[n] = -INFINITY;
    }
    Ints open = 0; // whether the part before is kept
    for (int part = 0; part < PARTS; ++part) {
        const Ints there = cuts[part] < cuts[part + 1];
        const Reals share = 0.5f * (cuts[part] + cuts[part + 1]) * r_other;
        Ints region = 0;
        for (int axis = 2; axis >= 0; --axis) {
            const Ints beyond_low = fma(share, rises[2 * axis], at_deep[2 * axis]) >= 0.0f;
            const Ints beyond_high = fma(share, rises[2 * axis + 1], at_deep[2 * axis + 1]) >= 0.0f;
            region = 3 * region - beyond_low - beyond_high;
        }
        const Ints keeps = -((Ints)((int)regions) >> region & 1);
        const Ints begins = there && keeps && !open;
        for (int n = 0; n < MOST_KEPT; ++n)
            kept.from[n] = select(kept.from[n], cuts[part], begins && kept.counts == n);
        kept.counts -= begins;
        for (int n = 0; n < MOST_KEPT; ++n)
            kept.to[n] = select(kept.to[n], cuts[part + 1], there && keeps && kept.counts == n + 1);
        open = select(open, keeps, there);
    }
    return kept;
}
#endif
