"""Kernels as Python knows them, their text with its includes, and programs compiled once.

A kernel's file says what its arguments are. Files of the package are expanded once per program,
with ``#line`` marks, and compiled once per device, source and options; threads may share kernels.
"""

import contextlib
import hashlib
import logging
import operator
import os
import re
import threading
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pyvista_vdi.device.constants import definitions
from pyvista_vdi.device.devices import opencl
from pyvista_vdi.errors import KernelBuildError
from pyvista_vdi.model.user_cache import user_cache

Define = str | int | float | bool

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


_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_STRUCTURE = re.compile(r"typedef struct\s*\{([^}]*)\}\s*(\w+);")
_PARAMETERS = re.compile(r"#define (\w+_PARAMETERS)((?:[^\n]*\\\n)*[^\n]*)")
_INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([^">]+)[">]')
_QUALIFIERS = {"__global", "__local", "__constant", "const", "volatile", "restrict"}

_logger = logging.getLogger(__name__)
_kernel_lock = threading.RLock()


class Parameter(NamedTuple):
    """An argument of a compiled kernel: its place, and its type in OpenCL C and in NumPy.

    ``dtype`` is that of what a pointer points to, None where it is not known: of a type that the
    kernel's file defines.
    """

    place: int
    kind: str
    dtype: np.dtype[Any] | None

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

        A structure is given as its fields by name; None is a null pointer. TypeError, or what NumPy
        raises, for what is not of its type.
        """
        dtype = self.dtype
        pointer, local = self.kind.endswith("*"), self.kind.startswith("local ")
        if pointer and not local and value is None:
            return _NULL
        if value is None or dtype is None or pointer != local:
            raise TypeError
        if local:
            return cl.LocalMemory(operator.index(value) * dtype.itemsize)
        if dtype.names is not None:
            if value.keys() != set(dtype.names):
                raise TypeError(f"fields missing or unknown: {value.keys() ^ set(dtype.names)}")
            return np.array(tuple(map(value.__getitem__, dtype.names)), dtype)
        converted = np.array(value, dtype.base)
        whole = dtype.base.kind != "f"
        if converted.shape != dtype.shape or (whole and np.any(converted != value)):
            raise TypeError
        return converted


def parameters_of(
    path: str | Path, name: str, defines: Mapping[str, Define]
) -> dict[str, Parameter]:
    """Return a kernel's arguments in a program with these ``-D`` options, by name, in order."""
    source = _COMMENT.sub("", expand(path))
    known: dict[str, np.dtype[Any]] = dict(SCALARS)
    for body, structure in _STRUCTURE.findall(source):
        fields: dict[str, np.dtype[Any] | None] = {}
        for each in body.split(";")[:-1]:
            kind, *names = each.replace(",", " ").split()
            inner = known.get(kind)
            if inner is not None and inner.names:  # whose fields are the structure's own
                fields |= {each: inner[each] for each in inner.names}
            else:
                fields |= {each: _dtype(kind, known) for each in names}
        if any(kind is None for kind in fields.values()):
            continue
        # Laid out as in OpenCL C: each field aligned to its size
        offsets, end, sizes = [], 0, [kind.itemsize for kind in fields.values() if kind]
        for size in sizes:
            offsets.append(-(-end // size) * size)
            end = offsets[-1] + size
        layout: Any = {"names": list(fields), "formats": list(fields.values())}
        layout |= {"offsets": offsets, "itemsize": -(-end // max(sizes)) * max(sizes)}
        known[structure] = np.dtype(layout)
    # Read the arguments; what is the same in several kernels is a macro
    written = re.search(rf"(?:__kernel|KERNEL_OF_LANES)\s+void\s+{name}\s*\(([^)]*)\)", source)
    if written is None:
        return {}  # the compiler will say so
    text = written[1]
    for macro, expanded in _PARAMETERS.findall(source):
        text = re.sub(rf"\b{macro}\b", lambda _, to=expanded: to.replace("\\", " "), text)
    found: dict[str, Parameter] = {}
    for each in text.replace("*", " * ").split(","):
        words = each.split()
        element = next(word for word in words if word not in _QUALIFIERS)
        declared = "local " * ("__local" in words) + element + "*" * ("*" in words)
        dtype = _dtype(str(defines.get(element, element)), known)
        found[words[-1]] = Parameter(len(found), declared, dtype)
    return found


def _dtype(kind: str, known: Mapping[str, np.dtype[Any]]) -> np.dtype[Any] | None:
    """Return a number's, a vector's or a structure's type, None if it is not known."""
    name = kind.rstrip("0123456789")
    number, count = known.get(name), int(kind[len(name) :] or 1)
    return number if number is None or count == 1 else np.dtype((number, (count,)))


def read_resource(path: str) -> str:
    """Return the text of a file of the package ``pyvista_vdi.opencl``: ``"lib/rays.cl"``, say."""
    return files("pyvista_vdi.opencl").joinpath(path).read_text(encoding="utf-8")


def expand(path: str | Path) -> str:
    """Return a kernel file's text with its includes, and the constants that it may use, in place.

    Each file is expanded where it is first included, outside ``#if``, and left out afterwards, so
    files need no include guards. A string is a path inside ``pyvista_vdi.opencl``; a Path is any
    file on disk (tests and users' own kernels), whose includes are taken from there.
    """
    if isinstance(path, str):
        return _with_includes(path)
    return _with_includes(path.name, path.read_text(encoding="utf-8"))


@cache
def _with_includes(name: str, text: str | None = None) -> str:
    lines: list[str] = []
    seen = {name}

    def append(name: str, text: str) -> None:
        lines.append(f'#line 1 "{name}"')
        for number, line in enumerate(text.splitlines(), start=1):
            found = _INCLUDE.match(line)
            if found is None:
                lines.append(line)
                continue
            # Replace the directive by the file's text, or by nothing where it stands already
            if found[1] not in seen:
                seen.add(found[1])
                append(found[1], read_resource(found[1]))
            lines.append(f'#line {number + 1} "{name}"')

    append(name, read_resource(name) if text is None else text)
    return "\n".join([*definitions(), *lines]) + "\n"


class Kernel:
    """A kernel function of a compiled program; threads may share it.

    OpenCL's kernel objects carry their arguments and are not thread safe, so each launch has one of
    its own while it is there: ``free`` are those that no launch has. ``parameters`` are its
    arguments, by name and in order.
    """

    def __init__(
        self, program: Any, path: str | Path, name: str, defines: Mapping[str, Define]
    ) -> None:
        self.path, self.name = str(path), name
        self._program, self.parameters = program, parameters_of(path, name, defines)
        self.free = [self.new_object()]

    def new_object(self) -> Any:
        """Return a driver's object of it, which takes its time to be made."""
        cl: Any = opencl()
        # pyopencl makes Python code for each, under names that it takes for free in two threads
        with _kernel_lock:
            return cl.Kernel(self._program, self.name)


def build(context: Any, device: Any, path: str, source: str, options: tuple[str, ...]) -> Any:
    """Compile a source, or take it from the cache; the compiler's remarks go to the log (DEBUG).

    KernelBuildError has the compiler's log, the options and the source.
    """
    # Not Program.build: that warns of all that compilers say, and to silence warnings would silence
    # those of other threads; and its cache fails where its folder cannot be written
    cl: Any = opencl()
    joined = " ".join(options)
    call = {"options": joined.encode(), "devices": [device]}
    # Find its file in the cache, unless the driver has one
    place, folder = None, user_cache()
    kept = import_module("pyopencl.characterize").has_src_build_cache(device)
    if folder is not None and not kept and os.environ.get("PYOPENCL_NO_CACHE") != "1":
        names = ("vendor", "name", "version")
        driver = [getattr(each, name) for each in (device.platform, device) for name in names]
        key = repr((driver, device.driver_version, joined, source))
        place = folder / "programs" / hashlib.sha256(key.encode()).hexdigest()
    with contextlib.suppress(cl.Error, OSError):  # made for another processor of that name
        if place is not None and place.exists():
            program = cl._cl._Program(context, [device], [place.read_bytes()])
            program._build(**call)
            return cl.Program(program)

    program = cl._cl._Program(context, source)
    _logger.debug("compiling kernels: %s", path)
    try:
        program._build(**call)
    except cl.Error as exc:
        log = _log(program, device) or str(exc)
        raise KernelBuildError(
            f"{path} does not compile on {device.platform.name.strip()} / "
            f"{device.name.strip()} with {joined}:\n{log}",
            log=log,
            options=joined,
            source=source,
        ) from exc
    _logger.debug("%s: %s", path, _log(program, device))
    if place is not None:
        (binary,) = program.get_info(cl.program_info.BINARIES)
        with contextlib.suppress(OSError):  # a full disk, say: it is compiled again
            place.parent.mkdir(exist_ok=True)
            new = place.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
            try:
                new.write_bytes(binary)
                new.replace(place)  # whole, or not at all
            finally:
                new.unlink(missing_ok=True)
    return cl.Program(program)


def _log(program: Any, device: Any) -> str:
    return str(program.get_build_info(device, opencl().program_build_info.LOG) or "").strip()
