"""Stores of HDF5; h5py is imported where one is opened."""

from __future__ import annotations

import os
from typing import Any

from pyvista_vdi.errors import InvalidVolumeError, MissingDependencyError, VDIError
from pyvista_vdi.io.coordinates import meant_of_nexus
from pyvista_vdi.io.stores.arrays import BROKEN, array_store, only_array
from pyvista_vdi.io.stores.record import Store


def open_hdf5(path: str, inner: str) -> Store:
    """Open an array of an HDF5 file, by its name in it or as the only one."""
    try:
        import h5py
    except ImportError as error:
        raise MissingDependencyError(
            f"{path} needs h5py ({error}): pip install 'pyvista-vdi[hdf5]'"
        ) from error
    try:
        file = h5py.File(os.path.abspath(path), "r")  # noqa: PTH100 - links may differ elsewhere
    except (OSError, ValueError) as error:
        raise InvalidVolumeError(f"{path} cannot be read as HDF5: {error}") from error
    try:
        meant = {name: file[name] for name in meant_of_nexus(file)}
        found = meant if meant and not inner else {**arrays_in(file), **meant}
        return array_store(path, only_array(path, inner, found), "HDF5")
    except BaseException as error:
        file.close()  # whoever keeps the error would keep it from being written
        if isinstance(error, BROKEN) and not isinstance(error, VDIError):
            raise InvalidVolumeError(f"{path} cannot be read as HDF5: {error}") from error
        raise


def arrays_in(file: Any) -> dict[str, Any]:
    """Return the arrays of three axes or more in an HDF5 file, by their names."""
    found: dict[str, Any] = {}

    def visit(name: str, node: Any) -> None:
        # "#" begins what MATLAB keeps for itself
        if (
            hasattr(node, "shape")
            and node.ndim > 2
            and node.dtype.kind in "biuf"
            and name[0] != "#"
        ):
            found[name] = node

    file.visititems(visit)
    return found
