"""How pixels are dealt to work-items: blocks of 4 x 4, as ``block_pixel`` of the kernels undoes."""

from __future__ import annotations

#: Work-items per group: four blocks.
GROUP = 64


def block_items(width: int, height: int) -> int:
    """Return the work-items that cover a window in blocks of 4 x 4 pixels, in whole groups."""
    items = -(-width // 4) * -(-height // 4) * 16
    return -(-items // GROUP) * GROUP
