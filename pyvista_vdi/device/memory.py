"""Memory of a device: buffers, checked before they are taken."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.device import devices
from pyvista_vdi.device.buffers import (
    DeviceBuffer,
    Held,
    PinnedArrays,
    bytes_text,
    shape_of,
)
from pyvista_vdi.device.devices import Candidate
from pyvista_vdi.device.queues import Queues
from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.model.host_memory import HOST_ALIGNMENT, aligned_empty

#: Bytes of the largest results whose memory on a GPU is kept for the next ones, and how many.
MOST_POOLED, BLOCKS_HELD = 64 * 2**20, 4


class Memory(Queues):
    """A device with buffers on it."""

    def __init__(self, candidate: Candidate, context: Any = None) -> None:
        super().__init__(candidate, context)
        self._peak = 0  # bytes
        # Re-entrant: a garbage collection inside the lock may release other buffers
        self._ledger = threading.RLock()
        self._alignment = max(1, int(self._device.mem_base_addr_align) // 8)
        self.pinned = PinnedArrays(self._pin)
        # Of pictures: to allocate one anew for each frame takes a GPU longer than to draw it
        tools = self.cl.tools
        self._pool = tools.MemoryPool(tools.ImmediateAllocator(self.queue))

    @property
    def allocated(self) -> int:
        """Bytes that this runtime's buffers hold now; arrays used in place count nothing."""
        return self._allocated

    @property
    def peak_allocated(self) -> int:
        """The most bytes that were held at once."""
        return self._peak

    @property
    def in_place_alignment(self) -> int | None:
        """Bytes; what begins at a multiple in an :func:`aligned_empty` array is used in place.

        None where a device uses no array in place.
        """
        return self._alignment if self.is_cpu and HOST_ALIGNMENT % self._alignment == 0 else None

    def in_place(self, array: NDArray[Any]) -> bool:
        """Whether kernels can use a C-contiguous array where it is."""
        return self.is_cpu and array.nbytes > 0 and array.ctypes.data % self._alignment == 0

    def buffer(
        self,
        nbytes_or_shape: int | tuple[int, ...],
        dtype: DTypeLike = np.float32,
        name: str = "buffer",
        read_only: bool = False,
    ) -> DeviceBuffer:
        """Uninitialised memory on the device, checked against its limits before it is taken.

        An integer is a number of **bytes**, a tuple a shape in elements; zero is allowed. ``name``
        is what it is for: messages say it. Release it, use it in a ``with`` block, or drop it.

        Raises
        ------
        DeviceMemoryError
            If it is larger than the device allows per buffer or has left, or the driver fails.
        InvalidArgumentError
            If the size is negative or no whole number of elements.
        """
        dtype, flags = np.dtype(dtype), self.cl.mem_flags
        access = flags.READ_ONLY if read_only else flags.READ_WRITE
        return self.allocate(access, shape_of(nbytes_or_shape, dtype), dtype, name)

    def result(
        self,
        shape: tuple[int, ...],
        dtype: DTypeLike = np.float32,
        name: str = "result",
        *,
        lasting: bool = False,
    ) -> DeviceBuffer:
        """Uninitialised memory for kernels to write, downloaded when they have.

        On a CPU device it is the memory of the array that :meth:`download` returns, so that nothing
        is copied, and that array holds what is written afterwards, too. ``lasting`` is as for
        :func:`aligned_empty`; all else, and what is raised, as for :meth:`buffer`.
        """
        dtype, flags = np.dtype(dtype), self.cl.mem_flags
        shape = shape_of(shape, dtype)
        if self.is_cpu and 0 not in shape:
            in_place = flags.READ_WRITE | flags.USE_HOST_PTR
            return self.allocate(in_place, shape, dtype, name, lasting=lasting)
        pooled = not lasting and 0 not in shape
        return self.allocate(flags.READ_WRITE, shape, dtype, name, pooled=pooled)

    def target(self, array: NDArray[Any], name: str = "array") -> DeviceBuffer:
        """Memory for kernels to write what an array is to hold; :meth:`download` brings it there.

        A CPU device writes into an array that is aligned for it in place, and the download into
        that very array, or its beginning, copies nothing. The array is C-contiguous and writable
        (InvalidArgumentError else); what is in it is not read. Leave it alone until the download.
        """
        if not (array.flags.c_contiguous and array.flags.writeable):
            raise InvalidArgumentError(
                f"the array for {name!r} must be C-contiguous and writable; its strides are "
                f"{array.strides}, writeable={array.flags.writeable}"
            )
        access, host = self.cl.mem_flags.READ_WRITE, None
        if self.in_place(array):
            access, host = access | self.cl.mem_flags.USE_HOST_PTR, array
        return self.allocate(access, array.shape, array.dtype, name, host)

    def allocate(
        self,
        flags: int,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        name: str,
        host: NDArray[Any] | None = None,
        *,
        writable: bool = True,
        lasting: bool = False,
        pooled: bool = False,
    ) -> DeviceBuffer:
        """Return a buffer, filled from a host array or used in its place as the flags say.

        Where they want a host array's place and there is none, one is made.
        """
        if devices.forked:
            devices.require_drivers()
        cl, limits = self.cl, self.info
        buffer = DeviceBuffer(shape, dtype, name, self._release, writable=writable)
        held, nbytes = buffer.held, buffer.nbytes
        in_place = bool(flags & cl.mem_flags.USE_HOST_PTR)
        # A caller's array takes no memory; drivers refuse size 0
        taken = 0 if in_place and host is not None else max(nbytes, dtype.itemsize)
        try:
            # Refuse what the device has no room for
            if max(nbytes, taken) > limits.max_allocation:
                raise DeviceMemoryError(
                    f"the buffer {name!r} needs {bytes_text(nbytes)}; {limits.full_name!r} allows "
                    f"{bytes_text(limits.max_allocation)} per buffer (of "
                    f"{bytes_text(limits.global_memory)} in all): use a smaller volume, window "
                    "size or max_supersegments, or another device"
                )
            with self._ledger:
                if self._allocated + taken > limits.global_memory:
                    raise DeviceMemoryError(
                        f"the buffer {name!r} needs {bytes_text(nbytes)} and "
                        f"{bytes_text(self._allocated)} are in use already; {limits.full_name!r} "
                        f"has {bytes_text(limits.global_memory)} in all: release VDIs or volumes "
                        "that are no longer drawn, use a smaller window size or "
                        "max_supersegments, or another device"
                    )
                # One statement without a call: no interrupt comes between the two
                self._allocated, held.nbytes = self._allocated + taken, taken
                self._peak = max(self._peak, self._allocated)

            # Take it
            if in_place and host is None:
                try:
                    host = aligned_empty(shape, dtype, lasting=lasting)
                except MemoryError as exc:
                    raise DeviceMemoryError(
                        f"there is no host memory for the buffer {name!r} of "
                        f"{bytes_text(nbytes)}: close other programs, or use a smaller volume, "
                        "window size or max_supersegments"
                    ) from exc
            if pooled and nbytes <= MOST_POOLED:
                if self._pool.held_blocks > BLOCKS_HELD:  # of windows that were larger once
                    self._pool.free_held()
                held.memory = self._pool.allocate(nbytes)
            elif host is None or nbytes == 0:
                flags &= ~cl.mem_flags.COPY_HOST_PTR
                held.memory = cl.Buffer(self._context, flags, size=taken)
            else:
                held.memory = cl.Buffer(self._context, flags, hostbuf=host)
        except BaseException as exc:
            buffer.release()  # now: whoever keeps the error keeps this frame
            if isinstance(exc, cl.Error):
                doing = f"allocating {bytes_text(nbytes)} for the buffer {name!r}"
                raise self.failure(exc, doing) from exc
            raise
        buffer.memory = held.memory
        if in_place:
            buffer.readers = held.readers = set()
            buffer.host = host if writable else None
        return buffer

    def _release(self, held: Held) -> None:
        """Take back what a buffer has held."""
        with self._ledger:
            self._allocated, held.nbytes = self._allocated - held.nbytes, 0
        try:
            if held.readers:
                self.finish_queues(held.readers)  # the array may go when the buffer has gone
        finally:
            if held.memory is not None:
                held.memory.release()

    def _pin(self, nbytes: int) -> tuple[NDArray[np.uint8], Callable[[], None]]:
        """Return page-locked host memory, and what gives it back."""
        cl, queue = self.cl, self.queue
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.ALLOC_HOST_PTR
        access = cl.map_flags.READ | cl.map_flags.WRITE
        try:
            memory = cl.Buffer(self._context, flags, nbytes)
            mapped, _ = cl.enqueue_map_buffer(queue, memory, access, 0, (nbytes,), np.uint8)
        except cl.Error as exc:
            doing = f"allocating {bytes_text(nbytes)} of page-locked host memory"
            raise self.failure(exc, doing) from exc

        def release() -> None:
            mapped.base.release(self.queue)
            memory.release()

        return mapped, release
