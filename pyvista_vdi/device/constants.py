"""Numbers that kernels and Python share: defined here, and ``-D`` names of every program."""

from __future__ import annotations

from pyvista_vdi.model.packing import DEPTH_CODES as DEPTH_CODES

#: Blocks of 4 x 4 pixels up a strip of them (``lib/rays.cl``).
STRIP = 4
#: Work-items of a column of a strip, and of every group that draws, unless it may be of any size.
COLUMN_ITEMS = 16 * STRIP
#: Pixels along the edges of a cell, and all of them.
CELL = 4 * STRIP
CELL_ITEMS = CELL * CELL

#: Logarithm to base 2 of the points along each edge of a macrocell (``volume/macrocells.cl``).
MACROCELL_SHIFT = 3
#: float32 numbers of a recorded run (``generation/runs.cl``).
RUN_WORDS = 8
#: Merge errors of a ray that are looked at in one step: records have room for a multiple of them.
ERRORS_AT_A_TIME = 8
#: Lists whose lengths a work-item sums up (``generation/offsets.cl``).
LISTS_PER_ITEM = 16

#: Lists along each edge of a bundle, in which supersegments lie together; those of 8 bytes lie list
#: by list (``raycasting/supersegments.cl``).
BUNDLE_SHIFT = 1
BUNDLE = 1 << BUNDLE_SHIFT
#: Bits of a bundle's header that say where it begins.
FIRST_BITS = 36
#: Pairs of words before the supersegments of an 8-byte list.
LIST_HEADER = 2
#: Lists along each edge of a stack of cells of the occupancy grid, and slabs of depth.
STACK_SHIFT = 4
STACK = 1 << STACK_SHIFT
SLABS = 64
#: Of a frame's forms: (u, v, depth, denominator) and the model direction, before the planes to clip
#: to (``lib/list_space.cl``).
PLANE_FORMS = 7
#: Pixels across by pixels along a packet, at most: that of the line that it follows.
STEEPEST = 1.5
#: float32 numbers of a segment of a ray, and slots that a ray has to spare where segments lie in
#: rows (``raycasting/segments.cl``).
SEGMENT_SIZE, SPARE_SLOTS = 6, 2

#: All of them by name.
KERNEL_CONSTANTS: dict[str, int | float] = {
    name: value for name, value in list(vars().items()) if name.isupper()
}
