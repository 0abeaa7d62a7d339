"""NRRD, by pynrrd, which knows no lists and patterns of files: ``pieces.py`` does."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.io.volumes.pieces import names_of
from pyvista_vdi.model.host_memory import aligned_empty

#: Letters of what lies along an axis that is no domain; others are channels.
_KINDS = {"time": "t", "rgb-color": "s", "rgba-color": "s", "3-color": "s", "4-color": "s"}
_DOMAINS = ("domain", "space")


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the volume of an NRRD file, in the coordinates that its ``space`` names."""
    import nrrd

    lines, pieces = _header(file)
    header = nrrd.read_header(lines)
    sizes = [int(n) for n in header["sizes"]]
    axes = _axes(header, sizes)
    domains = [i for i, a in enumerate(axes) if a in "xyz"]
    dtype = np.dtype(nrrd.reader._determine_datatype(header)).newbyteorder("=")
    if min(sizes) < 1:
        raise InvalidVolumeError(f"its sizes are {sizes}")

    def read() -> NDArray[Any]:
        # Where a CPU device reads it without a copy of its own
        array = aligned_empty(tuple(sizes[::-1]), dtype)
        if not pieces:
            with file.open("rb") as stream:
                whole = nrrd.read_header(stream)
                array[...] = nrrd.read_data(whole, stream, str(file), index_order="C")
            return array
        missing = [name for name in pieces if not (file.parent / name).is_file()][:1]
        if missing or array.size % len(pieces):
            raise InvalidVolumeError(f"of its {len(pieces)} files of data, {missing} are not there")
        parts = array.reshape(len(pieces), -1)
        part = {**header, "dimension": 1, "sizes": np.array(parts.shape[1:])}
        for values, name in zip(parts, pieces, strict=True):
            values[:] = nrrd.read_data({**part, "data file": name}, filename=str(file))
        return array

    of_all = header.get("units", [""] * len(sizes))
    units = {str(u) for u in header.get("space units") or [of_all[i] for i in domains]}
    unit, name = units.pop() if len(units) == 1 else "", str(header.get("content", ""))
    place = _to_world(header, domains, sizes)
    return [VolumeInFile(Lazy(sizes[::-1], dtype, read), axes[::-1], place, name, unit)]


def _header(file: Path) -> tuple[list[str], list[str]]:
    """Return the header's lines, and the names of its files of data: none where it holds them."""
    with file.open("rb") as stream:
        of_header = itertools.takewhile(lambda line: line.strip(b"\r\n"), stream)
        lines = [line.decode("latin-1").rstrip("\r\n") for line in of_header]
    for i, line in enumerate(lines):
        key, _, said = line.partition(":")
        if key.strip().lower() in ("data file", "datafile"):
            after = [] if said.split()[:1] == ["LIST"] else lines[i + 1 :]
            return [*lines[:i], *after, "data file: pieces"], names_of(said, lines[i + 1 :])
    return lines, []


def _axes(header: Any, sizes: list[int]) -> str:
    """Return the axes' letters, the fastest first."""
    kinds = [str(kind).lower() for kind in header.get("kinds", ["???"] * len(sizes))]
    steps = header.get("space directions")
    of_space = [kind in _DOMAINS for kind in kinds]
    if steps is not None:
        of_space = [s is not None and bool(np.isfinite(s).all()) for s in steps]
    elif len(sizes) == 3 and not {*kinds} & {*_KINDS}:
        of_space = [True] * 3
    if sum(of_space) != 3:
        raise InvalidVolumeError(
            f"a volume is a three-dimensional array; got shape {tuple(sizes[::-1])}, and "
            f"kinds ({', '.join(kinds)}) that do not say which are of space: write domain there"
        )
    letters, named = iter("xyz"), zip(of_space, kinds, strict=True)
    return "".join(next(letters) if space else _KINDS.get(kind, "c") for space, kind in named)


def _to_world(header: Any, domains: list[int], sizes: list[int]) -> NDArray[np.float64]:
    """Return where points lie: by directions, or by spacings and axis mins, of cells' centres."""
    if (steps := header.get("space directions")) is not None:
        along = np.asarray([steps[i] for i in domains], dtype=np.float64).T
        return to_world(along, header.get("space origin", np.zeros(3)))
    centers = header.get("centers", header.get("centerings", ["none"] * len(sizes)))
    centers = centers.split() if isinstance(centers, str) else centers
    low, high, step = (
        np.array([float(header[name][i]) if name in header else np.nan for i in domains])
        for name in ("axis mins", "axis maxs", "spacings")
    )
    cell = np.array([centers[i] == "cell" for i in domains])
    count = np.array([sizes[i] for i in domains])
    step = np.where(np.isfinite(step), step, (high - low) / np.maximum(1, count - ~cell))
    step = np.where(np.isfinite(step), step, 1.0)
    first = np.where(np.isfinite(low), low + cell * step / 2, 0.0)
    return to_world(step, header.get("space origin", first))
