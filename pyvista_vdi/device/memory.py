"""A device's command queue and its memory: buffers, checked before they are taken, and copies."""

import contextlib
import math
import threading
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.device import devices
from pyvista_vdi.device.devices import DeviceInfo, bytes_text
from pyvista_vdi.device.scheduling import Turns
from pyvista_vdi.errors import DeviceError, DeviceMemoryError
from pyvista_vdi.model.host_memory import aligned_empty

#: Page-locked host memory that a device may have, and the least worth it, bytes.
PINNED_BYTES, LEAST_PINNED = 256 * 2**20, 2**20
#: Bytes of the largest buffers whose memory is kept for the next ones, and of all that is kept.
MOST_POOLED, MOST_KEPT = 64 * 2**20, 256 * 2**20
#: Bytes of the smallest array that is read in place: a smaller one is aligned by chance.
LEAST_IN_PLACE = 2**16
#: Bytes that background work copies at a time: about a millisecond at a host memory's pace.
COPY_BYTES = 4 * 2**20

_SMALLER = "use a smaller volume, window size or max_supersegments, or another device"


class Held:
    """What goes back with a buffer: bytes that are accounted for, and the driver's memory.

    ``in_place``: the memory is a host's array, which may go when the buffer has gone.
    """

    nbytes = 0
    memory: Any = None
    in_place = False


class DeviceBuffer:
    """Memory on a device, made by :class:`~pyvista_vdi.device.Runtime`, with a shape and a dtype.

    Released by :meth:`release`, at the end of a ``with`` block, or with its last reference.
    ``nbytes`` is its size as asked for, ``name`` what it holds, for messages, and ``memory`` the
    driver's object, None when it has been given back. Where kernels write a host array's memory,
    that is ``host`` (:meth:`Runtime.result`).
    """

    memory: Any = None
    host: NDArray[Any] | None = None

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        name: str,
        give_back: Callable[[Held], None],
    ) -> None:
        self.shape, self.dtype, self.name = shape, dtype, name
        self.nbytes = math.prod(shape) * dtype.itemsize
        # Nothing is held yet, so that wherever an interrupt comes, what is held goes back
        self.held = Held()
        self._finalizer = weakref.finalize(self, give_back, self.held)
        self._finalizer.atexit = False  # the driver frees everything at exit

    def release(self) -> None:
        """Return the memory; a second call does nothing. Enqueued work still finishes."""
        self.memory = None
        self._finalizer()

    def used(self) -> Any:
        """Return the driver's memory for a use of it; DeviceError if it has been given back."""
        if self.memory is None:
            raise DeviceError(f"the buffer {self.name!r} was used after its release")
        return self.memory

    def __enter__(self) -> "DeviceBuffer":
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


#: Keeps a buffer until those beside it are made, or used, and returns it.
Keep = Callable[[DeviceBuffer], DeviceBuffer]


@contextlib.contextmanager
def kept_together() -> Iterator[Keep]:
    """Keep the buffers that the block hands over, or release them all if it fails.

    An object whose buffers are made one after the other is otherwise kept half made by the error
    that tells of it, for as long as somebody looks at the error.
    """
    with contextlib.ExitStack() as made:
        yield made.enter_context
        made.pop_all()


class Memory(Turns):
    """A device, a context on it, a command queue for all threads, and buffers.

    ``cl`` is pyopencl; ``vector_floats`` the floats of the device's longest vectors; ``allocated``
    the bytes that buffers hold now, where arrays used in place count nothing, and
    ``peak_allocated`` the most that they ever held.
    """

    allocated = peak_allocated = 0

    def __init__(self, info: DeviceInfo) -> None:
        super().__init__()
        self.cl: Any = devices.opencl()
        self.info, self.is_cpu = info, info.kind == "CPU"
        self._device = devices.handles[info.selector]
        self.vector_floats = int(self._device.native_vector_width_float)
        with self.failing("making a context and a command queue"):
            self._context = self.cl.Context([self._device])
            self._queue = self.cl.CommandQueue(self._context, self._device)
        # Re-entrant: a garbage collection inside the lock may release other buffers
        self._ledger = threading.RLock()
        self._alignment = max(1, int(self._device.mem_base_addr_align) // 8)
        self._pinned: dict[int, list[tuple[Any, Any]]] = {}  # by size, that nobody has any more
        self._pinned_bytes = 0
        # Of pictures and of what launches read once: to allocate memory anew for each frame takes a
        # GPU longer than to draw it, and to release it waits for the frame
        tools = self.cl.tools
        self._pool = tools.MemoryPool(tools.ImmediateAllocator(self.queue))
        self._sent: list[Any] = []  # events of copies that nobody has waited for, and their arrays

    def failure(self, error: Any, doing: str) -> DeviceError | DeviceMemoryError:
        """Return the package's error for one of the driver's, naming what was being done."""
        codes, info = self.cl.status_code, self.info
        if getattr(error, "code", None) in (  # what pyopencl raises by itself has none
            codes.MEM_OBJECT_ALLOCATION_FAILURE,
            codes.OUT_OF_RESOURCES,
            codes.OUT_OF_HOST_MEMORY,
            codes.INVALID_BUFFER_SIZE,
        ):
            return DeviceMemoryError(
                f"{info.full_name!r} ran out of memory or resources while {doing} ({error}); it "
                f"has {bytes_text(info.global_memory)}, of which this process holds "
                f"{bytes_text(self.allocated)}: {_SMALLER}"
            )
        return DeviceError(
            f"{info.full_name!r} failed while {doing}: {error}; try again, start the program again "
            "if the device was lost (unplugged, or reset by its driver), or use another device "
            f"(device=, or the environment variable {devices.DEVICE_VARIABLE}; pyvista-vdi devices "
            "lists them)"
        )

    @contextlib.contextmanager
    def failing(self, doing: str) -> Iterator[None]:
        """Raise the driver's errors as the package's, which say what was being done."""
        try:
            yield
        except self.cl.Error as exc:
            raise self.failure(exc, doing) from exc

    @property
    def queue(self) -> Any:
        """The queue of all threads; an error in a fork, where its driver would wait for ever."""
        devices.require_drivers()
        return self._queue

    def finish(self) -> None:
        """Wait until all is done that was enqueued; DeviceError if a kernel failed."""
        with self.failing("waiting for enqueued work"):
            self.queue.finish()
        self._sent.clear()

    @property
    def in_place_alignment(self) -> int | None:
        """Bytes at a multiple of which an array begins that is used in place; None: none is."""
        return self._alignment if self.is_cpu else None

    def in_place(self, array: NDArray[Any]) -> bool:
        """Return whether kernels can use a C-contiguous array where it is."""
        return self.is_cpu and array.nbytes > 0 and array.ctypes.data % self._alignment == 0

    def buffer(
        self, shape: tuple[int, ...], dtype: DTypeLike = np.float32, name: str = "buffer"
    ) -> DeviceBuffer:
        """Return uninitialised memory on the device, checked against its limits before.

        ``name`` is what it is for: messages say it. Release it, use it in a ``with`` block, or drop
        it. DeviceMemoryError if it is larger than the device allows per buffer or has left, or the
        driver fails.
        """
        return self._take(self.cl.mem_flags.READ_WRITE, shape, np.dtype(dtype), name)

    def result(
        self,
        shape: tuple[int, ...],
        dtype: DTypeLike = np.float32,
        name: str = "result",
        *,
        out: NDArray[Any] | None = None,
    ) -> DeviceBuffer:
        """Return uninitialised memory for kernels to write, downloaded when they have.

        On a CPU device it is the memory of the array that :meth:`download` returns, so that nothing
        is copied, and that array holds what is written afterwards, too. ``out``: that array, or
        another that begins with it, C-contiguous and writable; a CPU device writes into it if it is
        aligned, and leave it alone until the download. All else as for :meth:`buffer`.
        """
        access, own = self.cl.mem_flags.READ_WRITE, np.dtype(dtype)
        if self.is_cpu and 0 not in shape and (out is None or self.in_place(out)):
            access |= self.cl.mem_flags.USE_HOST_PTR
        return self._take(access, shape, own, name, out, pooled=not self.is_cpu)

    def upload(
        self, array: NDArray[Any], name: str = "array", *, brief: bool = False
    ) -> DeviceBuffer:
        """Return an array's values on the device, for kernels to read; ``name`` says of what.

        A CPU device uses a large array that is C-contiguous and aligned for it in place (see
        :func:`aligned_empty`): do not change the array before the buffer is released. Otherwise
        the values are copied. ``brief``: for launches that are enqueued now, and released behind
        them. Nothing waits then; do not change the array before their results are downloaded.
        Raises as :meth:`buffer` does.
        """
        array, flags = np.ascontiguousarray(array), self.cl.mem_flags
        if array.nbytes >= LEAST_IN_PLACE and self.in_place(array):
            access = flags.READ_ONLY | flags.USE_HOST_PTR
            return self._take(access, array.shape, array.dtype, name, array)
        with kept_together() as keep:
            access = flags.READ_ONLY
            buffer = keep(self._take(access, array.shape, array.dtype, name, pooled=brief))
            event = self._copy(buffer, array, later=brief)
        if event is not None:
            self._sent.append(event)
        return buffer

    def _take(
        self,
        flags: int,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        name: str,
        host: NDArray[Any] | None = None,
        *,
        pooled: bool = False,
    ) -> DeviceBuffer:
        """Return a buffer in a host array's place if the flags say so; one is made if need be."""
        devices.require_drivers()
        cl, limits = self.cl, self.info
        buffer = DeviceBuffer(shape, dtype, name, self._release)
        held, nbytes = buffer.held, buffer.nbytes
        in_place = bool(flags & cl.mem_flags.USE_HOST_PTR)
        # A caller's array takes no memory; drivers refuse size 0
        taken = 0 if in_place and host is not None else max(nbytes, dtype.itemsize)
        try:
            # Refuse what the device has no room for
            with self._ledger:
                left, largest = limits.global_memory - self.allocated, limits.max_allocation
                if nbytes > largest or taken > min(left, largest):
                    raise DeviceMemoryError(
                        f"the buffer {name!r} needs {bytes_text(nbytes)}; {limits.full_name!r} "
                        f"allows {bytes_text(largest)} per buffer, and of its "
                        f"{bytes_text(limits.global_memory)} {bytes_text(self.allocated)} are in "
                        f"use: release VDIs or volumes that are no longer drawn, {_SMALLER}"
                    )
                # One statement without a call: no interrupt comes between the two
                self.allocated, held.nbytes = self.allocated + taken, taken
                self.peak_allocated = max(self.peak_allocated, self.allocated)

            # Take it
            if in_place and host is None:
                host = aligned_empty(shape, dtype)
            with self.failing(f"allocating {bytes_text(nbytes)} for the buffer {name!r}"):
                if pooled and 0 < nbytes <= MOST_POOLED:
                    if self._pool.managed_bytes - self._pool.active_bytes > MOST_KEPT:
                        self._pool.free_held()
                    held.memory = self._pool.allocate(nbytes)
                elif in_place:
                    held.memory = cl.Buffer(self._context, flags, hostbuf=host)
                else:
                    held.memory = cl.Buffer(self._context, flags, size=taken)
        except BaseException:
            buffer.release()  # now: whoever keeps the error keeps this frame
            raise
        held.in_place, buffer.memory = in_place, held.memory
        buffer.host = host if in_place and flags & cl.mem_flags.READ_WRITE else None
        return buffer

    def _release(self, held: Held) -> None:
        """Take back what a buffer has held."""
        with self._ledger:
            self.allocated, held.nbytes = self.allocated - held.nbytes, 0
        try:
            if held.in_place and not devices.forked:  # the array may go when the buffer has gone
                with contextlib.suppress(DeviceError):  # a device that is lost uses it no more
                    self.finish()
        finally:
            if held.memory is not None:
                held.memory.release()

    def pinned(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an uninitialised array, into which a GPU copies several times as fast.

        It is in page-locked memory, which is given out again when nobody has the array any more.
        That is scarce: what :data:`PINNED_BYTES` has no room for is in ordinary memory.
        """
        cl, nbytes = self.cl, math.prod(shape) * dtype.itemsize
        size = 1 << (nbytes - 1).bit_length()  # so that windows of other sizes use it, too
        with self._ledger:
            free = self._pinned.setdefault(size, [])
            if not free and self._pinned_bytes + size > PINNED_BYTES:
                return aligned_empty(shape, dtype)
            try:
                if not free:
                    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.ALLOC_HOST_PTR
                    block, access = cl.Buffer(self._context, flags, size), cl.map_flags.WRITE
                    place = self.queue, block, access, 0, (size,), np.uint8
                    free.append((block, cl.enqueue_map_buffer(*place)[0]))
                    self._pinned_bytes += size
            except cl.Error:
                return aligned_empty(shape, dtype)
            block, mapped = free.pop()
        # Views have this array as their base, so that it lives as long as they do
        array = np.frombuffer(memoryview(mapped)[:nbytes], dtype)
        weakref.finalize(array, free.append, (block, mapped)).atexit = False
        return array.reshape(shape)

    def download(self, buffer: DeviceBuffer, out: NDArray[Any] | None = None) -> NDArray[Any]:
        """Return the values of a buffer, when all that was enqueued before is done.

        They are in ``out``, a C-contiguous array of the buffer's dtype, as many from the start as
        it has elements, or in a new one of the buffer's shape. DeviceError if the driver fails, now
        or in a kernel before.
        """
        if out is None:
            out = buffer.host
        if out is None:
            waits = self.thread.worker is None
            pins = waits and not self.is_cpu and buffer.nbytes >= LEAST_PINNED
            out = (self.pinned if pins else aligned_empty)(buffer.shape, buffer.dtype)
        if buffer.host is None or out.ctypes.data != buffer.host.ctypes.data:
            self._copy(buffer, out, to_host=True)
        elif out.nbytes:
            # Map it: the memory is the array's, so that nothing is copied, and the values stay
            self.give_way()
            cl, queue = self.cl, self.queue
            with self.failing(f"reading the buffer {buffer.name!r}"):
                access, kind = cl.map_flags.READ, (out.shape, out.dtype)
                mapped, _ = cl.enqueue_map_buffer(queue, buffer.used(), access, 0, *kind)
                mapped.base.release(queue)
        return out

    def download_later(
        self, buffer: DeviceBuffer, out: NDArray[Any], *, first: int = 0
    ) -> Callable[[], None]:
        """Copy part of a buffer into an array when all that was enqueued before is done.

        Inside :meth:`background` the copy is done when this returns. As many elements as ``out``
        has are copied, from the ``first`` on; leave it alone until what is returned, when called,
        has waited for them (and raised DeviceError if the driver failed).
        """
        event = self._copy(buffer, out, to_host=True, first=first, later=True)

        def wait() -> None:
            if event is not None:
                with self.failing(f"reading the buffer {buffer.name!r}"):
                    event.wait()

        return wait

    def write(self, buffer: DeviceBuffer, array: NDArray[Any], *, first: int = 0) -> None:
        """Copy a C-contiguous array into a buffer, from the element ``first`` on."""
        self._copy(buffer, array, first=first)

    def _copy(
        self,
        buffer: DeviceBuffer,
        host: NDArray[Any],
        *,
        to_host: bool = False,
        first: int = 0,
        later: bool = False,
    ) -> Any:
        """Copy a C-contiguous array to a buffer, from the buffer's element ``first`` on.

        With ``to_host`` the other way. Background work copies in pieces, and what others ask for
        ``later`` is not waited for: its event is returned.
        """
        memory, cl, queue = buffer.used(), self.cl, self.queue
        background = self.thread.worker is not None
        waits, event = background or not later, None
        data: Any = host.data.cast("B") if host.nbytes else b""
        size = COPY_BYTES if background else max(1, host.nbytes)
        with self.failing(f"{'reading' if to_host else 'writing'} the buffer {buffer.name!r}"):
            for start in range(0, host.nbytes, size):
                self.give_way()
                part, place = data[start : start + size], first * host.itemsize + start
                if to_host:
                    ends = {"dest": part, "src": memory, "src_offset": place}
                else:
                    ends = {"dest": memory, "src": part, "dst_offset": place}
                event = cl.enqueue_copy(queue, **ends, is_blocking=waits)
        if not waits:
            return event
        self._sent.clear()
        return None

    def fill(
        self, buffer: DeviceBuffer, value: float | np.generic, count: int | None = None
    ) -> None:
        """Fill a buffer, or its first elements, with a number."""
        memory, queue, pattern = buffer.used(), self.queue, np.array(value, buffer.dtype)
        nbytes = buffer.nbytes if count is None else count * buffer.dtype.itemsize
        if nbytes == 0:
            return
        with self.failing(f"filling the buffer {buffer.name!r}"):
            self.cl.enqueue_fill_buffer(queue, memory, pattern, 0, nbytes)
            if self.thread.worker is not None:
                queue.finish()  # nothing of this thread runs when its turn is over
