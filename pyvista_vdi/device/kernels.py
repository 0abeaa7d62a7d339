"""Launches of kernels, whose arguments keep their values."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from pyvista_vdi.device.buffers import DeviceBuffer, LocalMemory
from pyvista_vdi.device.declarations import Parameter
from pyvista_vdi.device.programs import Kernel
from pyvista_vdi.errors import InvalidArgumentError

Size = int | tuple[int, ...]


class Launcher(Protocol):
    """The part of a :class:`Runtime` that launches need."""

    def set_arguments(self, kernel: Kernel, driver_kernel: Any, given: dict[int, Any]) -> None:
        """Give a driver's kernel some arguments, by their places."""

    def enqueue(
        self,
        kernel: Kernel,
        driver_kernel: Any,
        size: Size,
        group: Size | None,
        buffers: Sequence[DeviceBuffer],
    ) -> None:
        """Enqueue a driver's kernel whose arguments are set, these buffers among them."""


class Launch:
    """A kernel and its arguments, to be launched again and again; made by :meth:`Runtime.bind`.

    Arguments keep their values, and buffers are kept, until they are given anew. One thread at a
    time may use it.
    """

    def __init__(self, runtime: Launcher, kernel: Kernel) -> None:
        self._runtime, self._kernel = runtime, kernel
        self._missing = dict.fromkeys(kernel.parameters)  # in order
        self._buffers: dict[str, DeviceBuffer | None] = {}
        self._object = kernel.take()

    def __del__(self) -> None:
        if hasattr(self, "_object"):
            self._kernel.put_back(self._object)

    def __repr__(self) -> str:
        return f"<Launch of {self._kernel!r}>"

    def set(self, **arguments: Any) -> None:
        """Set some of the arguments; parameters and errors are those of :meth:`Runtime.bind`."""
        kernel, given = self._kernel, {}
        for name, value in arguments.items():
            parameter = kernel.parameters.get(name)
            if parameter is None:
                raise InvalidArgumentError(
                    f"kernel {kernel.name!r} of {kernel.path} has no argument {name!r} with these "
                    f"options; it takes {', '.join(kernel.parameters)}"
                )
            buffer = value if isinstance(value, DeviceBuffer) else None
            try:
                given[parameter.index] = _converted(parameter, value)
            except (AttributeError, OverflowError, TypeError, ValueError) as exc:
                raise TypeError(
                    f"argument {name!r} of kernel {kernel.name!r} is declared as {parameter.kind}; "
                    f"{value!r} of type {type(value).__name__} was given"
                ) from exc
            self._buffers[name] = buffer
            self._missing.pop(name, None)
        self._runtime.set_arguments(kernel, self._object, given)

    def __call__(self, size: Size, group: Size | None = None, /, **arguments: Any) -> None:
        """Set the arguments that change, and enqueue the kernel.

        It returns at once; inside :meth:`Runtime.background`, when all is done, in pieces.

        Parameters
        ----------
        size : int or tuple of int
            Work-items in each dimension; nothing is launched if one is 0.
        group : int or tuple of int, optional
            Work-items of a work-group, which divide ``size`` (see :func:`padded`); by default the
            driver chooses.
        **arguments : DeviceBuffer, number, sequence of numbers, structure or None
            As of :meth:`Runtime.bind`.

        Raises
        ------
        InvalidArgumentError
            If the sizes do not fit each other, a name is no argument's, or one was never given.
        TypeError
            If a value is not of its argument's type.
        DeviceMemoryError
            If the driver lacks memory or resources.
        DeviceError
            If a buffer has been released, or the driver refuses for any other reason.
        Cancelled
            Inside :meth:`Runtime.background`, if the work is no longer wanted.
        """
        if arguments:
            self.set(**arguments)
        if self._missing:
            raise InvalidArgumentError(
                f"kernel {self._kernel.name!r} of {self._kernel.path} was launched without its "
                f"arguments {', '.join(self._missing)}"
            )
        buffers = [buffer for buffer in self._buffers.values() if buffer is not None]
        self._runtime.enqueue(self._kernel, self._object, size, group, buffers)


def _converted(parameter: Parameter, value: Any) -> Any:
    """Return a value as the driver takes it.

    Numbers are rounded to float32 where the type is that, and are otherwise kept exactly.

    Raises
    ------
    AttributeError, OverflowError, TypeError or ValueError
        If it cannot be had of the argument's type.
    """
    kind, number, count = parameter.kind, parameter.number, parameter.count
    if kind.startswith("local "):
        assert number is not None
        return LocalMemory(operator.index(value) * count * number.itemsize)
    if kind.endswith("*"):
        if value is None:
            return None
        if not isinstance(value, DeviceBuffer):
            raise TypeError
        # Buffers may hold the parts of a pointer's numbers, such as two floats for a ulong
        held = value.dtype
        if number is not None and held != number and number.itemsize % (2 * held.itemsize):
            raise TypeError
        return value
    if number is None or number.names is not None:
        if value.dtype != number:
            raise TypeError
        return value
    converted = np.array(value, number)
    exact = number.kind == "f" or np.array_equal(converted, value)
    if value is None or converted.size != count or not exact:
        raise TypeError
    return converted
