"""Conversion of the engine's volumes to PyVista's."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyvista as pv

    from pyvista_vdi.model.volume import Volume


def to_image_data(volume: Volume, name: str | None = None) -> pv.ImageData:
    """Return a volume as PyVista's uniform grid, with its values as the active point array.

    ``name`` is the array's, the volume's own by default. It may share memory with the volume.
    """
    import pyvista as pv

    from pyvista_vdi.vtk_pipeline.filters.convert import volume_to_image

    grid: pv.ImageData = pv.wrap(volume_to_image(volume, name))
    return grid
