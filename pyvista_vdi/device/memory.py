"""Memory of a device: buffers, checked before they are taken, and page-locked host memory."""

import contextlib
import math
import threading
import weakref
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.device import devices
from pyvista_vdi.device.devices import Candidate, bytes_text
from pyvista_vdi.device.queues import Device
from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.model.host_memory import HOST_ALIGNMENT, aligned_empty

#: Page-locked host memory that a device may have, and the least worth it, bytes.
PINNED_BYTES, LEAST_PINNED = 256 * 2**20, 2**20


class PinnedArrays:
    """Arrays in page-locked host memory, into which a GPU copies several times as fast.

    Memory of an array that nobody has any more is given out again. It is scarce: what
    :data:`PINNED_BYTES` has no room for is in ordinary memory. ``allocate`` takes bytes and returns
    a uint8 array, and what gives its memory back.
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
    """Memory on a device, made by :class:`~pyvista_vdi.device.Runtime`, with a shape and a dtype.

    Released by :meth:`release`, at the end of a ``with`` block, or with its last reference.
    ``nbytes`` is its size as asked for, ``name`` what it holds, for messages, and ``memory`` the
    driver's object, None when it has been given back. :meth:`Runtime.write` and
    :meth:`Runtime.fill` change it if it is ``writable``. Where its memory is a host array's,
    ``readers`` are the queues whose kernels use it, and ``host`` is the array, if kernels write it
    (:meth:`Runtime.result`, :meth:`Runtime.target`).
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

    def __enter__(self) -> "DeviceBuffer":
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
    """Return the shape for an integer number of *bytes*, or the given shape, checked."""
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


#: Bytes of the largest results whose memory on a GPU is kept for the next ones, and how many.
MOST_POOLED, BLOCKS_HELD = 64 * 2**20, 4


class Memory(Device):
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
        """Return uninitialised memory on the device, checked against its limits before.

        An integer is a number of **bytes**, a tuple a shape in elements; zero is allowed, less or
        no whole number of elements an InvalidArgumentError. ``name`` is what it is for: messages
        say it. Release it, use it in a ``with`` block, or drop it. DeviceMemoryError if it is
        larger than the device allows per buffer or has left, or the driver fails.
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
        """Return uninitialised memory for kernels to write, downloaded when they have.

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
        """Return memory for kernels to write what an array is to hold, see :meth:`download`.

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
