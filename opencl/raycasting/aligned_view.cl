// The picture of raycasting/raycast.cl at V_O, where the pixels of the picture are those of the
// VDI's window, or some of them, or more: the ray of each goes through a list of its own from front
// to back, and through no other (docs/decisions/aligned_view.md).
//
// A work-item draws a packet of LANES pixels: those of PACKET_BUNDLES bundles of lists side by
// side. What these hold lies in one piece of memory (raycasting/supersegments.cl), and one packet's
// behind the other's; so it is loaded in whole vectors, and nothing is gathered or searched for.
// (Lists of 8-byte supersegments do not lie in bundles: here, four side by side are called one, and
// their words are loaded one by one.) Only depth matters: a supersegment is clipped to the ray in
// the depth coordinate, and a length is a difference of it over the reciprocal depths at both ends.
#define LANES 16
#include "lib/compositing.cl"
#include "lib/transpose.cl"
#include "raycasting/supersegments.cl"
#pragma OPENCL FP_CONTRACT OFF

// Lane p * PACKET_BUNDLES + n has place p in the n-th bundle: vectors of bundles become vectors of
// lanes within each 128 bits
#define PACKET_BUNDLES 4
#define BUNDLE_WIDE (PACKED ? 4 : BUNDLE)
#define BUNDLE_HIGH (PACKED ? 1 : BUNDLE)
#define PACKET_WIDE (LANES / BUNDLE_HIGH) // pixels
// Each lane's pixel, from the packet's first; and the same of one lane
#define LANE_X                                                                                     \
    (PACKED ? (Int)(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15)                          \
            : (Int)(0, 2, 4, 6, 1, 3, 5, 7, 0, 2, 4, 6, 1, 3, 5, 7))
#define LANE_Y (PACKED ? (Int)(0) : (Int)(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1))
#define X_OF(lane) ((lane) % PACKET_BUNDLES * BUNDLE_WIDE + (lane) / PACKET_BUNDLES % BUNDLE_WIDE)
#define Y_OF(lane) ((lane) / PACKET_BUNDLES / BUNDLE_WIDE)

// The lists of a packet, bundle by bundle; of 8 bytes, lane by lane.
typedef struct {
    int longest;                     // the most supersegments
    Int count;                       // of each lane; 0 beside the window
    int counts[PACKET_BUNDLES];      // of entries
    OFFSET_T firsts[PACKET_BUNDLES]; // entry; of a bundle that has none, another one's, if any
    OFFSET_T begin;                  // of 8 bytes: the packet's, and behind it:
    Int first;                       // entry; of a list that has none, another one's, if any
    Int origin, stride;
    Real per_code;
} PacketLists;

typedef struct {
    Real front, back; // depth coordinates
    Uint words[2];    // if packed, what is loaded with them: extinction, colour; all of 8 bytes
} PacketFaces;

// Four bundles of lists from list (i, j) on.
inline PacketLists bundles_at(const Lists *in, int i, int j)
{
    PacketLists lists;
    lists.longest = 0;
    if (i < 0 || j < 0 || j >= in->frame.lists_high)
        return lists;
    OFFSET_T any_first = 0;
    for (int n = 0; n < PACKET_BUNDLES; ++n) {
        const int column = i + n * BUNDLE;
        const ulong header = column < in->frame.lists_wide
                                 ? in->headers[BUNDLE_OF_LIST(column, j, in->frame.lists_wide)]
                                 : 0;
        lists.firsts[n] = first_of_header(header);
        lists.counts[n] = count_of_header(header);
        lists.longest = max(lists.longest, lists.counts[n]);
        any_first = lists.counts[n] > 0 ? lists.firsts[n] : any_first;
    }
    for (int n = 0; n < PACKET_BUNDLES; ++n)
        lists.firsts[n] = lists.counts[n] > 0 ? lists.firsts[n] : any_first;
    const int4 counts = vload4(0, lists.counts);
    lists.count = (Int)(counts, counts, counts, counts);
    return lists;
}

// Sixteen lists of 8 bytes from list (i, j) on.
inline PacketLists lists_in_row(const Lists *in, int i, int j)
{
    PacketLists lists;
    lists.longest = 0;
    if (i < 0 || i >= in->frame.lists_wide || j < 0 || j >= in->frame.lists_high)
        return lists;
    const int wide = min(in->frame.lists_wide - i, PACKET_WIDE);
    __global const ulong *const headers = in->headers + ((size_t)j * in->frame.lists_wide + i);
    lists.begin = first_of_header(headers[0]);
    int counts[LANES], firsts[LANES], origins[LANES], strides[LANES];
    float per_codes[LANES];
    int any_lane = 0;
    for (int lane = 0; lane < LANES; ++lane) {
        const int dx = X_OF(lane);
        const ulong header = dx < wide ? headers[dx] : headers[0];
        counts[lane] = dx < wide ? count_of_header(header) : 0;
        firsts[lane] = (int)(first_of_header(header) - lists.begin);
        any_lane = counts[lane] > 0 ? lane : any_lane;
        lists.longest = max(lists.longest, counts[lane]);
    }
    if (lists.longest == 0)
        return lists;
    for (int lane = 0; lane < LANES; ++lane) {
        firsts[lane] = firsts[counts[lane] > 0 ? lane : any_lane];
        __global const uint2 *const scale =
            (__global const uint2 *)in->faces + lists.begin + firsts[lane] - LIST_HEADER;
        origins[lane] = as_int(scale[0].x);
        strides[lane] = as_int(scale[0].y);
        per_codes[lane] = as_float(scale[1].x);
    }
    lists.count = vload16(0, counts);
    lists.first = vload16(0, firsts);
    lists.origin = vload16(0, origins);
    lists.stride = vload16(0, strides);
    lists.per_code = vload16(0, per_codes);
    return lists;
}

inline PacketLists packet_at(const Lists *in, int i, int j)
{
    if (PACKED)
        return lists_in_row(in, i, j);
    return bundles_at(in, i, j);
}

// Bring lines of the cache close.
inline void fetch_lines(__global const ulong *words, OFFSET_T first, OFFSET_T end)
{
    for (OFFSET_T k = first; k < end; k += WORDS_PER_LINE)
        prefetch(words + k, 1);
}

// Bring the first `depth` supersegments of all lists close.
inline void fetch(const Lists *in, const PacketLists *lists, int depth)
{
    if (PACKED) {
        int firsts[LANES], ends[LANES];
        vstore16(lists->first, 0, firsts);
        vstore16(lists->first + min(lists->count, depth), 0, ends);
        for (int lane = 0; lane < LANES; ++lane)
            fetch_lines(in->faces, lists->begin + firsts[lane], lists->begin + ends[lane]);
        return;
    }
    for (int n = 0; n < PACKET_BUNDLES; ++n) {
        const OFFSET_T first = lists->firsts[n];
        const OFFSET_T end = first + min(depth, lists->counts[n]) * LISTS_PER_BUNDLE;
        fetch_lines(in->faces, first, end);
        fetch_lines(in->media, 2 * first, 2 * end);
    }
}

// Entry of the k-th supersegment of a bundle's first list; of any, if the bundle has no more.
inline OFFSET_T entry_at(const PacketLists *lists, int n, int k)
{
    return lists->firsts[n] + (k < lists->counts[n] ? k * LISTS_PER_BUNDLE : 0);
}

// `words` of 8 bytes, two of which an entry takes.
inline Real4 numbers_at(__global const ulong *words, const PacketLists *lists, int k)
{
#define OF_BUNDLE(n) vload16(0, (__global const float *)(words + 2 * entry_at(lists, n, k)))
    return transpose(REAL4(OF_BUNDLE(0), OF_BUNDLE(1), OF_BUNDLE(2), OF_BUNDLE(3)));
#undef OF_BUNDLE
}

inline float8 faces_of_bundle(__global const ulong *faces, const PacketLists *lists, int n, int k)
{
    return vload8(0, (__global const float *)(faces + entry_at(lists, n, k)));
}

// The k-th supersegments of all lists.
inline PacketFaces packet_faces(const Lists *in, const PacketLists *lists, int k, Depths depths)
{
    PacketFaces at;
    if (PACKED) {
        int at_lane[LANES];
        vstore16(lists->first + select((Int)(0), (Int)(k), k < lists->count), 0, at_lane);
        __global const ulong *const from = in->faces + lists->begin;
        const Uint low_lanes = as_uint16(
            (ulong8)(from[at_lane[0]], from[at_lane[1]], from[at_lane[2]], from[at_lane[3]],
                     from[at_lane[4]], from[at_lane[5]], from[at_lane[6]], from[at_lane[7]]));
        const Uint high_lanes = as_uint16(
            (ulong8)(from[at_lane[8]], from[at_lane[9]], from[at_lane[10]], from[at_lane[11]],
                     from[at_lane[12]], from[at_lane[13]], from[at_lane[14]], from[at_lane[15]]));
        at.words[0] = (Uint)(low_lanes.even, high_lanes.even);
        at.words[1] = (Uint)(low_lanes.odd, high_lanes.odd);
        at.front = depths_of_codes(in, lists->origin, lists->stride, at.words[0], depths);
        at.back = depths_of_codes(in, lists->origin, lists->stride, at.words[0] >> 14, depths);
    } else {
        const Real of_01 = (Real)(faces_of_bundle(in->faces, lists, 0, k),
                                  faces_of_bundle(in->faces, lists, 1, k));
        const Real of_23 = (Real)(faces_of_bundle(in->faces, lists, 2, k),
                                  faces_of_bundle(in->faces, lists, 3, k));
        at.front = ((Real)(of_01.even, of_23.even)).s048c159d26ae37bf;
        at.back = ((Real)(of_01.odd, of_23.odd)).s048c159d26ae37bf;
    }
    return at;
}

// Their media.
inline Real4 packet_media(const Lists *in, const PacketLists *lists, int k, PacketFaces at)
{
    if (!PACKED)
        return numbers_at(in->media, lists, k);
    return media_of_words(at.words[0], at.words[1], lists->per_code);
}

KERNEL_OF_LANES void raycast_aligned_view(
    VDI_PARAMETERS, // masks are not looked at: lists say by themselves what is empty
    int2 origin,    // the pixel of list (0, 0); maybe beside the window
    __global float4 *image)
{
    const int width = frame.width, height = frame.height;
    const Lists in = LISTS_OF_PARAMETERS;
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
    const long place =
        (long)(height - 1 - y) * width + x; // of the first pixel; row y + 1 is a width before
// Whether a pixel of the packet is one of the window's
#define IS_IN_WINDOW(dx, dy)                                                                       \
    (x + (dx) >= 0 && x + (dx) < width && y + (dy) >= 0 && y + (dy) < height)

    Seen seen = nothing_seen();
    const PacketLists lists = packet_at(&in, i, j);
    if (lists.longest > 0) {
        Real t_end = INFINITY;
        if (opaque_depth) {
            float ends[LANES];
            for (int lane = 0; lane < LANES; ++lane) {
                const int dx = X_OF(lane), dy = Y_OF(lane);
                ends[lane] =
                    whole || IS_IN_WINDOW(dx, dy) ? opaque_depth[place + dx - dy * width] : 0.0f;
            }
            t_end = vload16(0, ends);
        }
        const Real a = offsets_from_middle(x + LANE_X, width);
        const Real b = offsets_from_middle(y + LANE_Y, height);
        const Int wanted = IS_IN_WINDOW(LANE_X, LANE_Y) && i + LANE_X < frame.lists_wide &&
                           j + LANE_Y < frame.lists_high && lists.count > 0;
        Real t0 = -INFINITY, t1 = t_end;
        Int going =
            clip_to_planes(forms + PLANE_FORMS * FORM_SIZE, frame.planes, a, b, &t0, &t1) && wanted;
        const Real begin = list_depth(forms, a, b, select((Real)(0.0f), t0, going));
        const Real end = list_depth(forms, a, b, select((Real)(1.0f), t1, going));
        // Model length per unit of V_O's depth, whose form is, up to a number, that of the offset
        // or the denominator, and over the reciprocal depths at both ends: first + slope z, times
        // the origin if SHIFTED
        const Depths depths = {frame.depth_kind, frame.depth_origin};
        const int z_form = depths.kind == PARALLEL ? DEPTH_FORM : DENOMINATOR_FORM;
        Real scale = model_speed(forms, a, b) / form_slope(forms + z_form * FORM_SIZE, a, b);
        if (depths.kind == SHIFTED)
            scale *= depths.origin;
        const Real first = depths.kind == RECIPROCAL ? 0.0f : 1.0f;
        const Real slope = depths.kind == PARALLEL ? 0.0f : -1.0f;
        int k = 0;
        for (; k < lists.longest; ++k) {
            const PacketFaces at = packet_faces(&in, &lists, k, depths);
            going = going && k < lists.count && at.front < end && !(seen.sums.w < frame.cutoff);
            const Real from = HIGHER_OF(at.front, begin);
            const Real to = LOWER_OF(at.back, end);
            const Int meet = going && from < to;
            if (!ANY(meet)) {
                if (!ANY(going))
                    break;
                continue;
            }
            const Real4 medium = packet_media(&in, &lists, k, at);
            const Real lengths =
                scale * (to - from) / (fma(from, slope, first) * fma(to, slope, first));
            composite_medium(&seen, medium.w * lengths, medium, meet);
        }
        // The next packet, which comes to about the same depth: all at once, as loads in the loop
        // are not
        const PacketLists next = packet_at(&in, i + PACKET_WIDE, j);
        if (next.longest > 0)
            fetch(&in, &next, k + 1);
        // The others have looked at what is not theirs, or lies beside V_O's window, where there
        // may be anything
        seen.sums.x = select((Real)(0.0f), seen.sums.x, wanted);
        seen.sums.y = select((Real)(0.0f), seen.sums.y, wanted);
        seen.sums.z = select((Real)(0.0f), seen.sums.z, wanted);
    }

    const Real4 pixels = transpose(composited(&seen)); // of each bundle, row by row
    const Real of_bundle[PACKET_BUNDLES] = {pixels.x, pixels.y, pixels.z, pixels.w};
    for (int n = 0; n < PACKET_BUNDLES; ++n) {
        __global float4 *const target = image + place + n * BUNDLE_WIDE;
        if (whole) {
            // Four pixels of a row, or two of each of two rows
            vstore8(of_bundle[n].lo, 0, (__global float *)target);
            vstore8(of_bundle[n].hi, 0,
                    (__global float *)(BUNDLE_HIGH == 1 ? target + 2 : target - width));
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
