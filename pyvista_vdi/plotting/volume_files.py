"""Volumes in VTK's own formats, which PyVista reads as uniform grids."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pyvista as pv

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile, head_of
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.volumes import as_grid
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, volume_from_vtk
from pyvista_vdi.vtk_pipeline.filters.temporal import only_grid


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the arrays of a uniform grid in a file, read by PyVista.

    Equidistant rectilinear grids are uniform, and the only grid of a multi-block is its volume.
    """
    # Legacy files may have any name; what VTK would print is raised
    legacy = head_of(file).startswith(b"# vtk DataFile")
    with vtk.caught_messages() as window, pv.vtk_verbosity("off"):
        read = pv.get_reader(file, force_ext=".vtk" if legacy else None).read()
    if "error" in (written := window.GetOutput()).lower():  # of what is no error it warns, too
        said = written.partition("\n")[2].partition("\n\n")[0].split("): ", 1)[-1]
        raise InvalidVolumeError(f"{file} cannot be read ({' '.join(said.split())}): write it anew")
    data, _ = as_grid(pv.wrap(only_grid(read)), None, None)
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
    return found
