"""Which kernel draws what: one table, of which the first row that supports a scene draws it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
    defines : callable
        ``-D`` names beside those of :attr:`Scene.defines`.
    launch : callable or None
        Its :class:`Launch`; None where segments are asked for, band by band
        (``raycasting/multi_vdi.py``).
    rays : int
        Rays that a work-item follows.
    whole : bool
        Whether it writes every pixel of the window, those beside :attr:`Scene.part`, too.
    """

    name: str
    file: str
    kernel: str
    supports: Callable[[Scene], bool]
    defines: Callable[[Scene], Defines]
    launch: Callable[[Scene], Launch] | None = None
    rays: int = 1
    whole: bool = False

    def build(self, scene: Scene) -> Kernel:
        """Return the kernel for a scene."""
        defines = {**scene.defines, **self.defines(scene)}
        return scene.prepared.runtime.kernel(self.file, self.kernel, defines)


def _preview(scene: Scene) -> Launch:
    samples = np.int32(scene.options.preview_samples or 0)
    items = block_items(*scene.size)
    return Launch(items, GROUP, (scene.prepared.occupancy.counts, samples))


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
    return Launch(items // rays, COLUMN_ITEMS // rays, (columns,))


def _ray_by_ray(scene: Scene) -> Launch:
    launch = _columns(scene)
    if scene.hit is None:
        return launch
    hit = (np.float32(scene.hit.optical_depth), np.int32(scene.hit.accumulated))
    return launch._replace(arguments=(*launch.arguments, *hit))


def _ray_by_ray_defines(scene: Scene) -> Defines:
    return {**scene.skipping, **({"ONE_LIST": 1} if scene.one_list else {})}


STRATEGIES = (
    Strategy(
        "preview",
        "raycasting/preview.cl",
        "preview",
        supports=lambda scene: scene.options.preview_samples is not None,
        defines=lambda scene: {},
        launch=_preview,
        whole=True,
    ),
    Strategy(
        "segments in blocks",
        "raycasting/blocks.cl",
        "raycast_blocks",
        supports=lambda scene: scene.segments == 2 and scene.in_blocks,
        defines=lambda scene: scene.skipping,
        rays=LANES,
    ),
    Strategy(
        "segments ray by ray",
        "raycasting/raycast.cl",
        "raycast",
        supports=lambda scene: scene.segments > 0,
        defines=lambda scene: scene.skipping,
    ),
    Strategy(
        "first hits",
        "raycasting/raycast.cl",
        "raycast",
        supports=lambda scene: scene.hit is not None,
        defines=_ray_by_ray_defines,
        launch=_ray_by_ray,
    ),
    Strategy(
        "aligned view",
        "raycasting/aligned_view.cl",
        "raycast_own_lists",
        supports=lambda scene: (
            scene.in_vectors and not scene.in_regions and scene.aligned is not None
        ),
        defines=lambda scene: {},
        launch=_aligned,
        whole=True,
    ),
    # V_O's rays have a loop of their own where they are followed one by one; regions have blocks
    Strategy(
        "one list",
        "raycasting/raycast.cl",
        "raycast",
        supports=lambda scene: scene.one_list and not (scene.in_regions and scene.in_blocks),
        defines=_ray_by_ray_defines,
        launch=_ray_by_ray,
    ),
    Strategy(
        "packets",
        "raycasting/packets.cl",
        "raycast_packets",
        supports=lambda scene: (
            scene.in_vectors and not scene.in_regions and scene.packets is not None
        ),
        defines=_packet_defines,
        launch=_packets,
    ),
    Strategy(
        "blocks",
        "raycasting/blocks.cl",
        "raycast_blocks",
        supports=lambda scene: scene.in_blocks,
        defines=lambda scene: scene.skipping,
        launch=lambda scene: _columns(scene, LANES),
        rays=LANES,
    ),
    Strategy(
        "ray by ray",
        "raycasting/raycast.cl",
        "raycast",
        supports=lambda scene: True,
        defines=_ray_by_ray_defines,
        launch=_ray_by_ray,
    ),
)


def strategy_for(scene: Scene) -> Strategy:
    """Return the first row of the table that supports a scene."""
    return next(strategy for strategy in STRATEGIES if strategy.supports(scene))
