"""A device ready for work, and launches of kernels: arguments by name, in pieces behind frames."""

import math
import threading
import time
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from pyvista_vdi.device import programs
from pyvista_vdi.device.constants import literal
from pyvista_vdi.device.devices import DeviceInfo
from pyvista_vdi.device.memory import DeviceBuffer, Memory
from pyvista_vdi.device.programs import Define, Kernel
from pyvista_vdi.device.scheduling import Worker
from pyvista_vdi.errors import InvalidArgumentError

Size = int | tuple[int, ...]

#: Work-groups for each of the device's compute units in the first piece of a launch.
_FIRST_GROUPS = 4


def padded(size: Size, group: Size) -> tuple[int, ...]:
    """Return the next multiple of a work-group size in each dimension; the surplus is left out."""
    sizes = size if isinstance(size, tuple) else (size,)
    groups = group if isinstance(group, tuple) else (group,)
    return tuple([-(-n // g) * g for n, g in zip(sizes, groups, strict=True)])


class Launch:
    """A kernel and its arguments, to be launched again and again; made by :meth:`Runtime.bind`.

    Arguments keep their values, and buffers are kept, until they are given anew. One thread at a
    time may use it.
    """

    def __init__(self, device: Memory, kernel: Kernel) -> None:
        self._device, self._kernel = device, kernel
        self._missing = dict.fromkeys(kernel.parameters)  # in order
        self._buffers: dict[str, DeviceBuffer] = {}
        # The driver's, which holds the arguments: one that no other launch has
        try:
            self._object = kernel.free.pop()
        except IndexError:
            self._object = kernel.new_object()

    def __del__(self) -> None:
        if hasattr(self, "_object"):
            self._kernel.free.append(self._object)

    def __repr__(self) -> str:
        return f"<Launch of {self._kernel.name!r}>"

    def set(self, **arguments: Any) -> None:
        """Set some of the arguments; parameters and errors are those of :meth:`Runtime.bind`."""
        kernel, device = self._kernel, self._device
        for name, value in arguments.items():
            parameter = kernel.parameters.get(name)
            if parameter is None:
                raise InvalidArgumentError(
                    f"kernel {kernel.name!r} of {kernel.path} has no argument {name!r} with these "
                    f"options; it takes {', '.join(kernel.parameters)}"
                )
            is_buffer = isinstance(value, DeviceBuffer)
            try:
                given = value.used() if is_buffer else parameter.given(device.cl, value)
                if is_buffer and not parameter.holds(value.dtype):
                    raise TypeError
                self._object.set_arg(parameter.place, given)
            except (AttributeError, OverflowError, TypeError, ValueError) as exc:
                raise TypeError(
                    f"argument {name!r} of kernel {kernel.name!r} is declared as {parameter.kind}; "
                    f"{value!r} of type {type(value).__name__} was given"
                ) from exc
            self._buffers.pop(name, None)
            if is_buffer:
                self._buffers[name] = value
            self._missing.pop(name, None)

    def __call__(self, size: Size, group: Size, /, **arguments: Any) -> None:
        """Set the arguments that change, and enqueue the kernel.

        It returns at once; inside :meth:`Runtime.background`, when all is done, in pieces. ``size``
        is the work-items in each dimension, of which none are launched if one is 0; ``group`` those
        of a work-group, which divide them (see :func:`padded`). Raises what :meth:`Runtime.bind`
        does, and DeviceMemoryError or DeviceError if the driver refuses.
        """
        # Set what changes
        device, kernel = self._device, self._kernel
        self.set(**arguments)
        if self._missing:
            raise InvalidArgumentError(
                f"kernel {kernel.name!r} of {kernel.path} was launched without its arguments "
                f"{', '.join(self._missing)}"
            )
        for buffer in self._buffers.values():
            buffer.used()

        # Enqueue it
        whole = tuple(map(int, size)) if isinstance(size, tuple) else (int(size),)
        local = group if isinstance(group, tuple) else (group,)
        if 0 in whole:
            return
        worker = device.thread.worker
        try:
            if worker is not None:
                self._run_in_pieces(worker, whole, local)
            else:
                device.cl.enqueue_nd_range_kernel(device.queue, self._object, whole, local)
        except device.cl.Error as exc:
            doing = f"launching {kernel.name!r} of {kernel.path} on {whole} by {local}"
            raise device.failure(exc, doing) from exc

    def _run_in_pieces(
        self, worker: Worker, whole: tuple[int, ...], local: tuple[int, ...]
    ) -> None:
        """Run parts of its last dimension one after the other, each no longer than allowed.

        Kernels do not ask for the number of their group, which would be another in a part.
        """
        device, name = self._device, self._kernel.name
        queue, enqueue = device.queue, device.cl.enqueue_nd_range_kernel
        rows, row_items = whole[-1], math.prod(whole[:-1])
        step, done = local[-1], 0
        first = step * device.info.compute_units * _FIRST_GROUPS
        while done < rows:
            items = worker.piece(name, device.give_way())
            fitting = first if items is None else items // row_items
            # Equal parts, in whole groups: a small rest would run as badly as it would be measured
            left = rows - done
            parts = -(-left // max(fitting, step))
            rows_now = min(left, -(-left // (parts * step)) * step)
            offset = (*(0 for _ in whole[1:]), done)
            began = time.perf_counter()
            enqueue(queue, self._object, (*whole[:-1], rows_now), local, global_work_offset=offset)
            queue.finish()
            worker.took(name, rows_now * row_items, time.perf_counter() - began)
            done += rows_now


class Runtime(Memory):
    """A device ready for work. Made by :func:`~pyvista_vdi.device.get_runtime`.

    Every method may be called from any thread. Commands run in the order in which they are
    enqueued. Threads must have ended before the interpreter does: drivers do not survive use at
    exit.
    """

    def __init__(self, info: DeviceInfo) -> None:
        super().__init__(info)
        self._kernels: dict[tuple[Any, ...], Kernel] = {}
        self._programs: dict[tuple[Any, ...], Any] = {}
        self._locks: dict[tuple[Any, ...], threading.Lock] = {}
        self._options = ["-cl-std=CL1.2"]
        rounded = self.cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        if self._device.single_fp_config & rounded:
            self._options.append("-cl-fp32-correctly-rounded-divide-sqrt")

    def bind(
        self,
        path: str | Path,
        name: str,
        defines: Mapping[str, Define] | None = None,
        /,
        **arguments: Any,
    ) -> Launch:
        """Return a launch of a kernel, which is compiled when first asked for.

        ``path`` is a file of ``pyvista_vdi.opencl``, or any other one as a Path. ``defines`` are
        ``-D`` options: what changes the code's shape; floats become exact float32 literals.
        Arguments are those that are known already. Numbers are converted to the declared type,
        which they must fit; vectors are given as arrays or sequences, structures as dictionaries of
        their fields, local memory as elements for each work-group; None is a null pointer.

        Raises KernelBuildError if it cannot be compiled, InvalidArgumentError if a name is no
        argument's, TypeError if a value is not of its argument's type, and DeviceError if a buffer
        has been released.
        """
        launch = Launch(self, self.kernel(path, name, defines or {}))
        launch.set(**arguments)
        return launch

    def kernel(self, path: str | Path, name: str, defines: Mapping[str, Define]) -> Kernel:
        """Return a kernel, compiled when first asked for, and the same for the same source.

        Threads may share it. KernelBuildError if it cannot be compiled. Background work compiles
        beside frames: that takes seconds, and not the device.
        """
        given = [f"-D{name}={literal(value)}" for name, value in sorted(defines.items())]
        options, source = (*self._options, *given), programs.expand(path)
        program, key = (source, options), (source, name, options)
        if key in self._kernels:
            return self._kernels[key]
        aside = nullcontext() if self.thread.worker is None else self.aside()
        # Different programs are compiled side by side. OpenCL has every function thread safe but
        # the one that sets arguments (1.2, A.2); compilers that are not are locked by their drivers
        with aside, self._locks.setdefault(program, threading.Lock()):
            if program not in self._programs:
                of = self._context, self._device, str(path)
                self._programs[program] = programs.build(*of, source, options)
            if key not in self._kernels:
                self._kernels[key] = Kernel(self._programs[program], path, name, defines)
            return self._kernels[key]
