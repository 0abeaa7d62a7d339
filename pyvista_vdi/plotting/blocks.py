"""A ``pyvista.MultiBlock`` in one call, block by block as ``add_volume`` adds it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import cycle
from typing import Any

import pyvista as pv

from pyvista_vdi.vtk_pipeline.filters.convert import require_image

#: Colour maps of blocks that are to be told apart: those of ``add_volume``.
_MAPS = ("Reds", "Greens", "Blues", "Greys", "Oranges", "Purples")


def add_blocks(add: Callable[..., Any], blocks: Any, arguments: Mapping[str, Any]) -> Iterator[Any]:
    """Add each block with the same arguments; give their actors, lists of those within blocks.

    Blocks that are missing are left out, and a name gets the block's number. A block that is no
    uniform grid is refused before anything is added.
    """
    blocks = pv.wrap(blocks)
    for block in blocks.recursive_iterator(skip_none=True):
        require_image(block)
    found = [(i, block) for i, block in enumerate(blocks) if block is not None]
    own: dict[str, Any] = {}
    maps = cycle(_MAPS)
    for i, block in found:
        if arguments["multi_colors"]:
            own["cmap"] = next(maps)
        if arguments["name"] is not None:
            own["name"] = f"{arguments['name']}-{i}"
        yield add(block, **{**arguments, **own})
