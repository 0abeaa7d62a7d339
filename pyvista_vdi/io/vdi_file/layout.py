"""The .vdi format: what its writer and its reader agree on.

A .vdi file is a ZIP archive of one JSON description and one member per array;
``docs/files.md`` describes it for those who read it with other tools. Members are stored as they
are (the arrays are compressed already), times are constant, and the description comes first: the
same VDI gives the same bytes, and the description is read without the arrays.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.model.vdi import Lists

#: Highest version of the format, and the lowest that is read.
FORMAT_VERSION, LEAST_VERSION = 4, 2

#: What is written for each precision: version 3 only where version 2 has no place for it.
VERSION_OF = {"exact": 2, "8-byte": 3}

#: The codec of version 4, which browsers decode by themselves, and the version of no other.
DEFLATE = "deflate"

#: Rows of an array in one chunk. What one chunk holds of all arrays, 1.5 MiB,
#: stays in a core's cache until it has been decoded; larger chunks do not compress better.
CHUNK_ROWS = 1 << 16

#: What a description calls the format.
FORMAT_NAME = "pyvista-vdi"

#: What it calls a file of the same layout whose lists keep values: a program that does not know
#: what they are refuses it, and takes no value for a colour. Its description has an entry
#: ``deferred``, with a version of its own.
DEFERRED_NAME = "pyvista-vdi-deferred"

#: The archive's first member.
DESCRIPTION = "vdi.json"

#: In version 4 the member behind the description: a whole .vdi file of fewer lists, which can be
#: drawn until the rest is there. It is left out where a list stands for fewer than COARSE_STEP².
COARSE = "coarse.vdi"
COARSE_STEP = 4

#: The archive's last member: bytes and CRC-32 of every chunk, in the order of
#: the arrays. A chunk is found, read and checked by itself.
INDEX = "chunks"
INDEX_DTYPE = np.dtype([("bytes", "<u4"), ("crc32", "<u4")])

#: No description is longer: the longest metadata are a transfer function's table.
MAX_DESCRIPTION_BYTES = 1 << 26


@dataclass(frozen=True)
class Layout:
    """How one array lies in its member.

    ``dtype``: type of its elements, little-endian. ``row_shape``: shape of a row. ``n_rows``:
    number of rows. ``filter`` ("none", "difference", "channel-difference"): what was done to the
    rows before they were compressed. ``chunk_rows``: rows that are compressed together.
    """

    dtype: np.dtype[Any]
    row_shape: tuple[int, ...]
    n_rows: int
    filter: str
    chunk_rows: int

    @property
    def row_bytes(self) -> int:
        """Bytes of one row."""
        return self.dtype.itemsize * int(np.prod(self.row_shape, dtype=np.int64))

    @property
    def n_chunks(self) -> int:
        """Number of chunks."""
        return -(-self.n_rows // self.chunk_rows)

    def ranges(self) -> list[tuple[int, int]]:
        """Return the first row of each chunk and the one behind its last."""
        firsts = range(0, self.n_rows, self.chunk_rows)
        return [(first, min(first + self.chunk_rows, self.n_rows)) for first in firsts]

    def to_dict(self) -> dict[str, Any]:
        """Return what the description says about the array."""
        return {
            "dtype": self.dtype.str,
            "shape": [self.n_rows, *self.row_shape],
            "filter": self.filter,
        }


def layouts(vdi: Any, counts: np.dtype[Any], *, filtered: bool, version: int) -> dict[str, Layout]:
    """Return the arrays of a file, in their order.

    ``vdi``: a VDI, or what a file says of it. ``counts``: type of the lists' lengths, as small as
    they allow. ``filtered``: whether exact depths are stored as differences.
    """
    n_lists, n = vdi.window_size[0] * vdi.window_size[1], vdi.n_supersegments
    arrays: dict[str, tuple[Any, tuple[int, ...], int, str]]
    if vdi.precision == "8-byte":  # since version 3
        color_filter = "none" if version < 4 else "channel-difference"
        arrays = {
            "counts": (counts, (), n_lists, "none"),
            "origin": ("<i4", (), n_lists, "none"),
            "stride": ("<u2", (), n_lists, "none"),
            "front": ("<u2", (), n, "difference"),
            "back": ("<u2", (), n, "difference"),
            "color": ("|u1", (3,), n, color_filter),
            "optical_depth": ("<u2", (), n, "none"),
        }
    else:
        depths = ("<u4", (), n, "difference") if filtered else ("<f4", (), n, "none")
        arrays = {
            "counts": (counts, (), n_lists, "none"),
            "front": depths,
            "back": depths,
            "color": ("<f4", (3,), n, "none"),
            "optical_depth": ("<f4", (), n, "none"),
        }
    return {
        name: Layout(np.dtype(dtype), row_shape, rows, how, CHUNK_ROWS)
        for name, (dtype, row_shape, rows, how) in arrays.items()
    }


def describe(vdi: Lists, version: int) -> dict[str, Any]:
    """Return the entries that all formats share, in their order; ``version`` is the format's."""
    return {
        "format": FORMAT_NAME,
        "version": version,
        "written_by": f"pyvista-vdi {__version__}",
        "window_size": list(vdi.window_size),
        "n_supersegments": vdi.n_supersegments,
        "camera": vdi.camera.to_dict(),
        "bounds": list(vdi.bounds),
        "depth_origin": vdi.depth_origin,
        "metadata": vdi.metadata,
    }


def to_json(description: dict[str, Any]) -> str:
    """Return a description as ASCII text; float64 come back from it to the last bit.

    Raises VDIFileError if the metadata hold what JSON cannot, or are too long.
    """
    try:
        text = json.dumps(description, allow_nan=False, default=plain_number)
    except (TypeError, ValueError, RecursionError) as error:
        raise VDIFileError(
            f"the VDI's metadata cannot be written: {error}; "
            "they may hold finite numbers, text, lists and dictionaries with text as keys"
        ) from error
    if len(text) > MAX_DESCRIPTION_BYTES:
        raise VDIFileError(
            f"the VDI's metadata take {len(text)} bytes as JSON; {MAX_DESCRIPTION_BYTES} are "
            "allowed: keep large arrays beside the VDI"
        )
    return text


def from_json(text: str | bytes) -> Any:
    """Return what the text says; ValueError or RecursionError where it is no JSON."""

    def no_constant(name: str) -> NoReturn:
        raise ValueError(f"{name} is not a number of JSON")

    return json.loads(text, parse_constant=no_constant)


def number(value: object) -> float:
    """Return a JSON number as float; text and truth values are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is not a number")
    return float(value)


def plain_number(value: Any) -> Any:
    """Return NumPy's numbers and arrays as Python's."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"a value of type {type(value).__name__} is not JSON")
