"""How a chunked grid is cut into blocks, what each of them reads, and in which order V_O sees them.

A step of a ray belongs to the block in whose cells its midpoint lies. A block owns the points from
its first to the one before the next block's first; samples in its last cells read a few of its
neighbours' points too, the halo.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Geometry, Grid
from pyvista_vdi.volume.rays import GridPart

#: Bytes of a block's own points, unless one chunk has more: large ones exchange less and small ones
#: need less memory (docs/decisions/large.md).
BLOCK_BYTES = 2**24
#: A block has more points than any halo along each axis, or it belongs to the one before.
_LEAST_POINTS = 4
#: Pixels by which a block's window is larger than its projection: rays that rounding moves in.
_SLACK = 1.0

Indices = tuple[int, int, int]
Ends = tuple[float, float]
Offset = tuple[int, int, int]
Values = NDArray[Any]


@dataclass(frozen=True)
class Read:
    """A box of an array, read when it is called."""

    array: Any
    box: tuple[slice, ...]  # of its points (z, y, x)

    def __call__(self) -> Values:
        """Read it."""
        values: Values = self.array[self.box]
        return values

    @property
    def points(self) -> int:
        """How many points it reads."""
        return math.prod(part.stop - part.start for part in self.box)


@dataclass(frozen=True)
class Halo:
    """Points of neighbours before and behind a block's own that its samples read."""

    before: int
    after: int

    @classmethod
    def of(cls, transfer_function: TransferFunction) -> Halo:
        """Return what a classification needs: gradients look a point before and three behind."""
        gradients = transfer_function.shading or transfer_function.gradient_opacities is not None
        return cls(1, 3) if gradients else cls(0, 1)

    def offsets(self) -> Iterator[Offset]:
        """Yield where neighbours lie that points are needed of, in blocks along z, y and x."""
        ends = (0, 1) if self.before == 0 else (-1, 0, 1)
        yield from ((z, y, x) for z, y, x in itertools.product(ends, ends, ends) if z or y or x)

    def _taken(self, along: int) -> slice:
        """Points along an axis of a neighbour in this direction."""
        if along == 0:
            return slice(None)
        return slice(0, self.after) if along > 0 else slice(-self.before, None)

    def slabs(self, own: Values) -> dict[tuple[int, int], Values]:
        """Return copies of all points of a block that any neighbour may need, by axis and side."""
        sides = [1] + [-1] * (self.before > 0)
        return {
            (axis, side): own[(slice(None),) * axis + (self._taken(side),)].copy()
            for axis in range(3)
            for side in sides
        }

    def from_slabs(self, slabs: Mapping[tuple[int, int], Values], offset: Offset) -> Values:
        """Return a neighbour's points that a block needs, from the neighbour's slabs."""
        axis = next(k for k, along in enumerate(offset) if along)
        box = [self._taken(along) for along in offset]
        box[axis] = slice(None)
        return slabs[axis, offset[axis]][tuple(box)]


@dataclass(frozen=True)
class Blocks:
    """A grid in blocks."""

    grid: Grid
    #: Along z, y and x: the first point of each block, and behind them the number of points
    cuts: tuple[tuple[int, ...], ...]
    chunks: Indices  # points of a chunk along z, y and x: blocks begin where chunks do

    @classmethod
    def of(
        cls,
        geometry: Geometry,
        chunks: Sequence[int],
        point_bytes: int,
        block_bytes: int = BLOCK_BYTES,
    ) -> Blocks:
        """Cut a grid where its chunks end, into blocks of so many bytes at most."""
        points = tuple(reversed(geometry.dimensions))
        lengths = [min(chunk, n) for chunk, n in zip(chunks, points, strict=True)]
        while True:
            short = [k for k in range(3) if lengths[k] < points[k]]
            if not short or 2 * math.prod(lengths) * point_bytes > block_bytes:
                break
            axis = min(short, key=lambda k: lengths[k])
            lengths[axis] = min(2 * lengths[axis], points[axis])
        z, y, x = chunks
        return cls(Grid.of(geometry), tuple(map(_cuts, points, lengths)), (z, y, x))

    @property
    def counts(self) -> Indices:
        """Blocks along z, y and x."""
        z, y, x = (len(cuts) - 1 for cuts in self.cuts)
        return z, y, x

    def __iter__(self) -> Iterator[Indices]:
        nz, ny, nx = self.counts
        return itertools.product(range(nz), range(ny), range(nx))

    def __len__(self) -> int:
        return math.prod(self.counts)

    def own(self, block: Indices) -> tuple[slice, ...]:
        """Return where a block's own points lie in the grid, (z, y, x)."""
        return tuple(slice(cuts[k], cuts[k + 1]) for cuts, k in zip(self.cuts, block, strict=True))

    def neighbours(self, block: Indices, halo: Halo) -> dict[Offset, Indices]:
        """Return the neighbours of which a block needs points, by where they lie."""
        found = {}
        for offset in halo.offsets():
            z, y, x = (k + along for k, along in zip(block, offset, strict=True))
            if all(0 <= k < n for k, n in zip((z, y, x), self.counts, strict=True)):
                found[offset] = (z, y, x)
        return found

    def with_halo(self, own: Values, parts: Mapping[Offset, Values], halo: Halo) -> Values:
        """Put a block's points and those of its neighbours together."""
        if not parts:
            return own
        axes = range(3)
        before = [halo.before * any(offset[k] < 0 for offset in parts) for k in axes]
        after = [halo.after * any(offset[k] > 0 for offset in parts) for k in axes]
        shape = [before[k] + own.shape[k] + after[k] for k in axes]
        whole = np.empty((*shape, *own.shape[3:]), own.dtype)
        for offset, part in {(0, 0, 0): own, **parts}.items():
            starts = [
                (0 if along < 0 else before[k] + own.shape[k] * (along > 0))
                for k, along in enumerate(offset)
            ]
            ends = [start + n for start, n in zip(starts, part.shape, strict=False)]
            whole[tuple(map(slice, starts, ends))] = part
        return whole

    def part(
        self, block: Indices, halo: Halo | None, scalar_range: tuple[float, float]
    ) -> GridPart:
        """Return which part of the grid a block is, with the halo's points at hand or without."""
        before = halo.before if halo else 0
        first = [cuts[k] - before * (k > 0) for cuts, k in zip(self.cuts, block, strict=True)]
        lower, upper = self.ends(block, math.inf)
        return GridPart(self.grid, _xyz(first), _xyz(lower), _xyz(upper), scalar_range)

    def ends(self, block: Indices, beyond: float = 0.0) -> tuple[list[float], list[float]]:
        """Index positions (z, y, x) between which a block's cells lie; beyond the grid's ends."""
        lower, upper = [], []
        for cuts, k in zip(self.cuts, block, strict=True):
            lower.append(float(cuts[k]) if k > 0 else -beyond)
            upper.append(float(cuts[k + 1]) if k + 2 < len(cuts) else cuts[-1] - 1 + beyond)
        return lower, upper

    def windows(self, camera: Camera, size: tuple[int, int]) -> dict[Indices, Rectangle]:
        """Return where in V_O's window rays may meet each block that is not out of sight."""
        to_view = camera.model_to_view @ self.grid.index_to_model
        found = {}
        for block in self:
            lower, upper = self.ends(block)
            axes = [(low, high) for low, high in zip(lower, upper, strict=True)]
            corners = np.array([[x, y, z, 1.0] for z, y, x in itertools.product(*axes)])
            window = _window(corners @ to_view.T, camera, size)
            if window.pixels:
                found[block] = window
        return found

    def in_order(self, camera: Camera) -> list[Indices]:
        """Return the blocks so that none comes after one that hides it from V_O.

        Along a ray from the eye each index position moves away from the eye's, or stays: so do the
        numbers of the blocks that it passes through, on each axis, and their sum grows.
        """
        to_index = np.linalg.inv(camera.model_to_view @ self.grid.index_to_model)
        toward = to_index[:3, 2]
        eye = to_index[:3, 3]
        if camera.parallel_projection:
            eye = np.where(toward > 0, -np.inf, np.inf)
        places = [
            int(np.clip(np.searchsorted(cuts[1:-1], at, side="right"), 0, len(cuts) - 2))
            for cuts, at in zip(self.cuts, eye[::-1], strict=True)
        ]
        return sorted(
            self, key=lambda block: sum(abs(k - at) for k, at in zip(block, places, strict=True))
        )


def ends_of(values: Values) -> Ends:
    """Return the least and the largest scalar, NaN left out, unless there is nothing else."""
    scalars = values[..., 3] if values.ndim == 4 else values
    if values.dtype.kind != "f":
        return float(scalars.min()), float(scalars.max())
    return float(np.fmin.reduce(scalars, axis=None)), float(np.fmax.reduce(scalars, axis=None))


def _cuts(points: int, length: int) -> tuple[int, ...]:
    starts = [n for n in range(0, points, length) if n == 0 or points - n >= _LEAST_POINTS]
    return (*starts, points)


def _xyz(values: Sequence[Any]) -> tuple[Any, Any, Any]:
    z, y, x = values
    return x, y, z


def _window(corners: NDArray[np.float64], camera: Camera, size: tuple[int, int]) -> Rectangle:
    """Return the pixels that the hull of some points may cover, homogeneous view coordinates.

    All of the window where a corner is behind the eye.
    """
    whole = Rectangle(0, size[0], 0, size[1])
    depths = corners[:, 2]
    if not camera.parallel_projection and not (depths > 0).all():
        return whole if (depths > 0).any() else Rectangle(0, 0, 0, 0)
    viewport = corners @ camera.viewport_matrix(size).T
    places = (viewport[:, :2] / viewport[:, 3:] + 1) / 2 * size
    low = np.clip(np.floor(places.min(axis=0) - _SLACK), 0, size)
    high = np.clip(np.ceil(places.max(axis=0) + _SLACK), 0, size)
    (x0, y0), (x1, y1) = low.astype(int).tolist(), high.astype(int).tolist()
    return Rectangle(x0, x1, y0, y1)
