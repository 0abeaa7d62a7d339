"""``pyvista.read`` of ``.vdi`` and ``.exr`` files: VDIs in their canonical VTK form."""

from __future__ import annotations

from typing import Any

import pyvista as pv

from pyvista_vdi.io import read
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_any_vdi
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_to_image


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
    found = read(path, **options)
    vdi = found[0] if isinstance(found, VDICollection) else found
    return pv.wrap(vdi_to_image(as_any_vdi(vdi)))
