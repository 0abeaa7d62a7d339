"""A volume that a device cannot hold, or is not allowed to: brick by brick (volume/bricks.cl).

Which bricks the steps of some rays lie in is asked of the device; each of them is copied there,
the steps in it are sampled, and what was used longest ago makes room for the next. The samples are
those of the whole volume to the last bit, and so is what is made of them.
"""

import itertools
import math
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.device import DeviceBuffer, Keep, Runtime, kept_together
from pyvista_vdi.device.constants import GROUP, block_items
from pyvista_vdi.volume.rays import Variant

#: Logarithms to base 2 of the cells along a brick's edge: large ones copy fewer points twice.
SHIFTS = (6, 5, 4)
#: Bricks that should be on a device at once: a slice of rays then finds most where it left them.
_ENOUGH_SLOTS = 64
#: Points before and behind a brick's cells that samples in them read, and that gradients read.
_NEIGHBOURS, _GRADIENT_NEIGHBOURS = (0, 1), (1, 3)
#: Bytes of a step's sample: colour and optical depth, float32.
SAMPLE_BYTES = 16
#: Share of a device's free memory that bricks take where no limit is given: drivers need some.
_SHARE_OF_FREE = 0.8
#: Turns part of a volume's array, or all of it, into what the kernels read, C-contiguous.
Read = Callable[[NDArray[Any]], NDArray[Any]]


@dataclass(frozen=True)
class Room:
    """Device memory for a volume: the limit, if any, and what else is on the device meanwhile.

    ``working``: bytes of the buffers that the rays need; ``samples``: those of the samples of all
    rays that bricks need beside them; ``rays``: what they are of, for messages.
    """

    limit: int | None
    working: int
    samples: int
    rays: str

    def in_all(self, runtime: Runtime) -> int:
        """Return the bytes that may be taken, drivers' needs left out."""
        if self.limit is not None:
            return self.limit
        return int(_SHARE_OF_FREE * (runtime.info.global_memory - runtime.allocated))


@dataclass(frozen=True)
class BrickLayout:
    """How a grid is cut into bricks.

    ``shift``: logarithm to base 2 of the cells along an edge; ``gradients``: whether samples need
    the points that gradients read; ``counts``: bricks along x, y and z, ``n_bricks`` in all, each
    of ``points`` along an edge, ``before`` of them before its first cell; ``brick_bytes``: of one
    on the device; ``table_bytes``: of what says which bricks are wanted, and where they are.
    """

    shift: int
    gradients: bool
    counts: tuple[int, int, int]
    n_bricks: int
    before: int
    points: int
    brick_bytes: int
    table_bytes: int

    @classmethod
    def of(
        cls, dimensions: Sequence[int], shift: int, gradients: bool, point_bytes: int
    ) -> "BrickLayout":
        """Return the layout for a grid of so many points along x, y and z."""
        x, y, z = (-(-(points - 1) // 2**shift) for points in dimensions)
        before, behind = _GRADIENT_NEIGHBOURS if gradients else _NEIGHBOURS
        n, points = x * y * z, before + 2**shift + behind
        return cls(shift, gradients, (x, y, z), n, before, points, points**3 * point_bytes, 8 * n)

    def region(self, brick: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
        """Return where a brick lies in the grid and in its own points, both (z, y, x)."""
        x, y, _ = self.counts
        numbers = brick // (x * y), brick // x % y, brick % x
        firsts = [(n << self.shift) - self.before for n in numbers]
        grid = tuple(slice(max(first, 0), first + self.points) for first in firsts)
        own = tuple(slice(max(-first, 0), self.points) for first in firsts)
        return grid, own


def fitting_layout(
    dimensions: Sequence[int], point_bytes: int, gradients: bool, nbytes: int, largest: int
) -> tuple[BrickLayout, int] | None:
    """Return how to cut a grid, and how many bricks the device holds at once; None: not even one.

    Bricks and their tables may take ``nbytes``, and one buffer ``largest``.
    """
    best = None
    for shift in SHIFTS:
        layout = BrickLayout.of(dimensions, shift, gradients, point_bytes)
        room = min(nbytes - layout.table_bytes, largest)
        slots = min(room // layout.brick_bytes, layout.n_bricks)
        if slots > 0:
            best = layout, slots
        if slots >= min(_ENOUGH_SLOTS, layout.n_bricks):
            break
    return best


class DeviceBricks(AbstractContextManager["DeviceBricks"]):
    """The bricks of a volume that are on a device.

    Parameters are the voxels, read as they are needed; what turns part of them into what kernels
    read, of ``dtype``; how they are cut, how many ``slots`` there are, and the ``memory_limit``
    that was asked for; and which macrocells are ``visible``: other bricks are never copied.
    ``pool`` has the bricks, ``slots`` where each is whose steps are to be sampled now, int32, -1
    for the others; ``wanted`` is for kernels to say which they need; ``copied`` counts bricks that
    were copied to the device so far.
    """

    def __init__(
        self,
        runtime: Runtime,
        array: NDArray[Any],
        read: Read,
        dtype: DTypeLike,
        layout: BrickLayout,
        slots: int,
        memory_limit: int | None,
        visible: DeviceBuffer,
        name: str,
    ) -> None:
        self.layout = layout
        self.visible = visible
        self.memory_limit = memory_limit
        self.copied = 0
        self._runtime = runtime
        self._array = array
        self._read = read
        self._staged = np.zeros((layout.points,) * 3 + array.shape[3:], dtype)
        self._slot_of: OrderedDict[int, int] = OrderedDict()  # used longest ago first
        self._free = list(range(slots))
        self._n_slots = slots
        with kept_together() as keep:
            pool = runtime.buffer((slots, self._staged.size), dtype, f"bricks of volume {name!r}")
            self.pool = keep(pool)
            self.slots = keep(runtime.buffer((layout.n_bricks,), np.int32, "slots of bricks"))
            self.wanted = keep(runtime.buffer((layout.n_bricks,), np.uint32, "wanted bricks"))

    def __exit__(self, *_: object) -> None:
        self._runtime.finish()
        for buffer in (self.pool, self.slots, self.wanted):
            buffer.release()

    def rounds(self, bricks: NDArray[np.intp]) -> Iterator[None]:
        """Bring bricks to the device, as many at a time as there is room for.

        In each round ``slots`` says where those are that have not had their turn.
        """
        ordered = sorted(bricks.tolist(), key=lambda brick: brick not in self._slot_of)
        for first in range(0, len(ordered), self._n_slots):
            now = ordered[first : first + self._n_slots]
            missing = [brick for brick in now if brick not in self._slot_of]
            for brick in now:
                if brick in self._slot_of:
                    self._slot_of.move_to_end(brick)
            for brick in missing:
                self._runtime.give_way()
                slot = self._free.pop() if self._free else self._slot_of.popitem(last=False)[1]
                self._copy(brick, slot)
                self._slot_of[brick] = slot
            slots = np.full(self.layout.n_bricks, -1, np.int32)
            slots[now] = [self._slot_of[brick] for brick in now]
            self._runtime.write(self.slots, slots)
            yield

    def _copy(self, brick: int, slot: int) -> None:
        grid, own = self.layout.region(brick)
        part = self._read(self._array[grid])
        # What a brick at the volume's end holds beyond it is never read
        starts = (place.start for place in own)
        place = tuple(slice(k, k + n) for k, n in zip(starts, part.shape[:3], strict=True))
        self._staged[place] = part
        self._runtime.write(self.pool, self._staged.ravel(), first=slot * self._staged.size)
        self.copied += 1


class StepSampler:
    """Samples the steps of rays in a volume that is on the device brick by brick.

    ``medium``: arguments ``MEDIUM_PARAMETERS``; ``variant``: what kernels are compiled for;
    ``room``: most steps of all rays at a time; ``ends``: where each ray ends in t, top row first.
    ``samples`` are those of the steps that were sampled last, for kernels that march; ``keep`` is
    given their buffer.
    """

    def __init__(
        self,
        runtime: Runtime,
        bricks: DeviceBricks,
        medium: Mapping[str, Any],
        variant: Variant,
        forms: DeviceBuffer,
        room: int,
        keep: Keep,
        ends: DeviceBuffer | None = None,
    ) -> None:
        self._runtime = runtime
        self._bricks = bricks
        self.samples = keep(runtime.buffer((room, 4), name="samples of steps"))
        rays: dict[str, Any] = {"forms": forms, "opaque_depth": ends, "visible": bricks.visible}
        layout = bricks.layout
        numbers: dict[str, Any] = {"shift": layout.shift, "points": layout.points}
        numbers |= {"margin": layout.before, "counts": (*layout.counts, 0)}
        rays |= {"bricks": numbers, "samples": self.samples}
        defines = replace(variant, index="uint").defines  # of a brick's points
        self._launch = runtime.bind(
            "volume/bricks.cl", "sample_steps", defines, **medium, slots=bricks.slots, **rays
        )

    def sample(self, view: dict[str, Any]) -> None:
        """Sample steps of rays, as their numbers (``RaysOfView``) say."""
        items, wanted = block_items(view["columns"], view["rows"]), self._bricks.wanted
        self._runtime.fill(wanted, np.uint32(0))
        self._launch(items, GROUP, view=view, wanted=wanted)
        for _ in self._bricks.rounds(np.flatnonzero(self._runtime.download(wanted))):
            self._launch(items, GROUP, view=view, wanted=None)


def in_parts(
    macrocells: tuple[int, int, int], macrocell_points: int, point_bytes: int, nbytes: int
) -> Iterator[tuple[tuple[slice, ...], tuple[slice, ...]]]:
    """Yield parts of whole macrocells of up to ``nbytes``, or one macrocell, cut along z first.

    Of each which macrocells, and which points, both (z, y, x); macrocells share the points on their
    faces.
    """
    lengths = list(reversed(macrocells))
    for axis in range(3):
        of_others = math.prod(n * macrocell_points + 1 for k, n in enumerate(lengths) if k != axis)
        fitting = (nbytes // (of_others * point_bytes) - 1) // macrocell_points
        lengths[axis] = max(1, min(lengths[axis], fitting))
        if fitting >= 1:
            break
    starts = (range(0, n, length) for n, length in zip(reversed(macrocells), lengths, strict=True))
    for first in itertools.product(*starts):
        ends = [
            min(start + length, n)
            for start, length, n in zip(first, lengths, reversed(macrocells), strict=True)
        ]
        yield (
            tuple(slice(start, end) for start, end in zip(first, ends, strict=True)),
            tuple(
                slice(start * macrocell_points, end * macrocell_points + 1)
                for start, end in zip(first, ends, strict=True)
            ),
        )
