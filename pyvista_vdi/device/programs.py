"""Programs compiled once per (device, source, options), and kernels that threads may share."""

from __future__ import annotations

import contextlib
import logging
import os
import re
import sys
import threading
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from pyvista_vdi.device import sources
from pyvista_vdi.device.constants import KERNEL_CONSTANTS
from pyvista_vdi.device.devices import opencl
from pyvista_vdi.errors import InvalidArgumentError, KernelBuildError

Define = str | int | float | bool | None
LOG_LINES_SHOWN = 30
_LINE_MARK = re.compile(r'#line (\d+) "(.*)"')
#: Age in seconds from which pyopencl's lock on its cache belongs to no living process: it is held
#: while a program's file is read or written, which takes milliseconds.
STALE_LOCK = 20.0

_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
_NOT_IN_OPTIONS = re.compile(r"[\s\"'\\;]")
#: What several launches with offsets answer otherwise than one launch does.
_PLACE_OF_GROUP = re.compile(r"\bget_(group_id|num_groups|global_size|global_offset)\b")
_logger = logging.getLogger(__name__)

# One build at a time in the process: warning filters are global, and not every driver's compiler
# is thread safe.
_build_lock = threading.RLock()


def define_options(defines: Mapping[str, Define]) -> tuple[str, ...]:
    """``-D`` options in sorted order.

    Parameters
    ----------
    defines : mapping of str to str, int, float, bool or None
        Floats become exact single-precision literals, booleans 0 or 1, None a name alone.

    Returns
    -------
    tuple of str
        One option each.

    Raises
    ------
    InvalidArgumentError
        If a name is no identifier, or a value holds what drivers split options at.
    """
    options = []
    for name in sorted(defines):
        value = defines[name]
        if not _IDENTIFIER.fullmatch(name):
            raise InvalidArgumentError(f"{name!r} is no name for a -D option")
        if value is None:
            options.append(f"-D{name}")
            continue
        if isinstance(value, (bool, np.bool_)):
            text = str(int(value))
        elif isinstance(value, (float, np.floating)):
            text = f"({float(np.float32(value)).hex()}f)"
        elif isinstance(value, (int, np.integer)):
            text = str(value) if value >= 0 else f"({value})"
        else:
            text = str(value)
        if not text or _NOT_IN_OPTIONS.search(text):
            raise InvalidArgumentError(
                f"-D{name}={text!r}: a value must be non-empty and free of spaces, quotes, "
                "backslashes and semicolons (drivers split options there)"
            )
        options.append(f"-D{name}={text}")
    return tuple(options)


class Kernel:
    """A kernel function of a compiled program; threads may share it.

    OpenCL kernel objects carry their arguments and are not thread safe, so each thread gets an
    object of its own when it first launches.

    Attributes
    ----------
    name : str
        The function.
    path : str
        The file that it comes from.
    divisible : bool
        Whether several launches with offsets do what one launch does: nothing in the program asks
        where in the whole its work-group is.
    """

    def __init__(self, program: Any, path: str, name: str, source: str) -> None:
        self.name = name
        self.path = path
        self.divisible = _PLACE_OF_GROUP.search(source) is None
        self._program = program
        self._local = threading.local()
        self.argument_count = int(self.object.num_args)

    @property
    def object(self) -> Any:
        """The driver's kernel object of the calling thread."""
        found = getattr(self._local, "kernel", None)
        if found is None:
            found = self._local.kernel = opencl().Kernel(self._program, self.name)
        return found

    @property
    def arguments_set(self) -> dict[int, Any]:
        """By index, what the calling thread's kernel object was given last, for who gives it."""
        found: dict[int, Any] | None = getattr(self._local, "arguments", None)
        if found is None:
            found = self._local.arguments = {}
        return found

    def __repr__(self) -> str:
        return f"<Kernel {self.name!r} of {self.path}>"


class ProgramCache:
    """Programs of one device.

    Parameters
    ----------
    context : pyopencl.Context
        With one device.
    device : pyopencl.Device
        That device.
    """

    def __init__(self, context: Any, device: Any) -> None:
        self._context = context
        self._device = device
        self._kernels: dict[tuple[Any, ...], Kernel] = {}
        self._programs: dict[tuple[str, tuple[str, ...]], Any] = {}
        self._base_options = (
            "-cl-std=CL1.2",
            *_rounding_options(device),
            *define_options(KERNEL_CONSTANTS),
        )

    def known(self, path: str | Path, name: str, defines: Mapping[str, Define]) -> Kernel | None:
        """A kernel of the package's files that was compiled before; parameters as for kernel."""
        if not isinstance(path, str):
            return None
        return self._kernels.get((path, name, self._options(defines)))

    def kernel(self, path: str | Path, name: str, defines: Mapping[str, Define]) -> Kernel:
        """The kernel, compiled when first asked for.

        Parameters
        ----------
        path : str or pathlib.Path
            As for :func:`pyvista_vdi.device.sources.expand`.
        name : str
            The function.
        defines : mapping
            As for :func:`define_options`.

        Returns
        -------
        Kernel
            The same object for the same arguments.

        Raises
        ------
        KernelBuildError
            If the source cannot be assembled or compiled, or has no such function.
        """
        kernel = self.known(path, name, defines)
        if kernel is not None:
            return kernel
        options = self._options(defines)
        with _build_lock:
            source = sources.expand(path)
            key = (path, name, options) if isinstance(path, str) else (source, name, options)
            kernel = self._kernels.get(key)
            if kernel is None:
                program = self._program(str(path), source, options)
                kernel = self._find(program, str(path), name, source, options)
                self._kernels[key] = kernel
            return kernel

    def _options(self, defines: Mapping[str, Define]) -> tuple[str, ...]:
        return (*self._base_options, *define_options(defines))

    def _program(self, path: str, source: str, options: tuple[str, ...]) -> Any:
        key = (source, options)
        program = self._programs.get(key)
        if program is None:
            program = build(self._context, self._device, path, source, options)
            self._programs[key] = program
        return program

    def _find(
        self, program: Any, path: str, name: str, source: str, options: tuple[str, ...]
    ) -> Kernel:
        try:
            return Kernel(program, path, name, source)
        except opencl().Error as exc:
            names = program.kernel_names.replace(";", ", ") or "none"
            raise KernelBuildError(
                f"{path} has no kernel {name!r}; with these options it has: {names}",
                options=" ".join(options),
            ) from exc


def _rounding_options(device: Any) -> tuple[str, ...]:
    correctly_rounded = opencl().device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
    if device.single_fp_config & correctly_rounded:
        return ("-cl-fp32-correctly-rounded-divide-sqrt",)
    return ()


def build(context: Any, device: Any, path: str, source: str, options: tuple[str, ...]) -> Any:
    """Compile a source, quietly; the compiler's remarks go to the log at level DEBUG.

    Parameters
    ----------
    context, device : pyopencl objects
        Where to build.
    path : str
        Name of the source for messages.
    source : str
        Expanded text.
    options : tuple of str
        Build options.

    Returns
    -------
    pyopencl.Program
        Built.

    Raises
    ------
    KernelBuildError
        With the compiler's log, the options and the source.
    """
    cl = opencl()
    # pyopencl asks for this without a default where its cache fails; empty, it compiles instead
    os.environ.setdefault("PYOPENCL_CACHE_FAILURE_FATAL", "")
    with _build_lock, warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        cache = cache_folder()
        _remove_stale_lock(cache / "lock")
        try:
            program = cl.Program(context, source).build(list(options), cache_dir=str(cache))
        except cl.Error as exc:
            log = _placed(_compiler_log(str(exc)), source)
            raise KernelBuildError(
                f"{path} does not compile on {device.platform.name.strip()} / "
                f"{device.name.strip()} with {' '.join(options)}:\n{_trimmed(log)}",
                log=log,
                options=" ".join(options),
                source=source,
            ) from exc
    for remark in remarks:
        _logger.debug("%s: %s", path, remark.message)
    return program


def cache_folder() -> Path:
    """Return where compiled programs are kept, by the system's convention for such folders."""
    versions = f"pyopencl{opencl().VERSION_TEXT}-py{'.'.join(map(str, sys.version_info[:3]))}"
    return Path(platformdirs.user_cache_dir("pyvista-vdi", appauthor=False)) / versions


def _remove_stale_lock(lock: Path) -> None:
    """Remove the lock of a process that was killed: everybody else would wait a minute for it."""
    with contextlib.suppress(OSError):
        if time.time() - lock.stat().st_mtime > STALE_LOCK:
            lock.unlink()


def _compiler_log(message: str) -> str:
    """The log inside pyopencl's message, and its copy of the source removed from the disk."""
    saved = re.search(r"\n\(source saved as (.+)\)\s*$", message)
    if saved:
        Path(saved[1]).unlink(missing_ok=True)  # the error carries the source
        message = message[: saved.start()]
    message = re.sub(r"\A.*?Build on [^\n]*:\n", "", message, count=1, flags=re.DOTALL)
    return re.sub(r"\n\(options: .*\)\s*$", "", message)


def _placed(log: str, source: str) -> str:
    """Name file and line where a compiler counts the lines of the whole source, as NVIDIA's."""
    places, name, number = [""], "", 0
    for line in source.splitlines():
        mark = _LINE_MARK.match(line)
        name, number = (mark[2], int(mark[1]) - 1) if mark else (name, number + 1)
        places.append(f"{name}:{number}")

    def place(found: re.Match[str]) -> str:
        return places[int(found[1])] if int(found[1]) < len(places) else found[0]

    return re.sub(r"<kernel>:(\d+)", place, log)


def _trimmed(log: str) -> str:
    lines = [line for line in log.splitlines() if line.strip()]
    if len(lines) <= LOG_LINES_SHOWN:
        return "\n".join(lines)
    left_out = len(lines) - LOG_LINES_SHOWN
    return "\n".join([*lines[:LOG_LINES_SHOWN], f"... {left_out} more lines in the error's .log"])
