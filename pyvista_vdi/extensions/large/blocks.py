"""How a chunked grid is cut into blocks, what each of them reads, and in which order V_O sees them.

A step of a ray belongs to the block in whose cells its midpoint lies. A block owns the points from
its first to the one before the next block's first; samples in its last cells read a few of its
neighbours' points too.
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
from pyvista_vdi.model.volume import Grid
from pyvista_vdi.volume.rays import GridPart

#: Bytes of a block's own points, unless one chunk has more: large ones exchange less and small ones
#: need less memory (docs/decisions/large.md).
BLOCK_BYTES = 2**24
#: A block has more points than are read of a neighbour along each axis, or it belongs to the one
#: before.
_LEAST_POINTS = 4

Indices = tuple[int, int, int]
Ends = tuple[float, float]
Offset = tuple[int, int, int]
Values = NDArray[Any]
Windows = Mapping[Indices, Rectangle]


@dataclass(frozen=True)
class Blocks:
    """A grid in blocks."""

    grid: Grid
    #: Along z, y and x: the first point of each block, and behind them the number of points
    cuts: tuple[tuple[int, ...], ...]
    #: Points of neighbours before and behind a block's own that its samples read
    before: int
    after: int

    @classmethod
    def of(cls, of: Grid, cuts: Sequence[Sequence[int]], function: TransferFunction) -> Blocks:
        """Return blocks for a classification: gradients look a point before and three behind."""
        grid = Grid(of.dimensions, of.spacing, of.origin, of.direction, of.unit_distance)
        gradients = function.shading or function.gradient_opacities is not None
        return cls(grid, tuple(map(tuple, cuts)), *((1, 3) if gradients else (0, 1)))

    @property
    def counts(self) -> Indices:
        """Blocks along z, y and x."""
        z, y, x = (len(cuts) - 1 for cuts in self.cuts)
        return z, y, x

    def __iter__(self) -> Iterator[Indices]:
        nz, ny, nx = self.counts
        return itertools.product(range(nz), range(ny), range(nx))

    def own(self, block: Indices) -> tuple[slice, ...]:
        """Return where a block's own points lie in the grid, (z, y, x)."""
        return tuple(slice(cuts[k], cuts[k + 1]) for cuts, k in zip(self.cuts, block, strict=True))

    @property
    def offsets(self) -> list[Offset]:
        """Where neighbours lie that points are needed of, in blocks along z, y and x."""
        ends = (-1, 0, 1) if self.before else (0, 1)
        return [(z, y, x) for z, y, x in itertools.product(ends, ends, ends) if z or y or x]

    def neighbours(self, block: Indices) -> dict[Offset, Indices]:
        """Return the neighbours of which a block needs points, by where they lie."""
        found = {}
        for offset in self.offsets:
            z, y, x = (k + along for k, along in zip(block, offset, strict=True))
            if all(0 <= k < n for k, n in zip((z, y, x), self.counts, strict=True)):
                found[offset] = (z, y, x)
        return found

    def faces(self, own: Values) -> dict[Offset, Values]:
        """Return copies of the points that those around a block need, by where it is for them."""
        along = {0: slice(None), 1: slice(0, self.after), -1: slice(-self.before, None)}
        return {offset: own[tuple(along[k] for k in offset)].copy() for offset in self.offsets}

    def part(self, block: Indices, before: int, scalar_range: Ends) -> GridPart:
        """Return which part of the grid a block is, with so many points before its own at hand."""
        begins = [cuts[k] - before * (k > 0) for cuts, k in zip(self.cuts, block, strict=True)]
        at: Any = begins, *self.ends(block, math.inf)
        first, lower, upper = ((x, y, z) for z, y, x in at)
        return GridPart(self.grid, first, lower, upper, scalar_range)

    def ends(self, block: Indices, beyond: float = 0.0) -> tuple[list[float], list[float]]:
        """Index positions (z, y, x) between which a block's cells lie; beyond the grid's ends."""
        lower, upper = [], []
        for cuts, k in zip(self.cuts, block, strict=True):
            lower.append(float(cuts[k]) if k > 0 else -beyond)
            upper.append(float(cuts[k + 1]) if k + 2 < len(cuts) else cuts[-1] - 1 + beyond)
        return lower, upper

    def corners(self, block: Indices) -> NDArray[np.float64]:
        """Return those of a block's cells, model coordinates (8, 3)."""
        corners = np.array([*itertools.product(*zip(*self.ends(block), strict=True))])[:, ::-1]
        return corners @ self.grid.index_to_model[:3, :3].T + self.grid.index_to_model[:3, 3]

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


def cuts_of(
    points: Sequence[int], chunks: Sequence[int], point_bytes: int, block_bytes: int = BLOCK_BYTES
) -> list[tuple[int, ...]]:
    """Cut a grid where its chunks end, into blocks of so many bytes at most.

    ``points`` and ``chunks``: points of the grid and of a chunk along z, y and x.
    """
    lengths = [min(chunk, n) for chunk, n in zip(chunks, points, strict=True)]
    while True:
        short = [k for k in range(3) if lengths[k] < points[k]]
        if not short or 2 * math.prod(lengths) * point_bytes > block_bytes:
            break
        axis = min(short, key=lambda k: lengths[k])
        lengths[axis] = min(2 * lengths[axis], points[axis])
    return [
        (*(at for at in range(0, n, length) if at == 0 or n - at >= _LEAST_POINTS), n)
        for n, length in zip(points, lengths, strict=True)
    ]


def with_halo(own: Values, parts: Mapping[Offset, Values]) -> Values:
    """Put a block's points and those of its neighbours together."""
    pieces, join = {(0, 0, 0): own, **parts}, np.concatenate
    zs, ys, xs = (sorted({offset[axis] for offset in pieces}) for axis in range(3))
    return join([join([join([pieces[z, y, x] for x in xs], 2) for y in ys], 1) for z in zs])


def ends_of(values: Values) -> Ends:
    """Return the least and the largest scalar, NaN left out, unless there is nothing else."""
    scalars = values[..., 3] if values.ndim == 4 else values
    if values.dtype.kind != "f":
        return float(scalars.min()), float(scalars.max())
    return float(np.fmin.reduce(scalars, axis=None)), float(np.fmax.reduce(scalars, axis=None))
