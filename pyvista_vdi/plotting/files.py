"""Files by PyVista's ``read`` and ``save``: VDIs in their VTK form, volumes in VTK's formats."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from pyvista_vdi.errors import InvalidVDIError, InvalidVolumeError, UnsupportedError
from pyvista_vdi.io import read, write
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import REMEDY, Lazy, VolumeInFile, head_of
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.volumes import as_grid
from pyvista_vdi.vtk_pipeline.filters.convert import (
    is_vdi_image,
    vdi_from_image,
    vdi_to_image,
    volume_from_vtk,
)


def read_vdi(path: str, **options: Any) -> pv.ImageData:
    """Read a ``.vdi`` file, a deep OpenEXR image, or a ``.vdis`` series' first step.

    Parameters
    ----------
    path : str
        The file.
    **options
        Those of :func:`pyvista_vdi.read`: for ``.exr`` files of other programs.

    Returns
    -------
    pyvista.ImageData
        The canonical VTK form, which ``add_vdi``, ``pyvista_vdi.render`` and ``VDIMapper`` take:
        see :func:`pyvista_vdi.vtk_pipeline.filters.convert.vdi_to_image`.

    Raises
    ------
    VDIFileError
        If it is not a readable VDI file, or a flat image.
    InvalidArgumentError
        If an option is not one of the file's format.
    """
    found: Any = read(path, **options)
    return pv.wrap(vdi_to_image(found[0] if isinstance(found, VDICollection) else found))


def write_vdi(dataset: Any, path: str, **options: Any) -> None:
    """Write a VDI by PyVista's ``save``.

    Parameters
    ----------
    dataset : pyvista.ImageData
        A VDI in its canonical VTK form: ``pyvista.read("x.vdi")``, or ``VDISource``'s output.
    path : str
        The target; its name ends in ``.vdi`` or ``.exr``.
    **options
        Those of ``VDI.save``: ``level`` for ``.vdi``. PyVista takes ``compression`` for its own:
        ``VDI.save`` has it.

    Raises
    ------
    InvalidVDIError
        If it is no such form.
    VDIFileError
        If the target cannot be written.
    InvalidArgumentError
        If an option is unknown or out of its range.
    """
    if not is_vdi_image(dataset):
        raise InvalidVDIError(
            f"{type(dataset).__name__} that holds no VDI cannot be written "
            f"to {path}: generate one of it by dataset.vdi.generate(camera, window_size), and save "
            "that"
        )
    write(vdi_from_image(dataset), path, **options)


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the arrays of a uniform grid in a file, read by PyVista.

    Equidistant rectilinear grids are uniform, and the only grid of a multi-block is its volume.
    """
    # Legacy files may have any name; what VTK would print is raised
    legacy = head_of(file).startswith(b"# vtk DataFile")
    with pv.VtkErrorCatcher(send_to_logging=False) as caught, pv.vtk_verbosity("off"):
        reader = pv.get_reader(file, force_ext=".vtk" if legacy else None)
        held = reader.read()
    said = [
        str(each.alert).splitlines()[-1] for each in caught.events if "error" in str(each).lower()
    ]
    if said:  # of what is no error it warns, too
        raise InvalidVolumeError(f"{file} cannot be read ({said[0]}): write it anew")
    if (steps := getattr(reader.reader, "GetNumberOfSteps", int)()) > 1:
        raise UnsupportedError(f"{file} holds {steps} times, and a volume is one: {REMEDY}")
    grid = pv.wrap(held)
    if isinstance(grid, pv.MultiBlock):  # of several blocks it is the only uniform one, or the only
        blocks = [*grid.recursive_iterator(skip_none=True)]
        found = [block for block in blocks if isinstance(block, pv.ImageData)] or blocks
        grid = found[0] if len(found) == 1 else grid
    data, _ = as_grid(grid, None, None)
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
