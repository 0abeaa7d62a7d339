"""Conversion of the engine's volumes to PyVista's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pyvista as pv

    from pyvista_vdi.model.volume import Volume


def to_image_data(volume: Volume, name: str | None = None) -> pv.ImageData:
    """Return a volume as PyVista's uniform grid, with its values as the active point array.

    ``name`` is the array's, the volume's own by default. It may share memory with the volume.
    """
    import pyvista as pv

    grid = pv.ImageData(
        dimensions=volume.dimensions,
        spacing=volume.spacing,
        origin=volume.origin,
        direction_matrix=np.array(volume.direction),
    )
    # x runs fastest in VTK's point order, as it does in a C-ordered [z, y, x] array
    name = volume.name if name is None else name
    grid.point_data[name] = volume.array.reshape((-1, 4) if volume.rgba else -1)
    grid.set_active_scalars(name)
    return grid
