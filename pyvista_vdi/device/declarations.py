"""Kernels as Python knows them: the arguments of each, by name and type."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError

Define = str | int | float | bool | None

#: OpenCL's types of a number, as NumPy has them.
SCALARS: dict[str, np.dtype[Any]] = {
    "char": np.dtype(np.int8),
    "uchar": np.dtype(np.uint8),
    "short": np.dtype(np.int16),
    "ushort": np.dtype(np.uint16),
    "int": np.dtype(np.int32),
    "uint": np.dtype(np.uint32),
    "long": np.dtype(np.int64),
    "ulong": np.dtype(np.uint64),
    "float": np.dtype(np.float32),
    "double": np.dtype(np.float64),
}


class Struct:
    """A structure of numbers and vectors, passed to kernels by value and laid out as in OpenCL C.

    Parameters
    ----------
    name : str
        Its name in the kernels.
    **fields : str
        Types by name, in order: ``width="int"``, ``origin="float4"``.
    """

    def __init__(self, name: str, /, **fields: str) -> None:
        self.name, self.fields = name, fields
        formats, offsets, end, alignment = [], [], 0, 1
        for kind in fields.values():
            number, count = _numbers(kind, {})
            assert number is not None, f"{kind} is no type of a number in OpenCL"
            size = number.itemsize * count  # a vector is aligned to its size
            offsets.append(-(-end // size) * size)
            formats.append(number if count == 1 else np.dtype((number, (count,))))
            end, alignment = offsets[-1] + size, max(alignment, size)
        self.dtype = np.dtype(
            {
                "names": list(fields),
                "formats": formats,
                "offsets": offsets,
                "itemsize": -(-end // alignment) * alignment,
            }
        )

    def __call__(self, **values: Any) -> NDArray[np.void]:
        """Return a value of it, with every field given by name."""
        if values.keys() != self.fields.keys():
            wrong = sorted(values.keys() ^ self.fields.keys())
            raise InvalidArgumentError(
                f"fields of {self.name} that are missing or unknown: {wrong}"
            )
        return np.array(tuple(values[name] for name in self.fields), self.dtype)


class Parameter:
    """An argument of a compiled kernel: its place and type, and the numbers that it consists of.

    Attributes
    ----------
    index, kind, number, count : int, str, numpy.dtype or None, int
        ``number`` is None where it is not known: of a type that the kernel's file defines.
    held : set of numpy.dtype or None
        Of a pointer: what buffers may hold, which are its numbers, or parts of them such as two
        floats for a ulong; None where that is not known.
    scalar : type or None
        Of a single number: NumPy's type of it.
    """

    def __init__(self, index: int, kind: str, number: np.dtype[Any] | None, count: int = 1) -> None:
        self.index, self.kind, self.number, self.count = index, kind, number, count
        local, pointer = kind.startswith("local "), kind.endswith("*")
        single = number is not None and number.names is None and count == 1
        self.scalar: Any = number.type if number is not None and single and not pointer else None
        self.held: set[np.dtype[Any]] | None = set()
        if pointer and not local:
            whole = 0 if number is None else number.itemsize
            parts = {n for n in SCALARS.values() if whole % (2 * n.itemsize) == 0}
            self.held = None if number is None else {number, *parts}


class KernelDeclaration:
    """A kernel function, with the types of its arguments by name and in order.

    Parameters
    ----------
    path, name : str
        A file of ``pyvista_vdi.opencl``, and the function in it.
    **arguments : str or Struct
        A number (``"int"``), a vector (``"float4"``), a pointer to a buffer (``"float4*"``), to
        memory of each work-group (``"local ulong*"``), or a structure. A type may be named by a
        ``-D`` option (``"VOXEL_T*"``). What only programs with an option have ends in
        ``" if OPTION"`` or ``" if OPTION=value"``, what only those without it have, in
        ``" if not OPTION"``; there may be several.
    """

    def __init__(self, path: str, name: str, /, **arguments: str | Struct) -> None:
        self.path, self.name, self.arguments = path, name, arguments

    def __repr__(self) -> str:
        return f"<KernelDeclaration {self.name!r} of {self.path}>"

    def parameters(self, defines: Mapping[str, Define]) -> dict[str, Parameter]:
        """Return the arguments in a program with these ``-D`` options, by name and in order."""
        found: dict[str, Parameter] = {}
        for name, declared in self.arguments.items():
            if isinstance(declared, Struct):
                found[name] = Parameter(len(found), declared.name, declared.dtype)
                continue
            kind, *conditions = declared.split(" if ")
            if not all(_holds(condition, defines) for condition in conditions):
                continue
            element = kind.removeprefix("local ").removesuffix("*")
            found[name] = Parameter(len(found), kind, *_numbers(element, defines))
        return found


def _holds(condition: str, defines: Mapping[str, Define]) -> bool:
    """Whether a program has, or has not, an option: ``NAME``, ``NAME=value`` or ``not NAME``."""
    option, _, value = condition.removeprefix("not ").partition("=")
    there = option in defines and value in ("", str(defines[option]))
    return there != condition.startswith("not ")


def _numbers(kind: str, defines: Mapping[str, Define]) -> tuple[np.dtype[Any] | None, int]:
    """Return the numbers that a type consists of, None if not known, and how many."""
    kind = str(defines.get(kind, kind))
    name = kind.rstrip("0123456789")
    number = SCALARS.get(name)
    return number, int(kind[len(name) :] or 1)
