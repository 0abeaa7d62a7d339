"""How pixels are dealt to work-items: blocks of 4 x 4, as ``block_pixel`` of the kernels undoes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.constants import STRIP
from pyvista_vdi.model.ray_forms import Rectangle

#: Work-items per group: four blocks.
GROUP = 64
#: Pixels along the edges of a block.
_BLOCK = 4
#: Rays of a block, which kernels written out in vectors follow in one work-item.
BLOCK_RAYS = _BLOCK * _BLOCK


def part_columns(part: Rectangle) -> NDArray[np.int32]:
    """Return the columns of strips that cover part of a window, as ``part_pixel`` takes them.

    First column, first strip, columns of each strip, strips: int32 (4,). Each column is a group.
    """
    column, strip = part.x0 // _BLOCK, part.y0 // (_BLOCK * STRIP)
    columns, strips = -(-part.x1 // _BLOCK) - column, -(-part.y1 // (_BLOCK * STRIP)) - strip
    return np.array([column, strip, columns, strips], np.int32)


def block_items(width: int, height: int) -> int:
    """Return the work-items that cover a window in blocks of 4 x 4 pixels, in whole groups."""
    items = -(-width // 4) * -(-height // 4) * 16
    return -(-items // GROUP) * GROUP
