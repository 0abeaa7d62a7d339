// A step of a series from the arrays of its frame: what series/differences.py's `decoded` does,
// list by list, to the last bit. Whole numbers are exact, and doubles are summed, multiplied,
// divided and rounded as IEEE 754 has it, here as there.
//
// -D GRID, TAU_BASE, TAU_CODES   see model/packing.py
// -D PLAIN                       nothing is known of samples: faces are counted in codes
//
// Where numbers are not those of a step that was written, `trouble` is set, and the host finds out
// what is wrong with them.
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF

// How a list is written
#define OWN 0
#define SAME 1
#define PLACED 2
#define KEPT 3
#define HOW 3
#define END 4

// Arrays of a frame that are read here, in the order of `streams`: where each begins in `data`, and
// bytes of an element
enum { GAP, LENGTH, BACK, FRONT, END_LEFT, ENTRY, RED, GREEN, BLUE, OPTICAL_DEPTH, STREAMS };

// Where a list's numbers begin in the arrays: columns of `places`
enum { ROW, NEW, OCCUPIED, KEPT_BIT, THERE_BIT, PLACES };

#define TAME 1073741824.0 // no number of a step that was written is beyond it

inline uint element(__global const uchar *data, __global const uint *streams, int stream, int k)
{
    const uint size = streams[2 * stream + 1];
    __global const uchar *place = data + streams[2 * stream] + (size_t)k * size;
    return size == 1   ? *place
           : size == 2 ? *(__global const ushort *)place
                       : *(__global const uint *)place;
}

inline int unfolded(uint value) { return (int)(value >> 1) ^ -(int)(value & 1); }

inline bool bit_at(__global const uchar *bits, int k) { return bits[k >> 3] >> (7 - (k & 7)) & 1; }

// The nearest whole number, ties to even; `tame` turns false where that is large.
inline int rounded(double value, double unit, bool *tame)
{
    const double quotient = rint(value / unit);
    const bool small = fabs(quotient) < TAME;
    *tame = *tame && small;
    return small ? (int)quotient : 0;
}

inline int tau_of(uint2 word) { return (int)(word.x >> 28 | (word.y & 255) << 4); }

// One work-item per list. The hint keeps Intel's compiler from following lists in vectors, as long
// as their longest: it takes twice as long.
__attribute__((vec_type_hint(float16))) __kernel void decode_lists(
    int n_lists,
    __global const uchar *how,        // how each list is written
    __global const int *starts,       // where lists begin among all supersegments, n_lists + 1
    __global const int *places,       // n_lists x PLACES
    __global const int *origins_left, // of lists that are written and not empty: what is left of
                                      // their origin, or all of it
    __global const int *strides_left, // likewise
    __global const int *shifts,       // likewise: samples by which they have moved
    __global const double
        *pitches,               // steps of the depth grid from sample to sample; unused where PLAIN
    __global const uchar *data, // the frame's arrays
    __global const uint *streams,     // STREAMS x (where, bytes of an element)
    __global const uchar *kept,       // bits: of the supersegments in lists that are KEPT
    __global const uchar *kept_there, // bits: of those that they had
    __global const int *old_starts,   // the step that this one is written by
    __global const int *old_origins, __global const ushort *old_strides,
    __global const uint2 *old_words, __global const uchar *old_entries,
    __global const uchar *colors,      // of the entries, red, green and blue
    __global const float *extinctions, // optical depth per sample
    __global int *origins, __global ushort *strides,
    __global uint2
        *words, // see raycasting/supersegments.cl; between the passes back and length, samples
    __global uchar *entries, __global int *trouble)
{
    const int i = get_global_id(0);
    if (i >= n_lists)
        return;
    const int begin = starts[i], count = starts[i + 1] - begin, way = how[i] & HOW;
    if (way == SAME) {
        origins[i] = old_origins[i];
        strides[i] = old_strides[i];
        for (int k = 0; k < count; ++k) {
            words[begin + k] = old_words[old_starts[i] + k];
            entries[begin + k] = old_entries[old_starts[i] + k];
        }
        return;
    }
    if (count == 0) {
        origins[i] = 0;
        strides[i] = 0;
        return;
    }
    __global const int *place = places + (size_t)i * PLACES;
    const int row = place[ROW], occupied = place[OCCUPIED];
    const bool placed = way >= PLACED;
    bool tame = true;

    // Where the list was, and is
    const int old_begin = placed ? old_starts[i] : 0,
              old_count = placed ? old_starts[i + 1] - old_begin : 0;
    const int old_origin = placed ? old_origins[i] : 0, old_stride = placed ? old_strides[i] : 0;
    const int shift = shifts[occupied];
#ifdef PLAIN
    const double moved_by = old_stride;
#else
    const double moved_by = pitches[i];
#endif
    int origin = origins_left[occupied], old_end = 0;
    if (placed) {
        origin += old_origin + rounded(shift * moved_by, 1.0, &tame);
        old_end = old_origin +
                  (int)(old_words[old_begin + old_count - 1].x >> 14 & DEPTH_CODES) * old_stride;
    }

    // Backs and lengths in samples, from which the list's extent follows
    int back = 0, next_new = place[NEW], old = 0;
    for (int k = 0; k < count; ++k) {
        int length;
        if (way == KEPT && bit_at(kept, place[KEPT_BIT] + k)) {
            while (old < old_count && !bit_at(kept_there, place[THERE_BIT] + old))
                ++old;
            if (old == old_count) {
                *trouble = 1;
                return;
            }
            const uint word = old_words[old_begin + old++].x;
            back =
                rounded((double)((int)(word >> 14 & DEPTH_CODES) * old_stride), moved_by, &tame) -
                shift;
            length =
                back - (rounded((double)((int)(word & DEPTH_CODES) * old_stride), moved_by, &tame) -
                        shift);
        } else {
            const uint gap = element(data, streams, GAP, next_new);
            length = (int)element(data, streams, LENGTH, next_new++);
            tame = tame && gap < 1u << 29 && length >= 0 && length < 1 << 29 && abs(back) < 1 << 29;
            back = tame ? back + (int)gap + length : 0;
        }
        words[begin + k] = (uint2)((uint)back, (uint)length);
    }
    for (; way == KEPT && old < old_count; ++old)
        tame = tame && !bit_at(kept_there, place[THERE_BIT] + old);
    const bool as_it_was = how[i] & END;
    int stride = strides_left[occupied];
#ifdef PLAIN
    stride += old_stride;
    const double unit = stride;
#else
    const double span = as_it_was ? (double)(old_end - origin) : back * moved_by;
    stride += max(1, (int)ceil(fmin(fmax(span, 0.0), TAME) / DEPTH_CODES));
    const double unit = moved_by;
#endif
    tame = tame && stride > 0 && stride < 1 << 16 && (placed || !as_it_was);
    // Its depths lie on the VDI's grid
    tame = tame && abs(origin) <= GRID && origin + stride * DEPTH_CODES <= GRID + DEPTH_CODES + 1;
    if (!tame) {
        *trouble = 1;
        return;
    }
    origins[i] = origin;
    strides[i] = (ushort)stride;

    // Codes of depth, and media
    int back_before = 0, code_before = 0;
    old = 0;
    for (int k = 0; k < count; ++k) {
        const int length = (int)words[begin + k].y;
        back = (int)words[begin + k].x;
        const int guessed = rounded(back * unit, stride, &tame);
        int b = guessed + unfolded(element(data, streams, BACK, row + k));
        if (k == count - 1) {
            const int end =
                as_it_was ? rounded((double)(old_end - origin), stride, &tame) : guessed;
            b = end + unfolded(element(data, streams, END_LEFT, occupied));
        }
        const int front = back - length;
        const int near = front == back_before ? code_before : rounded(front * unit, stride, &tame);
        const int f = near + unfolded(element(data, streams, FRONT, row + k));
        tame = tame && f >= code_before && b > f && b <= DEPTH_CODES && (k > 0 || f == 0);
        back_before = back;
        code_before = b;

        int same = -1; // the supersegment that this one was
        if (way == KEPT && bit_at(kept, place[KEPT_BIT] + k)) {
            while (old < old_count && !bit_at(kept_there, place[THERE_BIT] + old))
                ++old;
            same = old_begin + old++;
        }
        const uint left = element(data, streams, ENTRY, row + k);
        const uint entry = (left + (same < 0 ? 0 : old_entries[same])) & 255;
        entries[begin + k] = (uchar)entry;
        uint red, green, blue;
        int tau;
        if (same >= 0 && left == 0) {
            const uint color = old_words[same].y;
            red = color >> 8;
            green = color >> 16;
            blue = color >> 24;
            tau = tau_of(old_words[same]);
        } else {
            const float samples = (float)(length + (b - guessed) * (stride / unit));
            const long bits = (long)as_uint(extinctions[entry] * samples);
            tau = (int)clamp(((bits + 0x8000) >> 16) - TAU_BASE + 1, 0L, (long)TAU_CODES);
            red = colors[3 * entry];
            green = colors[3 * entry + 1];
            blue = colors[3 * entry + 2];
        }
        tau += unfolded(element(data, streams, OPTICAL_DEPTH, row + k));
        red += element(data, streams, RED, row + k);
        green += element(data, streams, GREEN, row + k);
        blue += element(data, streams, BLUE, row + k);
        tame = tame && tau >= 0 && tau <= TAU_CODES && isfinite(extinctions[entry]);
        words[begin + k] =
            (uint2)((uint)f | (uint)b << 14 | (uint)tau << 28,
                    (uint)tau >> 4 | (red & 255) << 8 | (green & 255) << 16 | blue << 24);
    }
    if (!tame)
        *trouble = 1;
}
