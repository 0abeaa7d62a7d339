"""What ``add_volume`` takes as a volume, and paths and stores, to a uniform grid with scalars."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pyvista as pv

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    InvalidVolumeTypeError,
    UnsupportedError,
)
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.vtk_pipeline.filters.convert import as_numpy, require_image, volume_to_image
from pyvista_vdi.vtk_pipeline.vtk import vtkRectilinearGrid

_log = logging.getLogger(__name__)

#: What ``add_volume`` calls scalars that are given as an array.
_UNNAMED = "Data"


def load(volume: StoredVolume) -> Volume:
    """Read a level of a store and log which; DeviceMemoryError if the host lacks the memory."""
    _log.info("%s: %s", volume.store.path, volume.describe())
    return volume.load()


def to_image_data(volume: Volume, name: str | None = None) -> pv.ImageData:
    """Return a volume as PyVista's uniform grid, with its values as the active point array.

    ``name`` is the array's, the volume's own by default. It may share memory with the volume.
    """
    grid: pv.ImageData = pv.wrap(volume_to_image(volume, name))
    return grid


def as_grid(volume: Any, scalars: Any, resolution: Any) -> tuple[Any, str | None]:
    """Return a uniform grid and the name of its scalars, ``None`` for the active ones.

    ``volume`` is a grid, a NumPy array with the spacing ``resolution``, or a Volume; the user's own
    grid is returned where that is possible, so that changes to it are seen. ``scalars`` is a name,
    or values per point or cell, which go into a shallow copy. A rectilinear grid whose points are
    equidistant is a uniform one; others are refused with a remedy.
    """
    if isinstance(volume, np.ndarray):
        image = _from_array(volume, resolution)
    elif isinstance(volume, Volume):
        image = to_image_data(volume)
    else:
        image = require_image(_as_uniform(volume))
    if scalars is None or isinstance(scalars, str):
        return image, scalars
    return _with_values(image, np.asarray(scalars)), _UNNAMED


def _as_uniform(grid: Any) -> Any:
    """Return a rectilinear grid of equidistant points as that uniform grid; else what is given.

    Equidistant: within four units of the last place of the farthest coordinate, as it is stored,
    which is what rounding leaves of ``linspace``. The arrays are shared.
    """
    if not isinstance(grid, vtkRectilinearGrid):
        return grid
    axes = [as_numpy(grid.GetXCoordinates()), as_numpy(grid.GetYCoordinates())]
    axes.append(as_numpy(grid.GetZCoordinates()))
    spacing = []
    for axis in axes:
        places = axis.astype(np.float64)
        step = (places[-1] - places[0]) / (len(places) - 1) if len(places) > 1 else 0.0
        rounding = np.finfo(axis.dtype if axis.dtype.kind == "f" else float).eps
        off = np.abs(places - (places[0] + step * np.arange(len(places)))).max()
        if not (step > 0 and off <= 4 * rounding * np.abs(places).max()):
            return grid
        spacing.append(step)
    image = pv.ImageData(
        dimensions=grid.GetDimensions(), spacing=spacing, origin=[float(axis[0]) for axis in axes]
    )
    image.GetPointData().ShallowCopy(grid.GetPointData())
    image.GetCellData().ShallowCopy(grid.GetCellData())
    image.GetFieldData().ShallowCopy(grid.GetFieldData())
    return image


def _from_array(array: Any, resolution: Any) -> pv.ImageData:
    if array.ndim == 4 and array.shape[-1] in (3, 4):
        raise UnsupportedError(_rgba(array))
    if array.ndim != 3:
        raise InvalidVolumeError(
            f"a NumPy volume is three-dimensional, indexed [x, y, z]; got shape {array.shape}"
        )
    image = pv.wrap(array)
    spacing = (1, 1, 1) if resolution is None else tuple(np.ravel(resolution))
    if len(spacing) != 3 or not all(np.isfinite(s) and s > 0 for s in spacing):
        raise InvalidArgumentError(
            f"resolution must be three positive spacings; got {resolution!r}"
        )
    image.spacing = spacing
    return image


def _with_values(image: Any, values: Any) -> pv.ImageData:
    rgba = values.ndim == 2 and values.shape[1] == 4 and values.dtype == np.uint8
    if values.ndim == 2 and values.shape[1] in (3, 4) and not rgba:
        raise UnsupportedError(_rgba(values))
    if not np.issubdtype(values.dtype, np.number) and values.dtype != bool:
        raise InvalidVolumeTypeError(f"scalars must be numbers; got {values.dtype}")
    n_points, n_cells = image.GetNumberOfPoints(), image.GetNumberOfCells()
    if not (values.ndim == 1 or rgba) or len(values) not in (n_points, n_cells):
        raise InvalidVolumeError(
            f"scalars must have one value per point ({n_points}) or per cell ({n_cells}); "
            f"got shape {values.shape}"
        )
    copy = pv.ImageData()
    copy.CopyStructure(image)
    copy.GetPointData().AddArray(image.GetPointGhostArray())
    copy.GetCellData().AddArray(image.GetCellGhostArray())
    data = copy.point_data if len(values) == n_points else copy.cell_data
    data.set_array(values, _UNNAMED)
    return copy


def _rgba(array: Any) -> str:
    return (
        f"scalars of shape {array.shape} and type {array.dtype} are no RGBA colours: pass uint8 "
        "of shape (number of points, 4) as scalars= of a grid, or one scalar per point"
    )
