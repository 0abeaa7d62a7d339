"""Frey, Sadlo, Ertl 2013: every supersegment a frustum, projected, ordered and composited."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baselines.medium import KERNELS, DeviceMedium, Floats, Medium, view_of
from pyvista_vdi.device import Runtime, padded
from pyvista_vdi.device.work_order import GROUP
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

#: Pixels along the edges of a tile (TILE of the kernels), in which frusta are dealt to pixels.
TILE = 4
#: Tiles that a frame may have: their numbers have 16 bits, which are sorted several times as fast.
_MOST_TILES = 2**16

#: Least w of a corner in front of the eye, in the largest of all corners' magnitudes.
_LEAST_W = 1e-4


def to_window(medium: Medium, camera: Camera, size: tuple[int, int]) -> Floats:
    """Return (U d, V d, Z less the origin, 1) to a window: rows for x w, y w and w, pixels."""
    x, y, _, w = camera.viewport_matrix(size) @ medium.from_lists(camera)
    return np.stack([size[0] / 2 * (x + w), size[1] / 2 * (y + w), w])


class Frusta(DeviceMedium):
    """A VDI drawn as frusta on an OpenCL device, nearest first, without a rasterizer."""

    def __init__(self, runtime: Runtime, vdi: VDI) -> None:
        super().__init__(runtime, vdi)
        self._list_of = self.upload(self.list_of, np.int32)
        self._deal, self._composite = (
            runtime.kernel(KERNELS, name) for name in ("deal_to_tiles", "composite_tiles")
        )

    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.float32]:
        """Draw a frame; premultiplied RGBA (H, W, 4).

        A window of more than a million pixels raises UnsupportedError.
        """
        runtime, (wide, high) = self.runtime, (-(-edge // TILE) for edge in size)
        if wide * high > _MOST_TILES:
            raise UnsupportedError(
                f"a window of {size[0]} x {size[1]} has {wide * high} tiles of {TILE} x {TILE} "
                f"pixels, and frusta are dealt to {_MOST_TILES} at most: take a smaller one"
            )
        count, view = len(self.faces), view_of(self, camera, size)
        matrix = to_window(self, camera, size)
        least = _LEAST_W * np.abs(matrix[2] @ self._corners()).max(initial=0.0)
        window = np.append(matrix.ravel(), least if len(self.faces) else 0.0)
        with (
            self.upload(self.order(camera), np.int32) as order,
            self.upload(window, np.float32) as to,
        ):
            shared = (
                np.int32(count),
                order,
                self._list_of,
                self.lists[1],
                np.int32(self.wide),
                to,
                np.float32(self.vdi.depth_origin),
                np.int32(self.parallel),
                np.int32(wide),
                np.int32(high),
            )
            items = padded(count, GROUP)
            with runtime.result((max(count, 1),), np.int32, "tiles of frusta") as numbers:
                runtime.launch(self._deal, items, GROUP, *shared, None, numbers, None, None)
                met = np.zeros(count + 1, np.int64)
                np.cumsum(runtime.download(numbers)[:count], out=met[1:])
            pairs = max(1, int(met[-1]))
            with (
                self.upload(met, np.int32) as begins,
                runtime.result((pairs,), np.uint16, "tiles met") as tiles,
                runtime.result((pairs,), np.int32, "frusta met") as frusta,
            ):
                runtime.launch(self._deal, items, GROUP, *shared, begins, None, tiles, frusta)
                tile_of = runtime.download(tiles)[: int(met[-1])]
                by_tile = runtime.download(frusta)[np.argsort(tile_of, kind="stable")]
        begins_of_tiles = np.zeros(wide * high + 1, np.int64)
        np.cumsum(np.bincount(tile_of, minlength=wide * high), out=begins_of_tiles[1:])
        with (
            self.upload(begins_of_tiles, np.int32) as tile_begins,
            self.upload(by_tile, np.int32) as members,
        ):
            before = (tile_begins, members, self._list_of, *self.lists[1:], np.int32(self.wide))
            after = (np.int32(wide), np.int32(wide * high))
            pixels = wide * high * TILE**2
            return self.draw(self._composite, view, size, before, after, pixels)

    def _corners(self) -> Floats:
        """Return the corners of all lists over all depths, (4, 8): (U d, V d, Z less origin, 1)."""
        depths = [self.faces[:, 0].min(initial=0.0), self.faces[:, 1].max(initial=0.0)]
        points = []
        for z in depths:
            d = 1.0 if self.parallel else z + self.vdi.depth_origin
            points += [(i * d, j * d, z, 1.0) for i in (0, self.wide) for j in (0, self.high)]
        return np.array(points).T
