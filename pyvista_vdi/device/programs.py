"""Kernels as Python knows them, their text with its includes, and programs compiled once.

A declaration has a kernel's arguments by name and type. Files of the package are expanded once per
program, with ``#line`` marks, and compiled once per device, source and options; threads may share
kernels.
"""

import contextlib
import hashlib
import itertools
import logging
import operator
import os
import re
import sqlite3
import threading
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from importlib import import_module
from importlib.resources import files
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.constants import definitions, literal
from pyvista_vdi.device.devices import opencl
from pyvista_vdi.errors import InvalidArgumentError, KernelBuildError
from pyvista_vdi.model.user_cache import user_cache

Define = str | int | float | bool | None

#: A pointer to a null handle; pyopencl 2024 refuses None itself.
_NULL = np.uintp(0)
#: OpenCL's types of a number, as NumPy has them.
SCALARS: dict[str, np.dtype[Any]] = {
    name: np.dtype(kind)
    for name, kind in zip(
        ["char", "uchar", "short", "ushort", "int", "uint", "long", "ulong", "float", "double"],
        ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"],
        strict=True,
    )
}


class Struct:
    """A structure of numbers and vectors, passed to kernels by value and laid out as in OpenCL C.

    ``fields`` are types by name, in order: ``width="int"``, ``origin="float4"``.
    """

    def __init__(self, name: str, /, **fields: str) -> None:
        self.name, self.fields = name, fields
        kinds: list[Any] = [_kind(kind, {}) for kind in fields.values()]
        assert None not in kinds, f"{name} has a field of no type of a number in OpenCL"
        # Each is aligned to its size
        offsets = [0]
        for kind, after in itertools.pairwise(kinds):
            end = offsets[-1] + kind.itemsize
            offsets.append(-(-end // after.itemsize) * after.itemsize)
        largest, end = max(kind.itemsize for kind in kinds), offsets[-1] + kinds[-1].itemsize
        layout: Any = {"names": list(fields), "formats": kinds, "offsets": offsets}
        layout["itemsize"] = -(-end // largest) * largest
        self.dtype = np.dtype(layout)

    def __call__(self, **values: Any) -> NDArray[np.void]:
        """Return a value of it, with every field given by name."""
        if values.keys() != self.fields.keys():
            wrong = sorted(values.keys() ^ self.fields.keys())
            raise InvalidArgumentError(
                f"fields of {self.name} that are missing or unknown: {wrong}"
            )
        return np.array(tuple(map(values.__getitem__, self.fields)), self.dtype)


class Parameter:
    """An argument of a compiled kernel: its place, and its type in OpenCL C and in NumPy.

    ``dtype`` is that of what a pointer points to, None where it is not known: of a type that the
    kernel's file defines.
    """

    def __init__(self, index: int, kind: str, dtype: np.dtype[Any] | None) -> None:
        self.index, self.kind, self.dtype = index, kind, dtype

    def holds(self, dtype: np.dtype[Any]) -> bool:
        """Return whether a buffer may be given: of its numbers, or of parts of them.

        Two floats for a ulong, say.
        """
        if self.kind.startswith("local ") or not self.kind.endswith("*"):
            return False
        own = self.dtype and self.dtype.base
        return own is None or own == dtype or own.itemsize % (2 * dtype.itemsize) == 0

    def given(self, cl: Any, value: Any) -> Any:
        """Return a number, a vector, a structure or local memory as the driver takes it.

        None is a null pointer. TypeError, or what NumPy raises, for what is not of its type.
        """
        dtype = self.dtype
        if self.kind.startswith("local ") and dtype is not None:
            return cl.LocalMemory(operator.index(value) * dtype.itemsize)
        if self.kind.endswith("*") and value is None:
            return _NULL
        if dtype is None or dtype.names is not None:
            if value.dtype != dtype:
                raise TypeError
            return value
        if value is None or self.kind.endswith("*"):
            raise TypeError
        converted = np.array(value, dtype.base) if dtype.shape else dtype.type(value)
        if converted.shape != dtype.shape or (
            dtype.base.kind != "f" and np.any(converted != value)
        ):
            raise TypeError
        return converted


class KernelDeclaration:
    """A kernel function, with the types of its arguments by name and in order.

    ``path`` is a file of ``pyvista_vdi.opencl``, any other one as a Path. The file says what the
    arguments are, but for the ``structures`` among them, which are known by their names; or they
    are given: a number (``"int"``), a vector (``"float4"``), a pointer to a buffer (``"float4*"``),
    to memory of each work-group (``"local ulong*"``), or a structure. A type may be named by a
    ``-D`` option (``"VOXEL_T*"``).
    """

    def __init__(
        self, path: str | Path, name: str, /, *structures: Struct, **arguments: str | Struct
    ) -> None:
        self.path, self.name = path, name
        self._structures, self._given = {each.name: each for each in structures}, arguments

    def __repr__(self) -> str:
        return f"<KernelDeclaration {self.name!r} of {self.path}>"

    @cached_property
    def arguments(self) -> Mapping[str, str | Struct]:
        """Their types by name, in order."""
        return self._given or {
            name: self._structures.get(kind, kind)
            for name, kind in written_arguments(expand(self.path), self.name).items()
        }

    def parameters(self, defines: Mapping[str, Define]) -> dict[str, Parameter]:
        """Return the arguments in a program with these ``-D`` options, by name and in order."""
        found: dict[str, Parameter] = {}
        for name, declared in self.arguments.items():
            if isinstance(declared, Struct):
                found[name] = Parameter(len(found), declared.name, declared.dtype)
                continue
            element = declared.removeprefix("local ").removesuffix("*")
            found[name] = Parameter(len(found), declared, _kind(element, defines))
        return found


_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_PARAMETERS = re.compile(r"#define (\w+_PARAMETERS)((?:[^\n]*\\\n)*[^\n]*)")


def written_arguments(source: str, name: str) -> dict[str, str]:
    """Return a kernel's arguments as OpenCL C has them: types by name, ``"local ulong*"``, say.

    What is the same in several kernels is a macro whose name ends in ``_PARAMETERS``.
    """
    text = _COMMENT.sub("", source)
    found = re.search(rf"(?:__kernel|KERNEL_OF_LANES)\s+void\s+{name}\s*\(([^)]*)\)", text)
    if found is None:
        return {}  # the compiler will say so
    written = found[1]
    for macro, expanded in _PARAMETERS.findall(text):
        written = re.sub(rf"\b{macro}\b", lambda _, to=expanded: to.replace("\\", " "), written)
    arguments = {}
    for each in written.replace("*", " * ").split(","):
        words = each.split()
        kind = next(word for word in words if word not in _QUALIFIERS)
        arguments[words[-1]] = "local " * ("__local" in words) + kind + "*" * ("*" in words)
    return arguments


_QUALIFIERS = {"__global", "__local", "__constant", "const", "volatile", "restrict"}


def _kind(kind: str, defines: Mapping[str, Define]) -> np.dtype[Any] | None:
    """Return a number's or a vector's type as NumPy has it, None if it is not known."""
    kind = str(defines.get(kind, kind))
    name = kind.rstrip("0123456789")
    number, count = SCALARS.get(name), int(kind[len(name) :] or 1)
    return number if number is None or count == 1 else np.dtype((number, (count,)))


_INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([^">]+)[">]')
_CONDITIONAL = re.compile(r"^\s*#\s*(if|endif)")


def read_resource(path: str) -> str:
    """Return the text of a file of the package ``pyvista_vdi.opencl``: ``"lib/rays.cl"``, say.

    FileNotFoundError if there is no such file, or the path leaves the package.
    """
    place = PurePosixPath(path)
    resource = files("pyvista_vdi.opencl").joinpath(*place.parts)
    if place.is_absolute() or ".." in place.parts or not resource.is_file():
        raise FileNotFoundError(path)
    return resource.read_text(encoding="utf-8")


def expand(path: str | Path) -> str:
    """Return a kernel file's text with its includes, and the constants that it may use, in place.

    Each file is expanded where it is first included and left out afterwards, so files need no
    include guards. An include inside ``#if`` is refused, as a missing file is (KernelBuildError):
    it would depend on the first place. A string is a path inside ``pyvista_vdi.opencl``; a Path is
    any file on disk (tests and users' own kernels), whose includes are taken from there.
    """
    if isinstance(path, str):
        return _expand_resource(path)
    try:
        return _expand_text(path.name, path.read_text(encoding="utf-8"))
    except OSError as exc:
        raise KernelBuildError(f"the kernel file {str(path)!r} cannot be read: {exc}") from exc


@cache
def _expand_resource(path: str) -> str:
    try:
        return _expand_text(path, read_resource(path))
    except FileNotFoundError as exc:
        raise KernelBuildError(f"no kernel file {path!r} in pyvista_vdi.opencl") from exc


def _expand_text(name: str, text: str) -> str:
    lines: list[str] = []
    seen = {name}

    def append(name: str, text: str) -> None:
        lines.append(f'#line 1 "{name}"')
        depth = 0
        for number, line in enumerate(text.splitlines(), start=1):
            if conditional := _CONDITIONAL.match(line):
                depth += 1 if conditional[1] == "if" else -1
            found = _INCLUDE.match(line)
            if found is None:
                lines.append(line)
                continue
            # Replace the directive by the file's text, or by nothing where it stands already
            target, why = str(PurePosixPath(found[1])), ""
            if depth > 0:
                why = "stands inside #if; files are included once, so move it out of it"
            elif target not in seen:
                seen.add(target)
                try:
                    append(target, read_resource(target))
                except FileNotFoundError:
                    why = "no such file in pyvista_vdi.opencl, to which paths are relative"
            if why:
                raise KernelBuildError(f'{name}:{number}: #include "{target}": {why}')
            lines.append(f'#line {number + 1} "{name}"')

    append(name, text)
    constants = definitions({file.partition("/")[0] for file in seen})
    return "\n".join([*constants, *lines]) + "\n"


LOG_LINES_SHOWN = 30
#: Seconds from which a driver that keeps programs itself is taken to be compiling.
_SLOW = 2.0

#: Called when a program begins to be compiled, which may take seconds; from any thread.
on_compiling: set[Callable[[], object]] = set()

_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
_NOT_IN_OPTIONS = re.compile(r"[\s\"'\\;]")
_logger = logging.getLogger(__name__)
_program_numbers = itertools.count(1)
_kernel_lock = threading.RLock()


def define_options(defines: Mapping[str, Define]) -> tuple[str, ...]:
    """Return ``-D`` options in sorted order; None is a name alone."""
    options = []
    for name, value in sorted(defines.items()):
        text = "1" if value is None else literal(value)
        if not _IDENTIFIER.fullmatch(name) or not text or _NOT_IN_OPTIONS.search(text):
            raise InvalidArgumentError(
                f"-D{name}={text!r}: the name must be an identifier, and the value non-empty and "
                "free of spaces, quotes, backslashes and semicolons (drivers split options there)"
            )
        options.append(f"-D{name}" if value is None else f"-D{name}={text}")
    return tuple(options)


class Kernel:
    """A kernel function of a compiled program; threads may share it.

    OpenCL's kernel objects carry their arguments and are not thread safe, so each launch has one of
    its own while it is there: ``free`` are those that no launch has. ``parameters`` are its
    arguments, by name and in order; empty until they are declared.
    """

    def __init__(self, program: Any, path: str, name: str) -> None:
        self.path, self.name, self._program = path, name, program
        self.parameters: dict[str, Parameter] = {}
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
    """Programs of one device, with a context that has it alone, and their kernels."""

    def __init__(self, context: Any, device: Any) -> None:
        self._context, self._device = context, device
        self._kernels: dict[tuple[Any, ...], Kernel] = {}
        self._programs: dict[tuple[Any, ...], Any] = {}
        self._locks: dict[tuple[Any, ...], threading.Lock] = {}
        self._options = ["-cl-std=CL1.2"]
        if device.single_fp_config & opencl().device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT:
            self._options.append("-cl-fp32-correctly-rounded-divide-sqrt")

    def kernel(
        self,
        path: str | Path,
        name: str,
        defines: Mapping[str, Define],
        aside: Callable[[], contextlib.AbstractContextManager[None]],
    ) -> Kernel:
        """Return a kernel, compiled when first asked for, and the same for the same source.

        What is compiled is so inside ``aside()``. KernelBuildError if it cannot be assembled or
        compiled, or has no such function.
        """
        options, source = (*self._options, *define_options(defines)), expand(path)
        program, key = (source, options), (source, name, options)
        if key in self._kernels:
            return self._kernels[key]
        # Different programs are compiled side by side. OpenCL has every function thread safe but
        # the one that sets arguments (1.2, A.2); compilers that are not are locked by their drivers
        with aside(), self._locks.setdefault(program, threading.Lock()):
            if program not in self._programs:
                of = self._context, self._device, str(path)
                self._programs[program] = build(*of, source, options)
            if key not in self._kernels:
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

    KernelBuildError has the compiler's log, the options and the source.
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
    announcing = threading.Timer(_SLOW, _announce, [path])
    announcing.daemon = True
    if kept_by_driver:
        announcing.start()
    else:
        _announce(path)
    try:
        program._build(**call)
    except cl.Error as exc:
        log = _log(program, device) or str(exc)
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
    finally:
        announcing.cancel()
    _logger.debug("%s: %s", path, _log(program, device))
    _write(place, program)
    return cl.Program(program)


def _announce(path: str) -> None:
    """Tell that a program is being compiled."""
    level = logging.INFO if next(_program_numbers) == 1 else logging.DEBUG
    _logger.log(level, "compiling kernels: %s", path)
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
