// Cropping: the parts of a ray in the regions that are kept (docs/dev/conventions.md, "Cropping").
//
// Two planes across each axis of the model frame make 27 regions; bit i + 3 j + 9 k of `regions`
// keeps the i-th along x, the j-th along y and the k-th along z, as in vtkVolumeMapper. The planes
// are forms (lib/rays.cl) that are positive beyond them: low x, high x, low y, high y, low z, high
// z; a high one is never below its low one. Rays are clipped to a box: then there are no regions.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#define CROPPING_PLANES 6
#define MOST_KEPT 4 // six crossings make seven parts, and those that touch are one

typedef struct {
    Int count;
    Real from[MOST_KEPT], to[MOST_KEPT]; // ascending; those that a ray does not have are empty
} Kept;

// The kept parts of a ray between two parameters, along which the planes' values are linear:
// `first` at r_first and `last` at r_last. Here and where parts are used, loops go to MOST_KEPT:
// one that ends otherwise for each ray is compiled wrongly by Intel's runtime for CPUs.
inline Kept kept_parts(const Real *first, const Real *last, Real r_first, Real r_last, uint regions)
{
    const Real begin = fmin(r_first, r_last);
    const Real end = fmax(r_first, r_last);
    Real rises[CROPPING_PLANES], cuts[CROPPING_PLANES + 2];
    cuts[0] = begin;
    cuts[CROPPING_PLANES + 1] = end;
    for (int k = 0; k < CROPPING_PLANES; ++k) {
        rises[k] = last[k] - first[k];
        Real r =
            SELECT(begin, clamp(r_first - (r_last - r_first) * (first[k] / rises[k]), begin, end),
                   rises[k] != 0.0f);
        for (int place = 1; place <= k; ++place) {
            const Real before = fmin(cuts[place], r);
            r = fmax(cuts[place], r);
            cuts[place] = before;
        }
        cuts[k + 1] = r;
    }

    Kept kept;
    kept.count = 0;
    for (int n = 0; n < MOST_KEPT; ++n) {
        kept.from[n] = INFINITY;
        kept.to[n] = -INFINITY;
    }
    Int open = 0; // whether the part before is kept
    for (int part = 0; part <= CROPPING_PLANES; ++part) {
        const Int there = cuts[part] < cuts[part + 1];
        const Real share = (0.5f * (cuts[part] + cuts[part + 1]) - r_first) / (r_last - r_first);
        Int region = 0;
        for (int axis = 2; axis >= 0; --axis) {
            const Int beyond_low = fma(share, rises[2 * axis], first[2 * axis]) >= 0.0f;
            const Int beyond_high = fma(share, rises[2 * axis + 1], first[2 * axis + 1]) >= 0.0f;
            region = 3 * region + COUNT(beyond_low) + COUNT(beyond_high);
        }
        const Int keeps = there && ((Int)((int)regions) >> region & 1) != 0;
        const Int begins = keeps && !open;
        for (int n = 0; n < MOST_KEPT; ++n)
            kept.from[n] = SELECT(kept.from[n], cuts[part], begins && kept.count == n);
        kept.count += COUNT(begins);
        for (int n = 0; n < MOST_KEPT; ++n)
            kept.to[n] = SELECT(kept.to[n], cuts[part + 1], keeps && kept.count == n + 1);
        open = SELECT(open, keeps, there);
    }
    return kept;
}

// Whether r lies in a kept part.
inline Int is_kept(const Kept *kept, Real r)
{
    Int inside = 0;
    for (int n = 0; n < MOST_KEPT; ++n)
        inside = inside || (r >= kept->from[n] && r < kept->to[n]);
    return inside;
}

// The part of [from, to] that lies in the n-th kept part; empty where not *from < *to.
inline void cut_to_part(const Kept *kept, int n, Real *from, Real *to)
{
    *from = fmax(*from, kept->from[n]);
    *to = fmin(*to, kept->to[n]);
}
