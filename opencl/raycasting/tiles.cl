// Cells of the occupancy grid (paper, section 4): tiles of lists x SLABS slabs of equal view depth.
#pragma OPENCL FP_CONTRACT OFF

#define TILE_SHIFT 4
#define TILE (1 << TILE_SHIFT) // lists along each edge of a tile; 16 of pyvista_vdi/occupancy.py
#define SLABS 64               // one bit of a tile's mask each

// Slab of a view depth less the VDI's depth origin. What lies before the first slab or behind the last one counts there.
inline int slab_of(float offset, float first_depth, float slabs_per_depth)
{
    return (int)clamp((offset - first_depth) * slabs_per_depth, 0.0f, (float)(SLABS - 1));
}

// The slabs from `slab` on to the deepest, and those from the first one to `slab`.
inline ulong slabs_from(int slab)
{
    return ~0UL << slab;
}

inline ulong slabs_to(int slab)
{
    return ~0UL >> (SLABS - 1 - slab);
}

// A ray that crosses fewer lists than this is not worth a look at the grid: at V_O it stays in one.
#define FEW_LISTS 2.0f
// Turns of a loop from one look at the grid to the next: lanes that come to a new tile one after another look together.
#define TURNS_PER_TEST 4
