"""Arrays that stand by themselves, in HDF5 or zarr: what is said of their axes and voxels."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pyvista_vdi.errors import (
    InvalidVolumeError,
    UnsupportedError,
    VDIError,
    needing,
    warn_external,
)
from pyvista_vdi.io.stores.record import AXES, Level, Store
from pyvista_vdi.model.volume import Grid

#: The axes of an array that does not name them, by their number.
_UNNAMED = {3: AXES[2:], 4: ("t", *AXES[2:]), 5: AXES}

#: What libraries and metadata that break their format raise.
BROKEN = (OSError, KeyError, IndexError, TypeError, ValueError, AttributeError, RuntimeError)


def only_array(path: str, inner: str, found: Mapping[str, Any]) -> tuple[str, Any]:
    """Return the array that is meant, by its name or as the only one."""
    if inner in found:
        return inner, found[inner]
    if not inner and len(found) == 1:
        return next(iter(found.items()))
    known = ", ".join([f"{path}::{name}" for name in sorted(found)][:8])
    said = f"has no array {inner!r} of three or more dimensions" if inner else "holds several"
    raise InvalidVolumeError(
        f"{path} {said}: open one of {known}" if found else f"{path} holds no array of 3 dimensions"
    )


def array_store(path: str, named: tuple[str, Any], kind: str) -> Store:
    """Return an array that stands by itself, with what its attributes say of its voxels."""
    name, array = named
    axes = _axis_names(array)
    check_axes(f"{path}::{name}", axes)
    attributes = dict(array.attrs)
    unit, spacing = "", attributes.get("spacing", attributes.get("element_size_um"))
    scales = [len(dimension) for dimension in getattr(array, "dims", ())]
    if spacing is None and (any(scales) or "_ARRAY_DIMENSIONS" in attributes):
        warn_external(
            f"{path}::{name} has axes with coordinates, which are not read: points are taken as 1 "
            "apart; give read_volume or pyvista_vdi.Volume(array) spacing= and origin="
        )
    if "element_size_um" in attributes:
        unit, spacing = "micrometer", attributes["element_size_um"]
    try:
        shape = [n for n, axis in zip(array.shape, axes, strict=True) if axis in "zyx"]
        grid = grid_of(shape, spacing, attributes.get("origin"))
    except BROKEN as error:
        raise InvalidVolumeError(
            f"{path}::{name}: element_size_um, spacing and origin must be three numbers, along "
            f"z, y and x ({error})"
        ) from error
    return Store(path, (Level(name, array, grid),), axes, unit, (), kind)


def check_axes(path: str, axes: tuple[str, ...]) -> None:
    """Refuse axes among which z, y and x are not in this order."""
    if tuple(axis for axis in axes if axis in "zyx") != ("z", "y", "x"):
        raise UnsupportedError(
            f"{path} has the axes {', '.join(axes)}: z, y, x must be among them in this order; "
            "give pyvista_vdi.Volume a transposed dask array instead"
        )


def _axis_names(array: Any) -> tuple[str, ...]:
    """Return the names that zarr 3, xarray or HDF5 have for an array's axes."""
    names: Any = getattr(getattr(array, "metadata", None), "dimension_names", None)
    names = names or array.attrs.get("_ARRAY_DIMENSIONS")
    if "axistags" in array.attrs:  # of ilastik and vigra
        names = [axis["key"] for axis in json.loads(array.attrs["axistags"])["axes"]]
    names = names or [dimension.label for dimension in getattr(array, "dims", ())]
    short = [{"time": "t", "channel": "c"}.get(str(n).lower(), str(n).lower()) for n in names]
    if len(short) == array.ndim and set(short) >= {"z", "y", "x"}:
        return tuple(short)
    if array.ndim not in _UNNAMED:
        raise InvalidVolumeError(
            f"a volume has three axes, before them time and channel; got shape {array.shape}"
        )
    return _UNNAMED[array.ndim]


def grid_of(shape: Sequence[int], spacing: Any = None, origin: Any = None) -> Grid:
    """Return the grid of points whose numbers are given along z, y and x."""
    numbers = [(1.0,) * 3 if spacing is None else spacing, (0.0,) * 3 if origin is None else origin]
    along = [np.asarray(n, dtype=np.float64).ravel()[-3:][::-1].tolist() for n in numbers]
    (x, y, z), (at_x, at_y, at_z) = along
    nz, ny, nx = shape
    turn = np.diag(np.sign([x, y, z]))  # coordinates may fall
    return Grid((nx, ny, nz), (abs(x), abs(y), abs(z)), (at_x, at_y, at_z), turn)


def open_hdf5(path: str, inner: str) -> Store:
    """Open an array of an HDF5 file, by its name in it or as the only one."""
    file = _opened(path)
    try:
        return array_store(path, only_array(path, inner, _arrays_in(file)), "HDF5")
    except BaseException as error:
        file.close()  # whoever keeps the error would keep it from being written
        if isinstance(error, BROKEN) and not isinstance(error, VDIError):
            raise InvalidVolumeError(f"{path} cannot be read as HDF5: {error}") from error
        raise


def names_in(path: str | os.PathLike[str]) -> list[str]:
    """Return the names of the arrays of three axes or more in an HDF5 file."""
    with _opened(os.fspath(path)) as file:
        return list(_arrays_in(file))


def _opened(path: str) -> Any:
    with needing(f"{path} needs h5py: pip install 'pyvista-vdi[files]'"):
        import h5py
    try:
        return h5py.File(os.path.abspath(path), "r")  # noqa: PTH100 - links may differ elsewhere
    except (OSError, ValueError) as error:
        raise InvalidVolumeError(f"{path} cannot be read as HDF5: {error}") from error


def _arrays_in(file: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}

    def visit(name: str, node: Any) -> None:
        if hasattr(node, "shape") and node.ndim > 2 and node.dtype.kind in "biuf":
            found[name] = node

    file.visititems(visit)
    return found
