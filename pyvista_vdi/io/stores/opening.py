"""Where a store is opened: its kind, and what of it is meant."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi import registry
from pyvista_vdi.io.stores.hdf5 import open_hdf5
from pyvista_vdi.io.stores.record import Store, StoredVolume, chosen_level
from pyvista_vdi.io.stores.zarr import open_zarr
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.model.whole_file import as_path

_HDF5 = (".h5", ".hdf5", ".he5")
#: Metadata of a group or an array of zarr: a folder that has one belongs to a store.
_ZARR_FILES = ("zarr.json", ".zgroup", ".zarray", ".zattrs")


def is_store(path: str | os.PathLike[str]) -> bool:
    """Whether a path looks like one that :func:`open_volume` opens, by its name or its files."""
    outer, inner = _parts(path)
    if inner or outer.rstrip("/\\").lower().endswith((".zarr", *_HDF5)):
        return True
    return os.path.isdir(outer) and any(  # noqa: PTH112 - pathlib's raises for too long names
        (Path(outer) / name).is_file() for name in _ZARR_FILES
    )


def open_volume(
    path: str | os.PathLike[str],
    *,
    level: int | str = "auto",
    camera: Any = None,
    window_size: Sequence[int] | None = None,
    time: int = 0,
    channel: int | str = 0,
) -> Volume:
    """Open a volume in a store of chunks, of which only the metadata are read.

    Any other file is read whole, by :func:`read_volume`.

    Parameters
    ----------
    path : path-like
        ``"x.zarr"``, ``"x.ome.zarr"`` or ``"x.h5::/path"``: a zarr array, an image of OME-Zarr 0.4
        or 0.5, an HDF5 file. What follows ``::`` is a group or an array in it; without it the only
        one.
    level : int or "auto"
        Level of a multi-scale image, 0 is the finest. ``"auto"``: the coarsest whose voxels are
        still as fine as half a list's width where the volume is nearest to V_O; without a camera
        the finest.
    camera : Camera or anything that :func:`generate` takes as one, optional
        V_O.
    window_size : (int, int), optional
        Lists of V_O along x and y; with ``camera``.
    time : int
        Which time step.
    channel : int or str
        Which channel, by its number or its name.

    Returns
    -------
    StoredVolume
        A :class:`Volume` that is read where a part is needed. Its ``describe()`` says which level
        it is and why.

    Raises
    ------
    MissingDependencyError
        If zarr or h5py is not installed.
    InvalidVolumeError
        If there is no store, or its metadata break their format.
    UnsupportedError
        If it is of another version, or OME-Zarr 0.5 where zarr is older than 3; if its axes are
        not z, y, x in this order behind time and channel.
    InvalidArgumentError
        If it has no such level, time or channel.
    """
    if is_store(path):
        return open_store(path, level, camera, window_size, time, channel)
    chosen = {"time": time, "channel": channel}
    given: dict[str, Any] = {k: v for k, v in chosen.items() if not np.array_equal(v, 0)}
    return registry.method("Volume.read")(path, level=level, **given)  # type: ignore[no-any-return]


def open_store(
    path: str | os.PathLike[str],
    level: int | str = "auto",
    camera: Any = None,
    window_size: Sequence[int] | None = None,
    time: int = 0,
    channel: int | str = 0,
) -> StoredVolume:
    """Open a level of a store; arguments as of :func:`open_volume`."""
    store = store_at(path)
    number, why = chosen_level(store, level, camera, window_size)
    # Of four axes without names the first may be time or channel, whatever else time is
    either = "t" in store.axes and "c" not in store.axes and not store.named
    if either and np.array_equal(time, 0) and not isinstance(channel, str):
        time, channel = channel, 0
    return StoredVolume(store, number, why, time, channel)


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
