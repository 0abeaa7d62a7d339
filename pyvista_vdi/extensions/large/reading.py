"""Which chunks are read at all: none of which nothing shows, and none that are known."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.large.blocks import Blocks, Indices, Values
from pyvista_vdi.extensions.large.passes import Task
from pyvista_vdi.model.chunked import Ranges

Box = tuple[slice, ...]


@dataclass(frozen=True)
class Read:
    """A box of an array, read when it is called, but for chunks whose values are known."""

    array: Any
    box: Box  # of its points (z, y, x)
    #: Values of chunks that need not be read, by their boxes in the box
    known: dict[tuple[tuple[int, int], ...], float] = field(default_factory=dict)
    #: The boxes of the other chunks, where there are any that are known
    others: list[tuple[tuple[int, int], ...]] = field(default_factory=list)

    def __call__(self) -> Values:
        """Read it."""
        if not self.known:
            values: Values = self.array[self.box]
            return values
        shape = [part.stop - part.start for part in self.box]
        whole = np.empty(shape, self.array.dtype)
        for place, value in self.known.items():
            whole[_slices(place)] = value
        for place in self.others:
            at = tuple(
                slice(part.start + a, part.start + b)
                for part, (a, b) in zip(self.box, place, strict=True)
            )
            whole[_slices(place)] = self.array[at]
        return whole

    @property
    def points(self) -> int:
        """How many points it reads."""
        boxes = self.others if self.known else [tuple((p.start, p.stop) for p in self.box)]
        return sum(math.prod(b - a for a, b in box) for box in boxes)


@dataclass(frozen=True)
class Plan:
    """What is read of an array for a task."""

    array: Any
    blocks: Blocks
    needed: NDArray[np.bool_] | None = None  # whether a chunk is read; ``None`` where all are
    low: NDArray[np.float64] | None = None  # the value of those that are not

    @classmethod
    def of(cls, task: Task, array: Any, ranges: Ranges | None) -> Plan:
        """Plan the reading for a task.

        A chunk whose values lie in a range of which nothing shows, in the cells to its neighbours
        neither, may have any value of the range. A constant chunk has its own; one of floats may
        have NaN beside it, which ranges leave out.
        """
        if ranges is None:
            return cls(array, task.blocks)
        low, high = ranges
        around = task.may_be_visible(_around(np.fmin, low), _around(np.fmax, high))
        constant = np.isnan(low)
        if array.dtype.kind != "f":
            constant |= low == high
        return cls(array, task.blocks, around & ~constant, low)

    def read(self, block: Indices) -> Read:
        """Return what reads a block's own points."""
        box = self.blocks.own(block)
        if self.needed is None or self.low is None:
            return Read(self.array, box)
        known, others = {}, []
        for at, place in self._chunks(box):
            if self.needed[at]:
                others.append(place)
            else:
                known[place] = float(self.low[at])
        return Read(self.array, box, known, others)

    def _chunks(self, box: Box) -> Iterator[tuple[tuple[int, ...], tuple[tuple[int, int], ...]]]:
        axes = [
            [
                (k, (max(k * n - part.start, 0), min((k + 1) * n, part.stop) - part.start))
                for k in range(part.start // n, -(-part.stop // n))
            ]
            for part, n in zip(box, self.blocks.chunks, strict=True)
        ]
        for cell in itertools.product(*axes):
            yield tuple(k for k, _ in cell), tuple(place for _, place in cell)


def _around(least: np.ufunc, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least (or largest) of each chunk and its 26 neighbours."""
    for axis in range(3):
        before, after = np.roll(values, 1, axis), np.roll(values, -1, axis)
        ends = [slice(None)] * 3
        ends[axis] = slice(0, 1)
        before[tuple(ends)] = np.nan
        ends[axis] = slice(-1, None)
        after[tuple(ends)] = np.nan
        values = least(values, least(before, after))
    return values


def _slices(place: tuple[tuple[int, int], ...]) -> Box:
    return tuple(slice(a, b) for a, b in place)
