"""The host's memory: how much there is, so that what cannot fit is refused; aligned arrays."""

import math
from typing import Any

import numpy as np
import psutil
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.errors import DeviceMemoryError

#: Bytes; arrays that begin at a multiple are used in place by CPU drivers instead of copied.
HOST_ALIGNMENT = 4096


def aligned_empty(shape: int | tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return an uninitialised C-contiguous array that a CPU device can use without a copy."""
    shape = (shape,) if isinstance(shape, int) else tuple(shape)
    nbytes = math.prod(shape) * np.dtype(dtype).itemsize
    try:
        raw = np.empty(nbytes + HOST_ALIGNMENT, np.uint8)
    except MemoryError as error:
        needs = f"the host has no room for an array of {nbytes / 2**30:.2f} GiB"
        raise DeviceMemoryError(f"{needs}: use a smaller volume or window size") from error
    start = -raw.ctypes.data % HOST_ALIGNMENT
    return raw[start : start + nbytes].view(dtype).reshape(shape)


class GrowingArray:
    """A float32 array whose number of elements is known when the last one is written.

    Systems take memory as it is written, so room for the most that there may be costs nothing. Only
    where that is refused do its elements, of the shape ``item``, move when it grows. ``array`` are
    those that there is room for, to be written, until another method is called.
    """

    def __init__(self, item: tuple[int, ...] = ()) -> None:
        self._item, self.array = item, aligned_empty((0, *item), np.float32)

    def reserve(self, n: int, most: int) -> None:
        """Make room for at least n elements (MemoryError), for the most if it can be had."""
        if n > len(self.array):
            try:
                larger = aligned_empty((most, *self._item), np.float32)
            except MemoryError:
                larger = aligned_empty((2 * n, *self._item), np.float32)
            larger[: len(self.array)] = self.array
            self.array = larger

    def finished(self, n: int) -> NDArray[Any]:
        """Return the first n elements; the room for others is given back."""
        raw: Any = self.array.base
        start = self.array.ctypes.data - raw.ctypes.data
        end = start + self.array[:n].nbytes
        raw.resize(end, refcheck=False)
        self.array = raw[start:end].view(np.float32).reshape(n, *self._item)
        return self.array


def require_host_memory(nbytes: int, what: str, remedy: str, *, free: bool = False) -> None:
    """Raise DeviceMemoryError where the host has less memory in all, or less that is ``free``.

    ``what`` needs ``nbytes``, and how large it is; ``remedy`` is what the caller can do.
    """
    needs, memory = f"{what} needs {nbytes / 2**30:.2f} GiB on the host", psutil.virtual_memory()
    if nbytes > memory.total:
        raise DeviceMemoryError(f"{needs}, which has {memory.total / 2**30:.2f} GiB: {remedy}")
    if free and nbytes > memory.available:
        left = f"{memory.available / 2**30:.2f} GiB are free"
        raise DeviceMemoryError(f"{needs}, of which {left}: close other programs, or {remedy}")
