"""One device, ready for work: its queues, memory and programs in one object."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pyvista_vdi.device.declarations import Define, KernelDeclaration
from pyvista_vdi.device.devices import Candidate
from pyvista_vdi.device.launches import Launch
from pyvista_vdi.device.programs import Kernel, ProgramCache
from pyvista_vdi.device.transfers import Transfers


class Runtime(Transfers):
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

        Parameters are those of a :class:`KernelDeclaration` and of :meth:`bind`.

        Raises
        ------
        KernelBuildError
            If it cannot be assembled or compiled; carries log, options and source.
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
