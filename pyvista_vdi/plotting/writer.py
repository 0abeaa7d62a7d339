"""``image.save("x.vdi")`` and ``("x.exr")``: a VDI in its canonical VTK form becomes a file."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.io import write
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, vdi_from_image


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
