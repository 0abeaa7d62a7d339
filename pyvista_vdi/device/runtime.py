"""One device with its context, queues, programs and buffers: what the engine launches through."""

from __future__ import annotations

import atexit
import contextlib
import math
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.device.arguments import (
    Argument,
    Size,
    as_size,
    check_host_array,
    driver_argument,
    preferred_group,
    set_arguments,
)
from pyvista_vdi.device.buffers import (
    LEAST_PINNED,
    DeviceBuffer,
    Ledger,
    PinnedArrays,
    bytes_text,
    shape_of,
)
from pyvista_vdi.device.declarations import Define, KernelDeclaration
from pyvista_vdi.device.devices import Candidate, DeviceInfo, drivers_lost, opencl
from pyvista_vdi.device.kernels import Launch
from pyvista_vdi.device.profiling import KernelTime, Profile, profiling_wanted, table
from pyvista_vdi.device.programs import Kernel, ProgramCache
from pyvista_vdi.device.scheduling import Turns, Worker
from pyvista_vdi.errors import DeviceError, DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.model.host_memory import HOST_ALIGNMENT, aligned_empty

#: Bytes that background work copies at a time: about a millisecond at a host memory's pace.
_COPY_BYTES = 4 * 2**20
#: Work-groups for each of the device's compute units in the first piece of a launch.
_FIRST_GROUPS = 4
#: Where the driver chooses work-groups, pieces are a multiple of as much of this as divides all.
_FREE_STEP = 256
#: Bytes of the largest results whose memory on a GPU is kept for the next ones, and how many.
MOST_POOLED, BLOCKS_HELD = 64 * 2**20, 4


class Runtime:
    """A device ready for work. Made by :func:`~pyvista_vdi.device.get_runtime`.

    Every method may be called from any thread. Commands run in the order in which they are
    enqueued, one queue for all threads unless :meth:`queue_scope` gives a thread its own. What
    one queue has written another sees when the first has been finished, see :meth:`finish`.
    Threads must have ended before the interpreter does: drivers do not survive use at exit.

    Parameters
    ----------
    candidate : Candidate
        The device.
    context : pyopencl.Context, optional
        A context to share; one of its own by default.

    Attributes
    ----------
    info : DeviceInfo
        What is known of the device.
    is_cpu : bool
        Whether it is the host's processor.
    preferred_group : tuple of int
        Suggested work-group size (width, height) for kernels over an image: 64 work items.
    """

    def __init__(self, candidate: Candidate, context: Any = None) -> None:
        self.info: DeviceInfo = candidate.info
        self.is_cpu = candidate.info.kind == "CPU"
        self._device = candidate.device
        with self._driver("making a context"):
            self._context = context or opencl().Context([self._device])
            self._compute_units = int(self._device.max_compute_units)
            self._alignment = max(1, int(self._device.mem_base_addr_align) // 8)
            self.preferred_group = preferred_group(self._device, self.is_cpu)
        self._programs = ProgramCache(self._context, self._device)
        self._ledger = Ledger(candidate.info.full_name)
        self._pinned = PinnedArrays(self._pin)
        self._turns = Turns()
        self._local = threading.local()
        self._queues: dict[int, Any] = {}  # those that exist, numbered as they were made
        self._queues_made = 0
        self._queues_lock = threading.RLock()
        self._profile: Profile | None = None
        if profiling_wanted():
            self._profile = Profile()
            atexit.register(self._print_profile)
        self._main_queue = self._new_queue()
        # Of pictures: to allocate one anew for each frame takes a GPU longer than to draw it
        self._pool = opencl().tools.MemoryPool(opencl().tools.ImmediateAllocator(self._queue))

    def __repr__(self) -> str:
        return f"<Runtime on {self.info.full_name}>"

    def kernel(
        self,
        path: str | Path | KernelDeclaration,
        name: str = "",
        defines: Mapping[str, Define] | None = None,
    ) -> Kernel:
        """A kernel function, compiled when first asked for and kept.

        Parameters
        ----------
        path : str or pathlib.Path
            A file of ``pyvista_vdi.opencl`` (``"raycasting/raycast.cl"``), or any file on disk as
            a Path.
        name : str
            The kernel function.
        defines : mapping of str to str, int, float, bool or None, optional
            ``-D`` names: what changes the code's shape. Floats become exact float32 literals.

        Returns
        -------
        Kernel
            For :meth:`launch`; threads may share it.

        Raises
        ------
        KernelBuildError
            If it cannot be assembled or compiled; carries log, options and source.
        InvalidArgumentError
            If a define cannot be written as an option.
        """
        defines = defines or {}
        if isinstance(path, KernelDeclaration):
            kernel = self.kernel(path.path, path.name, defines)
            kernel.declare(path, defines)
            return kernel
        found = self._programs.known(path, name, defines)
        if found is not None:
            return found
        if self._turns.worker is None:
            return self._programs.kernel(path, name, defines)
        with self._turns.aside():  # compilers take seconds, and not the device
            return self._programs.kernel(path, name, defines)

    def launch(
        self,
        kernel: Kernel,
        global_size: Size,
        local_size: Size | None,
        *args: Argument,
    ) -> None:
        """Enqueue a kernel and return at once; inside :meth:`background`, run it in pieces.

        Parameters
        ----------
        kernel : Kernel
            From :meth:`kernel`.
        global_size : int or tuple of int
            Work items in each dimension; nothing is launched if one is 0.
        local_size : int or tuple of int or None
            Work-group size, a divisor of ``global_size`` (see :func:`padded`); None leaves the
            choice to the driver.
        *args : DeviceBuffer, LocalMemory, numpy scalar, numpy.ndarray or None
            In the kernel's order. Numbers carry their type (``np.float32(x)``); a small array is
            passed by value, as a vector (``float4``) or a structure; None is a null pointer.

        Raises
        ------
        InvalidArgumentError
            If the sizes do not fit each other or the number of arguments is wrong.
        TypeError
            If an argument has no device type (a Python number).
        DeviceMemoryError
            If the driver lacks memory or resources.
        DeviceError
            If the driver refuses for any other reason.
        Cancelled
            Inside :meth:`background`, if the work is no longer wanted.
        """
        if len(args) != kernel.argument_count:
            raise InvalidArgumentError(
                f"kernel {kernel.name!r} of {kernel.path} takes {kernel.argument_count} "
                f"arguments, {len(args)} were given"
            )
        whole, group = self._checked_sizes(kernel, global_size, local_size)
        if 0 in whole:
            return
        with self._driver(f"launching {kernel.name!r} of {kernel.path} on {whole} by {group}"):
            set_arguments(kernel, args)
        buffers = [argument for argument in args if isinstance(argument, DeviceBuffer)]
        self.enqueue(kernel, kernel.object, global_size, local_size, buffers)

    def bind(
        self,
        declaration: KernelDeclaration,
        defines: Mapping[str, Define] | None = None,
        /,
        **arguments: Any,
    ) -> Launch:
        """Return a launch of a kernel, which is compiled when first asked for.

        Parameters
        ----------
        declaration : KernelDeclaration
            The kernel and its arguments.
        defines : mapping of str to str, int, float, bool or None, optional
            ``-D`` options: what changes the code's shape. Floats become exact float32 literals.
        **arguments : DeviceBuffer, number, sequence of numbers, structure or None
            Those that are known already. Numbers are converted to the declared type, which they
            must fit; vectors are given as arrays or sequences, local memory as elements for each
            work-group; None is a null pointer.

        Returns
        -------
        Launch
            To be called with sizes, and with the arguments that are missing or change.

        Raises
        ------
        KernelBuildError
            If it cannot be assembled or compiled; carries log, options and source.
        InvalidArgumentError
            If a name is no argument's, or a define cannot be written as an option.
        TypeError
            If a value is not of its argument's type.
        DeviceError
            If a buffer has been released.
        """
        launch = Launch(self, self.kernel(declaration, defines=defines))
        if arguments:
            launch.set(**arguments)
        return launch

    def set_arguments(self, kernel: Kernel, driver_kernel: Any, given: dict[int, Any]) -> None:
        """Give a driver's kernel some arguments, by their places; for :class:`Launch`."""
        with self._driver(f"setting arguments of {kernel.name!r} of {kernel.path}"):
            for index, argument in given.items():
                driver_kernel.set_arg(index, driver_argument(kernel, index, argument))

    def enqueue(
        self,
        kernel: Kernel,
        driver_kernel: Any,
        size: Size,
        group: Size | None,
        buffers: Sequence[DeviceBuffer],
    ) -> None:
        """Enqueue a driver's kernel whose arguments are set, these buffers among them."""
        whole, local = self._checked_sizes(kernel, size, group)
        if 0 in whole:
            return
        with self._driver(f"launching {kernel.name!r} of {kernel.path} on {whole} by {local}"):
            for buffer in buffers:
                if buffer.released:
                    raise DeviceError(f"the buffer {buffer.name!r} was used after its release")
                if buffer.readers is not None:
                    self._note_reader(buffer)
            if self._turns.worker is None:
                self._enqueue(kernel, driver_kernel, whole, local)
            else:
                self._run_in_pieces(self._turns.worker, kernel, driver_kernel, whole, local)

    def _checked_sizes(
        self, kernel: Kernel, size: Size, group: Size | None
    ) -> tuple[tuple[int, ...], tuple[int, ...] | None]:
        whole = as_size(size)
        local = None if group is None else as_size(group)
        if local is not None and (
            len(local) != len(whole) or any(n % g for n, g in zip(whole, local, strict=True))
        ):
            raise InvalidArgumentError(
                f"kernel {kernel.name!r}: the global size {whole} is no multiple of the "
                f"work-group size {local} in every dimension; round it up with padded()"
            )
        return whole, local

    def _enqueue(
        self,
        kernel: Kernel,
        driver_kernel: Any,
        size: tuple[int, ...],
        group: tuple[int, ...] | None,
        offset: tuple[int, ...] | None = None,
    ) -> None:
        event = opencl().enqueue_nd_range_kernel(
            self._queue, driver_kernel, size, group, global_work_offset=offset
        )
        self._record(kernel.name, event)

    def _run_in_pieces(
        self,
        worker: Worker,
        kernel: Kernel,
        driver_kernel: Any,
        whole: tuple[int, ...],
        group: tuple[int, ...] | None,
    ) -> None:
        """Run a launch as launches of parts of its last dimension, each no longer than allowed."""
        rows, row_items = whole[-1], math.prod(whole[:-1])
        step = group[-1] if group is not None else math.gcd(rows, _FREE_STEP)
        first = step * self._compute_units * _FIRST_GROUPS
        done = 0
        while done < rows:
            seconds = self._turns.checkpoint()
            left = rows - done
            items = worker.piece(kernel.name, seconds)
            fitting = first if items is None else items // row_items
            if not kernel.divisible:
                fitting = left
            # Equal parts, in whole groups: a small rest would run as badly as it would be measured
            parts = -(-left // max(fitting, step))
            size = min(left, -(-left // (parts * step)) * step)
            began = time.perf_counter()
            offset = (*(0 for _ in whole[1:]), done)
            self._enqueue(kernel, driver_kernel, (*whole[:-1], size), group, offset)
            self._queue.finish()
            worker.took(kernel.name, size * row_items, time.perf_counter() - began)
            done += size

    def buffer(
        self,
        nbytes_or_shape: int | tuple[int, ...],
        dtype: DTypeLike = np.float32,
        name: str = "buffer",
        read_only: bool = False,
    ) -> DeviceBuffer:
        """Uninitialised memory on the device, checked against its limits before it is taken.

        Parameters
        ----------
        nbytes_or_shape : int or tuple of int
            An integer is a number of **bytes**, a tuple a shape in elements. Zero is allowed.
        dtype : dtype_like, default: numpy.float32
            Element type.
        name : str, default: "buffer"
            What it is for; messages say it.
        read_only : bool, default: False
            Whether kernels only read it.

        Returns
        -------
        DeviceBuffer
            Release it, use it in a ``with`` block, or drop it.

        Raises
        ------
        DeviceMemoryError
            If it is larger than the device allows per buffer or has left, or the driver fails.
        InvalidArgumentError
            If the size is negative or no whole number of elements.
        """
        dtype = np.dtype(dtype)
        shape = shape_of(nbytes_or_shape, dtype)
        flags = opencl().mem_flags
        access = flags.READ_ONLY if read_only else flags.READ_WRITE
        return self._allocate(access, shape, dtype, name, None, writable=True)

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
        is copied, and that array holds what is written afterwards, too.

        Parameters
        ----------
        shape : tuple of int
            Shape in elements; zero is allowed.
        dtype : dtype_like, default: numpy.float32
            Element type.
        name : str, default: "result"
            What it holds; messages say it.
        lasting : bool, default: False
            As for :func:`aligned_empty`.

        Returns
        -------
        DeviceBuffer
            As of :meth:`buffer`.

        Raises
        ------
        DeviceMemoryError
            As for :meth:`buffer`.
        """
        dtype = np.dtype(dtype)
        shape = shape_of(shape, dtype)
        flags = opencl().mem_flags
        if not self.is_cpu or 0 in shape:
            pooled = not lasting and 0 not in shape
            return self._allocate(
                flags.READ_WRITE, shape, dtype, name, None, writable=True, pooled=pooled
            )
        access = flags.READ_WRITE | flags.USE_HOST_PTR
        return self._allocate(access, shape, dtype, name, None, writable=True, lasting=lasting)

    def upload(self, array: NDArray[Any], name: str = "array") -> DeviceBuffer:
        """An array's values on the device, for kernels to read.

        A CPU device uses an array that is C-contiguous and aligned for it in place (see
        :func:`aligned_empty`): do not change the array before the buffer is released. Otherwise
        the values are copied.

        Parameters
        ----------
        array : numpy.ndarray
            Any shape; made C-contiguous if it is not.
        name : str, default: "array"
            What it holds; messages say it.

        Returns
        -------
        DeviceBuffer
            Not writable.

        Raises
        ------
        DeviceMemoryError
            As for :meth:`buffer`.
        """
        shape = np.shape(array)
        array = np.ascontiguousarray(array)
        flags = opencl().mem_flags
        in_place = self._in_place(array)
        if self._turns.worker is not None and not in_place and array.nbytes > _COPY_BYTES:
            return self._upload_in_pieces(array.reshape(shape), name)
        source = flags.USE_HOST_PTR if in_place else flags.COPY_HOST_PTR
        return self._allocate(
            flags.READ_ONLY | source, shape, array.dtype, name, array, writable=False
        )

    def target(self, array: NDArray[Any], name: str = "array") -> DeviceBuffer:
        """Memory for kernels to write what an array is to hold; :meth:`download` brings it there.

        A CPU device writes into an array that is aligned for it in place, and the download into
        that very array, or its beginning, copies nothing.

        Parameters
        ----------
        array : numpy.ndarray
            C-contiguous and writable; what is in it is not read. Leave it alone until the
            download.
        name : str, default: "array"
            What it is to hold; messages say it.

        Returns
        -------
        DeviceBuffer
            Of the array's shape and dtype, uninitialised.

        Raises
        ------
        InvalidArgumentError
            If the array is not C-contiguous or not writable.
        DeviceMemoryError
            As for :meth:`buffer`.
        """
        if not (array.flags.c_contiguous and array.flags.writeable):
            raise InvalidArgumentError(
                f"the array for {name!r} must be C-contiguous and writable; its strides are "
                f"{array.strides}, writeable={array.flags.writeable}"
            )
        flags = opencl().mem_flags
        if not self._in_place(array):
            return self._allocate(
                flags.READ_WRITE, array.shape, array.dtype, name, None, writable=True
            )
        access = flags.READ_WRITE | flags.USE_HOST_PTR
        return self._allocate(access, array.shape, array.dtype, name, array, writable=True)

    @property
    def in_place_alignment(self) -> int | None:
        """Bytes; what begins at a multiple in an :func:`aligned_empty` array is used in place.

        None where a device uses no array in place.
        """
        return self._alignment if self.is_cpu and HOST_ALIGNMENT % self._alignment == 0 else None

    def _in_place(self, array: NDArray[Any]) -> bool:
        """Whether kernels can use a C-contiguous array where it is."""
        return self.is_cpu and array.nbytes > 0 and array.ctypes.data % self._alignment == 0

    def _upload_in_pieces(self, array: NDArray[Any], name: str) -> DeviceBuffer:
        """As :meth:`upload`; a driver that makes a buffer from an array keeps Python's lock."""
        read_only = opencl().mem_flags.READ_ONLY
        buffer = self._allocate(read_only, array.shape, array.dtype, name, None, writable=False)
        try:
            with self._driver(f"writing {array.nbytes} bytes to the buffer {name!r}"):
                self._copy("[write]", buffer.memory, array)
        except BaseException:
            buffer.release()
            raise
        return buffer

    def download(
        self, buffer: DeviceBuffer, out: NDArray[Any] | None = None, count: int | None = None
    ) -> NDArray[Any]:
        """Values of a buffer, when all that was enqueued before is done.

        Parameters
        ----------
        buffer : DeviceBuffer
            The source.
        out : numpy.ndarray, optional
            C-contiguous target of the buffer's dtype and of as many elements.
        count : int, optional
            Only so many elements from the start, as a 1D array.

        Returns
        -------
        numpy.ndarray
            ``out``, or a new array of the buffer's shape.

        Raises
        ------
        InvalidArgumentError
            If ``out`` or ``count`` does not fit.
        DeviceError
            If the driver fails, now or in a kernel before.
        """
        memory = buffer.memory
        elements = buffer.nbytes // buffer.dtype.itemsize
        if count is not None and not 0 <= count <= elements:
            raise InvalidArgumentError(
                f"{count} elements were asked of the buffer {buffer.name!r}, which has {elements}"
            )
        if out is None and count is None and buffer.host is not None:
            out = buffer.host
        if out is None:
            shape = buffer.shape if count is None else (count,)
            pins = not self.is_cpu and buffer.nbytes >= LEAST_PINNED and self._turns.worker is None
            out = (self._pinned.empty if pins else np.empty)(shape, buffer.dtype)
        check_host_array(out, buffer, elements if count is None else count)
        if not out.flags.writeable:
            raise InvalidArgumentError(f"the target for {buffer.name!r} is not writable")
        if out.nbytes:
            with self._driver(f"reading {out.nbytes} bytes of the buffer {buffer.name!r}"):
                if buffer.host is not None and out.ctypes.data == buffer.host.ctypes.data:
                    self._map(memory, out)
                else:
                    self._copy("[read]", memory, out, to_host=True)
        return out

    def download_later(
        self, buffer: DeviceBuffer, out: NDArray[Any], *, first: int = 0
    ) -> Callable[[], None]:
        """Copy part of a buffer into an array when all that was enqueued before is done.

        Inside :meth:`background` the copy is done when this returns.

        Parameters
        ----------
        buffer : DeviceBuffer
            The source.
        out : numpy.ndarray
            C-contiguous target of the buffer's dtype; leave it alone until then.
        first : int
            The first element that is copied; as many follow as the array has.

        Returns
        -------
        callable
            Returns when the values are there, and raises DeviceError if the driver failed.

        Raises
        ------
        InvalidArgumentError
            If the elements are not all in the buffer, or the array does not fit.
        DeviceError
            If the driver fails.
        """
        memory = buffer.memory
        self._check_part(buffer, out, first)
        if not out.flags.writeable:
            raise InvalidArgumentError(f"the target for {buffer.name!r} is not writable")
        if not out.nbytes:
            return lambda: None
        reading = f"reading {out.nbytes} bytes of the buffer {buffer.name!r}"
        with self._driver(reading):
            if self._turns.worker is not None:
                self._copy("[read]", memory, out, to_host=True, offset=first * out.itemsize)
                return lambda: None
            event = opencl().enqueue_copy(
                self._queue, out, memory, src_offset=first * out.itemsize, is_blocking=False
            )
            self._record("[read]", event)

        def wait() -> None:
            with self._driver(reading):
                event.wait()

        return wait

    def write(self, buffer: DeviceBuffer, array: NDArray[Any], *, first: int | None = None) -> None:
        """Copy an array into a buffer; the array is free to change when this returns.

        Parameters
        ----------
        buffer : DeviceBuffer
            The target, not one from :meth:`upload`.
        array : numpy.ndarray
            Of the buffer's dtype and of as many elements.
        first : int, optional
            Write only part of the buffer: as many elements as the array has, from this one on.

        Raises
        ------
        InvalidArgumentError
            If it does not fit or the buffer is not writable.
        DeviceError
            If the driver fails.
        """
        memory = self._writable_memory(buffer)
        array = np.ascontiguousarray(array)
        if first is None:
            check_host_array(array, buffer, buffer.nbytes // buffer.dtype.itemsize)
        else:
            self._check_part(buffer, array, first)
        if array.nbytes:
            with self._driver(f"writing {array.nbytes} bytes to the buffer {buffer.name!r}"):
                self._copy("[write]", memory, array, offset=(first or 0) * array.itemsize)

    def fill(self, buffer: DeviceBuffer, value: int | np.generic) -> None:
        """Fill a buffer with one byte or one element.

        Parameters
        ----------
        buffer : DeviceBuffer
            The target, not one from :meth:`upload`.
        value : int or numpy scalar
            A Python integer (0 to 255) is a byte; a NumPy scalar is the pattern as it is.

        Raises
        ------
        InvalidArgumentError
            If the value is no byte, the pattern does not divide the buffer, or the buffer is not
            writable.
        DeviceError
            If the driver fails.
        """
        memory = self._writable_memory(buffer)
        if isinstance(value, int) and not 0 <= value <= 255:
            raise InvalidArgumentError(
                f"{value} is no byte to fill the buffer {buffer.name!r} with; give a NumPy scalar "
                f"such as np.{buffer.dtype}({value})"
            )
        pattern = np.uint8(value) if isinstance(value, int) else value
        if buffer.nbytes % pattern.nbytes:
            raise InvalidArgumentError(
                f"a pattern of {pattern.nbytes} bytes does not divide the buffer "
                f"{buffer.name!r} of {buffer.nbytes} bytes"
            )
        if buffer.nbytes:
            with self._driver(f"filling the buffer {buffer.name!r}"):
                event = opencl().enqueue_fill_buffer(self._queue, memory, pattern, 0, buffer.nbytes)
                self._note_reader(buffer)
                self._record("[fill]", event)
                if self._turns.worker is not None:
                    self._queue.finish()  # nothing of this thread runs when its turn is over

    @property
    def allocated(self) -> int:
        """Bytes that this runtime's buffers hold now; arrays used in place count nothing."""
        return self._ledger.allocated

    @property
    def peak_allocated(self) -> int:
        """The most bytes that were held at once."""
        return self._ledger.peak

    def _pin(self, nbytes: int) -> tuple[NDArray[np.uint8], Callable[[], None]]:
        """Return page-locked host memory, and what gives it back."""
        cl = opencl()
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.ALLOC_HOST_PTR
        with self._driver(f"allocating {bytes_text(nbytes)} of page-locked host memory"):
            memory = cl.Buffer(self._context, flags, nbytes)
            access = cl.map_flags.READ | cl.map_flags.WRITE
            mapped, _ = cl.enqueue_map_buffer(self._queue, memory, access, 0, (nbytes,), np.uint8)

        def release() -> None:
            mapped.base.release(self._queue)
            memory.release()

        return mapped, release

    def _allocate(
        self,
        flags: int,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        name: str,
        host: NDArray[Any] | None,
        *,
        writable: bool,
        lasting: bool = False,
        pooled: bool = False,
    ) -> DeviceBuffer:
        cl = opencl()
        nbytes = int(np.prod(shape, dtype=object)) * dtype.itemsize
        in_place = bool(flags & cl.mem_flags.USE_HOST_PTR)
        callers = in_place and host is not None
        taken = 0 if callers else max(nbytes, dtype.itemsize)  # drivers refuse size 0
        if callers:
            # No memory is taken, but the limit per buffer holds for it as well.
            self._ledger.check_size(name, nbytes, self.info.max_allocation, self.info.global_memory)
        reserved = self._ledger.take(name, taken, self.info.max_allocation, self.info.global_memory)
        try:
            if in_place and host is None:
                try:
                    host = aligned_empty(shape, dtype, lasting=lasting)
                except MemoryError as exc:
                    raise DeviceMemoryError(
                        f"there is no host memory for the buffer {name!r} of "
                        f"{bytes_text(nbytes)}: close other programs, or use a smaller volume, "
                        "window size or max_supersegments"
                    ) from exc
            with self._driver(f"allocating {bytes_text(nbytes)} for the buffer {name!r}"):
                if pooled and nbytes <= MOST_POOLED:
                    if self._pool.held_blocks > BLOCKS_HELD:  # of windows that were larger once
                        self._pool.free_held()
                    memory = self._pool.allocate(nbytes)
                elif host is None or nbytes == 0:
                    flags &= ~cl.mem_flags.COPY_HOST_PTR
                    memory = cl.Buffer(self._context, flags, size=taken)
                else:
                    memory = cl.Buffer(self._context, flags, hostbuf=host)
        except BaseException:
            reserved.give_back()  # now: whoever keeps the error keeps this frame
            raise

        readers: set[int] | None = set() if in_place else None

        def on_release() -> None:
            reserved.give_back()
            if readers:
                self._finish(readers)  # the array may go when the buffer has gone

        buffer = DeviceBuffer(memory, shape, dtype, name, on_release, writable=writable)
        buffer.readers = readers
        buffer.host = host if in_place and writable else None
        return buffer

    def _copy(
        self,
        label: str,
        memory: Any,
        host: NDArray[Any],
        *,
        to_host: bool = False,
        offset: int = 0,
    ) -> None:
        """Copy between a buffer, from a byte on, and a C-contiguous array.

        Background work copies in pieces.
        """
        data = host.reshape(-1).view(np.uint8)
        size = data.nbytes if self._turns.worker is None else _COPY_BYTES
        for start in range(0, data.nbytes, size):
            self._turns.checkpoint()
            part = data[start : start + size]
            if to_host:
                ends = {"dest": part, "src": memory, "src_offset": offset + start}
            else:
                ends = {"dest": memory, "src": part, "dst_offset": offset + start}
            self._record(label, opencl().enqueue_copy(self._queue, **ends, is_blocking=True))

    def _map(self, memory: Any, host: NDArray[Any]) -> None:
        """Have an array that kernels wrote in place hold what they wrote.

        That is what mapping a buffer is for; the memory being the array's, nothing is copied, and
        the values stay when it is unmapped.
        """
        cl = opencl()
        self._turns.checkpoint()
        mapped, event = cl.enqueue_map_buffer(
            self._queue, memory, cl.map_flags.READ, 0, host.shape, host.dtype, is_blocking=True
        )
        self._record("[map]", event)
        mapped.base.release(self._queue)

    @staticmethod
    def _check_part(buffer: DeviceBuffer, array: NDArray[Any], first: int) -> None:
        """Refuse an array that does not fit a buffer's elements from one on."""
        elements = buffer.nbytes // buffer.dtype.itemsize
        if not 0 <= first <= elements - array.size:
            raise InvalidArgumentError(
                f"{array.size} elements from {first} on are not all in the buffer "
                f"{buffer.name!r}, which has {elements}"
            )
        check_host_array(array, buffer, array.size)

    def _writable_memory(self, buffer: DeviceBuffer) -> Any:
        if not buffer.writable:
            raise InvalidArgumentError(
                f"the buffer {buffer.name!r} was uploaded and may share the caller's array; "
                "make a buffer() to write to"
            )
        return buffer.memory

    def finish(self) -> None:
        """Wait until all that was enqueued on the calling thread's queue is done.

        Threads outside :meth:`queue_scope` share one. A buffer that a thread with a queue of its
        own has written may be handed to another thread after this.

        Raises
        ------
        DeviceError
            If a kernel failed meanwhile.
        """
        with self._driver("waiting for enqueued work"):
            self._queue.finish()

    @contextlib.contextmanager
    def queue_scope(self, profile: Profile | None = None) -> Iterator[None]:
        """Give the calling thread an in-order command queue of its own inside the ``with`` block.

        What was enqueued before is finished first, and what is enqueued inside is finished at
        the end, so buffers may cross the borders of the block.

        Parameters
        ----------
        profile : Profile, optional
            Collects the device times of what the thread enqueues inside; by default they go where
            ``PYVISTA_VDI_PROFILE`` wants them, if anywhere.
        """
        self.finish()
        outer, inner = self._queue_number, self._new_queue(profiled=profile is not None)
        outer_profile = getattr(self._local, "profile", None)
        self._local.queue_number, self._local.profile = inner, profile
        try:
            yield
        finally:
            self._local.queue_number, self._local.profile = outer, outer_profile
            self._finish({inner})
            with self._queues_lock:
                del self._queues[inner]

    @property
    def _queue(self) -> Any:
        return self._queues[self._queue_number]

    @property
    def _queue_number(self) -> int:
        return getattr(self._local, "queue_number", self._main_queue)

    def _new_queue(self, *, profiled: bool = False) -> int:
        cl = opencl()
        wanted = profiled or self._profile is not None
        properties = cl.command_queue_properties.PROFILING_ENABLE if wanted else 0
        with self._driver("making a command queue"):
            queue = cl.CommandQueue(self._context, self._device, properties)
        with self._queues_lock:
            self._queues_made += 1
            self._queues[self._queues_made] = queue
            return self._queues_made

    def _note_reader(self, buffer: DeviceBuffer) -> None:
        """Remember that this thread's queue reads a buffer whose memory is a caller's array."""
        number = self._queue_number
        if buffer.readers is not None and number not in buffer.readers:
            with self._queues_lock:
                buffer.readers.intersection_update(self._queues)
                buffer.readers.add(number)

    def _finish(self, numbers: set[int]) -> None:
        """Finish those of some queues that still exist, where their driver does."""
        if drivers_lost():
            return
        with self._queues_lock:
            queues = [self._queues[number] for number in numbers if number in self._queues]
        with self._driver("waiting for enqueued work"):
            for queue in queues:
                queue.finish()

    def foreground(self) -> contextlib.AbstractContextManager[None]:
        """Draw a frame that a person waits for inside the ``with`` block.

        Background work on this device rests meanwhile: put into the block all that must not be
        disturbed, drawing included. The block begins when the piece of background work in
        progress is done. If background work could not go on before the last frame, it begins
        after a turn of it, 0.3 times as long as a recent frame. Blocks of several threads run
        side by side; inside another, or in background work, a block changes nothing.

        Do not begin one while holding a lock that background work may need.
        """
        return self._turns.foreground()

    @contextlib.contextmanager
    def background(self, cancelled: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Work inside the ``with`` block only when no frame is in progress, see `foreground`.

        The calling thread gets a queue of its own. Its launches and copies are cut into pieces
        that take no longer than a turn; each is finished when the call returns.

        Parameters
        ----------
        cancelled : callable
            Asked between pieces; True ends the work with :class:`Cancelled`. Called often, from
            the thread itself.

        Raises
        ------
        Cancelled
            From any method that uses the device.
        """
        with self.queue_scope(), self._turns.background(cancelled):
            yield

    def give_way(self) -> None:
        """Let frames that wait go first; background work on the host calls it now and then.

        Raises
        ------
        Cancelled
            If the background work is no longer wanted.
        """
        self._turns.checkpoint()

    def aside(self) -> contextlib.AbstractContextManager[None]:
        """Let frames go on inside the ``with`` block, whose background work needs no device."""
        return self._turns.aside()

    def clock(self) -> float:
        """Return seconds that go by for the calling thread's work, to be subtracted.

        In background work they stand still while frames go first.
        """
        return self._turns.clock()

    def holding(self, lock: threading.Lock) -> contextlib.AbstractContextManager[None]:
        """Hold a lock under which device work is done.

        Whoever holds it may be waiting for this thread's frame or turn to end, so a thread that
        finds it taken leaves either until it gets it.
        """
        return self._turns.holding(lock)

    def profile(self) -> list[KernelTime]:
        """Device time per kernel so far; empty unless ``PYVISTA_VDI_PROFILE`` was set.

        Returns
        -------
        list of KernelTime
            Longest total first.
        """
        return self._profile.figures() if self._profile else []

    def _record(self, name: str, event: Any) -> None:
        profile = getattr(self._local, "profile", None) or self._profile
        if profile is not None:
            profile.record(name, event)

    def _print_profile(self) -> None:
        rows = self.profile()
        if rows:
            sys.stderr.write(table(self.info.full_name, rows) + "\n")

    @contextlib.contextmanager
    def _driver(self, doing: str) -> Iterator[None]:
        """Turn the driver's errors into the package's, naming what was being done."""
        cl = opencl()
        try:
            yield
        except cl.Error as exc:
            codes = cl.status_code
            short_of_memory = (
                codes.MEM_OBJECT_ALLOCATION_FAILURE,
                codes.OUT_OF_RESOURCES,
                codes.OUT_OF_HOST_MEMORY,
                codes.INVALID_BUFFER_SIZE,
            )
            lost = (
                codes.DEVICE_NOT_AVAILABLE,
                codes.INVALID_COMMAND_QUEUE,
                codes.INVALID_CONTEXT,
                codes.INVALID_DEVICE,
            )
            # An error that pyopencl raises by itself has no code.
            code = getattr(exc, "code", None)
            if code in short_of_memory:
                raise DeviceMemoryError(
                    f"{self.info.full_name!r} ran out of memory or resources while {doing} "
                    f"({exc}); it has {bytes_text(self.info.global_memory)}, of which this "
                    f"process holds {bytes_text(self.allocated)}: use a smaller volume, window "
                    "size or max_supersegments, or another device"
                ) from exc
            remedy = (
                "it may be lost (unplugged, or reset by its driver): start the program again, or "
                "use another device"
                if code in lost
                else "try again, or use another device"
            )
            raise DeviceError(
                f"{self.info.full_name!r} failed while {doing}: {exc}; {remedy} (device=, or the "
                "environment variable PYVISTA_VDI_DEVICE; pyvista-vdi devices lists them)"
            ) from exc
