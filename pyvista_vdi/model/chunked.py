"""Arrays that are read chunk by chunk: of Dask, zarr and h5py, none of which is imported here.

Whoever gives such an array has its library. Nothing is read until a part is asked for.
"""

import functools
import importlib
import itertools
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, VDIError

#: Chunks of arrays that have none.
_CHUNK_POINTS = 64


class ChunkedArray:
    """A three-dimensional array in chunks, of which parts are read as NumPy arrays.

    ``source``: whatever has ``shape``, ``dtype``, ``chunks`` and is indexed by slices. ``index``:
    what is taken of a source that has more dimensions, time and channel say: a number for each axis
    that is left out, ``slice(None)`` for z, y and x. ``checked``: turns what was read into what a
    volume holds: widened, native, C-contiguous. ``dtype``: of that.
    ``shape``, ``dtype``, ``ndim``, ``size``, ``nbytes``: as of a NumPy array (z, y, x). ``chunks``:
    points of a chunk along z, y and x, some of which may have fewer. ``source``: what messages call
    it. ``lazy``: the array as Dask has it, if it does.
    """

    ndim = 3

    def __init__(
        self,
        source: Any,
        *,
        index: Sequence[int | slice] | None = None,
        checked: Callable[[NDArray[Any]], NDArray[Any]] | None = None,
        dtype: Any = None,
    ) -> None:
        self.lazy = source if _library(source) == "dask" else None
        self._array = source
        self._index = tuple(index) if index is not None else (slice(None),) * 3
        if self.lazy is not None and index is not None:
            self.lazy = self._array = source[self._index]
            self._index = (slice(None),) * 3
        kept = [k for k, at in enumerate(self._index) if isinstance(at, slice)]
        if len(kept) != 3 or len(self._index) != len(self._array.shape):
            raise InvalidVolumeError(
                f"a volume is a three-dimensional array; got shape {tuple(source.shape)}: choose "
                "time and channel (pyvista_vdi.read_volume does), index the array, or load "
                "colours, Volume(numpy.asarray(array))"
            )
        file = _file_of(source)
        self.source = f"the {_library(source)} array of shape {tuple(source.shape)}"
        self.source += f" in {file}" if file else ""
        if any(math.isnan(n) for n in self._array.shape):
            raise InvalidVolumeError(
                f"{self.source} does not know how long its chunks are: call "
                "array.compute_chunk_sizes() first, which computes it for that"
            )
        z, y, x = (int(self._array.shape[k]) for k in kept)
        self.shape: tuple[int, int, int] = (z, y, x)
        self.dtype = np.dtype(dtype if dtype is not None else source.dtype)
        self.size = math.prod(self.shape)
        self.nbytes = self.size * self.dtype.itemsize
        # Dask has the lengths of all chunks along an axis
        chunks: Any = getattr(self._array, "chunks", None) or (_CHUNK_POINTS,) * len(self._index)
        self.chunks = tuple(
            min(int(np.max(chunks[k])), n) for k, n in zip(kept, self.shape, strict=True)
        )
        self._checked = checked
        if self.lazy is not None and (checked is not None or self.dtype != source.dtype):
            self.lazy = self._array = self.lazy.map_blocks(
                _held, checked, self.dtype, dtype=self.dtype
            )

    def __getitem__(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Read a part: three slices of step 1 (z, y, x)."""
        boxes = isinstance(box, tuple) and all(isinstance(part, slice) for part in box)
        if not boxes or len(box) != 3 or any(part.step not in (None, 1) for part in box):
            raise self._needed_whole()
        parts = iter(box)
        at = tuple(next(parts) if isinstance(k, slice) else k for k in self._index)
        try:
            found = self._array[at]
            if self.lazy is not None:
                return np.ascontiguousarray(found.compute())
        except (MemoryError, VDIError):
            raise
        except Exception as error:  # each library, and each function of Dask's, has its own
            points = ", ".join(f"{part.start or 0}:{part.stop}" for part in box)
            remedy = "the chunk there is damaged or lost; copy it from its source again"
            raise InvalidVolumeError(
                f"{self.source} cannot be read at its points [{points}] "
                f"({type(error).__name__}: {error}): "
                f"{remedy if self.lazy is None else 'what computes them fails'}"
            ) from error
        return _held(found, self._checked, self.dtype)

    def __array__(self, *_: Any, **__: Any) -> NDArray[Any]:
        """Refuse to become one array in memory by accident."""
        raise self._needed_whole()

    def __getattr__(self, name: str) -> Any:
        """Refuse in the same words what NumPy's arrays have beyond this, ``reshape`` say."""
        if not name.startswith("_") and hasattr(np.ndarray, name):
            raise self._needed_whole()
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def _needed_whole(self) -> InvalidVolumeError:
        return InvalidVolumeError(
            f"{self.source} is read chunk by chunk, by three slices of step 1 (z, y, x), and this "
            f"needs all of its {self.nbytes / 2**30:.3g} GiB in memory: pyvista_vdi.generate makes "
            "a VDI of it block by block; volume.load() reads it whole"
        )

    @property
    def files(self) -> list[Path]:
        """The files or folders that it is read from, those of a Dask graph's arrays among them."""
        layers = getattr(getattr(self.lazy, "dask", None), "layers", {}).values()
        arrays = [value for layer in layers if len(layer) == 1 for value in layer.values()]
        return [path for each in (self._array, *arrays) if (path := _file_of(each)) is not None]

    @functools.cached_property
    def ends(self) -> tuple[float, float]:
        """The least and the largest scalar, NaN left out; all chunks are read for it, once."""
        counts = [-(-n // chunk) for n, chunk in zip(self.shape, self.chunks, strict=True)]
        low, high = [np.nan], [np.nan]
        for at in itertools.product(*map(range, counts)):
            pairs = zip(at, self.chunks, strict=True)
            part = self[tuple(slice(k * n, (k + 1) * n) for k, n in pairs)]
            low.append(np.fmin.reduce(part, axis=None))
            high.append(np.fmax.reduce(part, axis=None))
        return float(np.fmin.reduce(low)), float(np.fmax.reduce(high))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_array": closed(self._array)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _array=opened(state["_array"]))

    def __repr__(self) -> str:
        return f"ChunkedArray({self.source}, {self.shape} {self.dtype}, chunks={self.chunks})"


def _library(thing: Any) -> str:
    return type(thing).__module__.partition(".")[0]


def _file_of(array: Any) -> Path | None:
    """Return an array's file, or its folder, if it is in any here."""
    if _library(array) == "h5py":
        return Path(array.file.filename).absolute()
    # A local store has its folder as `root` in zarr 3, and as `path` in zarr 2 and by fsspec
    store = getattr(array, "store", None)
    root = Path(str(getattr(store, "root", None) or getattr(store, "path", None)))
    return root / array.path if _library(array) == "zarr" and root.is_dir() else None


def closed(array: Any) -> Any:
    """Return what is pickled in place of an array: an HDF5 file's is opened again."""
    if _library(array) == "h5py":
        return os.path.abspath(array.file.filename), array.name  # noqa: PTH100 - no links
    return array


def opened(array: Any) -> Any:
    """Return the array in whose place another was pickled."""
    if not isinstance(array, tuple):
        return array
    path, name = array
    return importlib.import_module("h5py").File(path, "r")[name]


def is_chunked(array: Any) -> bool:
    """Whether an array is one that is read chunk by chunk, by who made it."""
    return isinstance(array, ChunkedArray) or (
        not isinstance(array, np.ndarray)
        and _library(array) in ("dask", "zarr", "h5py")
        and all(hasattr(array, name) for name in ("shape", "dtype", "chunks"))
    )


def _held(values: Any, checked: Callable[[Any], Any] | None, dtype: Any) -> NDArray[Any]:
    """Return what was read as a volume holds it."""
    array = np.asarray(values) if checked is None else checked(np.asarray(values))
    return np.ascontiguousarray(array, dtype=dtype)
