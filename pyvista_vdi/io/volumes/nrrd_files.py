"""NRRD, by pynrrd; the lists and patterns of files that it does not know, here."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
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
    dtype = np.dtype(nrrd.reader._determine_datatype(header))
    total = int(np.prod(sizes, dtype=object))
    if min(sizes) < 1:
        raise InvalidVolumeError(f"its sizes are {sizes}")

    def read() -> NDArray[Any]:
        # Where a CPU device reads it without a copy of its own
        aligned = aligned_empty(tuple(sizes[::-1]), dtype.newbyteorder("="))
        aligned[...] = stored()
        return aligned

    def stored() -> NDArray[Any]:
        if not pieces:
            with file.open("rb") as stream:
                whole = nrrd.read_header(stream)
                return nrrd.read_data(whole, stream, str(file), index_order="C")
        names = [name for name in pieces if (file.parent / name).is_file()]
        if len(names) < len(pieces) or total % len(pieces):
            missing = sorted({*pieces} - {*names})[:1]
            raise InvalidVolumeError(f"of its {len(pieces)} files of data, {missing} are not there")
        flat = []
        for name in pieces:
            part = {**header, "dimension": 1, "sizes": np.array([total // len(pieces)])}
            part["data file"] = name
            flat.append(nrrd.read_data(part, filename=str(file)))
        return np.concatenate(flat).reshape(sizes[::-1])

    units = header.get("space units") or [
        header.get("units", [""] * len(sizes))[i] for i in domains
    ]
    units = {str(u) for u in units}
    array = Lazy(sizes[::-1], dtype.newbyteorder("="), read)
    place = _to_world(header, domains, sizes)
    unit = units.pop() if len(units) == 1 else ""
    return [VolumeInFile(array, axes[::-1], place, str(header.get("content", "")), unit)]


def _header(file: Path) -> tuple[list[str], list[str]]:
    """Return the header's lines, and the names of its files of data where these are several."""
    lines, pieces = [], []
    with file.open("rb") as stream:
        for raw in stream:
            line = raw.decode("latin-1").rstrip("\r\n")
            if not line:
                break
            lines.append(line)
    for i, line in enumerate(lines):
        key, _, value = line.partition(":")
        if key.strip().lower() not in ("data file", "datafile"):
            continue
        words = value.split()
        if words[:1] == ["LIST"]:
            pieces = [name.strip() for name in lines[i + 1 :]]
            return [*lines[:i], "data file: pieces"], pieces
        if re.search(r"%\d*d", value) and len(words) >= 4:
            first, last, step = (int(n) for n in words[1:4])
            numbers = range(first, last + (1 if step > 0 else -1), step)
            return [*lines[:i], *lines[i + 1 :], "data file: pieces"], [
                words[0] % n for n in numbers
            ]
    return lines, []


def _axes(header: Any, sizes: list[int]) -> str:
    """Return the axes' letters, the fastest first."""
    kinds = [str(kind).lower() for kind in header.get("kinds", ["???"] * len(sizes))]
    steps = header.get("space directions")
    if steps is not None:
        of_space = [s is not None and bool(np.isfinite(s).all()) for s in steps]
    elif len(sizes) == 3 and not {*kinds} & {*_KINDS}:
        of_space = [True] * 3
    else:
        of_space = [kind in _DOMAINS for kind in kinds]
    if sum(of_space) != 3:
        raise InvalidVolumeError(
            f"a volume is a three-dimensional array; got shape {tuple(sizes[::-1])}, and "
            f"kinds ({', '.join(kinds)}) that do not say which are of space: write domain there"
        )
    letters = iter("xyz")
    return "".join(
        next(letters) if space else _KINDS.get(kind, "c")
        for space, kind in zip(of_space, kinds, strict=True)
    )


def _to_world(header: Any, domains: list[int], sizes: list[int]) -> NDArray[np.float64]:
    """Return where points lie: by directions, or by spacings and axis mins, of cells' centres."""
    place = np.eye(4)
    if (steps := header.get("space directions")) is not None:
        place[:3, :3] = np.asarray([steps[i] for i in domains], dtype=np.float64).T
        place[:3, 3] = header.get("space origin", np.zeros(3))
        return place
    centers = header.get("centers", header.get("centerings", ["none"] * len(sizes)))
    centers = centers.split() if isinstance(centers, str) else centers
    for axis, i in enumerate(domains):
        n = sizes[i]
        low, high, step = (
            float(header[name][i]) if name in header else np.nan
            for name in ("axis mins", "axis maxs", "spacings")
        )
        cell = centers[i] == "cell"
        if not np.isfinite(step):
            step = (high - low) / (n if cell else max(1, n - 1))
        step = step if np.isfinite(step) else 1.0
        place[axis, axis] = step
        place[axis, 3] = (low if np.isfinite(low) else 0.0) + (
            step / 2 if cell and np.isfinite(low) else 0.0
        )
    if "space origin" in header:
        place[:3, 3] = header["space origin"]
    return place
