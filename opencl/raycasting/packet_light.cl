// What the rays of a packet (raycasting/packet.cl) see: lengths in supersegments, compositing front to back, and the picture.
//
// -D COMPENSATED  1: see lib/compositing.cl
#include "lib/opacity.cl"
#include "raycasting/packet.cl"
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    Reals red, green, blue;
    Reals transmittance;
#ifdef COMPENSATED
    Reals opacity;
#endif
} Seen;

inline Seen nothing_seen()
{
    Seen seen;
    seen.red = seen.green = seen.blue = 0.0f;
    seen.transmittance = 1.0f;
#ifdef COMPENSATED
    seen.opacity = 0.0f;
#endif
    return seen;
}

// What lies between depths `near` and `far` of the rays from r to r_next, where depths are `depth` and `next_depth`: clipped to
// the supersegment by interval, as in raycasting/raycast.cl. Depths grow along the rays.
inline void clip_to_faces(Reals *from, Reals *to, Reals near, Reals far, Reals r, Reals r_next, Reals depth, Reals next_depth,
                          Reals deep_depth, Reals inverse_depth)
{
    const Reals r_enters = (near - deep_depth) * inverse_depth;
    const Reals r_leaves = (far - deep_depth) * inverse_depth;
    *from = select(r, LOWER_OF(HIGHER_OF(r_enters, r), r_next), near > depth);
    *to = select(r_next, LOWER_OF(HIGHER_OF(r_leaves, *from), r_next), far < next_depth);
}

// The model lengths of that.
inline Reals lengths_between(const Packet *packet, Reals near, Reals far, Reals r, Reals r_next, Reals depth,
                             Reals next_depth, Reals deep_depth, Reals inverse_depth)
{
    Reals from, to;
    clip_to_faces(&from, &to, near, far, r, r_next, depth, next_depth, deep_depth, inverse_depth);
    return lengths_crossed(packet, from, to);
}

// Composite a medium of straight colour for the rays that are chosen.
inline void composite_medium(Seen *seen, Reals optical_depth, Reals red, Reals green, Reals blue, Ints chosen)
{
    const Reals weight = select((Reals)(0.0f), seen->transmittance * opacities_of(optical_depth), chosen);
    seen->red += weight * red;
    seen->green += weight * green;
    seen->blue += weight * blue;
#ifdef COMPENSATED
    seen->opacity += weight;
    seen->transmittance = 1.0f - seen->opacity;
#else
    seen->transmittance -= weight;
#endif
}

inline Reals alpha_seen(const Seen *seen)
{
#ifdef COMPENSATED
    return fmin(seen->opacity, 1.0f);
#else
    return 1.0f - seen->transmittance;
#endif
}

// The pixels of a packet.
typedef struct {
    int places[LANES]; // in the image
    int wanted[LANES]; // lanes that have one
} Pixels;

inline Pixels pixels_at(Ints x, Ints y, Ints in_window, int width, int height)
{
    Pixels pixels;
    vstore16((height - 1 - y) * width + x, 0, pixels.places);
    vstore16(in_window, 0, pixels.wanted);
    return pixels;
}

// t at which the rays end.
inline Reals ends_at(const Pixels *pixels, __global const float *opaque_depth)
{
    float ends[LANES];
    for (int k = 0; k < LANES; ++k)
        ends[k] = pixels->wanted[k] ? opaque_depth[pixels->places[k]] : 0.0f;
    return vload16(0, ends);
}

inline void write_pixels(__global float4 *image, const Pixels *pixels, const Seen *seen)
{
    float channels[4][LANES];
    vstore16(seen->red, 0, channels[0]);
    vstore16(seen->green, 0, channels[1]);
    vstore16(seen->blue, 0, channels[2]);
    vstore16(alpha_seen(seen), 0, channels[3]);
    for (int k = 0; k < LANES; ++k) {
        if (pixels->wanted[k])
            image[pixels->places[k]] = (float4)(channels[0][k], channels[1][k], channels[2][k], channels[3][k]);
    }
}
