"""What a launch takes: sizes, work-groups and arguments, checked and as the driver wants them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.buffers import DeviceBuffer, LocalMemory
from pyvista_vdi.device.devices import opencl
from pyvista_vdi.device.programs import Kernel
from pyvista_vdi.errors import InvalidArgumentError

Size = int | tuple[int, ...]
Argument = DeviceBuffer | LocalMemory | np.generic | NDArray[Any] | None


def padded(size: Size, group: Size) -> tuple[int, ...]:
    """The next multiple of a work-group size in each dimension.

    Parameters
    ----------
    size, group : int or tuple of int
        Work items wanted, and per work-group.

    Returns
    -------
    tuple of int
        A global size for :meth:`Runtime.launch`; the kernel leaves out the surplus itself.
    """
    return tuple(-(-n // g) * g for n, g in zip(as_size(size), as_size(group), strict=True))


def preferred_group(device: Any, is_cpu: bool) -> tuple[int, int]:
    """Suggested work-group (width, height) for kernels over an image: 64 work items if allowed."""
    # CPU compilers vectorise along the first dimension, GPUs like compact tiles.
    width, height = (16, 4) if is_cpu else (8, 8)
    limits = device.max_work_item_sizes
    width = min(width, int(limits[0]), int(device.max_work_group_size))
    return width, max(1, min(height, int(limits[1]), int(device.max_work_group_size) // width))


def as_size(size: Size) -> tuple[int, ...]:
    """A size in work items as a tuple of Python integers."""
    return tuple(int(n) for n in size) if isinstance(size, tuple) else (int(size),)


def set_arguments(kernel: Kernel, arguments: tuple[Argument, ...]) -> None:
    """Give the calling thread's kernel object those arguments that it does not have yet.

    A launch is often one of many that differ in a few, and drivers keep the others. The arguments
    are those of :meth:`Runtime.launch`; TypeError if one is untyped, and DeviceError if a buffer
    was released.
    """
    mine, known = kernel.object, kernel.arguments_set
    for index, argument in enumerate(arguments):
        if _same_to_driver(known.get(index), argument):
            continue
        known.pop(index, None)
        mine.set_arg(index, driver_argument(kernel, index, argument))
        if isinstance(argument, DeviceBuffer):
            known[index] = argument.identity
        elif isinstance(argument, np.ndarray):
            known[index] = argument.copy()  # the caller's may change
        else:
            known[index] = argument


def _same_to_driver(known: Any, argument: Argument) -> bool:
    """Whether an argument is sure to be what was given before; what is rare is given anew."""
    if isinstance(argument, DeviceBuffer):
        return known is argument.identity and not argument.released
    if not isinstance(argument, (np.generic, np.ndarray)) or type(known) is not type(argument):
        return False
    if known is argument:
        return True
    return bool(known.tobytes() == argument.tobytes())  # 0 is not -0, and NaN is NaN


def driver_argument(kernel: Kernel, index: int, argument: Argument) -> Any:
    """What the driver takes for an argument of :meth:`Runtime.launch`; TypeError if untyped."""
    if isinstance(argument, DeviceBuffer):
        return argument.memory
    if argument is None:
        # clSetKernelArg takes a pointer to a null handle; pyopencl 2024 refuses None itself.
        return np.uintp(0)
    if isinstance(argument, LocalMemory):
        return opencl().LocalMemory(argument.nbytes)
    if isinstance(argument, np.bool_) or not isinstance(argument, (np.generic, np.ndarray)):
        raise TypeError(
            f"argument {index} of kernel {kernel.name!r} is {argument!r} of type "
            f"{type(argument).__name__}; give a DeviceBuffer, LocalMemory, None, or a NumPy "
            "number or array of the kernel's own type, such as np.float32(...)"
        )
    return np.ascontiguousarray(argument) if isinstance(argument, np.ndarray) else argument


def check_host_array(array: NDArray[Any], buffer: DeviceBuffer, elements: int) -> None:
    """Refuse an array that cannot exchange so many elements with the buffer."""
    if array.dtype != buffer.dtype or array.size != elements or not array.flags.c_contiguous:
        raise InvalidArgumentError(
            f"the buffer {buffer.name!r} exchanges {elements} C-contiguous elements of "
            f"{buffer.dtype}; the array has {array.size} of {array.dtype}, strides {array.strides}"
        )
