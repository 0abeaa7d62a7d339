"""The arrays of a VDI while slices of lists are written into them, and lists that stay there."""

import contextlib
import threading
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, kept_together
from pyvista_vdi.device.constants import GROUP, LISTS_PER_ITEM
from pyvista_vdi.model.host_memory import aligned_empty, cut_to, require_host_memory, with_room
from pyvista_vdi.model.packing import Arrays

#: A VDI's arrays of supersegments, as kernels and as messages call them, and an element's shape.
_ARRAYS: dict[str, tuple[str, tuple[int, ...]]] = {
    "fronts": ("front depths", ()),
    "backs": ("back depths", ()),
    "colors": ("supersegment colours", (3,)),
    "optical_depths": ("optical depths", ()),
}
#: Bytes of a supersegment in them, and in the largest of them.
SUPERSEGMENT_BYTES, _LARGEST_ELEMENT = 24, 12

#: Share of a device's own memory that lists may take there.
_SHARE = 16
#: Lists whose lengths a work-group sums up.
LISTS_PER_GROUP = GROUP * LISTS_PER_ITEM


class ListsOnDevice:
    """Lists in ``buffers`` on a device, where they were made, until somebody asks for arrays."""

    def __init__(
        self,
        runtime: Runtime,
        offsets: NDArray[np.uint64],
        n: int,
        buffers: dict[str, DeviceBuffer],
    ) -> None:
        self._runtime, self.n_supersegments, self.buffers = runtime, n, buffers
        self._offsets = offsets  # writable until they are here
        self.nbytes = offsets.nbytes + SUPERSEGMENT_BYTES * n
        self._arrays: Arrays | None = None
        self._lock = threading.RLock()
        _on_devices.setdefault(runtime, []).append(weakref.ref(self))

    @property
    def offsets(self) -> NDArray[np.uint64]:
        """Where each list begins; brought to the host when first asked for."""
        with self._runtime.holding(self._lock):
            if self._offsets.flags.writeable:
                self._runtime.download(self.buffers["starts"], self._offsets)
                self._offsets.setflags(write=False)
            return self._offsets

    def arrays(self) -> Arrays:
        """Return the arrays; the device's memory is given back."""
        with self._runtime.holding(self._lock):
            if self._arrays is None:
                found = []
                for name, (_, item) in _ARRAYS.items():
                    array = np.empty((self.n_supersegments, *item), np.float32)
                    found.append(self._runtime.download(self.buffers[name], array))
                self._arrays = Arrays(self.offsets, *found)
                for buffer in self.buffers.values():
                    buffer.release()
                self.buffers = {}
            return self._arrays

    @contextlib.contextmanager
    def on(self, runtime: Runtime) -> Iterator[dict[str, DeviceBuffer]]:
        """Hold the lists on a device for a ``with`` block; empty where they are not on it."""
        with runtime.holding(self._lock):
            if self.buffers and runtime is self._runtime:
                yield self.buffers
                return
        yield {}


_on_devices: "weakref.WeakKeyDictionary[Runtime, list[weakref.ref[ListsOnDevice]]]" = (
    weakref.WeakKeyDictionary()
)


def bring_to_host(runtime: Runtime, nbytes: int) -> None:
    """Bring the oldest lists to the host until a device's share has room for so many bytes."""
    known = _on_devices.setdefault(runtime, [])
    living = [lists for each in known if (lists := each()) is not None and lists.buffers]
    held = [sum(buffer.nbytes for buffer in lists.buffers.values()) for lists in living]
    while held and nbytes + sum(held) > runtime.info.global_memory // _SHARE:
        living.pop(0).arrays()
        held.pop(0)
    known[:] = map(weakref.ref, living)


class GrowingLists(contextlib.AbstractContextManager["GrowingLists"]):
    """A VDI's arrays while slices of lists are written into them, one behind the other.

    A device that uses arrays in place writes them in the host's memory. Room for every list at its
    longest is asked for at once: systems take memory as it is written, so that what stays unused
    costs nothing, and nothing is ever copied. :meth:`finished` gives it back. Any other device has
    buffers of its own, for a slice at its longest or, where lists may ``stay``, for as many as a
    share of its memory holds; what does not fit is brought to the host. The device sums up the
    lists' lengths itself; the host learns the sum of a slice when it has launched the march of the
    next, and waits for nothing else unless the lists might pass the end of the buffers.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: tuple[int, int],
        limit: int,
        slice_lists: int,
        *,
        stay: bool = False,
    ) -> None:
        self._runtime, self._size, self._limit, self._stay = runtime, size, limit, stay
        self._most = size[0] * size[1] * limit  # supersegments
        self._made = 0  # lists, those of the last slice included
        self._wait: Callable[[], None] | None = None  # for the sum with the last slice
        self._sum = np.zeros(1, np.uint64)
        self._summed_up()  # refuses what lists without supersegments take already
        self._offsets = aligned_empty(size[0] * size[1] + 1, np.uint64)
        self._begin = self._end = 0  # supersegments that the buffers hold
        self._arrays = {name: aligned_empty((0, *item)) for name, (_, item) in _ARRAYS.items()}
        self._targets: dict[str, DeviceBuffer] = {}
        # Supersegments that a device's own buffers have room for
        self._largest = runtime.info.max_allocation // _LARGEST_ELEMENT
        share = runtime.info.global_memory // (_SHARE * SUPERSEGMENT_BYTES) if stay else 0
        self._room = max(slice_lists * limit, min(share, self._largest, self._most))
        with kept_together() as keep:
            groups = -(-slice_lists // LISTS_PER_GROUP)
            sums = keep(runtime.buffer((groups,), np.uint64, "sums of lengths"))
            place = self._offsets
            offsets = keep(runtime.result(place.shape, np.uint64, "list offsets", out=place))
            runtime.fill(offsets, 0, 1)
            shared = {"partial": GROUP, "sums": sums}
            self._sum_lengths = runtime.bind("generation/offsets.cl", "sum_lengths", **shared)
            self._place_lists = runtime.bind(
                "generation/offsets.cl", "list_offsets", **shared, all_offsets=offsets
            )
            self._sums, self._starts = sums, offsets

    def __exit__(self, *_: object) -> None:
        for buffer in (self._sums, self._starts, *self._targets.values()):
            buffer.release()

    def follow(self, lengths: DeviceBuffer, n: int) -> dict[str, Any]:
        """Find where the next n lists go, of which there are so many lengths, on the device.

        It waits for the slice before: the device has this one to go on with. Returns the arguments
        ``offsets`` to ``optical_depths`` of the kernel ``pack_lists``.
        """
        known = self._summed_up()
        if not self._targets:
            self._make_room(0, 1)
        items, made = -(-n // LISTS_PER_GROUP) * GROUP, self._made
        self._sum_lengths(items, GROUP, lists=n, lengths=lengths)
        self._place_lists(items, GROUP, lists=n, lengths=lengths, made=made)
        self._made += n
        self._wait = self._runtime.download_later(self._starts, self._sum, first=self._made)
        if known + n * self._limit > self._end and (end := self._summed_up()) > self._end:
            self._make_room(known, end)
        return {"offsets": self._starts, "made": made, "held": self._begin, **self._targets}

    def _summed_up(self) -> int:
        """Wait for the number of supersegments of all lists made; refuse what the host lacks."""
        if self._wait is not None:
            self._wait()
        known, (width, height) = int(self._sum[0]), self._size
        require_host_memory(
            known * SUPERSEGMENT_BYTES + 8 * width * height,
            f"a VDI of {width} x {height} lists",
            "lower the window size or max_supersegments, or raise tolerance",
        )
        return known

    def finished(self) -> Arrays | ListsOnDevice:
        """Return the arrays, on the host, or lists that stay in the device's own memory."""
        runtime, n = self._runtime, self._summed_up()
        if self._stay and self._begin == 0 and runtime.in_place_alignment is None:
            buffers, self._targets = {"starts": self._starts, **self._targets}, {}
            self._starts = self._sums  # all that is to be released
            return ListsOnDevice(runtime, self._offsets, n, buffers)
        runtime.download(self._starts, self._offsets)
        self._collect(n)
        return Arrays(self._offsets, *(cut_to(array, n) for array in self._arrays.values()))

    def _make_room(self, begin: int, end: int) -> None:
        """Make buffers of the supersegments from ``begin``, those made so far, to ``end``."""
        self._collect(begin)
        alignment = self._runtime.in_place_alignment
        if alignment is None:
            if not self._targets:
                bring_to_host(self._runtime, SUPERSEGMENT_BYTES * self._room)
                for name, (what, item) in _ARRAYS.items():
                    self._targets[name] = self._runtime.buffer((self._room, *item), name=what)
            self._begin, self._end = begin, begin + self._room
            return
        for name, array in self._arrays.items():
            self._arrays[name] = with_room(array, end, self._most)
        begin -= begin % alignment  # so many elements are aligned as well
        room = min(map(len, self._arrays.values()))
        self._begin, self._end = begin, max(end, min(room, begin + self._largest))
        for name, array in self._arrays.items():
            part = array[begin : self._end]
            target = self._runtime.result(part.shape, name=_ARRAYS[name][0], out=part)
            self._targets[name] = target

    def _collect(self, made: int) -> None:
        """Wait until so many supersegments are in the host's arrays; in place, release buffers."""
        in_place = self._runtime.in_place_alignment is not None
        for name, target in self._targets.items():
            array = self._arrays[name] = with_room(self._arrays[name], made, self._most)
            self._runtime.download(target, array[self._begin : made])
            if in_place:
                target.release()
        if in_place:
            self._targets = {}
