// The cells of a window (lib/rays.cl) in which one of several VDIs is met at most: it is drawn by
// itself, and they are taken from its picture. A work-item has a row of pixels of a cell.
#pragma OPENCL FP_CONTRACT OFF

#define NOBODY (-2) // of `alone`: no VDI is met there; -1: several are drawn together

// t at which the rays end by which a VDI is drawn by itself: at once in other cells.
__attribute__((vec_type_hint(float16))) __kernel void alone_ends(
    __global const short
        *alone, // (cells high, cells wide), bottom row first: the VDI in each of the window's cells
    int vdi, int cells_wide, int width, int height,
    __global const float *opaque_depth, // as for raycasting/raycast.cl
    __global float *ends)               // top row first
{
    const int cell = (int)get_global_id(0), row = (int)get_global_id(1);
    if (cell >= cells_wide)
        return;
    const bool here = alone[(height - 1 - row) / CELL * cells_wide + cell] == vdi;
    const size_t first = (size_t)row * width;
    for (int x = cell * CELL; x < min((cell + 1) * CELL, width); ++x)
        ends[first + x] = here ? (opaque_depth ? opaque_depth[first + x] : INFINITY) : -INFINITY;
}

// Take a VDI's cells from its picture, which may be the image itself; or clear those of NOBODY.
__attribute__((vec_type_hint(float16))) __kernel void
take_cells(__global const short *alone, int vdi, int cells_wide, int width, int height,
           __global const float4 *picture,
           __global float4 *image, // premultiplied RGBA, top row first
           __global short *owner)  // as in multi_vdi/merge.cl
{
    const int cell = (int)get_global_id(0), row = (int)get_global_id(1);
    if (cell >= cells_wide || alone[(height - 1 - row) / CELL * cells_wide + cell] != vdi)
        return;
    const size_t first = (size_t)row * width;
    for (int x = cell * CELL; x < min((cell + 1) * CELL, width); ++x) {
        const float4 color = vdi == NOBODY ? (float4)(0.0f) : picture[first + x];
        image[first + x] = color;
        owner[first + x] = any(color != 0.0f) ? (short)vdi : (short)-1;
    }
}
