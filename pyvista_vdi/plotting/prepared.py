"""What ``add_vdi`` makes of paths, stores, masks and grids that are not uniform."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv

from pyvista_vdi.errors import InvalidArgumentError, VDIError
from pyvista_vdi.io import is_vdi_file, read
from pyvista_vdi.io.files import holds
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.io.volumes import read_volume
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.plotting.actor import first_camera
from pyvista_vdi.plotting.refinement import load
from pyvista_vdi.plotting.uniform import UniformGrid
from pyvista_vdi.plotting.volumes import as_grid
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image


def prepared(plotter: Any, volume: Any, asked: Any) -> tuple[Any, StoredVolume | None]:
    """Return what can be shown of what is given, and the level of a store that this is.

    ``asked`` is an ``Addition``. What is to be resampled or masked becomes a
    :class:`~pyvista_vdi.plotting.uniform.UniformGrid`.
    """
    stored, scalars = None, asked.array.scalars
    if isinstance(volume, str | os.PathLike):
        ours = is_vdi_file(volume) or holds(volume) in ("series", "set")
        array = scalars if isinstance(scalars, str) else None
        volume = read(volume) if ours else read_volume(volume, array=array)
    if isinstance(volume, StoredVolume):
        stored = volume.in_view(
            framing_camera(plotter, volume.bounds), window_size=plotter.window_size
        )
        volume = load(stored)
    made = isinstance(volume, VDI | DeferredVDI | VDICollection) or is_vdi_image(volume)
    if made or (asked.making.resample is None and asked.making.mask is None):
        return volume, stored  # of a VDI both are refused
    grid, name = as_grid(
        volume, scalars, asked.making.resolution, uniform=asked.making.resample is None
    )
    uniform = UniformGrid(
        grid,
        name,
        asked.array.preference,
        resample=asked.making.resample,
        mask=None if asked.making.mask is None else _mask(asked.making.mask, grid, stored),
        categorical=bool(asked.look.categories),
    )
    # It has the points of one level
    return uniform, None if stored is None else stored.at_level(stored.level)


def _mask(mask: Any, grid: Any, stored: StoredVolume | None) -> Any:
    """Return a mask as a grid, or as a NumPy array of labels; of a store the volume's level."""
    if isinstance(mask, str) and mask in pv.wrap(grid).array_names:
        raise InvalidArgumentError(
            f"mask={mask!r} names an array of the volume: pass its values, mask=volume[{mask!r}]"
        )
    if isinstance(mask, np.ndarray):
        return mask
    named = repr(mask) if isinstance(mask, str | os.PathLike) else type(mask).__name__
    try:
        if isinstance(mask, str | os.PathLike):
            mask = read_volume(mask)
        if isinstance(mask, StoredVolume):
            mask = load(mask if stored is None else mask.at_level(stored.level))
        return as_grid(mask, None, None, uniform=False)[0]
    except VDIError as error:
        raise InvalidArgumentError(
            f"mask must be labels, as an array or a grid or in a file; got {named}: {error}"
        ) from error


def framing_camera(plotter: Any, bounds: Sequence[float]) -> Camera:
    """Return the plotter's view, or about what it will be where nobody has set it."""
    return Camera.from_any(first_camera(plotter.renderer, bounds))
