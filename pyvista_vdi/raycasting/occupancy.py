"""The occupancy grid of a VDI: where there is something to see (paper section 4)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, kept_together, padded
from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.device.work_order import GROUP
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.packing import Packed8
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.kernels import (
    COUNT_PACKED,
    COUNT_SUPERSEGMENTS,
    COUNTED,
    OCCUPIED_SLABS,
)

#: Squares of stacks along the grid's longer edge: `OccupancyGrid.corners` has a box for each.
_SQUARES = 12

#: By how much supersegments count beyond their faces: roundings of 2**-23 of the depths that the
#: raycaster looks up. At most 17 add up (docs/conventions.md, "Occupancy grid").
_ROUNDINGS = 32

#: Share of the cells within the volume's bounds above which skipping costs more than it saves.
#: Measured: on a CPU it gains below .6 and loses above 1 (docs/decisions/empty_space.md), on a GPU
#: it gains at .30 and loses from .39 on (docs/decisions/gpu.md).
_WORTHWHILE, _WORTHWHILE_ON_GPU = 0.8, 1 / 3


class OccupancyGrid:
    """How many supersegments reach into each cell: stacks of 64 slabs over 16 x 16 lists.

    A supersegment that spans several slabs counts in each. The slabs are equal in view depth and
    span the depth range of the VDI's bounds. Built on the device, from the VDI's arrays alone, so
    that a file need not carry it.

    ``lists`` are the kernel's arguments: buffers of offsets, which take 64 bits if
    ``long_offsets``, and of fronts and backs, or of 8-byte lists their origins, strides, words and
    step. ``nearest`` is the least view depth in front of V_O's eye, and ``shifted`` says whether
    the depth coordinate is that of a long lens.
    """

    #: uint32 (stacks high, stacks wide, slabs); uint64 per stack: bit s is set where slab s is
    #: occupied.
    counts: DeviceBuffer
    masks: DeviceBuffer

    def __init__(
        self,
        runtime: Runtime,
        vdi: VDI,
        lists: dict[str, Any],
        *,
        nearest: float,
        shifted: bool,
        long_offsets: bool,
    ) -> None:
        self._on_cpu = runtime.is_cpu
        width, height = vdi.window_size
        wide, high = self.stacks = (-(-width // STACK), -(-height // STACK))
        near, far = rays.depth_range(vdi.camera, vdi.bounds)
        if not vdi.camera.parallel_projection:
            near = max(near, nearest)
        #: Where slab 0 begins, view depth less the VDI's depth origin; slabs per world unit.
        self.first_depth = near - vdi.depth_origin
        # Bounds without depth, or behind the eye: everything is in slab 0
        self.slabs_per_depth = SLABS / (far - near) if far > near else 1.0
        #: By which supersegments count beyond their faces, world units: more than the raycaster's
        #: depths are rounded by.
        self.margin = _ROUNDINGS * 2.0**-23 * _looked_up(vdi, near, far, shifted)
        with kept_together() as keep:
            self.counts = keep(runtime.buffer((high, wide, SLABS), np.uint32, "occupancy counts"))
            self.masks = keep(runtime.buffer((high, wide), np.uint64, "occupancy masks"))
            # Count, and sum up by stacks
            offset_type = {"OFFSET_T": "long" if long_offsets else "int"}
            packed = isinstance(vdi.packing, Packed8)
            count = runtime.bind(
                COUNT_PACKED if packed else COUNT_SUPERSEGMENTS,
                offset_type,
                **lists,
                grid=COUNTED(
                    width=width,
                    height=height,
                    stacks_wide=wide,
                    first_depth=self.first_depth,
                    slabs_per_depth=self.slabs_per_depth,
                    margin=self.margin,
                ),
                changes=self.counts,
            )
            occupied = runtime.bind(
                OCCUPIED_SLABS,
                offset_type,
                counts=self.counts,
                stacks=wide * high,
                masks=self.masks,
            )
            runtime.fill(self.counts, np.uint32(0))
            count(padded(width * height, GROUP), GROUP)
            occupied(padded(wide * high, GROUP), GROUP)
            masks = runtime.download(self.masks)
        #: Model points, (n, 3), whose convex hull holds all occupied cells that rays meet, and a
        #: list and a slab around them.
        self.corners = _corners(vdi, masks, near, far)
        cells = _share_in_bounds(vdi, near, far) * masks.size * SLABS
        #: Occupied cells over cells within the volume's bounds; above 1 if borders are crossed.
        self.occupied = float(np.unpackbits(masks.view(np.uint8)).sum() / max(cells, 1.0))

    @property
    def worthwhile(self) -> bool:
        """Whether enough is empty for skipping to gain time."""
        return self.occupied < (_WORTHWHILE if self._on_cpu else _WORTHWHILE_ON_GPU)


def _corners(vdi: VDI, masks: NDArray[np.uint64], near: float, far: float) -> NDArray[np.float64]:
    """Return corners of boxes in list space that hold the occupied cells, in the model frame.

    A box for each square of stacks. ``near`` and ``far`` are the view depths that slabs divide;
    what counts in the first or the last of them lies within the bounds, too, where a ray meets it.
    """
    half = np.asarray(vdi.window_size) / 2
    pixel_rays = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds)
    slab = (far - near) / SLABS
    least = -np.inf if vdi.camera.parallel_projection else 0.0
    high, wide = masks.shape
    edge = -(-max(high, wide) // _SQUARES)
    points = [np.empty((0, 3))]
    for row in range(0, high, edge):
        for column in range(0, wide, edge):
            part = masks[row : row + edge, column : column + edge]
            j, i = np.nonzero(part)
            if not i.size:
                continue
            bits = np.unpackbits(part.reshape(-1, 1).view(np.uint8), axis=1, bitorder="little")
            slabs = np.flatnonzero(bits.any(axis=0))
            a = (column + np.array([i.min(), i.max() + 1])) * STACK + [-1, 1] - half[0]
            b = (row + np.array([j.min(), j.max() + 1])) * STACK + [-1, 1] - half[1]
            depth = np.maximum(near + slab * (slabs[[0, -1]] + [-1, 2]), least)
            at = np.stack(np.meshgrid(1.0, a, b, depth, indexing="ij"), axis=-1).reshape(-1, 4)
            t = at[:, 3:] - pixel_rays.reference_depth
            points.append(at[:, :3] @ pixel_rays.origin + t * (at[:, :3] @ pixel_rays.direction))
    return np.concatenate(points)


def _looked_up(vdi: VDI, near: float, far: float, shifted: bool) -> float:
    """Return the size of what the raycaster rounds where it looks up a depth, world units.

    That is the offset from the VDI's depth origin and, in perspective, the depth coordinate times
    the change of view depth Z with it: Z**2 for -1 / Z, Z**2 / depth_origin for the long lens's
    (``opencl/lib/list_space.cl``; docs/conventions.md, "Occupancy grid").
    """
    origin = vdi.depth_origin
    offset = max(abs(near - origin), abs(far - origin))
    if vdi.camera.parallel_projection:
        return offset
    if shifted:
        coordinate = max(abs(near - origin) / near, abs(far - origin) / far)
        return offset + coordinate * far**2 / origin
    return offset + max(far, 0.0)


def _share_in_bounds(vdi: VDI, near: float, far: float) -> float:
    """Return the share of all cells that lies within the bounds, by the stacks' centre rays."""
    width, height = vdi.window_size
    pixel_rays = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds)
    a, b = np.meshgrid(_stack_centres(width), _stack_centres(height))
    pixels = np.stack([np.ones_like(a), a, b], axis=-1)
    first = np.full(a.shape, near - pixel_rays.reference_depth)
    last = np.full(a.shape, far - pixel_rays.reference_depth)
    for form in rays.box_planes(pixel_rays, vdi.bounds):
        value, slope = pixels @ form[:3], pixels @ form[3:]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -value / slope
        first = np.where(slope > 0, np.maximum(first, crossing), first)
        last = np.where(slope < 0, np.minimum(last, crossing), last)
        last = np.where((slope == 0) & (value < 0), first, last)  # beside the bounds
    depth = far - near
    return float(np.maximum(last - first, 0).mean() / depth) if depth > 0 else 0.0


def _stack_centres(lists: int) -> NDArray[np.float64]:
    """Return the stacks' centres along an edge of that many lists, pixels from its middle."""
    starts = np.arange(0, lists, STACK)
    return (starts + np.minimum(starts + STACK, lists)) / 2 - lists / 2
