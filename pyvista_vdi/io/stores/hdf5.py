"""Stores of HDF5; h5py is imported where one is opened."""

from __future__ import annotations

import os
from typing import Any

from pyvista_vdi.errors import InvalidVolumeError, MissingDependencyError, VDIError
from pyvista_vdi.io.stores.arrays import BROKEN, array_store, only_array
from pyvista_vdi.io.stores.record import Store


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
    try:
        import h5py
    except ImportError as error:
        raise MissingDependencyError(
            f"{path} needs h5py ({error}): pip install 'pyvista-vdi[files]'"
        ) from error
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
