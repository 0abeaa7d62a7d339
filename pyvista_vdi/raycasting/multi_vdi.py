"""Several VDIs to one image, on a device: merged by depth along each ray.

Each VDI's raycaster writes what a ray crosses into a pool, as segments between two view depths of
the new view; then the rays' streams of segments are merged and composited (docs/conventions.md,
"Several VDIs"). Rays are taken in bands, so that the pool stays small. Where no two of the VDIs can
be met, each is drawn as it would be by itself.
"""

from __future__ import annotations

import contextlib
import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Kernel, Runtime, get_runtime
from pyvista_vdi.device.constants import CELL, CELL_ITEMS, SEGMENT_SIZE, SPARE_SLOTS
from pyvista_vdi.device.ray_forms import cells_of_points
from pyvista_vdi.device.work_order import GROUP, Rectangle
from pyvista_vdi.model.float32_limits import compensation
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF, FrameRequest, RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.packets import LANES
from pyvista_vdi.raycasting.placed import PlacedVDI, canonical_order
from pyvista_vdi.raycasting.prepared import Defines, prepared_vdi
from pyvista_vdi.raycasting.raycast import enqueue, render_vdi
from pyvista_vdi.raycasting.scene import OnDevice, Scene
from pyvista_vdi.raycasting.strategies import strategy_for

#: Bytes of the pool, unless the segments of a cell need more. A GPU needs more rays at a time; on a
#: CPU what is below 32 MiB is memory that the process has freed, without page faults (glibc).
_POOL_BYTES_CPU = 24 * 2**20
_POOL_BYTES = 256 * 2**20
#: Cells of a work-group, of which each work-item has a row.
_CELLS_OF_GROUP = 16
#: Segments of a ray that the first frame has room for; later ones go by the frame before.
_FIRST_SLOTS = 64
#: Room for so many times what the frame before needed.
_SPARE_SLOTS = 1.1

_slots: weakref.WeakKeyDictionary[VDI, int] = weakref.WeakKeyDictionary()


@dataclass(frozen=True)
class OwnedImage:
    """The picture of several VDIs.

    Attributes
    ----------
    image : numpy.ndarray
        Premultiplied RGBA, float32 (H, W, 4), top row first.
    owner : numpy.ndarray
        int16 (H, W), top row first: the index of the VDI to which each pixel belongs, -1 where
        there is none.
    """

    image: NDArray[np.float32]
    owner: NDArray[np.int16]


def render_vdis(placed: Sequence[PlacedVDI], request: FrameRequest) -> NDArray[np.float32]:
    """Raycast VDIs together: premultiplied RGBA, float32 (height, width, 4), top row first.

    Camera and options are those of each VDI; ``request`` has the rest.
    """
    if len(placed) == 1:
        (one,) = placed
        return render_vdi(one.vdi, request.replace(camera=one.camera, options=one.options))
    return owned_image(placed, request).image


def owned_image(
    placed: Sequence[PlacedVDI], request: FrameRequest, *, margin: float = 0.0
) -> OwnedImage:
    """Raycast VDIs together, and say to which each pixel belongs.

    Parameters
    ----------
    placed : sequence of PlacedVDI
        All seen by the same eye: their cameras differ in ``model_transform`` only.
    request : FrameRequest
        The frame; its camera and options are not used.
    margin : float
        A pixel belongs to the first VDI that it meets and whose bounds it meets this many pixels
        farther to all four corners, too; or else to the first that it meets.

    Returns
    -------
    OwnedImage
        The same picture, to the last bit, in whatever order the VDIs are given.
    """
    runtime = get_runtime(request.device)
    segments = 2 if _in_rows(runtime) else 1
    scenes = [
        Scene.of(
            prepared_vdi(runtime, one.vdi),
            request.replace(camera=one.camera, options=_merged(one.options)),
            segments=segments,
        )
        for one in placed
    ]
    order = canonical_order(placed, [scene.reference_depth for scene in scenes])
    width, height = request.size
    cells = _Cells.of(scenes, request.size)
    with contextlib.ExitStack() as stack:
        on_device = [stack.enter_context(scene.on_device()) for scene in scenes]
        image = stack.enter_context(runtime.result((height, width, 4), name="image"))
        owner = stack.enter_context(runtime.result((height, width), np.int16, "owners"))
        _draw_alone(runtime, scenes, on_device, cells, image, owner)
        if len(cells.shared):
            merged = _MergedCells(runtime, scenes, on_device, order, margin)
            slots = max(_slots.get(one.vdi, _FIRST_SLOTS) for one in placed)
            needed = merged.draw(cells.shared, slots, image, owner)
            for one in placed:
                _slots[one.vdi] = math.ceil(_SPARE_SLOTS * max(needed, 1))
        result = OwnedImage(runtime.download(image), runtime.download(owner))
        runtime.finish()  # arrays on the device may be host memory in use
        return result


def _merged(options: RenderOptions) -> RenderOptions:
    """Return the options of a VDI that is merged with others: all end at the same transmittance."""
    return options.replace(transmittance_cutoff=TRANSMITTANCE_CUTOFF, preview_samples=None)


@dataclass(frozen=True)
class _Cells:
    """The cells of a window, by which VDIs may be met in them."""

    SHARED: ClassVar[int] = -1
    #: That of ``opencl/multi_vdi/cells.cl``.
    NOBODY: ClassVar[int] = -2

    #: (high, wide), bottom row first: the VDI that is the only one, or ``SHARED`` or ``NOBODY``.
    alone: NDArray[np.int16]
    #: Column and row of each in which several may be met, (n, 2), row by row.
    shared: NDArray[np.int32]

    @classmethod
    def of(cls, scenes: Sequence[Scene], size: tuple[int, int]) -> _Cells:
        # Whether or not rays pass by what is empty: the picture is the same
        corners = [(scene.camera, size, scene.prepared.occupancy.corners) for scene in scenes]
        met = np.array([cells_of_points(*points) for points in corners])
        count = met.sum(axis=0)
        alone = np.choose(
            np.minimum(count, 2), [np.full_like(count, cls.NOBODY), met.argmax(axis=0), cls.SHARED]
        )
        shared = np.argwhere(count > 1)[:, ::-1]
        return cls(alone.astype(np.int16), np.ascontiguousarray(shared, dtype=np.int32))

    def part(self, vdi: int, size: tuple[int, int]) -> Rectangle:
        """Return the part of the window in which a VDI's cells are."""
        rows, columns = np.nonzero(self.alone == vdi)
        if not len(rows):
            return Rectangle(0, 0, 0, 0)
        return Rectangle(
            int(columns.min()) * CELL,
            min((int(columns.max()) + 1) * CELL, size[0]),
            int(rows.min()) * CELL,
            min((int(rows.max()) + 1) * CELL, size[1]),
        )


def _draw_alone(
    runtime: Runtime,
    scenes: Sequence[Scene],
    on_device: Sequence[OnDevice],
    cells: _Cells,
    image: DeviceBuffer,
    owner: DeviceBuffer,
) -> None:
    """Draw the cells in which no two VDIs are met, as each would be by itself."""
    width, height = size = scenes[0].size
    wide = cells.alone.shape[1]
    group = (_CELLS_OF_GROUP, 1)
    items = (-(-wide // _CELLS_OF_GROUP) * _CELLS_OF_GROUP, height)
    ends_kernel = runtime.kernel("multi_vdi/cells.cl", "alone_ends")
    take = runtime.kernel("multi_vdi/cells.cl", "take_cells")
    with contextlib.ExitStack() as stack:
        alone = stack.enter_context(runtime.upload(cells.alone, "cells"))
        window = (np.int32(wide), np.int32(width), np.int32(height))
        picture, ends = image, None  # others are drawn over the first one's picture
        for number, (scene, (forms, opaque)) in enumerate(zip(scenes, on_device, strict=True)):
            part = cells.part(number, size)
            if not part.pixels:
                continue
            vdi = np.int32(number)
            if ends is None:
                ends = stack.enter_context(runtime.result((height, width), name="ends of rays"))
            elif picture is image:
                picture = stack.enter_context(runtime.result(image.shape, name="one's picture"))
            has_ends = np.int32(scene.ends is not None)
            runtime.launch(ends_kernel, items, group, alone, vdi, *window, opaque, has_ends, ends)
            scene = replace(scene, segments=0, only=part)
            enqueue(scene, scene.walk_arguments(forms, ends, has_ends=True), picture)
            runtime.launch(take, items, group, alone, vdi, *window, picture, image, owner)
        if (cells.alone == cells.NOBODY).any():
            nobody = np.int32(cells.NOBODY)
            runtime.launch(take, items, group, alone, nobody, *window, image, image, owner)
        runtime.finish()  # the buffers above may be host memory in use


class _Walk(NamedTuple):
    """A kernel that writes a VDI's segments, and what does not change per band."""

    kernel: Kernel
    rays: int  # that a work-item follows
    arguments: tuple[Any, ...]
    depth_shift: np.float32


class _MergedCells:
    """Draws a frame's cells in which several VDIs are met.

    ``order`` is that in which the scenes' streams of segments are written, and sums are formed;
    ``margin`` is :func:`owned_image`'s.
    """

    def __init__(
        self,
        runtime: Runtime,
        scenes: Sequence[Scene],
        on_device: Sequence[OnDevice],
        order: Sequence[int],
        margin: float,
    ) -> None:
        self._runtime = runtime
        self._size = scenes[0].size
        self._streams_of = np.argsort(order).astype(np.int32)
        self._margin = np.float32(margin)
        nearest = min(scene.reference_depth for scene in scenes)
        self._in_rows = _in_rows(runtime)
        self._walks = []
        for scene, (forms, ends) in ((scenes[i], on_device[i]) for i in order):
            strategy = strategy_for(scene)
            walk = scene.walk_arguments(forms, ends, has_ends=scene.ends is not None)
            shift = np.float32(scene.reference_depth - nearest)
            self._walks.append(_Walk(strategy.build(scene), strategy.rays, walk, shift))
        defines: Defines = {
            "STREAMS": len(scenes),
            **compensation(sum(scene.prepared.media for scene in scenes)),
        }
        in_blocks = self._in_rows and defines.get("COMPENSATED") != 2
        self._merged_rays = LANES if in_blocks else 1
        if in_blocks:
            self._merge = runtime.kernel("cpu16/merge.cl", "merge_blocks", defines)
        else:
            defines["SEGMENT_ROWS"] = int(self._in_rows)
            self._merge = runtime.kernel("multi_vdi/merge.cl", "merge", defines)

    def draw(
        self, cells: NDArray[np.int32], slots: int, image: DeviceBuffer, owner: DeviceBuffer
    ) -> int:
        """Draw cells, again where ``slots`` are too few, and return how many rays needed."""
        needed = self._pass(cells, slots, image, owner)
        most = int(needed.max())
        if most > slots:
            self._pass(cells[needed > slots], most, image, owner)
        return most

    def _pass(
        self, cells: NDArray[np.int32], slots: int, image: DeviceBuffer, owner: DeviceBuffer
    ) -> NDArray[np.int32]:
        """Draw cells whose rays have room, and return how many slots those of each have needed."""
        runtime = self._runtime
        width, height = self._size
        streams = len(self._walks)
        room = _POOL_BYTES_CPU if runtime.is_cpu else _POOL_BYTES
        ray_bytes = 4 * SEGMENT_SIZE * (slots + (SPARE_SLOTS if self._in_rows else 0))
        most = min(max(1, room // (CELL_ITEMS * ray_bytes)), len(cells))  # cells of a band
        rays = np.int32(most * CELL_ITEMS)
        with (
            runtime.result((int(rays) * ray_bytes // 4,), name="segments") as segments,
            runtime.result((streams, int(rays)), np.int32, "ends of the streams") as ends,
            runtime.result((streams, int(rays)), np.uint8, "VDIs met") as contributes,
            runtime.result((int(rays),), name="ends of light") as dark,
            runtime.buffer((len(cells),), np.int32, "slots needed") as needed,
            runtime.upload(cells, "cells") as of_cells,
            runtime.upload(self._streams_of, "order of the VDIs") as streams_of,
        ):
            runtime.fill(needed, np.int32(0))
            for first in range(0, len(cells), most):
                items = min(most, len(cells) - first) * CELL_ITEMS
                for number, walk in enumerate(self._walks):
                    runtime.launch(
                        walk.kernel,
                        items // walk.rays,
                        GROUP // walk.rays,
                        *walk.arguments,
                        of_cells,
                        np.int32(first),
                        np.int32(number),
                        rays,
                        walk.depth_shift,
                        self._margin,
                        np.int32(slots),
                        segments,
                        ends,
                        contributes,
                        dark,
                    )
                runtime.launch(
                    self._merge,
                    items // self._merged_rays,
                    GROUP // self._merged_rays,
                    segments,
                    np.int32(slots),
                    ends,
                    contributes,
                    rays,
                    of_cells,
                    np.int32(first),
                    np.int32(width),
                    np.int32(height),
                    np.float32(TRANSMITTANCE_CUTOFF),
                    streams_of,
                    needed,
                    image,
                    owner,
                )
            return runtime.download(needed)


def _in_rows(runtime: Runtime) -> bool:
    """Return whether segments lie ray by ray, for kernels in vectors (raycasting/segments.cl)."""
    return runtime.is_cpu
