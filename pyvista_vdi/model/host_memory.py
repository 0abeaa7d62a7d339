"""The host's memory: how much there is, so that what cannot fit is refused; aligned arrays."""

import math
from typing import Any

import numpy as np
import psutil
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.errors import DeviceMemoryError

#: Bytes; arrays that begin at a multiple are used in place by CPU drivers instead of copied.
HOST_ALIGNMENT = 4096


def aligned_empty(shape: int | tuple[int, ...], dtype: DTypeLike = np.float32) -> NDArray[Any]:
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


def with_room(array: NDArray[Any], n: int, most: int) -> NDArray[Any]:
    """Return an aligned array with room for at least n elements (MemoryError), itself if it has it.

    Systems take memory as it is written, so room for the most that there may be costs nothing. Only
    where that is refused do elements move more than once.
    """
    if n <= len(array):
        return array
    try:
        larger = aligned_empty((most, *array.shape[1:]), array.dtype)
    except MemoryError:
        if most <= n:
            raise
        return with_room(array, n, 2 * n if most > 2 * n else n)
    larger[: len(array)] = array
    return larger


def cut_to(array: NDArray[Any], n: int) -> NDArray[Any]:
    """Return an aligned array's first n elements in its place: the room for others is released."""
    raw: Any = array.base
    start = array.ctypes.data - raw.ctypes.data
    raw.resize(start + array[:n].nbytes, refcheck=False)
    return raw[start:].view(array.dtype).reshape(n, *array.shape[1:])


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
