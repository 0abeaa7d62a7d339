"""Buffers on a device: sized, named, accounted for, and checked before they are taken."""

from __future__ import annotations

import contextlib
import math
import threading
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.errors import DeviceError, DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.model.host_memory import HOST_ALIGNMENT

#: Page-locked host memory that a device may have, and the least worth it, bytes.
PINNED_BYTES, LEAST_PINNED = 256 * 2**20, 2**20


@dataclass(frozen=True)
class LocalMemory:
    """Local memory of a work-group, as a kernel argument.

    Attributes
    ----------
    nbytes : int
        Bytes for each work-group.
    """

    nbytes: int


def bytes_text(nbytes: int) -> str:
    """A number of bytes for people: ``"1.50 GiB (1610612736 bytes)"``."""
    for unit, size in (("GiB", 2**30), ("MiB", 2**20), ("KiB", 2**10)):
        if nbytes >= size:
            return f"{nbytes / size:.2f} {unit} ({nbytes} bytes)"
    return f"{nbytes} bytes"


class PinnedArrays:
    """Arrays in page-locked host memory, into which a GPU copies several times as fast.

    Memory of an array that nobody has any more is given out again. It is scarce: what
    :data:`PINNED_BYTES` has no room for is in ordinary memory.

    Parameters
    ----------
    allocate : callable
        Takes bytes and returns a uint8 array, and what gives its memory back.
    """

    def __init__(self, allocate: Callable[[int], tuple[NDArray[np.uint8], Callable[[], None]]]):
        self._allocate = allocate
        self._free: list[tuple[NDArray[np.uint8], Callable[[], None]]] = []
        self._taken = 0  # bytes, those that are free included
        self._lock = threading.Lock()

    def empty(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an uninitialised array, ordinary memory where there is no room."""
        nbytes = math.prod(shape) * dtype.itemsize
        with self._lock:
            places = (k for k, (memory, _) in enumerate(self._free) if memory.nbytes == nbytes)
            place = next(places, None)
            if place is not None:
                block = self._free.pop(place)
            else:
                while self._free and self._taken + nbytes > PINNED_BYTES:
                    memory, release = self._free.pop(0)
                    self._taken -= memory.nbytes
                    release()
                if self._taken + nbytes > PINNED_BYTES:
                    return np.empty(shape, dtype)
                try:
                    block = self._allocate(nbytes)
                except DeviceMemoryError:
                    return np.empty(shape, dtype)
                self._taken += nbytes
        # Views have this array as their base, so that it lives as long as they do
        array = np.frombuffer(memoryview(block[0]), dtype)  # type: ignore[arg-type]
        weakref.finalize(array, self._free.append, block).atexit = False
        return array.reshape(shape)


class GrowingArray:
    """An array whose number of elements is known when the last one is written.

    Systems take memory as it is written, so room for the most that there may be costs nothing.
    Only where that is refused do its elements move when it grows.

    Parameters
    ----------
    item : tuple of int
        Shape of an element.
    dtype : dtype_like
        Element type.

    Attributes
    ----------
    room : int
        Elements that there is room for.
    """

    def __init__(self, item: tuple[int, ...] = (), dtype: DTypeLike = np.float32) -> None:
        self._item = item
        self._dtype = np.dtype(dtype)
        self._bytes = math.prod(item) * self._dtype.itemsize
        self._raw = np.empty(0, np.uint8)
        self._start = 0  # where it is aligned as that of aligned_empty
        self.room = 0

    def reserve(self, n: int, most: int) -> None:
        """Have room for at least n elements, and if it can be had for the most there may be.

        Raises
        ------
        MemoryError
            If not even that many can be had.
        """
        if n <= self.room:
            return
        for room in (most, 2 * n):
            try:
                self._move(room)
            except MemoryError:
                continue
            return
        self._move(n)

    def _move(self, room: int) -> None:
        raw = np.empty(room * self._bytes + HOST_ALIGNMENT, np.uint8)
        start = -raw.ctypes.data % HOST_ALIGNMENT
        kept = self.room * self._bytes
        raw[start : start + kept] = self._raw[self._start : self._start + kept]
        self._raw, self._start, self.room = raw, start, room

    def part(self, first: int, last: int) -> NDArray[Any]:
        """Return elements to write, a view that is valid until the next call of another method."""
        begin, end = (self._start + n * self._bytes for n in (first, last))
        return self._raw[begin:end].view(self._dtype).reshape(last - first, *self._item)

    def finished(self, n: int) -> NDArray[Any]:
        """Return the first n elements; the room for others is given back."""
        self._raw.resize(self._start + n * self._bytes, refcheck=False)
        return self.part(0, n)


class Reservation:
    """Bytes of a ledger: they go back when they are given back, or with the last reference.

    So wherever an interrupt comes, nothing stays reserved that nobody holds.
    """

    nbytes = 0

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger

    def give_back(self) -> None:
        """Return the bytes; a second call does nothing."""
        self._ledger.give_back(self)

    def __del__(self) -> None:
        if self.nbytes:
            self.give_back()


class Ledger:
    """Bytes that one runtime holds on its device.

    Parameters
    ----------
    device_name : str
        For messages.
    """

    def __init__(self, device_name: str) -> None:
        self.device_name = device_name
        # Re-entrant: a garbage collection inside the lock may release other buffers.
        self._lock = threading.RLock()
        self.allocated = 0
        self.peak = 0

    def check_size(self, name: str, nbytes: int, max_allocation: int, global_memory: int) -> None:
        """Refuse a buffer that is larger than the device allows for one; parameters as for take.

        Raises
        ------
        DeviceMemoryError
            If it is.
        """
        if nbytes > max_allocation:
            raise DeviceMemoryError(
                f"the buffer {name!r} needs {bytes_text(nbytes)}; {self.device_name!r} allows "
                f"{bytes_text(max_allocation)} per buffer (of {bytes_text(global_memory)} in "
                "all): use a smaller volume, window size or max_supersegments, or another device"
            )

    def take(self, name: str, nbytes: int, max_allocation: int, global_memory: int) -> Reservation:
        """Reserve bytes, or say why they cannot be had.

        Parameters
        ----------
        name : str
            What the buffer is for.
        nbytes, max_allocation, global_memory : int
            Bytes wanted, allowed in one buffer, and on the device.

        Returns
        -------
        Reservation
            What keeps them reserved.

        Raises
        ------
        DeviceMemoryError
            If either limit is passed; nothing is reserved then.
        """
        self.check_size(name, nbytes, max_allocation, global_memory)
        taken = Reservation(self)
        with self._lock:
            if self.allocated + nbytes > global_memory:
                raise DeviceMemoryError(
                    f"the buffer {name!r} needs {bytes_text(nbytes)} and "
                    f"{bytes_text(self.allocated)} are in use already; {self.device_name!r} has "
                    f"{bytes_text(global_memory)} in all: release VDIs or volumes that are no "
                    "longer drawn, use a smaller window size or max_supersegments, or another "
                    "device"
                )
            # One statement without a call: no interrupt comes between the two
            self.allocated, taken.nbytes = self.allocated + nbytes, nbytes
            self.peak = max(self.peak, self.allocated)
        return taken

    def give_back(self, taken: Reservation) -> None:
        """Return reserved bytes."""
        with self._lock:
            self.allocated, taken.nbytes = self.allocated - taken.nbytes, 0


class DeviceBuffer:
    """Memory on a device, made by :class:`~pyvista_vdi.device.Runtime`.

    Released by :meth:`release`, at the end of a ``with`` block, or with its last reference.

    Attributes
    ----------
    nbytes : int
        Size as asked for; may be 0.
    shape : tuple of int
        Shape of the array that :meth:`Runtime.download` returns.
    dtype : numpy.dtype
        Element type.
    name : str
        What it holds, for messages.
    writable : bool
        Whether :meth:`Runtime.write` and :meth:`Runtime.fill` may change it.
    readers : set of int or None
        Where the memory is a host array's: the queues whose kernels use it.
    host : numpy.ndarray or None
        The array whose memory it is and that kernels write, of :meth:`Runtime.result` and
        :meth:`Runtime.target` on a CPU device.
    identity : object
        Tells this buffer from every other one for as long as anybody remembers it.
    """

    def __init__(
        self,
        memory: Any,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        name: str,
        on_release: Callable[[], None],
        *,
        writable: bool = True,
    ) -> None:
        self.shape = shape
        self.dtype = dtype
        self.nbytes = math.prod(shape) * dtype.itemsize
        self.name = name
        self.writable = writable
        self.readers: set[int] | None = None
        self.host: NDArray[Any] | None = None
        self.identity = object()
        self._memory = memory
        self._finalizer = weakref.finalize(self, _release, memory, on_release)
        self._finalizer.atexit = False  # the driver frees everything at exit

    @property
    def memory(self) -> Any:
        """The driver's memory object.

        Raises
        ------
        DeviceError
            If the buffer has been released.
        """
        if self._memory is None:
            raise DeviceError(f"the buffer {self.name!r} was used after its release")
        return self._memory

    @property
    def released(self) -> bool:
        """Whether the memory has been given back."""
        return self._memory is None

    def release(self) -> None:
        """Give the memory back; a second call does nothing. Enqueued work still finishes."""
        self._memory = None
        self._finalizer()

    def __enter__(self) -> DeviceBuffer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def __repr__(self) -> str:
        state = "released" if self.released else bytes_text(self.nbytes)
        return f"<DeviceBuffer {self.name!r}: {self.dtype} {self.shape}, {state}>"


@contextlib.contextmanager
def kept_together() -> Iterator[Callable[[DeviceBuffer], DeviceBuffer]]:
    """Keep the buffers that the block hands over, or release them all if it fails.

    An object whose buffers are made one after the other is otherwise kept half made by the error
    that tells of it, for as long as somebody looks at the error.
    """
    with contextlib.ExitStack() as made:
        yield made.enter_context
        made.pop_all()


def _release(memory: Any, on_release: Callable[[], None]) -> None:
    try:
        on_release()
    finally:
        memory.release()


def shape_of(nbytes_or_shape: int | tuple[int, ...], dtype: np.dtype[Any]) -> tuple[int, ...]:
    """Shape for an integer number of *bytes*, or the given shape, checked.

    Raises
    ------
    InvalidArgumentError
        If a size is negative, or the bytes are no whole number of elements.
    """
    if isinstance(nbytes_or_shape, (int, np.integer)):
        nbytes = int(nbytes_or_shape)
        if nbytes < 0 or nbytes % dtype.itemsize:
            raise InvalidArgumentError(
                f"{nbytes} bytes are no whole number of {dtype} ({dtype.itemsize} bytes each); "
                "an integer size is in bytes, a shape is a tuple"
            )
        return (nbytes // dtype.itemsize,)
    shape = tuple(int(n) for n in nbytes_or_shape)
    if any(n < 0 for n in shape):
        raise InvalidArgumentError(f"a buffer's shape must not be negative: {shape}")
    return shape
