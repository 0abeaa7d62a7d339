"""Least and largest values of chunks, kept beside the store that they were read from.

``x.zarr.ranges/`` holds a small file for each array, time and channel; where it cannot be written,
the user's cache folder does. Ranges of a store that has changed since are not used.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.io.whole_file import whole_file
from pyvista_vdi.model.user_cache import user_cache

Ranges = tuple[NDArray[np.float64], NDArray[np.float64]]

#: Metadata of a group or an array: a folder that has one belongs to a store.
ZARR_FILES = ("zarr.json", ".zgroup", ".zarray", ".zattrs")


def keeper_of(array: Any, index: Sequence[int | slice] | None = None) -> RangeFile | None:
    """Return what keeps the ranges of an array's chunks, if it is in a file or a folder here.

    Parameters
    ----------
    array : zarr.Array or h5py.Dataset
        Others have no place.
    index : sequence of int or slice, optional
        What is taken of it: its time and its channel.
    """
    library = type(array).__module__.partition(".")[0]
    if library == "h5py":
        return RangeFile(array.file.filename, array.file.filename, array.name, index)
    if library != "zarr":
        return None
    # A local store has its folder as `root` in zarr 3, and as `path` in zarr 2
    store = getattr(array, "store", None)
    root = getattr(store, "root", None) or getattr(store, "path", None)
    if root is None or not Path(str(root)).is_dir():
        return None
    folder = (Path(str(root)) / array.path).resolve()
    outermost = folder
    while any((outermost.parent / name).exists() for name in ZARR_FILES):
        outermost = outermost.parent
    name = folder.relative_to(outermost).as_posix()
    return RangeFile(str(outermost), str(folder), name, index)


class RangeFile:
    """Keeps the ranges of one array's chunks beside its store, or in the cache folder.

    Parameters
    ----------
    store : str
        The store's file, or its outermost folder.
    data : str
        The file or the folder whose files hold the chunks.
    name : str
        The array's in the store.
    index : sequence of int or slice, optional
        What is taken of it.
    """

    def __init__(
        self, store: str, data: str, name: str, index: Sequence[int | slice] | None
    ) -> None:
        self._data = Path(data).resolve()
        taken = [str(k) for k in index or () if isinstance(k, int)]
        title = "-".join([*(name.strip("./") or "array").split("/"), *taken])
        self._name = f"{title[:80]}-{_digest(name, *taken)[:8]}.npz"
        self._store = Path(store).resolve()
        self._before: str | None = None

    def _places(self) -> Iterator[Path]:
        yield self._store.with_name(self._store.name + ".ranges") / self._name
        if (cache := user_cache()) is not None:
            yield cache / "ranges" / _digest(str(self._store))[:16] / self._name

    def load(self) -> Ranges | None:
        """Return the ranges, if they are of the chunks as they are now."""
        self._before = self._fingerprint()
        for place in self._places():
            with contextlib.suppress(Exception):  # whatever is wrong: they are found again
                kept = NpzFile(io.BytesIO(place.read_bytes()))  # which reads no pickles
                if self._before is not None and str(kept["of"]) == self._before:
                    return kept["low"].astype(np.float64), kept["high"].astype(np.float64)
        return None

    def save(self, ranges: Ranges) -> None:
        """Keep ranges that were found after ``load``, unless the store has changed meanwhile."""
        if self._before is None or self._fingerprint() != self._before:
            return
        low, high = ranges
        for place in self._places():
            with contextlib.suppress(OSError, VDIFileError):
                place.parent.mkdir(parents=True, exist_ok=True)
                with whole_file(place) as stream:
                    np.savez_compressed(stream, of=np.array(self._before), low=low, high=high)
                return

    def _fingerprint(self) -> str | None:
        """Return what changes with any file: their names, lengths and times."""
        data = str(self._data)
        found = [data] if self._data.is_file() else []
        for folder, _, files in os.walk(data):  # nothing, of a file
            found += [f"{folder}/{name}" for name in files]
        try:
            states = [(name, os.stat(name)) for name in sorted(found)]  # noqa: PTH116 - millions
        except OSError:
            return None
        return _digest(
            *(f"{name[len(data) :]} {at.st_size} {at.st_mtime_ns}" for name, at in states)
        )


def _digest(*texts: str) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()
