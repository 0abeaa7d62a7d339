"""Numbers that kernels and Python share: defined here, and ``-D`` names of every program."""

from __future__ import annotations

#: Blocks of 4 x 4 pixels up a strip of them (``lib/rays.cl``).
STRIP = 4
#: Work-items of a column of a strip, and of every group that draws, unless it may be of any size.
COLUMN_ITEMS = 16 * STRIP
#: Pixels along the edges of a cell, and all of them.
CELL = 4 * STRIP
CELL_ITEMS = CELL * CELL

#: float32 numbers of a recorded run (``generation/runs.cl``).
RUN_WORDS = 8
#: Merge errors of a ray that are looked at in one step: records have room for a multiple of them.
ERRORS_AT_A_TIME = 8
#: Lists whose lengths a work-item sums up (``generation/offsets.cl``).
LISTS_PER_ITEM = 16

#: All of them by name.
KERNEL_CONSTANTS: dict[str, int] = {
    name: value for name, value in list(vars().items()) if name.isupper()
}
