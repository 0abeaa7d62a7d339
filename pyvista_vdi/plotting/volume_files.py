"""Volumes in VTK's own formats, which PyVista reads as uniform grids."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, with_article
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile, head_of
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.volumes import as_grid
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, volume_from_vtk
from pyvista_vdi.vtk_pipeline.filters.temporal import steps_and_times


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the arrays of a uniform grid in a file, read by PyVista.

    Equidistant rectilinear grids are uniform, and the only grid of a multi-block is its volume.
    """
    data = _read(file)
    while isinstance(data, pv.MultiBlock):
        blocks = [block for block in data if block is not None]
        grids = [block for block in blocks if isinstance(block, pv.ImageData)]
        if len(grids or blocks) != 1:
            break
        (data,) = grids or blocks
    if isinstance(data, pv.RectilinearGrid):
        with contextlib.suppress(UnsupportedError):
            data, _ = as_grid(data, None, None)
    if not isinstance(data, pv.ImageData):
        kind = with_article(type(data).__name__)
        remedy = "resample it to a pyvista.ImageData first"
        raise UnsupportedError(f"{file} holds {kind}, not a uniform grid: {remedy}")
    if is_vdi_image(data):
        raise InvalidVolumeError(
            f"{file} is a VDI in its VTK form, not a volume: "
            "plotter.add_vdi(pyvista.read(path)) shows it"
        )
    place = to_world(data.direction_matrix * np.array(data.spacing), data.origin)
    active, found = data.active_scalars_info, []
    for kind, arrays in (("point", data.point_data), ("cell", data.cell_data)):
        for key, values in arrays.items() if data.n_points else ():
            if key.startswith("vtk"):  # what is hidden
                continue
            name = f"cell:{key}" if kind == "cell" and key in data.point_data else key
            meant = active.name == key and active.association.name.lower() == kind
            array = Lazy(data.dimensions[::-1], values.dtype, partial(np.asarray, values))
            volume = partial[Volume](volume_from_vtk, data, key, kind)
            found.append(VolumeInFile(array, "zyx", place, name, meant=meant, volume=volume))
    if not found:
        raise InvalidVolumeError(f"{file} holds no scalars that PyVista could read")
    return found


def _read(file: Path) -> Any:
    """Read by PyVista; what VTK would print is raised."""
    # Legacy files may have any name
    legacy = head_of(file).startswith(b"# vtk DataFile")
    with vtk.caught_messages() as window, pv.vtk_verbosity("off"):
        data = pv.get_reader(file, force_ext=".vtk" if legacy else None).read()
    written = window.GetOutput()
    # A warning that says Error is one
    said = re.findall(r"(?s)(?:ERROR|(?i:warning)): In [^\n]*\n(.*?)(?=\n\n|\Z)", written)
    for text in (" ".join(one.split()).split("): ", 1)[-1] for one in said):
        if "rror" in text or "ERROR" in written:
            raise InvalidVolumeError(f"{file} cannot be read as a volume: {text}: write it anew")
    return data


def steps_of(path: str | os.PathLike[str]) -> tuple[Sequence[Any], tuple[float, ...]]:
    """Return what a file holds at each of its times, read when it is asked for, and the times.

    There are none where its reader announces none, or it cannot be read.
    """
    with contextlib.suppress(Exception):  # of each format; reading one volume says what is wrong
        reader: Any = pv.get_reader(path)
        if hasattr(reader, "time_values"):
            return steps_and_times(reader)
        # That of legacy .vtk files announces others
        if Path(path).suffix.lower() in (".vti", ".pvti", ".vtkhdf"):
            return steps_and_times(reader.reader)
    return (), ()
