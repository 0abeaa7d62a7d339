"""NRRD, by pynrrd, which knows no lists and patterns of files: ``pieces.py`` does."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.axes import one_unit, to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.io.volumes.pieces import files_of
from pyvista_vdi.model.host_memory import aligned_empty

#: Letters of what lies along an axis that is no domain; others are channels.
_KINDS = {"time": "t", "rgb-color": "s", "rgba-color": "s", "3-color": "s", "4-color": "s"}


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the volume of an NRRD file, in the coordinates that its ``space`` names."""
    import nrrd

    with file.open("rb") as stream:
        lines = [*itertools.takewhile(lambda line: line.strip(b"\r\n"), stream)]
        begin = stream.tell()
    said = [line.decode("latin-1").rstrip("\r\n") for line in lines]
    listed = (i for i, line in enumerate(said) if re.match(r"(?i)data ?file:\s*LIST\b", line))
    last = next(listed, len(said))
    header = nrrd.read_header(said[: last + 1], {"centers": "string list"})
    named = [header.pop(k) for k in [*header] if k.lower() in ("data file", "datafile")][:1]
    pieces = [one for name in named for one in files_of(file.parent, name, said[last + 1 :])]
    sizes = [int(n) for n in header["sizes"]]
    dtype = np.dtype(nrrd.reader._determine_datatype(header)).newbyteorder("=")
    if min(sizes) < 1 or (pieces and np.prod(sizes, dtype=object) % len(pieces)):
        raise InvalidVolumeError(f"its sizes are {sizes}, of {len(pieces)} files of data")

    def read() -> NDArray[Any]:
        # Where a CPU device reads it without a copy of its own
        array = aligned_empty(tuple(sizes[::-1]), dtype)
        parts = array.reshape(max(1, len(pieces)), -1)
        part = {**header, "dimension": 1, "sizes": np.array(parts.shape[1:])}
        for values, path in zip(parts, pieces or [file], strict=True):
            with path.open("rb") as stream:
                stream.seek(0 if pieces else begin)
                values[:] = nrrd.read_data(part, stream)
        return array

    axes, place = _placed(header, sizes)
    units = header.get("units", [""] * len(sizes))
    units = header.get("space units") or [units[axes.index(a)] for a in "xyz"]
    array, name = Lazy(sizes[::-1], dtype, read), str(header.get("content", ""))
    return [VolumeInFile(array, axes[::-1], place, name, one_unit([str(u) for u in units]))]


def _placed(header: Any, sizes: list[int]) -> tuple[str, NDArray[np.float64]]:
    """Return the axes' letters, the fastest first, and where points lie.

    By directions, or by spacings and axis mins, of cells' borders or of points.
    """
    unsaid = np.full(len(sizes), np.nan)
    kinds = [str(kind).lower() for kind in header.get("kinds", ["???"] * len(sizes))]
    of_space = [kind in ("domain", "space") for kind in kinds]
    if (steps := header.get("space directions")) is not None:
        of_space = [s is not None and bool(np.isfinite(s).all()) for s in steps]
    elif len(sizes) == 3 and not {*kinds} & {*_KINDS}:
        of_space = [True] * 3
    if sum(of_space) != 3:
        raise InvalidVolumeError(
            f"a volume is a three-dimensional array; got shape {tuple(sizes[::-1])}, and "
            f"kinds ({', '.join(kinds)}) that do not say which are of space: write domain there"
        )
    letters, named = iter("xyz"), zip(of_space, kinds, strict=True)
    axes = "".join(next(letters) if space else _KINDS.get(kind, "c") for space, kind in named)
    domains = np.flatnonzero(of_space)
    if steps is not None:
        along = np.array([steps[i] for i in domains], dtype=np.float64).T
        return axes, to_world(along, header.get("space origin", np.zeros(3)))
    low, high, step = (
        np.take(header.get(name, header.get(name.replace(" ", ""), unsaid)), domains)
        for name in ("axis mins", "axis maxs", "spacings")
    )
    centers = header.get("centers", header.get("centerings", kinds))
    cell, count = np.take(centers, domains) == "cell", np.take(sizes, domains)
    step = np.where(np.isfinite(step), step, (high - low) / np.maximum(1, count - ~cell))
    step = np.nan_to_num(step, nan=1.0)
    return axes, to_world(step, header.get("space origin", np.nan_to_num(low + cell * step / 2)))
