"""Launching one function of a kernel file: NumPy in, NumPy out."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np

from pyvista_vdi.device import padded
from pyvista_vdi.device.programs import parameters_of

GROUP = 64


class Output:
    """An argument that a kernel writes: starts as ``values`` and is returned."""

    def __init__(self, values):
        self.values = np.ascontiguousarray(values)


class Caller:
    """Launches the kernels of one folder on one device."""

    def __init__(self, runtime, folder):
        self._runtime = runtime
        self._folder = folder

    #: An argument that starts as an array and is returned.
    out = Output

    @staticmethod
    def empty(*shape, dtype=np.float32):
        """An argument to be written: starts as bytes of 0xA5, so that what is left out shows."""
        values = np.empty(shape, dtype)
        values.view(np.uint8)[...] = 0xA5
        return Output(values)

    def __call__(self, file, kernel, items, *arguments, by_value=(), **defines):
        """What the kernel wrote: its outputs in order, alone where there is one.

        The kernel's first parameter is ``items``. Arrays are uploaded but for those whose place
        is in ``by_value`` (vectors and structures).
        """
        with ExitStack() as stack:
            given, written = [items], []
            for place, argument in enumerate(arguments):
                value = argument
                if isinstance(argument, Output):
                    values = argument.values
                    value = stack.enter_context(self._runtime.buffer(values.shape, values.dtype))
                    self._runtime.write(value, values)
                    written.append(value)
                elif isinstance(argument, np.ndarray) and place not in by_value:
                    value = stack.enter_context(self._runtime.upload(argument))
                given.append(value)
            path = self._folder / file
            named = dict(zip(parameters_of(path, kernel, defines), given, strict=True))
            launch = self._runtime.bind(path, kernel, defines, **named)
            launch(padded(items, GROUP), GROUP)
            results = [self._runtime.download(buffer) for buffer in written]
        return results[0] if len(results) == 1 else results
