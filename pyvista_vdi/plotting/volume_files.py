"""Volumes in VTK's own formats and what else PyVista reads as a uniform grid."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, VDIError, with_article
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.plotting.volumes import as_image
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, volume_from_vtk
from pyvista_vdi.vtk_pipeline.filters.temporal import steps_and_times

#: Names of files that hold VDIs, not volumes.
_VDI_SUFFIXES = (".vdi", ".exr", ".html")

#: Names of files whose readers announce times; that of legacy .vtk files announces others.
_WITH_TIMES = (".vti", ".pvti", ".vtkhdf")

#: Ends of names, by what VTK's XML files say that they hold.
_SUFFIXES = {
    "ImageData": ".vti",
    "RectilinearGrid": ".vtr",
    "StructuredGrid": ".vts",
    "UnstructuredGrid": ".vtu",
    "PolyData": ".vtp",
    "vtkMultiBlockDataSet": ".vtm",
    "PImageData": ".pvti",
    "PRectilinearGrid": ".pvtr",
}

_XDMF = (".xdmf", ".xmf")

#: Angstrom.
_BOHR = 0.529177249


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the arrays of a uniform grid in a file, read by PyVista.

    Equidistant rectilinear grids are uniform, and the only block of a multi-block is its volume.
    """
    name = file.name.lower()
    if name.endswith(_VDI_SUFFIXES):
        raise InvalidVolumeError(
            f"{file} is a VDI, not a volume: 'pyvista-vdi render' and 'view' show it"
        )
    cube = _head_of_cube(file) if name.endswith(".cube") else None
    data = _read_apart(file) if name.endswith(_XDMF) else _read(file)
    while (
        isinstance(data, pv.MultiBlock) and len(blocks := [b for b in data if b is not None]) == 1
    ):
        data = blocks[0]
    if isinstance(data, pv.MultiBlock):
        grids = [b for b in blocks if isinstance(b, pv.ImageData)]
        data = grids[0] if len(grids) == 1 else data
    if isinstance(data, pv.RectilinearGrid):
        with contextlib.suppress(UnsupportedError):
            data, _ = as_image(data, None, None)
    if not isinstance(data, pv.ImageData):
        raise UnsupportedError(
            f"{file} holds {with_article(type(data).__name__)}, not a uniform grid: resample "
            "it to a pyvista.ImageData first"
        )
    if is_vdi_image(data):
        raise InvalidVolumeError(
            f"{file} is a VDI in its VTK form, not a volume: "
            "plotter.add_vdi(pyvista.read(path)) shows it"
        )
    if data.n_points == 0 or not data.array_names:
        raise InvalidVolumeError(f"{file} holds no scalars that PyVista could read")
    if cube is not None:
        # Of Gaussian, which VTK's reader leaves at the origin: Bohr in angstrom
        steps = cube[1:, 1:4]
        data.spacing = np.linalg.norm(steps, axis=1) * _BOHR
        data.direction_matrix = (steps / np.linalg.norm(steps, axis=1)[:, None]).T
        data.origin = cube[0, 1:4] * _BOHR
    unit = "" if cube is None else "angstrom"
    active = data.active_scalars_info
    found = []
    for kind, arrays in (("point", data.point_data), ("cell", data.cell_data)):
        for key, values in arrays.items():
            if key.startswith("vtk"):  # what is hidden
                continue
            both = kind == "cell" and key in data.point_data
            meant = active.name == key and active.association.name.lower() == kind

            def taken(key: str = key, kind: str = kind) -> Any:
                volume = volume_from_vtk(data, key, kind)
                volume.unit = unit
                return volume

            place = np.eye(4)
            place[:3, :3] = data.direction_matrix * np.array(data.spacing)
            place[:3, 3] = data.origin
            shape = data.dimensions[::-1]
            lazy = Lazy(shape, values.dtype, lambda: None)
            found.append(
                VolumeInFile(
                    *(lazy, "zyx", place, f"{kind}:{key}" if both else key, unit),
                    meant=meant,
                    taken=taken,
                )
            )
    return found


def _head_of_cube(file: Path) -> NDArray[np.float64]:
    """Return the counts and vectors of lines 3 to 6, (4, 4): VTK ends the process on wrong ones.

    It does on atoms of no element, too, and these lines must be there for what the counts say.
    """
    why, size = "its lines 3 to 6 must each be a whole number and three others", file.stat().st_size
    with file.open(encoding="utf-8", errors="replace") as stream:
        rows = _numbers(itertools.islice(stream, 2, 6), 4)
        if rows.shape == (4, 4):
            n_atoms, points = abs(rows[0, 0]), rows[1:, 0]
            if (points < 0).all():
                raise UnsupportedError(
                    f"{file} has negative numbers of points, by which its lengths are in angstrom, "
                    "which is not read: write them positive, and lengths in Bohr (1 / 0.529177249)"
                )
            why = (
                f"its head says {n_atoms:g} atoms and {' x '.join(f'{n:g}' for n in points)} points"
            )
            # A line of an atom has ten bytes at least, a value two
            if (points >= 1).all() and 10 * n_atoms + 2 * points.prod() <= size:
                atoms = _numbers(itertools.islice(stream, int(n_atoms)), 5)
                if len(atoms) == n_atoms and (abs(atoms[:, :1] - 59) <= 59).all():
                    return rows
    raise InvalidVolumeError(
        f"{file} cannot be read as a volume: {why}, and it has {size} bytes: is it whole?"
    )


def _numbers(lines: Iterable[str], count: int) -> NDArray[np.float64]:
    """Return lines of numbers, the first of each a whole one; no lines where they are not that."""
    try:
        rows = np.array([[float(n) for n in line.split()[:count]] for line in lines]).reshape(
            -1, count
        )
    except ValueError:
        return np.empty((0, count))
    right = np.isfinite(rows).all() and not (rows[:, 0] % 1).any()
    return rows if right else np.empty((0, count))


def _read(file: Path) -> Any:
    """Read by PyVista; what VTK would print is raised."""
    failure: Exception | None = None
    with vtk.caught_messages() as window, pv.vtk_verbosity("off"):
        try:
            try:
                reader = pv.get_reader(file, force_ext=_suffix_of(file))
            except ValueError:  # formats that are not VTK's
                data = pv.read(file)
            else:
                data = reader.read()
        except VDIError:
            raise
        except Exception as error:  # each format has readers, and exceptions, of its own
            failure = error
    messages = _errors_in(window.GetOutput())
    if failure is not None:
        first = (str(failure) or type(failure).__name__).splitlines()[0]
        raise InvalidVolumeError(
            f"{file} cannot be read as a volume ({messages[0] if messages else first}): it is "
            "of a format that is not known here, or damaged: convert it to NRRD, NIfTI or VTI"
        ) from failure
    if messages:
        raise InvalidVolumeError(
            f"{file} cannot be read as a volume: {messages[0]}: is it whole? Write it anew"
        )
    return data


def _read_apart(file: Path) -> Any:
    """Read XDMF in a process of its own, which VTK ends on some that are damaged.

    PyVista's reader wants times, which XDMF need not have.
    """
    for grid in _grids_of_xdmf(file):
        topology = grid.find("Topology")
        said = "" if topology is None else topology.get("Dimensions", "")
        points = [int(n) for n in said.split()] if re.fullmatch(r"(\s*\d+){3}\s*", said) else []
        of_grid = {math.prod(points), math.prod(n - 1 for n in points)} - {0}
        for item in grid.findall("Attribute/DataItem[@Dimensions]") if points else ():
            count = math.prod(int(n) for n in item.get("Dimensions", "").split())
            if not any(count % n == 0 for n in of_grid):  # VTK leaves the rest as it finds it
                raise InvalidVolumeError(
                    f"{file} cannot be read as XDMF: it has {count} values for {said} points"
                )
    code = (
        "import sys, pyvista\n"
        "from pyvista_vdi.vtk_pipeline import vtk\n"
        "reader = vtk.vtkXdmfReader()\n"
        "reader.SetFileName(sys.argv[1])\n"
        "reader.Update()\n"
        "pyvista.MultiBlock([reader.GetOutputDataObject(0)]).save(sys.argv[2])\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder, "found.vtm")
        command = [sys.executable, "-c", code, str(file.resolve()), str(found)]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        if done.returncode or re.search(r"ERR|rror", done.stderr):
            messages = [*_errors_in(done.stderr), f"its reader ended by {done.returncode}"]
            why = messages[0][:200]
            raise InvalidVolumeError(f"{file} cannot be read as XDMF ({why}): is it whole?")
        return pv.read(found)


def _grids_of_xdmf(file: Path) -> Iterable[Any]:
    try:
        return ET.parse(file).iter("Grid")
    except ET.ParseError as error:
        raise InvalidVolumeError(
            f"{file} cannot be read as XDMF ({error}): is it whole?"
        ) from error


def _suffix_of(file: Path) -> str | None:
    """Return the end of name that a file of VTK's should have, by its content."""
    with file.open("rb") as stream:
        head = stream.read(1024)
    if head.startswith(b"# vtk DataFile"):
        return ".vtk"
    said = re.search(rb'<VTKFile[^>]*\stype="(\w+)"', head)
    return _SUFFIXES.get(said[1].decode()) if said else None


def _errors_in(written: str) -> list[str]:
    """Return the errors that VTK wrote; a warning that says Error is one."""
    said = re.findall(r"(?s)(?:ERROR|(?i:warning)): In [^\n]*\n(.*?)(?=\n\n|\Z)", written)
    texts = [" ".join(one.split()) for one in said]
    return [t.split("): ", 1)[-1] for t in texts if "rror" in t or "ERROR" in written]


def steps_of(path: str | os.PathLike[str]) -> tuple[Sequence[Any], tuple[float, ...]]:
    """Return what a file holds at each of its times, read when it is asked for, and the times.

    There are none where its reader announces none, or it cannot be read.
    """
    try:
        reader: Any = pv.get_reader(path)
        if hasattr(reader, "time_values"):
            return steps_and_times(reader)
        if Path(path).suffix.lower() in _WITH_TIMES:
            return steps_and_times(reader.reader)
    except Exception:  # of each format; reading it as one volume says what is wrong
        return (), ()
    return (), ()
