"""Which kernel draws what: one table, of which the first row that supports a scene draws it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pyvista_vdi.device import Kernel
from pyvista_vdi.device.constants import COLUMN_ITEMS
from pyvista_vdi.device.work_order import GROUP, block_items, part_columns
from pyvista_vdi.raycasting.packets import LANES
from pyvista_vdi.raycasting.prepared import Defines
from pyvista_vdi.raycasting.scene import Scene


class Launch(NamedTuple):
    """Work-items, those of a group, and the kernel's arguments between the walk's and the image."""

    items: int
    group: int
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class Strategy:
    """A way to draw scenes.

    Attributes
    ----------
    name : str
        What it is called in the documentation.
    file, kernel : str
        A file of ``opencl/`` and the kernel in it.
    supports : callable
        Whether it draws a scene that no row above does.
    launch : callable
        Its launch; segments are asked for band by band in place of it (``multi_vdi.py``).
    defines : callable
        ``-D`` names beside those of :attr:`Scene.defines`.
    rays : int
        Rays that a work-item follows.
    whole : bool
        Whether it writes every pixel of the window, those beside :attr:`Scene.part`, too.
    """

    name: str
    file: str
    kernel: str
    supports: Callable[[Scene], bool]
    launch: Callable[[Scene], Launch]
    defines: Callable[[Scene], Defines] = lambda scene: scene.skipping
    rays: int = 1
    whole: bool = False

    def build(self, scene: Scene) -> Kernel:
        """Return the kernel for a scene."""
        defines = {**scene.defines, **self.defines(scene)}
        if self.file in ("cpu16/raycast.cl", "cpu16/segments.cl"):
            for name in ("PACKED", "OFFSET_T", "SEGMENT_ROWS"):
                defines.pop(name, None)
        elif self.file.startswith("cpu16"):
            defines.pop("CROPPED")
        return scene.prepared.runtime.kernel(self.file, self.kernel, defines)


def _preview(scene: Scene) -> Launch:
    samples = np.int32(scene.options.preview_samples or 0)
    return Launch(block_items(*scene.size), GROUP, (scene.prepared.occupancy.counts, samples))


def _aligned(scene: Scene) -> Launch:
    assert scene.aligned is not None
    return Launch(scene.aligned.items, LANES, (scene.aligned.origin,))


def _packets(scene: Scene) -> Launch:
    assert scene.packets is not None
    return Launch(scene.packets.items, LANES, (scene.packets.epipole, scene.packets.part))


def _packet_defines(scene: Scene) -> Defines:
    assert scene.packets is not None
    return {**scene.skipping, **scene.packets.defines}


def _columns(scene: Scene, rays: int = 1) -> Launch:
    """Return the launch of strips of the part to be drawn, column by column."""
    columns = part_columns(scene.part)
    items = COLUMN_ITEMS * int(columns[2]) * int(columns[3])
    hit = scene.hit
    hits = () if hit is None else (np.float32(hit.optical_depth), np.int32(hit.accumulated))
    return Launch(items // rays, COLUMN_ITEMS // rays, (columns, *hits))


def _ray_by_ray_defines(scene: Scene) -> Defines:
    if scene.segments:
        return scene.skipping
    return {**scene.skipping, "ONE_LIST": int(scene.one_list)}


_BLOCKS = Strategy(
    "blocks",
    "cpu16/raycast.cl",
    "raycast_blocks",
    supports=lambda scene: scene.in_blocks,
    launch=lambda scene: _columns(scene, LANES),
    rays=LANES,
)
_RAY_BY_RAY = Strategy(
    "ray by ray",
    "raycasting/raycast.cl",
    "raycast",
    supports=lambda scene: True,
    launch=_columns,
    defines=_ray_by_ray_defines,
)

STRATEGIES = (
    Strategy(
        "preview",
        "raycasting/preview.cl",
        "preview",
        supports=lambda scene: scene.options.preview_samples is not None,
        launch=_preview,
        defines=lambda scene: {},
        whole=True,
    ),
    replace(
        _BLOCKS,
        name="segments in blocks",
        file="cpu16/segments.cl",
        kernel="segments_of_blocks",
        supports=lambda scene: scene.segments == 2 and scene.in_blocks,
    ),
    replace(
        _RAY_BY_RAY,
        name="segments ray by ray",
        file="multi_vdi/segments.cl",
        kernel="segments",
        supports=lambda scene: scene.segments > 0,
    ),
    replace(
        _RAY_BY_RAY,
        name="first hits",
        file="raycasting/first_hits.cl",
        kernel="first_hits",
        supports=lambda scene: scene.hit is not None,
    ),
    Strategy(
        "aligned view",
        "cpu16/aligned_view.cl",
        "raycast_aligned_view",
        supports=lambda scene: scene.plain and scene.aligned is not None,
        launch=_aligned,
        defines=lambda scene: {},
        whole=True,
    ),
    # V_O's rays have a loop of their own where they are followed one by one; regions have blocks
    replace(
        _RAY_BY_RAY,
        name="one list",
        supports=lambda scene: scene.one_list and not (scene.in_regions and scene.in_blocks),
    ),
    Strategy(
        "packets",
        "cpu16/packets.cl",
        "raycast_packets",
        supports=lambda scene: scene.plain and scene.packets is not None,
        launch=_packets,
        defines=_packet_defines,
    ),
    _BLOCKS,
    _RAY_BY_RAY,
)


def strategy_for(scene: Scene) -> Strategy:
    """Return the first row of the table that supports a scene."""
    return next(strategy for strategy in STRATEGIES if strategy.supports(scene))
