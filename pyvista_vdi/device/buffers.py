"""Buffers on a device, and arrays in page-locked host memory."""

from __future__ import annotations

import contextlib
import math
import threading
import weakref
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError

#: Page-locked host memory that a device may have, and the least worth it, bytes.
PINNED_BYTES, LEAST_PINNED = 256 * 2**20, 2**20


def bytes_text(nbytes: int) -> str:
    """Return a number of bytes for people: ``"1.50 GiB (1610612736 bytes)"``."""
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


class Held:
    """What goes back with a buffer: bytes that are accounted for, and the driver's memory.

    ``readers``: where the memory is a host's array, the queues whose kernels use it.
    """

    nbytes = 0
    memory: Any = None
    readers: set[int] | None = None


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
    memory : pyopencl.MemoryObject or None
        The driver's; None when it has been given back.
    readers : set of int or None
        Where the memory is a host array's: the queues whose kernels use it.
    host : numpy.ndarray or None
        The array whose memory it is and that kernels write, of :meth:`Runtime.result` and
        :meth:`Runtime.target` on a CPU device.
    """

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        name: str,
        give_back: Callable[[Held], None],
        *,
        writable: bool = True,
    ) -> None:
        self.shape = shape
        self.dtype = dtype
        self.nbytes = math.prod(shape) * dtype.itemsize
        self.name = name
        self.writable = writable
        self.memory: Any = None
        self.readers: set[int] | None = None
        self.host: NDArray[Any] | None = None
        # Nothing is held yet, so that wherever an interrupt comes, what is held goes back
        self.held = Held()
        self._finalizer = weakref.finalize(self, give_back, self.held)
        self._finalizer.atexit = False  # the driver frees everything at exit

    def release(self) -> None:
        """Return the memory; a second call does nothing. Enqueued work still finishes."""
        self.memory = None
        self._finalizer()

    @property
    def released(self) -> bool:
        """Whether the memory has been given back."""
        return self.memory is None

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


def shape_of(nbytes_or_shape: int | tuple[int, ...], dtype: np.dtype[Any]) -> tuple[int, ...]:
    """Return the shape for an integer number of *bytes*, or the given shape, checked.

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
    shape = tuple(map(int, nbytes_or_shape))
    if min(shape, default=0) < 0:
        raise InvalidArgumentError(f"a buffer's shape must not be negative: {shape}")
    return shape
