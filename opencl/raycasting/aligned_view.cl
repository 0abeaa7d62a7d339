// VDI to image at V_O, where the pixels of the picture are those of the VDI's window, or some of them, or more: what
// raycasting/raycast.cl does, where the ray of each pixel goes through a list of its own from front to back, and through no other.
//
// A work-item draws a packet of LANES pixels: those of PACKET_BUNDLES bundles of lists side by side. What
// these hold lies in one piece of memory (raycasting/supersegments.cl), and one packet's behind the other's; so it is loaded in
// whole vectors, and nothing is gathered or searched for. (Lists of 8-byte supersegments do not lie in bundles: here, four side
// by side are called one, and their words are loaded one by one.) Only depth matters: a supersegment is clipped to the ray
// in the depth coordinate, and a length is a difference of it over the reciprocal depths at both ends.
//
// -D OFFSET_T, PARALLEL, SHIFTED, PACKED, COMPENSATED (1)    as in raycasting/raycast.cl
#define LANES 16
#include "lib/compositing.cl"
#include "lib/transpose.cl"
#include "raycasting/list_rays.cl"
#include "raycasting/pixels.cl"
#include "raycasting/frame.cl"
#pragma OPENCL FP_CONTRACT OFF

// Lane p * PACKET_BUNDLES + n has place p in the n-th bundle: vectors of bundles become vectors of lanes within each 128 bits
#define PACKET_BUNDLES 4
#if defined(PACKED) && PACKED == 8
#define BUNDLE_WIDE 4
#define BUNDLE_HIGH 1
#define LANE_X (Int)(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15)
#define LANE_Y (Int)(0)
#else
#define BUNDLE_WIDE BUNDLE
#define BUNDLE_HIGH BUNDLE
#define LANE_X (Int)(0, 2, 4, 6, 1, 3, 5, 7, 0, 2, 4, 6, 1, 3, 5, 7)
#define LANE_Y (Int)(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1)
#endif
#define PACKET_WIDE (LANES / BUNDLE_HIGH) // pixels
// The same of one lane, from the packet's first pixel
#define X_OF(lane) ((lane) % PACKET_BUNDLES * BUNDLE_WIDE + (lane) / PACKET_BUNDLES % BUNDLE_WIDE)
#define Y_OF(lane) ((lane) / PACKET_BUNDLES / BUNDLE_WIDE)

// The form of V_O's depth, or of that less a number
#ifdef PARALLEL
#define Z_FORM DEPTH_FORM
#else
#define Z_FORM DENOMINATOR_FORM
#endif

// Reciprocal depth at a depth coordinate; times the depth origin if SHIFTED
#ifdef SHIFTED
#define NEARNESS(z) (1.0f - (z))
#else
#define NEARNESS(z) (-(z))
#endif

typedef struct {
    Real front, back; // depth coordinates
#ifdef PACKED
    Uint words[2]; // as loaded with them: 16 bytes: extinction, colour; 8 bytes: all
#endif
} Faces;

// Bring lines of the cache close.
inline void fetch_lines(__global const ulong *words, OFFSET_T first, OFFSET_T end)
{
    for (OFFSET_T k = first; k < end; k += WORDS_PER_LINE)
        prefetch(words + k, 1);
}

#if defined(PACKED) && PACKED == 8
// The lists of a packet, lane by lane.
typedef struct {
    List list;     // of each, behind `begin`; one that has none has another one's entry, if there is one; 0 beside the window
    int longest;   // the most supersegments
    OFFSET_T begin;
} Lists;

inline Lists lists_at(__global const HEADER_T *headers, SUPERSEGMENTS_PARAMETERS int i, int j, int lists_wide, int lists_high,
                      float depth_origin)
{
    Lists lists;
    lists.longest = 0;
    if (i < 0 || i >= lists_wide || j < 0 || j >= lists_high)
        return lists;
    const int wide = min(lists_wide - i, PACKET_WIDE);
    __global const HEADER_T *const begins = headers + ((size_t)j * lists_wide + i);
    lists.begin = begins[0];
    if (begins[wide] == lists.begin)
        return lists;
    int counts[LANES], firsts[LANES], origins[LANES], strides[LANES];
    float per_codes[LANES];
    int any_lane = 0;
    for (int lane = 0; lane < LANES; ++lane) {
        const int dx = X_OF(lane);
        const int first = dx < wide ? (int)(begins[dx] - lists.begin) + LIST_HEADER : 0;
        counts[lane] = dx < wide ? max((int)(begins[dx + 1] - lists.begin) - first, 0) : 0;
        firsts[lane] = first;
        any_lane = counts[lane] > 0 ? lane : any_lane;
        lists.longest = max(lists.longest, counts[lane]);
    }
    for (int lane = 0; lane < LANES; ++lane) {
        firsts[lane] = firsts[counts[lane] > 0 ? lane : any_lane];
        __global const uint2 *const scale = words + lists.begin + firsts[lane] - LIST_HEADER;
        origins[lane] = as_int(scale[0].x);
        strides[lane] = as_int(scale[0].y);
        per_codes[lane] = as_float(scale[1].x);
    }
    lists.list.count = vload16(0, counts);
    lists.list.first = vload16(0, firsts);
    lists.list.origin = vload16(0, origins);
    lists.list.stride = vload16(0, strides);
    lists.list.per_code = vload16(0, per_codes);
    lists.list.step = constants[0];
    lists.list.nearest = constants[1];
    lists.list.depths = depth_origin;
    return lists;
}

// The first `depth` supersegments of all lists.
inline void fetch(SUPERSEGMENTS_PARAMETERS const Lists *lists, int depth)
{
    int firsts[LANES], ends[LANES];
    vstore16(lists->list.first, 0, firsts);
    vstore16(lists->list.first + min(lists->list.count, depth), 0, ends);
    for (int lane = 0; lane < LANES; ++lane)
        fetch_lines((__global const ulong *)words, lists->begin + firsts[lane], lists->begin + ends[lane]);
}

inline Faces faces_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k)
{
    int places[LANES];
    vstore16(entry_of(&lists->list, select((Int)(0), (Int)(k), k < lists->list.count)), 0, places);
    __global const ulong *const from = (__global const ulong *)words + lists->begin;
    const Uint low_lanes = as_uint16((ulong8)(from[places[0]], from[places[1]], from[places[2]], from[places[3]],
                                                from[places[4]], from[places[5]], from[places[6]], from[places[7]]));
    const Uint high_lanes = as_uint16((ulong8)(from[places[8]], from[places[9]], from[places[10]], from[places[11]],
                                                 from[places[12]], from[places[13]], from[places[14]], from[places[15]]));
    Faces at;
    at.words[0] = (uint16)(low_lanes.even, high_lanes.even);
    at.words[1] = (uint16)(low_lanes.odd, high_lanes.odd);
    at.front = FRONT_OF_WORD(&lists->list, at.words[0]);
    at.back = BACK_OF_WORD(&lists->list, at.words[0]);
    return at;
}

inline Real4 media_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, Faces at)
{
    return medium_of(&lists->list, at.words[0], at.words[1]);
}

#else
// The lists of a packet, bundle by bundle.
typedef struct {
    List list;                      // of each lane only the count, of entries; 0 beside the window
    int longest;                    // the most of them
    int counts[PACKET_BUNDLES];
    OFFSET_T first[PACKET_BUNDLES]; // entry; of a bundle that has none, another one's, if there is one
} Lists;

inline Lists lists_at(__global const HEADER_T *headers, SUPERSEGMENTS_PARAMETERS int i, int j, int lists_wide, int lists_high,
                      float depth_origin)
{
    Lists lists;
    lists.longest = 0;
    if (i < 0 || j < 0 || j >= lists_high)
        return lists;
    OFFSET_T any_first = 0;
    for (int n = 0; n < PACKET_BUNDLES; ++n) {
        const int column = i + n * BUNDLE;
        const ulong header = column < lists_wide ? headers[BUNDLE_OF_LIST(column, j, lists_wide)] : 0;
        lists.first[n] = first_of_header(header);
        lists.counts[n] = count_of_header(header);
        lists.longest = max(lists.longest, lists.counts[n]);
        any_first = lists.counts[n] > 0 ? lists.first[n] : any_first;
    }
    for (int n = 0; n < PACKET_BUNDLES; ++n)
        lists.first[n] = lists.counts[n] > 0 ? lists.first[n] : any_first;
    const int4 counts = vload4(0, lists.counts);
    lists.list.count = (Int)(counts, counts, counts, counts);
    return lists;
}

// The first `depth` supersegments of all lists.
inline void fetch(SUPERSEGMENTS_PARAMETERS const Lists *lists, int depth)
{
    for (int n = 0; n < PACKET_BUNDLES; ++n) {
        const OFFSET_T first = lists->first[n];
        const OFFSET_T end = first + min(depth, lists->counts[n]) * LISTS_PER_BUNDLE;
#ifdef PACKED
        fetch_lines(supersegments, 2 * first, 2 * end);
#else
        fetch_lines(faces, first, end);
        fetch_lines(media, 2 * first, 2 * end);
#endif
    }
}

// Entry of the k-th supersegment of a bundle's first list; of any, if the bundle has no more.
inline OFFSET_T entry_at(const Lists *lists, int n, int k)
{
    return lists->first[n] + (k < lists->counts[n] ? k * LISTS_PER_BUNDLE : 0);
}

// `words` of 8 bytes, two of which an entry takes.
inline Real4 numbers_at(__global const ulong *words, const Lists *lists, int k)
{
#define OF_BUNDLE(n) vload16(0, (__global const float *)(words + 2 * entry_at(lists, n, k)))
    return transpose(REAL4(OF_BUNDLE(0), OF_BUNDLE(1), OF_BUNDLE(2), OF_BUNDLE(3)));
#undef OF_BUNDLE
}

#ifdef PACKED
inline Faces faces_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k)
{
    const Real4 numbers = numbers_at(supersegments, lists, k);
    const Faces at = {numbers.x, numbers.y, {AS_UINT(numbers.z), AS_UINT(numbers.w)}};
    return at;
}

inline Real4 media_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, Faces at)
{
    return medium_of(at.words[0], at.words[1]);
}
#else
inline float8 faces_of_bundle(__global const ulong *faces, const Lists *lists, int n, int k)
{
    return vload8(0, (__global const float *)(faces + entry_at(lists, n, k)));
}

inline Faces faces_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k)
{
    const Real of_01 = (Real)(faces_of_bundle(faces, lists, 0, k), faces_of_bundle(faces, lists, 1, k));
    const Real of_23 = (Real)(faces_of_bundle(faces, lists, 2, k), faces_of_bundle(faces, lists, 3, k));
    const Faces at = {((Real)(of_01.even, of_23.even)).s048c159d26ae37bf, ((Real)(of_01.odd, of_23.odd)).s048c159d26ae37bf};
    return at;
}

inline Real4 media_at(SUPERSEGMENTS_PARAMETERS const Lists *lists, int k, Faces at)
{
    return numbers_at(media, lists, k);
}
#endif
#endif

KERNEL_OF_LANES void raycast_aligned_view(
    FRAME_PARAMETERS                    // masks are not looked at: lists say by themselves what is empty
    int2 origin,                        // the pixel of list (0, 0); maybe beside the window
    __global float4 *image)             // premultiplied RGBA, top row first
{
    // Packets begin at multiples of their size, in lists
    const int first_i = -origin.x & -PACKET_WIDE, first_j = -origin.y & -BUNDLE_HIGH;
    const int packets_wide = (width - origin.x - first_i + PACKET_WIDE - 1) / PACKET_WIDE;
    const int packet = (int)get_global_id(0);
    const int i = first_i + packet % packets_wide * PACKET_WIDE;
    const int j = first_j + packet / packets_wide * BUNDLE_HIGH;
    const int x = i + origin.x, y = j + origin.y;
    if (y >= height)
        return;
    const bool whole = x >= 0 && x + PACKET_WIDE <= width && y >= 0 && y + BUNDLE_HIGH <= height;
    const long place = (long)(height - 1 - y) * width + x; // of the first pixel; row y + 1 is a width before
// Whether a pixel of the packet is one of the window's
#define IS_IN_WINDOW(dx, dy) (x + (dx) >= 0 && x + (dx) < width && y + (dy) >= 0 && y + (dy) < height)

    Seen seen = nothing_seen();
    const Lists lists = lists_at(headers, SUPERSEGMENTS_ARGUMENTS i, j, lists_wide, lists_high, depth_origin);
    if (lists.longest > 0) {
        Real t_end = INFINITY;
        if (has_opaque_depth) {
            float ends[LANES];
            for (int lane = 0; lane < LANES; ++lane) {
                const int dx = X_OF(lane), dy = Y_OF(lane);
                ends[lane] = whole || IS_IN_WINDOW(dx, dy) ? opaque_depth[place + dx - dy * width] : 0.0f;
            }
            t_end = vload16(0, ends);
        }
        const Real a = offsets_from_middle(x + LANE_X, width);
        const Real b = offsets_from_middle(y + LANE_Y, height);
        const Int wanted = IS_IN_WINDOW(LANE_X, LANE_Y) && i + LANE_X < lists_wide && j + LANE_Y < lists_high &&
                            lists.list.count > 0;
        Real t0 = -INFINITY, t1 = t_end;
        Int going = clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, planes, a, b, &t0, &t1) && wanted;
        const Real begin = list_depth(forms, a, b, SELECT((Real)(0.0f), t0, going));
        const Real end = list_depth(forms, a, b, SELECT((Real)(1.0f), t1, going));
        // Model length per unit of V_O's depth
        Real scale = model_speed(forms, a, b) / form_slope(forms + Z_FORM * FORM_SIZE, a, b);
#ifdef SHIFTED
        scale *= depth_origin;
#endif
        int k = 0;
        for (; k < lists.longest; ++k) {
            const Faces at = faces_at(SUPERSEGMENTS_ARGUMENTS &lists, k);
            going = going && k < lists.list.count && at.front < end && !(seen.sums.w < cutoff);
            const Real from = HIGHER_OF(at.front, begin);
            const Real to = LOWER_OF(at.back, end);
            const Int meet = going && from < to;
            if (!ANY(meet)) {
                if (!ANY(going))
                    break;
                continue;
            }
            const Real4 medium = media_at(SUPERSEGMENTS_ARGUMENTS &lists, k, at);
#ifdef PARALLEL
            const Real lengths = scale * (to - from);
#else
            const Real lengths = scale * (to - from) / (NEARNESS(from) * NEARNESS(to));
#endif
            composite_medium(&seen, medium.w * lengths, medium, meet);
        }
        // The next packet, which comes to about the same depth: all at once, as loads in the loop are not
        const Lists next = lists_at(headers, SUPERSEGMENTS_ARGUMENTS i + PACKET_WIDE, j, lists_wide, lists_high, depth_origin);
        fetch(SUPERSEGMENTS_ARGUMENTS &next, k + 1);
        // The others have looked at what is not theirs, or lies beside V_O's window, where there may be anything
        seen.sums.x = select((Real)(0.0f), seen.sums.x, wanted);
        seen.sums.y = select((Real)(0.0f), seen.sums.y, wanted);
        seen.sums.z = select((Real)(0.0f), seen.sums.z, wanted);
    }

    const Real4 pixels = transpose(composited(&seen)); // of each bundle, row by row
    const Real of_bundle[PACKET_BUNDLES] = {pixels.x, pixels.y, pixels.z, pixels.w};
    for (int n = 0; n < PACKET_BUNDLES; ++n) {
        __global float4 *const target = image + place + n * BUNDLE_WIDE;
        if (whole) {
#if BUNDLE_HIGH == 1
            vstore16(of_bundle[n], 0, (__global float *)target);
#else
            vstore8(of_bundle[n].lo, 0, (__global float *)target);
            vstore8(of_bundle[n].hi, 0, (__global float *)(target - width));
#endif
            continue;
        }
        float4 colors[BUNDLE_WIDE * BUNDLE_HIGH];
        vstore16(of_bundle[n], 0, (float *)colors);
        for (int p = 0; p < BUNDLE_WIDE * BUNDLE_HIGH; ++p) {
            const int dx = p % BUNDLE_WIDE, dy = p / BUNDLE_WIDE;
            if (IS_IN_WINDOW(n * BUNDLE_WIDE + dx, dy))
                target[dx - dy * width] = colors[p];
        }
    }
}
