"""What ``add_vdi`` makes of paths, stores, masks and grids that are not uniform: a uniform grid."""

from __future__ import annotations

import itertools
import logging
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyvista as pv

from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidVolumeError,
    UnsupportedError,
)
from pyvista_vdi.io import is_vdi_file, read
from pyvista_vdi.io.files import holds
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.io.volumes import read_volume
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.plotting.actor import first_camera
from pyvista_vdi.plotting.progress import progress_callback
from pyvista_vdi.plotting.refinement import load
from pyvista_vdi.plotting.volumes import as_image
from pyvista_vdi.vtk_pipeline.filters.convert import require_image
from pyvista_vdi.vtk_pipeline.vtk import vtkCommonDataModel, vtkImageData

_log = logging.getLogger(__name__)

#: Points that ``resample="auto"`` takes, at most.
_MOST_POINTS = 2**27
#: Points that are resampled at a time, about, between reports of how far it is.
_SLAB = 2**22
#: VTK's bit for a point that is not shown.
_HIDDEN = 2


def prepared(
    plotter: Any, volume: Any, scalars: Any, resample: Any, mask: Any, progress_bar: Any = False
) -> tuple[Any, StoredVolume | None]:
    """Return what can be shown of what is given, and the level of a store that this is."""
    stored, array = None, scalars if isinstance(scalars, str) else None
    if isinstance(volume, str | os.PathLike):
        ours = is_vdi_file(volume) or holds(volume) in ("series", "set")
        volume = read(volume) if ours else read_volume(volume, array=array)
    if isinstance(volume, StoredVolume):
        stored = volume.in_view(
            framing_camera(plotter, volume.bounds), window_size=plotter.window_size
        )
        volume = load(stored)
    if resample is not None and isinstance(volume, vtkCommonDataModel.vtkDataSet):
        progress = progress_callback(progress_bar, "resampling a grid")
        volume = resampled(pv.wrap(volume), resample, array, progress)
    if mask is None:
        return volume, stored
    # A mask has the points of one level
    return masked(volume, mask), None if stored is None else stored.at_level(stored.level)


def framing_camera(plotter: Any, bounds: Sequence[float]) -> Camera:
    """Return the plotter's view, or about what it will be where nobody has set it."""
    return Camera.from_any(first_camera(plotter.renderer, bounds))


def require_grid(data: Any, resample: Any) -> None:
    """Refuse what is no uniform grid, or, where it is to be resampled, what has no volume."""
    vtk = vtkCommonDataModel
    if (
        resample is None
        or not isinstance(data, vtk.vtkDataSet)
        or isinstance(data, vtk.vtkPolyData)
    ):
        require_image(data)


def resampled(
    grid: Any,
    resample: str | Sequence[int],
    name: str | None = None,
    progress: Callable[[float], object] | None = None,
) -> pv.ImageData:
    """Return a grid's arrays at the points of a uniform one; points outside are hidden.

    ``resample``: numbers of points along x, y and z, or ``"auto"``, by which voxels are as large as
    the grid's mean cell. The log says how large the difference at the grid's own points is, of the
    array ``name`` or the active one. ``progress``: gets the fraction done.
    """
    require_grid(grid, resample)
    if isinstance(grid, vtkImageData):
        return pv.wrap(grid)
    low, high = np.reshape(grid.bounds, (3, 2)).T
    size = high - low
    if grid.n_cells == 0 or not (size > 0).all():
        raise InvalidVolumeError(
            f"a {type(grid).__name__} of {grid.n_cells} cells, {size.tolist()} long, cannot be "
            "resampled: it must have cells, and a length along each axis"
        )
    if isinstance(resample, str) and resample == "auto":
        step = (np.prod(size) / grid.n_cells) ** (1 / 3)
        numbers = np.maximum(2, np.ceil(size / step).astype(int) + 1)
    else:
        numbers = np.asarray(resample)
    if numbers.shape != (3,) or numbers.dtype.kind not in "iu" or (numbers < 2).any():
        raise InvalidArgumentError(
            f'resample must be "auto" or three numbers of points, 2 or more; got {resample!r}'
        )
    count = int(np.prod(numbers, dtype=object))
    if count > _MOST_POINTS and isinstance(resample, str):
        raise UnsupportedError(
            f"the mean cell of the grid asks for {' x '.join(map(str, numbers))} points: give "
            "resample=(nx, ny, nz)"
        )
    need = count * 8 * max(1, len(grid.array_names))
    require_free_memory(need, f"the grid of {count} points", "resample to fewer")
    image = pv.ImageData(dimensions=numbers, spacing=size / (numbers - 1), origin=low)
    _probe(image, grid, progress)
    if not (image.point_data["vtkGhostType"] == 0).any():
        raise InvalidVolumeError("no point of the uniform grid lies in a cell of the other")
    name = name or grid.active_scalars_name
    if name in image.point_data:
        image.set_active_scalars(name, "point")
        _say_difference(grid, image, name)
    return image


def _probe(image: Any, grid: Any, progress: Callable[[float], object] | None) -> None:
    """Set the arrays of a uniform grid to another's, slab by slab."""
    nx, ny, nz = image.dimensions
    count = min(nz, 16, -(-image.n_points // _SLAB))  # each goes through all cells
    edges = np.linspace(0, nz, count + 1).astype(int)
    arrays: dict[str, Any] = {}
    step = np.multiply(image.spacing, 1 - 2**-50)  # rounded up, the last points would lie outside
    for low, high in itertools.pairwise(edges):
        if progress is not None and progress(low / nz) is False:
            raise Cancelled("resampling was stopped by its progress callback")
        slab = pv.ImageData(
            dimensions=(nx, ny, high - low),
            spacing=step,
            origin=np.add(image.origin, (0, 0, low * step[2])),
        )
        found = slab.sample(grid, categorical=False).point_data
        found["vtkGhostType"] = np.where(found.pop("vtkValidPointMask"), 0, _HIDDEN).astype(
            np.uint8
        )
        for name, values in found.items():
            shape = (image.n_points, *values.shape[1:])
            whole = arrays.setdefault(name, np.empty(shape, values.dtype))
            whole[low * nx * ny : high * nx * ny] = values
    for name, values in arrays.items():
        image.point_data[name] = values
    if progress is not None:
        progress(1.0)


def _say_difference(grid: Any, image: pv.ImageData, name: str) -> None:
    """Log how far a uniform grid is from another's values, where the other has them."""
    own = grid if name in grid.point_data else grid.cell_centers()
    seen = pv.PolyData(own.points).sample(image)
    at = seen["vtkValidPointMask"].astype(bool)
    off = np.abs(seen[name][at].astype(float) - own.point_data[name][at].astype(float))
    off = off[np.isfinite(off)]
    if off.size:
        _log.info(
            "%s resampled to %s points: at %d of its own %d, %r differs by %.3g at most, %.3g on "
            "average (the others are at its border)",
            type(grid).__name__,
            " x ".join(map(str, image.dimensions)),
            np.count_nonzero(at),
            len(at),
            name,
            off.max(),
            off.mean(),
        )


def masked(volume: Any, mask: Any) -> pv.ImageData:
    """Return a volume without the points at which a mask of the same grid is 0."""
    image = pv.wrap(as_image(volume, None, None)[0]).copy(deep=False)
    if isinstance(mask, str | os.PathLike):
        mask = read_volume(mask)
    if isinstance(mask, np.ndarray):  # as an array of add_volume's: along x, y, z
        labels = mask.ravel(order="F") if mask.ndim == 3 else mask
        dimensions = mask.shape if mask.ndim == 3 else image.dimensions
    else:
        grid = pv.wrap(as_image(mask, None, None)[0])
        labels, dimensions = grid.active_scalars, grid.dimensions
    if tuple(dimensions) != tuple(image.dimensions) or labels.shape != (image.n_points,):
        raise InvalidArgumentError(
            f"mask must have a label for each of the volume's {image.dimensions} points; got "
            f"{tuple(dimensions)}"
        )
    hidden = np.where(np.asarray(labels) == 0, _HIDDEN, 0).astype(np.uint8)
    before = image.point_data.get("vtkGhostType", np.uint8(0))
    image.point_data["vtkGhostType"] = hidden | before
    return image
