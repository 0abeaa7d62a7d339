// Cropping: the parts of a ray in the regions that are kept (docs/conventions.md, "Cropping").
//
// Two planes across each axis of the model frame make 27 regions; bit i + 3 j + 9 k of `regions` keeps the i-th along x, the
// j-th along y and the k-th along z, as in vtkVolumeMapper. The planes are forms (lib/rays.cl) that are positive beyond
// them: low x, high x, low y, high y, low z, high z; a high one is never below its low one.
//
// -D CROPPED   the regions that are kept are no box (a box is clipped to); without it nothing of this is compiled
#pragma OPENCL FP_CONTRACT OFF

#ifdef CROPPED
#define CROPPING_PARAMETER uint regions,
#define CROPPING_ARGUMENT regions,
#define CROPPING_PLANES 6
#define MOST_KEPT 4 // six crossings make seven parts, and those that touch are one

typedef struct {
    int count;
    float from[MOST_KEPT], to[MOST_KEPT]; // ascending
} Kept;

// The kept parts of a ray between two parameters, along which the planes' values are linear: `first` at r_first and `last`
// at r_last.
inline Kept kept_parts(const float *first, const float *last, float r_first, float r_last, uint regions)
{
    const float begin = fmin(r_first, r_last);
    const float end = fmax(r_first, r_last);
    float cuts[CROPPING_PLANES + 2];
    cuts[0] = begin;
    for (int k = 0; k < CROPPING_PLANES; ++k) {
        const float rise = last[k] - first[k];
        const float r = rise != 0.0f ? clamp(r_first - (r_last - r_first) * (first[k] / rise), begin, end) : begin;
        int place = k + 1;
        for (; cuts[place - 1] > r; --place)
            cuts[place] = cuts[place - 1];
        cuts[place] = r;
    }
    cuts[CROPPING_PLANES + 1] = end;

    Kept kept;
    kept.count = 0;
    bool open = false; // whether the part before is kept
    for (int part = 0; part <= CROPPING_PLANES; ++part) {
        if (!(cuts[part] < cuts[part + 1]))
            continue;
        const float share = (0.5f * (cuts[part] + cuts[part + 1]) - r_first) / (r_last - r_first);
        int region = 0;
        for (int axis = 2; axis >= 0; --axis) {
            const float low = fma(share, last[2 * axis] - first[2 * axis], first[2 * axis]);
            const float high = fma(share, last[2 * axis + 1] - first[2 * axis + 1], first[2 * axis + 1]);
            region = 3 * region + (low >= 0.0f ? 1 : 0) + (high >= 0.0f ? 1 : 0);
        }
        const bool keeps = regions >> region & 1;
        if (keeps && !open)
            kept.from[kept.count++] = cuts[part];
        if (keeps)
            kept.to[kept.count - 1] = cuts[part + 1];
        open = keeps;
    }
    return kept;
}

// Whether r lies in a kept part.
inline bool is_kept(const Kept *kept, float r)
{
    bool inside = false;
    for (int n = 0; n < kept->count; ++n)
        inside = inside || (r >= kept->from[n] && r < kept->to[n]);
    return inside;
}

// The part of [from, to] that lies in the n-th kept part; empty where not *from < *to.
inline void cut_to_part(const Kept *kept, int n, float *from, float *to)
{
    *from = fmax(*from, kept->from[n]);
    *to = fmin(*to, kept->to[n]);
}
#else
#define CROPPING_PARAMETER
#define CROPPING_ARGUMENT
#endif
