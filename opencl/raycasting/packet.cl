// Packets: LANES rays side by side, in vectors, that a work-item follows together.
//
// What raycasting/list_ray.cl says of a ray holds for each lane. Written in vectors, and not left to a compiler that makes a
// vector of work-items, because what lies in a list is the same for all lanes that cross it: it is loaded once, as a scalar,
// where lanes that compilers make gather it sixteen times.
#include "lib/lanes.cl"
#include "lib/list_space.cl"
#pragma OPENCL FP_CONTRACT OFF

#define NOWHERE INT_MAX
// One instruction each; for what is never NaN
#define LOWER_OF(x, y) select(y, x, (x) < (y))
#define HIGHER_OF(x, y) select(y, x, (x) > (y))

inline int least(Ints x)
{
    const int8 of_two = min(x.lo, x.hi);
    const int4 of_four = min(of_two.lo, of_two.hi);
    const int2 of_eight = min(of_four.lo, of_four.hi);
    return min(of_eight.x, of_eight.y);
}

// The least of those that are chosen, NOWHERE if none is.
inline int least_of(Ints x, Ints chosen)
{
    return least(select((Ints)(NOWHERE), x, chosen));
}

// A packet's pixels lie along the image of the line that its rays share in V_O's window: an epipolar line. Rays of one plane
// through both eyes cross the same lists, one after another. `epipole` is where V_N sees V_O's eye: homogeneous pixel offsets
// along the strips' width, across it, and their denominator. A strip is LANES pixels wide; its packets are numbered by where
// they meet that of its edges that is farther from the epipole, from before the window on. Lines draw together towards the
// epipole: a pixel may be in two packets or more, whose numbers follow one another, and is in one at least.
#define STEEPEST 1.5f // pixels across by pixels along; the margin of pyvista_vdi/packets.py allows for it
inline Ints across_strip(int first, int number, int along_size, int across_size, float4 epipole)
{
    const float first_offset = (float)first + 0.5f - 0.5f * (float)along_size;
    const float to_first = epipole.x - first_offset * epipole.z;
    const float to_last = epipole.x - (first_offset + (float)(LANES - 1)) * epipole.z;
    const bool last_is_farther = fabs(to_last) > fabs(to_first);
    const float farther = last_is_farther ? to_last : to_first;
    const float nearer = last_is_farther ? to_first : to_last;
    float slope = 0.0f;
    if (farther * nearer > 0.0f && fabs(nearer) > (float)LANES * fabs(epipole.z)) {
        // By a product: what is rounded must still not grow, or a pixel would be left out
        const float offset = (float)number + 0.5f - 0.5f * (float)across_size;
        slope = clamp((epipole.y - offset * epipole.z) * (1.0f / farther), -STEEPEST, STEEPEST);
    }
    return number + convert_int16_rte(slope * convert_float16(NUMBERS - (last_is_farther ? LANES - 1 : 0)));
}

typedef struct {
    Ints present;               // lanes whose rays meet what they are clipped to
    Reals start_u, start_v, start_z; // where they enter it: list coordinates
    Reals deep_u, deep_v, deep_z;    // r = 0
    Reals along_u, along_v, along_z; // per unit of r
    Ints away;
    Reals r_begin; // 0 or -1; they end at r_begin + 1
    Reals scale;   // model length per unit of r, but for the division by w(r_a) w(r_b) in perspective
#ifndef PARALLEL
    Reals w_deep, w_along; // 1 / Z is w_deep + r w_along
#endif
} Packet;

inline Reals values_of_form(__global const float *form, Reals a, Reals b, Reals t)
{
    return fma(t, FORM_SLOPE(Reals, form, a, b), FORM_VALUE(Reals, form, a, b));
}

inline void list_points(__global const float *forms, Reals a, Reals b, Reals t, Reals *u, Reals *v, Reals *z)
{
    *u = values_of_form(forms + U_FORM * FORM_SIZE, a, b, t);
    *v = values_of_form(forms + V_FORM * FORM_SIZE, a, b, t);
    *z = values_of_form(forms + DEPTH_FORM * FORM_SIZE, a, b, t);
#ifndef PARALLEL
    const Reals denominator = values_of_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
    *u /= denominator;
    *v /= denominator;
    *z /= denominator;
#endif
}

// Depth coordinates at t, as those of list_points.
inline Reals list_depths(__global const float *forms, Reals a, Reals b, Reals t)
{
#ifdef PARALLEL
    return values_of_form(forms + DEPTH_FORM * FORM_SIZE, a, b, t);
#else
    return values_of_form(forms + DEPTH_FORM * FORM_SIZE, a, b, t) / values_of_form(forms + DENOMINATOR_FORM * FORM_SIZE, a, b, t);
#endif
}

// As clip_to_planes, for pixel offsets (a, b) of lanes that are `wanted`: those that have something left, from *t0 to *t1.
inline Ints clip_packet(__global const float *forms, int planes, Reals a, Reals b, Reals t_end, Ints wanted, Reals *t0, Reals *t1)
{
    Reals begin = -INFINITY;
    Reals end = t_end;
    for (int k = 0; k < planes; ++k) {
        __global const float *plane = forms + (PLANE_FORMS + k) * FORM_SIZE;
        const Reals value = FORM_VALUE(Reals, plane, a, b);
        const Reals slope = FORM_SLOPE(Reals, plane, a, b);
        const Reals t = -value / slope;
        begin = select(begin, fmax(begin, t), slope > 0.0f);
        end = select(end, fmin(end, t), slope < 0.0f);
        end = select(end, (Reals)(-INFINITY), slope == 0.0f && value < 0.0f);
    }
    const Ints present = wanted && begin < end;
    // Where nothing is to be drawn, anything finite
    *t0 = select((Reals)(0.0f), begin, present);
    *t1 = select((Reals)(1.0f), end, present);
    return present;
}

// As begin_list_ray, for pixel offsets (a, b) of lanes that are `wanted`.
inline Packet begin_packet(__global const float *forms, int planes, Reals a, Reals b, Reals t_end, Ints wanted,
                           float depth_origin)
{
    Packet packet;
    Reals t0, t1;
    packet.present = clip_packet(forms, planes, a, b, t_end, wanted, &t0, &t1);

    Reals end_u, end_v, end_z;
    list_points(forms, a, b, t0, &packet.start_u, &packet.start_v, &packet.start_z);
    list_points(forms, a, b, t1, &end_u, &end_v, &end_z);
    packet.along_u = end_u - packet.start_u;
    packet.along_v = end_v - packet.start_v;
    packet.along_z = end_z - packet.start_z;
    packet.away = packet.along_z >= 0.0f;
    packet.deep_u = select(packet.start_u, end_u, packet.away);
    packet.deep_v = select(packet.start_v, end_v, packet.away);
    packet.deep_z = select(packet.start_z, end_z, packet.away);
    packet.r_begin = select((Reals)(0.0f), (Reals)(-1.0f), packet.away);
    // What changes by less than a normal number does not change: its reciprocal is not finite
    packet.along_u = select(packet.along_u, (Reals)(0.0f), fabs(packet.along_u) < FLT_MIN);
    packet.along_v = select(packet.along_v, (Reals)(0.0f), fabs(packet.along_v) < FLT_MIN);

    packet.scale = (t1 - t0) * MODEL_SPEED(Reals, forms, a, b);
#ifndef PARALLEL
    packet.scale *= reciprocal_depth(packet.start_z, depth_origin) * reciprocal_depth(end_z, depth_origin);
    packet.w_deep = reciprocal_depth(packet.deep_z, depth_origin);
#ifdef SHIFTED
    packet.w_along = -packet.along_z / depth_origin;
#else
    packet.w_along = -packet.along_z;
#endif
#endif
    return packet;
}

// Model lengths from r = from to r = to.
inline Reals lengths_crossed(const Packet *packet, Reals from, Reals to)
{
#ifdef PARALLEL
    return packet->scale * (to - from);
#else
    return packet->scale * (to - from) /
           (fma(from, packet->w_along, packet->w_deep) * fma(to, packet->w_along, packet->w_deep));
#endif
}
