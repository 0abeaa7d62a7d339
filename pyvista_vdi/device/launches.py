"""Launches of kernels: arguments by name, and work in pieces behind frames."""

import math
import operator
import time
from typing import Any

import numpy as np

from pyvista_vdi.device.memory import DeviceBuffer
from pyvista_vdi.device.programs import Kernel, Parameter
from pyvista_vdi.device.queues import Device
from pyvista_vdi.device.scheduling import Worker
from pyvista_vdi.errors import DeviceError, InvalidArgumentError

Size = int | tuple[int, ...]

#: Work-groups for each of the device's compute units in the first piece of a launch.
_FIRST_GROUPS = 4
#: Where the driver chooses work-groups, pieces are a multiple of as much of this as divides all.
_FREE_STEP = 256
#: A pointer to a null handle; pyopencl 2024 refuses None itself.
_NULL = np.uintp(0)


def padded(size: Size, group: Size) -> tuple[int, ...]:
    """Return the next multiple of a work-group size in each dimension; the surplus is left out."""
    sizes = size if isinstance(size, tuple) else (size,)
    groups = group if isinstance(group, tuple) else (group,)
    return tuple([-(-n // g) * g for n, g in zip(sizes, groups, strict=True)])


_RELEASED = "the buffer {!r} was used after its release"


class Launch:
    """A kernel and its arguments, to be launched again and again; made by :meth:`Runtime.bind`.

    Arguments keep their values, and buffers are kept, until they are given anew. One thread at a
    time may use it. Set ``divisible`` to False for a kernel that asks where in the whole its
    work-group is: launches of its parts, with offsets, would not do what one launch does.
    """

    divisible = True

    def __init__(self, queues: Device, kernel: Kernel) -> None:
        self._queues, self._kernel = queues, kernel
        self._missing = dict.fromkeys(kernel.parameters)  # in order
        self._buffers: dict[str, DeviceBuffer | None] = {}
        # The driver's, which holds the arguments: one that no other launch has
        try:
            self._object = kernel.free.pop()
        except IndexError:
            self._object = kernel.new_object()

    def __del__(self) -> None:
        if hasattr(self, "_object"):
            self._kernel.free.append(self._object)

    def __repr__(self) -> str:
        return f"<Launch of {self._kernel!r}>"

    def set(self, **arguments: Any) -> None:
        """Set some of the arguments; parameters and errors are those of :meth:`Runtime.bind`."""
        kernel, queues = self._kernel, self._queues
        for name, value in arguments.items():
            parameter = kernel.parameters.get(name)
            if parameter is None:
                raise InvalidArgumentError(
                    f"kernel {kernel.name!r} of {kernel.path} has no argument {name!r} with these "
                    f"options; it takes {', '.join(kernel.parameters)}"
                )
            buffer = value if isinstance(value, DeviceBuffer) else None
            try:
                if buffer is not None:
                    given = buffer.memory
                    if given is None:
                        raise DeviceError(_RELEASED.format(buffer.name))
                    if parameter.held is not None and buffer.dtype not in parameter.held:
                        raise TypeError
                elif parameter.scalar is not None and value is not None:
                    given = parameter.scalar(value)
                    if given != value and given.dtype.kind != "f":
                        raise TypeError
                else:
                    given = _given(queues.cl, parameter, value)
                self._object.set_arg(parameter.index, given)
            except (AttributeError, OverflowError, TypeError, ValueError) as exc:
                raise TypeError(
                    f"argument {name!r} of kernel {kernel.name!r} is declared as {parameter.kind}; "
                    f"{value!r} of type {type(value).__name__} was given"
                ) from exc
            except queues.cl.Error as exc:
                doing = f"setting argument {name!r} of {kernel.name!r} of {kernel.path}"
                raise queues.failure(exc, doing) from exc
            self._buffers[name] = buffer
            self._missing.pop(name, None)

    def __call__(self, size: Size, group: Size | None = None, /, **arguments: Any) -> None:
        """Set the arguments that change, and enqueue the kernel.

        It returns at once; inside :meth:`Runtime.background`, when all is done, in pieces. ``size``
        is the work-items in each dimension, of which none are launched if one is 0; ``group`` those
        of a work-group, which divide them (see :func:`padded`), or else the driver's choice;
        arguments are as of :meth:`Runtime.bind`.

        Raises InvalidArgumentError or TypeError if the sizes do not fit each other or the arguments
        not the kernel's, DeviceMemoryError or DeviceError if the driver refuses or a buffer has
        been released.
        """
        # Set what changes
        queues, kernel = self._queues, self._kernel
        if arguments:
            self.set(**arguments)
        if self._missing:
            raise InvalidArgumentError(
                f"kernel {kernel.name!r} of {kernel.path} was launched without its arguments "
                f"{', '.join(self._missing)}"
            )

        # Check the sizes
        whole = tuple(map(int, size)) if isinstance(size, tuple) else (int(size),)
        local = group if group is None or isinstance(group, tuple) else (group,)
        if local and (len(local) != len(whole) or any(map(operator.mod, whole, local))):
            raise InvalidArgumentError(
                f"kernel {kernel.name!r}: the global size {whole} is no multiple of the "
                f"work-group size {local} in every dimension; round it up with padded()"
            )
        if 0 in whole:
            return

        # Note who reads host memory in place, which is waited for before it goes
        number = queues.thread.number
        for buffer in self._buffers.values():
            if buffer is None:
                continue
            if buffer.memory is None:
                raise DeviceError(_RELEASED.format(buffer.name))
            if buffer.readers is not None and number not in buffer.readers:
                queues.note_reader(buffer.readers)

        # Enqueue it
        worker = queues.thread.worker
        try:
            if worker is not None:
                self._run_in_pieces(worker, whole, local)
                return
            event = queues.cl.enqueue_nd_range_kernel(queues.queue, self._object, whole, local)
        except queues.cl.Error as exc:
            doing = f"launching {kernel.name!r} of {kernel.path} on {whole} by {local}"
            raise queues.failure(exc, doing) from exc
        queues.record(kernel.name, event)

    def _run_in_pieces(
        self, worker: Worker, whole: tuple[int, ...], local: tuple[int, ...] | None
    ) -> None:
        """Run parts of its last dimension one after the other, each no longer than allowed."""
        queues, name = self._queues, self._kernel.name
        queue, enqueue = queues.queue, queues.cl.enqueue_nd_range_kernel
        rows, row_items = whole[-1], math.prod(whole[:-1])
        step = local[-1] if local is not None else math.gcd(rows, _FREE_STEP)
        first = step * queues.info.compute_units * _FIRST_GROUPS
        done = 0
        while done < rows:
            seconds = queues.give_way()
            left = rows - done
            items = worker.piece(name, seconds)
            fitting = first if items is None else items // row_items
            # Equal parts, in whole groups: a small rest would run as badly as it would be measured
            parts = -(-left // max(fitting, step)) if self.divisible else 1
            rows_now = min(left, -(-left // (parts * step)) * step)
            offset = (*(0 for _ in whole[1:]), done)
            began = time.perf_counter()
            event = enqueue(
                queue, self._object, (*whole[:-1], rows_now), local, global_work_offset=offset
            )
            queue.finish()
            worker.took(name, rows_now * row_items, time.perf_counter() - began)
            queues.record(name, event)
            done += rows_now


def _given(cl: Any, parameter: Parameter, value: Any) -> Any:
    """Return local memory, a null pointer, a structure or a vector as the driver takes it."""
    kind, number, count = parameter.kind, parameter.number, parameter.count
    if kind.startswith("local "):
        assert number is not None
        return cl.LocalMemory(operator.index(value) * count * number.itemsize)
    if kind.endswith("*"):
        if value is not None:
            raise TypeError
        return _NULL
    if number is None or number.names is not None:
        if value.dtype != number:
            raise TypeError
        return value
    converted = np.array(value, number)
    exact = number.kind == "f" or np.array_equal(converted, value)
    if converted.size != count or not exact:
        raise TypeError
    return converted
