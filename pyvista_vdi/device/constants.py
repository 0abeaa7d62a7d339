"""Numbers that kernels and Python share, and how pixels are dealt to work-items."""

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.packing import DEPTH_CODES as DEPTH_CODES
from pyvista_vdi.model.ray_forms import Rectangle

#: Blocks of 4 x 4 pixels up a strip of them (``lib/rays.cl``).
STRIP = 4
#: Work-items of a column of a strip, and of every group that draws, unless it may be of any size.
COLUMN_ITEMS = 16 * STRIP
#: Pixels along the edges of a cell, and all of them.
CELL = 4 * STRIP
CELL_ITEMS = CELL * CELL

#: Logarithm to base 2 of the points along each edge of a macrocell (``volume/macrocells.cl``).
MACROCELL_SHIFT = 3
#: float32 numbers of a recorded run (``generation/records.cl``), of a segment of a ray and slots
#: that a ray has to spare (``multi_vdi/pool.cl``), and numbers of a form (``lib/rays.cl``).
RUN_WORDS, SEGMENT_SIZE, SPARE_SLOTS, FORM_SIZE = 8, 6, 2, 12
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
#: Kinds of the depth coordinate (``lib/list_space.cl``).
RECIPROCAL, SHIFTED, PARALLEL = range(3)
#: Pixels across by pixels along a packet, at most: that of the line that it follows.
STEEPEST = 1.5


def definitions() -> list[str]:
    """Return the lines of OpenCL C that define the numbers in capitals."""
    known = [name for name in globals() if name.isupper() and not name.startswith("_")]
    return [f"#define {name} {literal(globals()[name])}" for name in known]


def literal(value: object) -> str:
    """Return a value as OpenCL C has it: floats as exact float32, booleans as 0 or 1."""
    if isinstance(value, (bool, np.bool_)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return f"({float(np.float32(value)).hex()}f)"
    if isinstance(value, (int, np.integer)) and value < 0:
        return f"({value})"
    return str(value)


#: Work-items per group: four blocks.
GROUP = 64
#: Pixels along the edges of a block, whose rays kernels in vectors follow in one work-item.
BLOCK = 4
BLOCK_RAYS = BLOCK * BLOCK


def part_columns(part: Rectangle) -> NDArray[np.int32]:
    """Return the columns of strips that cover part of a window, as ``rays_of_strips`` takes them.

    First column, first strip, columns of each strip, strips: int32 (4,). Each column is a group.
    """
    column, strip = part.x0 // BLOCK, part.y0 // (BLOCK * STRIP)
    columns, strips = -(-part.x1 // BLOCK) - column, -(-part.y1 // (BLOCK * STRIP)) - strip
    return np.array([column, strip, columns, strips], np.int32)


def block_items(width: int, height: int) -> int:
    """Return the work-items that cover a window in blocks of 4 x 4 pixels, in whole groups."""
    items = -(-width // 4) * -(-height // 4) * 16
    return -(-items // GROUP) * GROUP
