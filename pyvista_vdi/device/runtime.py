"""One device, ready for work: its queues, memory and programs in one object."""

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.devices import Candidate
from pyvista_vdi.device.launches import Launch
from pyvista_vdi.device.memory import LEAST_PINNED, DeviceBuffer, Memory
from pyvista_vdi.device.programs import Define, Kernel, KernelDeclaration, ProgramCache
from pyvista_vdi.errors import DeviceError, InvalidArgumentError

#: Bytes that background work copies at a time: about a millisecond at a host memory's pace.
_COPY_BYTES = 4 * 2**20


class Runtime(Memory):
    """A device ready for work. Made by :func:`~pyvista_vdi.device.get_runtime`.

    Every method may be called from any thread. Commands run in the order in which they are
    enqueued, one queue for all threads unless :meth:`queue_scope` gives a thread its own. What one
    queue has written another sees when the first has been finished, see :meth:`finish`. Threads
    must have ended before the interpreter does: drivers do not survive use at exit.
    """

    def __init__(self, candidate: Candidate, context: Any = None) -> None:
        super().__init__(candidate, context)
        self._programs = ProgramCache(self._context, self._device)

    def bind(
        self,
        declaration: KernelDeclaration,
        defines: Mapping[str, Define] | None = None,
        /,
        **arguments: Any,
    ) -> Launch:
        """Return a launch of a kernel, which is compiled when first asked for.

        ``defines`` are ``-D`` options: what changes the code's shape; floats become exact float32
        literals. Arguments are those that are known already. Numbers are converted to the declared
        type, which they must fit; vectors are given as arrays or sequences, local memory as
        elements for each work-group; None is a null pointer.

        Raises KernelBuildError if it cannot be assembled or compiled, InvalidArgumentError if a
        name is no argument's or a define cannot be written as an option, TypeError if a value is
        not of its argument's type, and DeviceError if a buffer has been released.
        """
        kernel = self.kernel(declaration.path, declaration.name, defines)
        if not kernel.parameters:
            kernel.declare(declaration, defines or {})
        launch = Launch(self, kernel)
        if arguments:
            launch.set(**arguments)
        return launch

    def kernel(
        self,
        path: str | Path,
        name: str,
        defines: Mapping[str, Define] | None = None,
    ) -> Kernel:
        """Return a kernel, compiled when first asked for and kept; threads may share it.

        Parameters are those of a :class:`KernelDeclaration` and of :meth:`bind`, as
        KernelBuildError is.
        """
        defines = defines or {}
        # Numbers that are equal are written otherwise as others' types
        key = (path, name, tuple(defines.items()), tuple(map(type, defines.values())))
        known = self._programs.known if isinstance(path, str) else {}  # a file on disk may change
        if key in known:
            return known[key]
        # Compilers take seconds, and not the device
        background = self.thread.worker is not None
        with self.aside() if background else contextlib.nullcontext():
            known[key] = self._programs.kernel(path, name, defines)
        return known[key]

    def upload(self, array: NDArray[Any], name: str = "array") -> DeviceBuffer:
        """Return an array's values on the device, for kernels to read; ``name`` says of what.

        A CPU device uses an array that is C-contiguous and aligned for it in place (see
        :func:`aligned_empty`): do not change the array before the buffer is released. Otherwise
        the values are copied. The buffer is not writable. Raises as :meth:`buffer` does.
        """
        shape, array, flags = np.shape(array), np.ascontiguousarray(array), self.cl.mem_flags
        in_place, dtype = self.in_place(array), array.dtype
        if in_place or self.thread.worker is None or array.nbytes <= _COPY_BYTES:
            access = flags.READ_ONLY | (flags.USE_HOST_PTR if in_place else flags.COPY_HOST_PTR)
            return self.allocate(access, shape, dtype, name, array, writable=False)

        # In pieces: a driver that makes a buffer from an array keeps Python's lock
        buffer = self.allocate(flags.READ_ONLY, shape, dtype, name, writable=False)
        try:
            self._copy(buffer, array)
        except BaseException:
            buffer.release()
            raise
        return buffer

    def download(
        self, buffer: DeviceBuffer, out: NDArray[Any] | None = None, count: int | None = None
    ) -> NDArray[Any]:
        """Return the values of a buffer, when all that was enqueued before is done.

        They are in ``out``, a C-contiguous array of the buffer's dtype and of as many elements, or
        in a new one of its shape; with ``count``, only so many from the start, in 1D.
        InvalidArgumentError if these do not fit; DeviceError if the driver fails, now or in a
        kernel before.
        """
        elements = buffer.nbytes // buffer.dtype.itemsize
        if count is not None and not 0 <= count <= elements:
            raise InvalidArgumentError(
                f"{count} elements were asked of the buffer {buffer.name!r}, which has {elements}"
            )
        if out is None and count is None:
            out = buffer.host
        if out is None:
            shape = buffer.shape if count is None else (count,)
            waits = self.thread.worker is None
            pins = waits and not self.is_cpu and buffer.nbytes >= LEAST_PINNED
            out = (self.pinned.empty if pins else np.empty)(shape, buffer.dtype)
        _check_exchange(buffer, out, elements if count is None else count, written=True)
        if buffer.host is None or out.ctypes.data != buffer.host.ctypes.data:
            self._copy(buffer, out, to_host=True)
        elif out.nbytes:
            # Map it: the memory is the array's, so that nothing is copied, and the values stay
            if self.thread.worker is not None:
                self.give_way()
            cl, queue = self.cl, self.queue
            try:
                mapped, event = cl.enqueue_map_buffer(
                    queue, buffer.memory, cl.map_flags.READ, 0, out.shape, out.dtype
                )
                mapped.base.release(queue)
            except cl.Error as exc:
                raise self.failure(exc, _copying(buffer, out, to_host=True)) from exc
            self.record("[map]", event)
        return out

    def download_later(
        self, buffer: DeviceBuffer, out: NDArray[Any], *, first: int = 0
    ) -> Callable[[], None]:
        """Copy part of a buffer into an array when all that was enqueued before is done.

        Inside :meth:`background` the copy is done when this returns. As many elements as ``out``
        has are copied, from the ``first`` on, or InvalidArgumentError is raised; leave it alone
        until what is returned, when called, has waited for them (and raised DeviceError if the
        driver failed).
        """
        _check_exchange(buffer, out, out.size, written=True, first=first)
        event = self._copy(buffer, out, to_host=True, first=first, later=True)

        def wait() -> None:
            if event is None:
                return
            try:
                event.wait()
            except self.cl.Error as exc:
                raise self.failure(exc, _copying(buffer, out, to_host=True)) from exc

        return wait

    def write(self, buffer: DeviceBuffer, array: NDArray[Any], *, first: int | None = None) -> None:
        """Copy an array into a buffer; the array is free to change when this returns.

        It fills the buffer, or only as many elements as it has, from the ``first`` on.
        InvalidArgumentError if it does not fit, or the buffer is not writable: one from
        :meth:`upload`.
        """
        _check_writable(buffer)
        array = np.ascontiguousarray(array)
        elements = buffer.nbytes // buffer.dtype.itemsize if first is None else array.size
        _check_exchange(buffer, array, elements, first=first or 0)
        self._copy(buffer, array, first=first or 0)

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

        With ``to_host`` the other way.
        Background work copies in pieces, and what others ask for ``later`` is not waited for: its
        event is returned.
        """
        memory, cl, queue = buffer.memory, self.cl, self.queue
        background = self.thread.worker is not None
        waits, event = background or not later, None
        data, offset = host.reshape(-1).view(np.uint8), first * host.itemsize
        size = _COPY_BYTES if background else max(1, data.nbytes)
        try:
            for start in range(0, data.nbytes, size):
                if background:
                    self.give_way()
                part = data[start : start + size]
                if to_host:
                    ends = {"dest": part, "src": memory, "src_offset": offset + start}
                else:
                    ends = {"dest": memory, "src": part, "dst_offset": offset + start}
                event = cl.enqueue_copy(queue, **ends, is_blocking=waits)
                self.record("[read]" if to_host else "[write]", event)
        except cl.Error as exc:
            raise self.failure(exc, _copying(buffer, host, to_host=to_host)) from exc
        return None if waits else event

    def fill(self, buffer: DeviceBuffer, value: int | np.generic) -> None:
        """Fill a buffer, not one from :meth:`upload`, with one byte or one element.

        A Python integer (0 to 255) is a byte; a NumPy scalar is the pattern as it is, which divides
        the buffer (InvalidArgumentError else).
        """
        _check_writable(buffer)
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
        memory, queue, cl = buffer.memory, self.queue, self.cl
        if buffer.nbytes == 0:
            return
        try:
            event = cl.enqueue_fill_buffer(queue, memory, pattern, 0, buffer.nbytes)
            if buffer.readers is not None:
                self.note_reader(buffer.readers)
            self.record("[fill]", event)
            if self.thread.worker is not None:
                queue.finish()  # nothing of this thread runs when its turn is over
        except cl.Error as exc:
            raise self.failure(exc, f"filling the buffer {buffer.name!r}") from exc


def _check_writable(buffer: DeviceBuffer) -> None:
    if buffer.memory is None:
        raise DeviceError(f"the buffer {buffer.name!r} was used after its release")
    if not buffer.writable:
        raise InvalidArgumentError(
            f"the buffer {buffer.name!r} was uploaded and may share the caller's array; "
            "make a buffer() to write to"
        )


def _check_exchange(
    buffer: DeviceBuffer,
    array: NDArray[Any],
    elements: int,
    *,
    written: bool = False,
    first: int = 0,
) -> None:
    """Refuse an array that cannot exchange so many elements with a buffer, from one on."""
    if buffer.memory is None:
        raise DeviceError(f"the buffer {buffer.name!r} was used after its release")
    room = buffer.nbytes // buffer.dtype.itemsize
    if not 0 <= first <= room - elements:
        raise InvalidArgumentError(
            f"{elements} elements from {first} on are not all in the buffer {buffer.name!r}, "
            f"which has {room}"
        )
    if array.dtype != buffer.dtype or array.size != elements or not array.flags.c_contiguous:
        raise InvalidArgumentError(
            f"the buffer {buffer.name!r} exchanges {elements} C-contiguous elements of "
            f"{buffer.dtype}; the array has {array.size} of {array.dtype}, strides {array.strides}"
        )
    if written and not array.flags.writeable:
        raise InvalidArgumentError(f"the target for {buffer.name!r} is not writable")


def _copying(buffer: DeviceBuffer, host: NDArray[Any], *, to_host: bool) -> str:
    if to_host:
        return f"reading {host.nbytes} bytes of the buffer {buffer.name!r}"
    return f"writing {host.nbytes} bytes to the buffer {buffer.name!r}"
