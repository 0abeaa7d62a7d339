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

from pyvista_vdi.device import sources
from pyvista_vdi.device.constants import literal
from pyvista_vdi.device.declarations import Define as Define
from pyvista_vdi.device.declarations import KernelDeclaration, Parameter
from pyvista_vdi.device.devices import opencl
from pyvista_vdi.errors import InvalidArgumentError, KernelBuildError
from pyvista_vdi.model.user_cache import user_cache

LOG_LINES_SHOWN = 30
#: Seconds from which a driver that keeps programs itself is taken to be compiling.
_SLOW = 2.0

#: Called when a program begins to be compiled, which may take seconds; from any thread.
on_compiling: set[Callable[[], object]] = set()

_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
_NOT_IN_OPTIONS = re.compile(r"[\s\"'\\;]")
_logger = logging.getLogger(__name__)
_numbers = itertools.count(1)
_kernel_lock = threading.RLock()


def define_options(defines: Mapping[str, Define]) -> tuple[str, ...]:
    """Return ``-D`` options in sorted order; None is a name alone.

    Raises
    ------
    InvalidArgumentError
        If a name is no identifier, or a value holds what drivers split options at.
    """
    options = []
    for name, value in sorted(defines.items()):
        if not _IDENTIFIER.fullmatch(name):
            raise InvalidArgumentError(f"{name!r} is no name for a -D option")
        text = "1" if value is None else literal(value)
        if not text or _NOT_IN_OPTIONS.search(text):
            raise InvalidArgumentError(
                f"-D{name}={text!r}: a value must be non-empty and free of spaces, quotes, "
                "backslashes and semicolons (drivers split options there)"
            )
        options.append(f"-D{name}" if value is None else f"-D{name}={text}")
    return tuple(options)


class Kernel:
    """A kernel function of a compiled program; threads may share it.

    OpenCL's kernel objects carry their arguments and are not thread safe, so each launch has one of
    its own while it is there.

    Attributes
    ----------
    path, name : str
        The file that it comes from, and the function.
    argument_count : int
        How many arguments it takes.
    parameters : dict of str to Parameter
        These, by name and in order; empty until they are declared.
    free : list of pyopencl.Kernel
        The driver's objects that no launch has.
    """

    def __init__(self, program: Any, path: str, name: str) -> None:
        self.path, self.name = path, name
        self.parameters: dict[str, Parameter] = {}
        self._program = program
        self.free = [self.new_object()]
        self.argument_count = int(self.free[0].num_args)

    def new_object(self) -> Any:
        """Return a driver's object of it, which takes its time to be made."""
        cl: Any = opencl()
        # pyopencl makes Python code for each, under names that it takes for free in two threads
        with _kernel_lock:
            try:
                return cl.Kernel(self._program, self.name)
            except sqlite3.Error:  # the file in which it keeps that code cannot be used
                cl._PYOPENCL_NO_CACHE = True
                return cl.Kernel(self._program, self.name)

    def declare(self, declaration: KernelDeclaration, defines: Mapping[str, Define]) -> None:
        """Take its arguments from a declaration; KernelBuildError if their number is another."""
        parameters = declaration.parameters(defines)
        if len(parameters) != self.argument_count:
            raise KernelBuildError(
                f"kernel {self.name!r} of {self.path} takes {self.argument_count} arguments, and "
                f"{len(parameters)} are declared: {', '.join(parameters)}"
            )
        self.parameters = parameters

    def __repr__(self) -> str:
        return f"<Kernel {self.name!r} of {self.path}>"


class ProgramCache:
    """Programs of one device, with a context that has it alone.

    Attributes
    ----------
    known : dict
        Kernels of the package's files by path, name and ``-D`` options with their types.
    """

    def __init__(self, context: Any, device: Any) -> None:
        self._context = context
        self._device = device
        self.known: dict[tuple[Any, ...], Kernel] = {}
        self._kernels: dict[tuple[Any, ...], Kernel] = {}
        self._programs: dict[tuple[str, tuple[str, ...]], Any] = {}
        self._locks: dict[tuple[str, tuple[str, ...]], threading.Lock] = {}
        self._options = ["-cl-std=CL1.2"]
        if device.single_fp_config & opencl().device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT:
            self._options.append("-cl-fp32-correctly-rounded-divide-sqrt")

    def kernel(self, path: str | Path, name: str, defines: Mapping[str, Define]) -> Kernel:
        """Return a kernel, compiled when first asked for, and the same for the same source.

        Raises
        ------
        KernelBuildError
            If the source cannot be assembled or compiled, or has no such function.
        """
        options = (*self._options, *define_options(defines))
        source = sources.expand(path)
        program, key = (source, options), (source, name, options)
        # Different programs are compiled side by side. OpenCL has every function thread safe but
        # the one that sets arguments (1.2, A.2); compilers that are not are locked by their drivers
        with self._locks.setdefault(program, threading.Lock()):
            if key not in self._kernels:
                if program not in self._programs:
                    self._programs[program] = build(
                        self._context, self._device, str(path), source, options
                    )
                try:
                    self._kernels[key] = Kernel(self._programs[program], str(path), name)
                except opencl().Error as exc:
                    names = self._programs[program].kernel_names.replace(";", ", ") or "none"
                    raise KernelBuildError(
                        f"{path} has no kernel {name!r}; with these options it has: {names}",
                        options=" ".join(options),
                    ) from exc
            return self._kernels[key]


def build(context: Any, device: Any, path: str, source: str, options: tuple[str, ...]) -> Any:
    """Compile a source, or take it from the cache; the compiler's remarks go to the log (DEBUG).

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
        lines = [line for line in log.splitlines() if line.strip()]
        if len(lines) > LOG_LINES_SHOWN:
            left_out = len(lines) - LOG_LINES_SHOWN
            lines[LOG_LINES_SHOWN:] = [f"... {left_out} more lines in the error's .log"]
        raise KernelBuildError(
            f"{path} does not compile on {device.platform.name.strip()} / "
            f"{device.name.strip()} with {joined}:\n" + "\n".join(lines),
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

    def announce() -> None:
        number = next(_numbers)
        level = logging.INFO if number == 1 else logging.DEBUG
        _logger.log(level, "compiling kernels, program %d of this process: %s", number, path)
        for tell in tuple(on_compiling):
            tell()

    timer = threading.Timer(delay, announce)
    timer.daemon = True
    if delay > 0:
        timer.start()
    else:
        announce()
    try:
        yield
    finally:
        timer.cancel()


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
    """Return a program that was kept, unless it is damaged."""
    try:
        content = place.read_bytes() if place else b""
    except OSError:
        return None
    return content[32:] if hashlib.sha256(content[32:]).digest() == content[:32] else None


def _write(place: Path | None, program: Any) -> None:
    """Keep a compiled program."""
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
        if line.startswith("#line "):
            _, first, name = line.split(" ", 2)
            name, number = name.strip('"'), int(first) - 1
        else:
            number += 1
        places.append(f"{name}:{number}")

    def place(found: re.Match[str]) -> str:
        return places[int(found[1])] if int(found[1]) < len(places) else found[0]

    return re.sub(r"<kernel>:(\d+)", place, log)
