"""Programs compiled once per (device, source, options), and kernels that threads may share."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import logging
import os
import re
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.device import sources
from pyvista_vdi.device.constants import KERNEL_CONSTANTS
from pyvista_vdi.device.declarations import Define as Define
from pyvista_vdi.device.declarations import KernelDeclaration, Parameter
from pyvista_vdi.device.devices import opencl
from pyvista_vdi.errors import InvalidArgumentError, KernelBuildError
from pyvista_vdi.model.user_cache import user_cache

LOG_LINES_SHOWN = 30
_LINE_MARK = re.compile(r'#line (\d+) "(.*)"')
#: Seconds from which a driver that keeps programs itself is taken to be compiling.
_SLOW = 2.0

#: Called when a program begins to be compiled, which may take seconds; from any thread.
on_compiling: set[Callable[[], object]] = set()

_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
_NOT_IN_OPTIONS = re.compile(r"[\s\"'\\;]")
#: What several launches with offsets answer otherwise than one launch does.
_PLACE_OF_GROUP = re.compile(r"\bget_(group_id|num_groups|global_size|global_offset)\b")
_logger = logging.getLogger(__name__)
_numbers = itertools.count(1)
# pyopencl makes Python code for each, under names that it takes for free in two threads at a time
_kernel_lock = threading.RLock()


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
        self.parameters: dict[str, Parameter] = {}
        self._free: list[Any] = []  # driver's kernel objects that no launch has
        self.argument_count = int(self.object.num_args)

    def declare(self, declaration: KernelDeclaration, defines: Mapping[str, Define]) -> None:
        """Take the names and types of the arguments from a declaration.

        Raises
        ------
        KernelBuildError
            If the compiled kernel has another number of them.
        """
        if self.parameters:
            return
        parameters = declaration.parameters(defines)
        if len(parameters) != self.argument_count:
            raise KernelBuildError(
                f"kernel {self.name!r} of {self.path} takes {self.argument_count} arguments, and "
                f"{len(parameters)} are declared: {', '.join(parameters)}"
            )
        self.parameters = parameters

    def take(self) -> Any:
        """Return a driver's kernel object that nobody else has; to make one takes its time."""
        try:
            return self._free.pop()
        except IndexError:
            return _kernel_object(self._program, self.name)

    def put_back(self, driver_kernel: Any) -> None:
        """Keep a driver's kernel object for the next launch."""
        self._free.append(driver_kernel)

    @property
    def object(self) -> Any:
        """The driver's kernel object of the calling thread."""
        found = getattr(self._local, "kernel", None)
        if found is None:
            found = self._local.kernel = _kernel_object(self._program, self.name)
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
        self._locks: dict[tuple[str, tuple[str, ...]], threading.Lock] = {}
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
        source = sources.expand(path)
        key = (path, name, options) if isinstance(path, str) else (source, name, options)
        # Different programs are compiled side by side. OpenCL has every function thread safe but
        # the one that sets arguments (1.2, A.2); compilers that are not are locked by their drivers
        with self._locks.setdefault((source, options), threading.Lock()):
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


def _kernel_object(program: Any, name: str) -> Any:
    cl: Any = opencl()
    with _kernel_lock:
        try:
            return cl.Kernel(program, name)
        except sqlite3.Error:  # the file in which it keeps that code cannot be used
            cl._PYOPENCL_NO_CACHE = True
            return cl.Kernel(program, name)


def build(context: Any, device: Any, path: str, source: str, options: tuple[str, ...]) -> Any:
    """Compile a source, or take it from the cache; the compiler's remarks go to the log (DEBUG).

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
    # Not Program.build: that warns of all that compilers say, and to silence warnings would silence
    # those of other threads; and its cache fails where its folder cannot be written
    cl: Any = opencl()
    joined = " ".join(options)
    call = {"options": joined.encode(), "devices": [device]}
    kept_by_driver = import_module("pyopencl.characterize").has_src_build_cache(device)
    place = None if kept_by_driver else _place(device, joined, source)
    binary = _read(place)
    if binary is not None:
        with contextlib.suppress(cl.Error):  # made for another processor of that name
            program = cl._cl._Program(context, [device], [binary])
            program._build(**call)
            return cl.Program(program)

    program = cl._cl._Program(context, source)
    try:
        with _announced(path, _SLOW if kept_by_driver else 0.0):
            program._build(**call)
    except cl.Error as exc:
        log = _placed(_log(program, device) or str(exc), source)
        raise KernelBuildError(
            f"{path} does not compile on {device.platform.name.strip()} / "
            f"{device.name.strip()} with {joined}:\n{_trimmed(log)}",
            log=log,
            options=joined,
            source=source,
        ) from exc
    _logger.debug("%s: %s", path, _log(program, device))
    _write(place, program)
    return cl.Program(program)


@contextlib.contextmanager
def _announced(path: str, delay: float) -> Iterator[None]:
    """Tell that a program is being compiled, if that takes longer than a delay in seconds."""
    timer = threading.Timer(delay, _announce, [path])
    timer.daemon = True
    if delay > 0:
        timer.start()
    else:
        _announce(path)
    try:
        yield
    finally:
        timer.cancel()


def _announce(path: str) -> None:
    number = next(_numbers)
    level = logging.INFO if number == 1 else logging.DEBUG
    _logger.log(level, "compiling kernels, program %d of this process: %s", number, path)
    for tell in tuple(on_compiling):
        tell()


def _place(device: Any, options: str, source: str) -> Path | None:
    """Return the file of a compiled program in the cache; None where there is none."""
    if os.environ.get("PYOPENCL_NO_CACHE", "").lower() in ("1", "true", "yes", "on"):
        return None
    folder = user_cache()
    names = ("vendor", "name", "version")
    driver = [getattr(each, name) for each in (device.platform, device) for name in names]
    key = repr((driver, device.driver_version, options, source))
    return folder and folder / "programs" / hashlib.sha256(key.encode()).hexdigest()


def _read(place: Path | None) -> bytes | None:
    if place is None:
        return None
    try:
        content = place.read_bytes()
    except OSError:
        return None
    return content[32:] if hashlib.sha256(content[32:]).digest() == content[:32] else None


def _write(place: Path | None, program: Any) -> None:
    if place is None:
        return
    (binary,) = program.get_info(opencl().program_info.BINARIES)
    with contextlib.suppress(OSError):  # a full disk, say: it is compiled again
        place.parent.mkdir(exist_ok=True)
        new = place.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
        try:
            new.write_bytes(hashlib.sha256(binary).digest() + binary)
            new.replace(place)  # whole, or not at all
        finally:
            new.unlink(missing_ok=True)


def _log(program: Any, device: Any) -> str:
    return str(program.get_build_info(device, opencl().program_build_info.LOG) or "").strip()


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
