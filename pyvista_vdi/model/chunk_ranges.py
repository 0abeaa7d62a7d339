"""Least and largest values of chunks, kept beside the store that they were read from.

``x.zarr.ranges/`` holds a small file for each array, time and channel; where it cannot be written,
the user's cache folder does. Ranges of a store that has changed since are not used, also while it
is open.
"""

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

from pyvista_vdi.errors import InvalidVolumeError, VDIFileError
from pyvista_vdi.model.store_identity import ARRAY_FILES, local_files
from pyvista_vdi.model.user_cache import user_cache
from pyvista_vdi.model.whole_file import whole_file

Ranges = tuple[NDArray[np.float64], NDArray[np.float64]]

#: Metadata of a group or an array: a folder that has one belongs to a store.
ZARR_FILES = ("zarr.json", ".zgroup", ".zarray", ".zattrs")


def keeper_of(array: Any, index: Sequence[int | slice] | None = None) -> "RangeFile | None":
    """Return what keeps the ranges of an array's chunks, if it is in a file or a folder here.

    ``array``: others have no place. ``index``: what is taken of it: its time and its channel.
    """
    found = local_files(array)
    if found is None:
        return None
    library, path = found
    if library == "h5py":
        return RangeFile(str(path), str(path), array.name, index, array)
    folder = path.resolve()
    outermost = folder
    while any((outermost.parent / name).exists() for name in ZARR_FILES):
        outermost = outermost.parent
    name = folder.relative_to(outermost).as_posix()
    return RangeFile(str(outermost), str(folder), name, index)


class RangeFile:
    """Keeps the ranges of one array's chunks beside its store, or in the cache folder.

    ``store``: the store's file, or its outermost folder. ``data``: the file or the folder whose
    files hold the chunks. ``name``: the array's in the store. ``index``: what is taken of it.
    ``in_file``: the array, if a file that is open holds it.
    """

    def __init__(
        self,
        store: str,
        data: str,
        name: str,
        index: Sequence[int | slice] | None,
        in_file: Any = None,
    ) -> None:
        self._data = Path(data).resolve()
        taken = [str(k) for k in index or () if isinstance(k, int)]
        title = "-".join([*(name.strip("./") or "array").split("/"), *taken])
        self._name = f"{title[:80]}-{_digest(name, *taken)[:8]}.npz"
        self._store = Path(store).resolve()
        self._in_file = in_file
        self._before: str | None = None
        self._found: Ranges | None = None
        self._opened = self._as_opened()

    def check_unchanged(self) -> None:
        """Raise InvalidVolumeError if what was read when the array was opened is no more valid."""
        now = self._as_opened()
        if now[0] == self._opened[0]:
            return
        if self._in_file is None and now[1] == self._opened[1]:
            self._opened = now
            return
        if self._in_file is not None and self._in_file.id.valid:
            # While it is open, HDF5 gives whoever opens it again what it has in memory of it
            self._in_file.file.close()
        raise InvalidVolumeError(
            f"{self._data} was closed, removed or written anew since it was opened: open it again"
        )

    def _as_opened(self) -> tuple[Any, bytes]:
        """Return the state of the file that is read when the array is opened, and its content."""
        if self._in_file is not None:
            if self._in_file.id.valid and self._in_file.file.mode != "r":
                self._in_file.file.flush()  # what this process has written is in the file then
                return None, b""
            return _state(self._data), b""
        found = []
        for name in (*ARRAY_FILES, ".zattrs"):  # of zarr's format 2, attributes
            with contextlib.suppress(OSError):
                found.append((_state(self._data / name), (self._data / name).read_bytes()))
        return [state for state, _ in found], b"\0".join(content for _, content in found)

    def _places(self) -> Iterator[Path]:
        yield self._store.with_name(self._store.name + ".ranges") / self._name
        if (cache := user_cache()) is not None:
            yield cache / "ranges" / _digest(str(self._store))[:16] / self._name

    def load(self) -> Ranges | None:
        """Return the ranges, if they are of the chunks as they are now."""
        self.check_unchanged()
        now = self._fingerprint()
        if now == self._before and self._found is not None:
            return self._found
        self._before, self._found = now, None
        for place in self._places():
            with contextlib.suppress(Exception):  # whatever is wrong: they are found again
                kept = NpzFile(io.BytesIO(place.read_bytes()))  # which reads no pickles
                if self._before is not None and str(kept["of"]) == self._before:
                    self._found = kept["low"].astype(np.float64), kept["high"].astype(np.float64)
                    break
        return self._found

    def save(self, ranges: Ranges) -> None:
        """Keep ranges that were found after ``load``, unless the store has changed meanwhile."""
        if self._before is None or self._fingerprint() != self._before:
            return
        self._found = low, high = ranges
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


def _state(file: Path) -> tuple[int, ...] | None:
    """Return what changes with a file."""
    try:
        at = file.stat()
    except OSError:
        return None
    return at.st_dev, at.st_ino, at.st_size, at.st_mtime_ns


def _digest(*texts: str) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()
