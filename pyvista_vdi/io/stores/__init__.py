"""Volumes in stores of chunks: zarr, OME-Zarr and HDF5; the metadata are read, no voxel is.

zarr and h5py are optional, and imported where a store of theirs is opened.
"""

from __future__ import annotations

import os
from pathlib import Path

from pyvista_vdi.io.stores.arrays import names_in, open_hdf5
from pyvista_vdi.io.stores.record import Level, Store, StoredVolume
from pyvista_vdi.io.stores.zarr import open_zarr
from pyvista_vdi.model.whole_file import as_path

__all__ = ["Level", "Store", "StoredVolume", "is_store", "names_in", "store_at"]

_HDF5 = (".h5", ".hdf5", ".he5")
#: Metadata of a group or an array of zarr: a folder that has one belongs to a store.
_ZARR_FILES = ("zarr.json", ".zgroup", ".zarray", ".zattrs")


def is_store(path: str | os.PathLike[str]) -> bool:
    """Whether a path looks like a store, by its name or its files."""
    outer, inner = _parts(path)
    if inner or outer.rstrip("/\\").lower().endswith((".zarr", *_HDF5)):
        return True
    return os.path.isdir(outer) and any(  # noqa: PTH112 - pathlib's raises for too long names
        (Path(outer) / name).is_file() for name in _ZARR_FILES
    )


def store_at(path: str | os.PathLike[str]) -> Store:
    """Return what the metadata of a store say."""
    outer, inner = _parts(path)
    named = outer.rstrip("/\\").lower()
    hdf5 = named.endswith(_HDF5) or (os.path.isfile(outer) and not named.endswith(".zarr"))  # noqa: PTH113
    return open_hdf5(outer, inner) if hdf5 else open_zarr(outer, inner)


def _parts(path: str | os.PathLike[str]) -> tuple[str, str]:
    as_path(path)
    outer, _, inner = os.fspath(path).partition("::")
    return outer, inner.strip("/")
