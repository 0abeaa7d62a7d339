"""The arrays of a VDI while slices of lists are written into them, one behind the other."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import (
    DeviceBuffer,
    GrowingArray,
    Runtime,
    aligned_empty,
    kept_together,
)
from pyvista_vdi.device.constants import GROUP, LISTS_PER_ITEM
from pyvista_vdi.generation.kernels import LIST_OFFSETS, SUM_LENGTHS
from pyvista_vdi.model.host_memory import require_host_memory

#: A VDI's arrays of supersegments, as messages call them, and the shape of an element.
_LIST_ARRAYS: dict[str, tuple[int, ...]] = {
    "front depths": (),
    "back depths": (),
    "supersegment colours": (3,),
    "optical depths": (),
}
#: Bytes of a supersegment in them, and in the largest of them.
SUPERSEGMENT_BYTES, _LARGEST_ELEMENT = 24, 12


class GrowingLists(ABC):
    """A VDI's arrays while slices of lists are written into them, one behind the other.

    Room for every list at its longest is asked for at once: systems take memory as it is written,
    so that what stays unused costs nothing, and nothing is ever copied. :meth:`finished` gives it
    back. The device sums up the lists' lengths itself; the host learns the sum of a slice when it
    has launched the march of the next, and waits for nothing else.
    """

    _offsets_on_device: DeviceBuffer

    def __init__(self, runtime: Runtime, size: tuple[int, int], limit: int, slice_lists: int):
        self._runtime = runtime
        self._size = size
        self._limit = limit
        self._most = size[0] * size[1] * limit  # supersegments
        self._offsets = aligned_empty(size[0] * size[1] + 1, np.uint64)
        self._offsets[0] = 0
        self._made = 0  # lists, those of the last slice included
        self._first = 0  # place, on the device, of the next slice's first offset
        self._known = 0  # supersegments of all lists whose sum is known here
        self._summing: Callable[[], int] | None = None  # waits for the sum with the last slice
        self._arrays = {name: GrowingArray(item) for name, item in _LIST_ARRAYS.items()}
        self._targets: list[DeviceBuffer] = []  # of slices' supersegments, in the arrays' order
        self._sums = runtime.buffer((blocks_to_sum(slice_lists),), np.uint64, "sums of lengths")
        shared = {"partial": GROUP, "sums": self._sums}
        self._sum_lengths = runtime.bind(SUM_LENGTHS, **shared)
        self._place_lists = runtime.bind(LIST_OFFSETS, **shared)

    def __enter__(self) -> "GrowingLists":
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._runtime.finish()  # the arrays may go when nothing is copied into them any more
        finally:
            for buffer in (*self._targets, self._sums, self._offsets_on_device):
                buffer.release()

    def follow(self, lengths: DeviceBuffer, n: int) -> dict[str, Any]:
        """Find where the next n lists go, of which there are so many lengths, on the device.

        Returns the arguments ``offsets`` to ``optical_depths`` of the kernel ``pack_lists``.
        """
        self.wait()
        items, made, offsets = blocks_to_sum(n) * GROUP, self._first, self._offsets_on_device
        self._sum_lengths(items, GROUP, lists=n, lengths=lengths)
        self._place_lists(items, GROUP, lists=n, lengths=lengths, made=made, all_offsets=offsets)
        held = self._expect(n)
        arrays = zip(("fronts", "backs", "colors", "optical_depths"), self._targets, strict=True)
        return {"offsets": offsets, "made": made, "held": held, **dict(arrays)}

    def wait(self) -> None:
        """Wait until the lengths of the last slice are summed up."""
        if self._summing is None:
            return
        begin, self._known = self._known, self._summing()
        self._summing = None
        require_room(self._known, self._size)
        self._learned(begin)

    def finished(self) -> list[NDArray[Any]]:
        """Return offsets, fronts, backs, colours and optical depths."""
        self.wait()
        self._collect_all()
        arrays = [array.finished(self._known) for array in self._arrays.values()]
        return [self._offsets, *arrays]

    @abstractmethod
    def _expect(self, n: int) -> int:
        """Begin to fetch the sum with n more lists, and make room for them.

        Returns the supersegments before those that the targets hold.
        """

    @abstractmethod
    def _learned(self, begin: int) -> None:
        """Do what can be done now that it is known which supersegments the last slice has."""

    @abstractmethod
    def _collect_all(self) -> None:
        """Bring what the device still has to the arrays."""


class _ListsInPlace(GrowingLists):
    """The arrays on a device that uses them in place: all slices are written by the same buffers.

    These reach as far as they may; where the lists might pass their end, the host waits for the
    lengths of the slice, and makes others.
    """

    def __init__(self, runtime: Runtime, size: tuple[int, int], limit: int, slice_lists: int):
        super().__init__(runtime, size, limit, slice_lists)
        self._begin = self._end = 0  # supersegments that the buffers hold
        self._parts: list[NDArray[Any]] = []  # and what they are to fill
        with kept_together() as keep:
            keep(self._sums)
            self._offsets_on_device = keep(runtime.target(self._offsets, "list offsets"))
            runtime.write(self._offsets_on_device, np.zeros(1, np.uint64), first=0)
            try:
                self._make_room(0, 1)
            except BaseException:
                self._release_targets()
                raise

    def _expect(self, n: int) -> int:
        last = np.zeros(1, np.uint64)
        self._made = self._first = self._made + n
        wait = self._runtime.download_later(self._offsets_on_device, last, first=self._made)

        def summed() -> int:
            wait()
            return int(last[0])

        self._summing = summed
        if self._known + n * self._limit > self._end:
            self.wait()
        return self._begin

    def _learned(self, begin: int) -> None:
        if self._known > self._end:
            self._make_room(begin, self._known)

    def _make_room(self, begin: int, end: int) -> None:
        """Make buffers of the supersegments from ``begin``, those made so far, to ``end``."""
        self._collect(begin)
        for array in self._arrays.values():
            array.reserve(end, self._most)
        alignment = self._runtime.in_place_alignment or 1
        begin -= begin % alignment  # so many elements are aligned as well
        room = min(array.room for array in self._arrays.values())
        largest = self._runtime.info.max_allocation // _LARGEST_ELEMENT
        end = max(end, min(room, begin + largest))
        self._begin, self._end = begin, end
        for name, array in self._arrays.items():
            part: NDArray[Any] = array.part(begin, end)
            self._targets.append(self._runtime.target(part, name))
            self._parts.append(part)

    def _collect(self, made: int) -> None:
        """Wait until so many supersegments are in the arrays, and release the buffers."""
        for target, part in zip(self._targets, self._parts, strict=True):
            filled = part[: made - self._begin]
            self._runtime.download(target, filled)
        self._release_targets()

    def _release_targets(self) -> None:
        while self._targets:
            self._targets[-1].release()
            self._targets.pop()
        self._parts.clear()

    def _collect_all(self) -> None:
        self._collect(self._known)
        self._runtime.download(self._offsets_on_device, self._offsets)


class _CopiedLists(GrowingLists):
    """The arrays beside any other device, which has buffers of a slice at its longest.

    What a slice has is copied from there while the next one is marched, before it is packed.
    """

    def __init__(self, runtime: Runtime, size: tuple[int, int], limit: int, slice_lists: int):
        super().__init__(runtime, size, limit, slice_lists)
        with kept_together() as keep:
            keep(self._sums)
            self._offsets_on_device = keep(
                runtime.buffer((slice_lists + 1,), np.uint64, "list offsets")
            )
            runtime.write(self._offsets_on_device, np.zeros(1, np.uint64), first=0)
            self._targets = [
                keep(runtime.buffer((slice_lists * limit, *item), name=name))
                for name, item in _LIST_ARRAYS.items()
            ]
        self._copies: list[Callable[[], None]] = []

    def _expect(self, n: int) -> int:
        before, ends = np.split(self._offsets[self._made : self._made + n + 1], [1])
        wait = self._runtime.download_later(self._offsets_on_device, ends, first=1)
        self._made += n

        def summed() -> int:
            wait()
            np.add(ends, before, out=ends)
            return int(ends[-1])

        self._summing = summed
        return 0

    def _learned(self, begin: int) -> None:
        if any(self._known > array.room for array in self._arrays.values()):
            self._runtime.finish()  # what is being copied would not move with the array
        copies = []
        for target, array in zip(self._targets, self._arrays.values(), strict=True):
            array.reserve(self._known, self._most)
            part: NDArray[Any] = array.part(begin, self._known)
            copies.append(self._runtime.download_later(target, part))
        self._copies = copies  # a copy that nobody remembers is waited for; those before are done

    def _collect_all(self) -> None:
        self._runtime.finish()


def growing_lists(
    runtime: Runtime, size: tuple[int, int], limit: int, slice_lists: int
) -> GrowingLists:
    """Return the arrays of a VDI of so many lists, for slices of up to ``slice_lists``."""
    offsets_bytes = 8 * (size[0] * size[1] + 1)
    in_place = runtime.in_place_alignment is not None
    if in_place and offsets_bytes <= runtime.info.max_allocation:
        return _ListsInPlace(runtime, size, limit, slice_lists)
    return _CopiedLists(runtime, size, limit, slice_lists)


def blocks_to_sum(lists: int) -> int:
    """Return the work-groups that sum up the lengths of so many lists."""
    return -(-lists // (GROUP * LISTS_PER_ITEM))


def require_room(supersegments: int, size: tuple[int, int]) -> None:
    """Refuse to go on where the host cannot hold a VDI of at least so many supersegments."""
    require_host_memory(
        supersegments * SUPERSEGMENT_BYTES + 8 * size[0] * size[1],
        f"a VDI of {size[0]} x {size[1]} lists",
        "lower the window size or max_supersegments, or raise tolerance",
    )
