"""Volumes in stores of chunks: zarr, OME-Zarr and HDF5; the metadata are read, no voxel is.

zarr and h5py are optional, and imported where a store of theirs is opened.
"""

from __future__ import annotations

from pyvista_vdi.io.stores.hdf5 import names_in
from pyvista_vdi.io.stores.opening import is_store, open_store, open_volume, store_at
from pyvista_vdi.io.stores.record import Level, Store, StoredVolume

__all__ = [
    "Level",
    "Store",
    "StoredVolume",
    "is_store",
    "names_in",
    "open_store",
    "open_volume",
    "store_at",
]
