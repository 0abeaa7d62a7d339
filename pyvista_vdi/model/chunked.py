"""Arrays that are read chunk by chunk: of Dask, zarr and h5py, none of which is imported here.

Whoever gives such an array has its library. Nothing is read until a part is asked for.
"""

import functools
import importlib
import itertools
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, VDIError

#: Chunks of arrays that have none.
_CHUNK_POINTS = 64

#: Voxel types that the kernels read as they are.
VOXEL_TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")

#: Types that one of those represents without loss; of 64-bit integers those up to 2^53.
_WIDENED = {"bool": "uint8", "float16": "float32", "int64": "float64", "uint64": "float64"}

#: Attributes by which arrays in files say that their values are others than those that are stored.
_PACKING = ("scale_factor", "add_offset", "_Unsigned")
#: Attributes with a number that stands for nothing, and NaN as zarr, HDF5 and xarray write it.
_MISSING, _NAN = ("_FillValue", "missing_value"), ("nan", "[nan]", "AAAAAAAA+H8=")


class Reopened:
    """Has an ``array``; one of an HDF5 file is pickled as its place, and opened again."""

    array: Any

    def __getstate__(self) -> dict[str, Any]:
        array = self.array
        if library_of(array) == "h5py":
            array = os.path.abspath(array.file.filename), array.name  # noqa: PTH100 - no links
        return {**self.__dict__, "array": array}

    def __setstate__(self, state: dict[str, Any]) -> None:
        array = state["array"]
        if isinstance(array, tuple):
            array = importlib.import_module("h5py").File(array[0], "r")[array[1]]
        self.__dict__.update(state, array=array)


class ChunkedArray(Reopened):
    """A three-dimensional array in chunks, of which parts are read as NumPy arrays.

    ``source``: whatever has ``shape``, ``dtype``, ``chunks`` and is indexed by slices. ``index``:
    what is taken of a source that has more dimensions, time and channel say: a number for each axis
    that is left out, ``slice(None)`` for z, y and x.

    ``shape``, ``dtype``, ``ndim``, ``size``, ``nbytes``: as of a NumPy array (z, y, x). ``chunks``:
    points of a chunk along z, y and x, some of which may have fewer. ``source``: what messages call
    it. ``lazy``: whether Dask computes it.
    """

    ndim = 3

    def __init__(self, source: Any, *, index: Sequence[int | slice] = (slice(None),) * 3) -> None:
        told = getattr(source, "attrs", {})
        said = [name for name in _PACKING if name in told]
        said += [name for name in _MISSING if name in told and str(told[name]) not in _NAN]
        if said:
            raise InvalidVolumeError(
                f"the array's values are packed ({', '.join(said)}): open it by xarray, which "
                'unpacks them, and give pyvista_vdi.Volume(dataset["name"].data)'
            )
        self.array, self._index = source, tuple(index)
        self.lazy = library_of(source) == "dask"
        kept = [k for k, at in enumerate(self._index) if isinstance(at, slice)]
        if len(kept) != 3 or len(self._index) != len(source.shape):
            raise InvalidVolumeError(
                f"a volume is a three-dimensional array; got shape {tuple(source.shape)}: choose "
                "time and channel (pyvista_vdi.read_volume does), index the array, or load "
                "colours, Volume(numpy.asarray(array))"
            )
        file = _file_of(source)
        self.source = f"the {library_of(source)} array of shape {tuple(source.shape)}"
        self.source += f" in {file}" if file else ""
        if any(math.isnan(n) for n in source.shape):
            raise InvalidVolumeError(
                f"{self.source} does not know how long its chunks are: call "
                "array.compute_chunk_sizes() first, which computes it for that"
            )
        z, y, x = (int(source.shape[k]) for k in kept)
        self.shape: tuple[int, int, int] = (z, y, x)
        self.dtype = voxel_type(source.dtype)
        self.size = math.prod(self.shape)
        self.nbytes = self.size * self.dtype.itemsize
        # Dask has the lengths of all chunks along an axis
        chunks: Any = source.chunks or (_CHUNK_POINTS,) * len(self._index)
        self.chunks = tuple(
            min(int(np.max(chunks[k])), n) for k, n in zip(kept, self.shape, strict=True)
        )
        if self.lazy and self.dtype != source.dtype:
            self.array = source.map_blocks(held, dtype=self.dtype)

    def __getitem__(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Read a part: three slices of step 1 (z, y, x)."""
        boxes = isinstance(box, tuple) and all(isinstance(part, slice) for part in box)
        if not boxes or len(box) != 3 or any(part.step not in (None, 1) for part in box):
            raise self._needed_whole()
        parts = iter(box)
        at = tuple(next(parts) if isinstance(k, slice) else k for k in self._index)
        try:
            found = np.asarray(self.array[at])  # which Dask computes
        except (MemoryError, VDIError):
            raise
        except Exception as error:  # each library, and each function of Dask's, has its own
            points = ", ".join(f"{part.start or 0}:{part.stop}" for part in box)
            remedy = "the chunk there is damaged or lost; copy it from its source again"
            raise InvalidVolumeError(
                f"{self.source} cannot be read at its points [{points}] "
                f"({type(error).__name__}: {error}): "
                f"{'what computes them fails' if self.lazy else remedy}"
            ) from error
        return held(found)

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
        layers = getattr(getattr(self.array, "dask", None), "layers", {}).values()
        arrays = [value for layer in layers if len(layer) == 1 for value in layer.values()]
        return [path for each in (self.array, *arrays) if (path := _file_of(each)) is not None]

    @functools.cached_property
    def ends(self) -> tuple[float, float]:
        """The least and the largest scalar, NaN left out; all chunks are read for it, once."""
        dz, dy, dx = self.chunks
        low, high = [], []
        for z, y, x in itertools.product(*map(range, (0, 0, 0), self.shape, self.chunks)):
            part = self[z : z + dz, y : y + dy, x : x + dx]
            low.append(np.fmin.reduce(part, axis=None))
            high.append(np.fmax.reduce(part, axis=None))
        return float(np.fmin.reduce(low)), float(np.fmax.reduce(high))


def library_of(thing: Any) -> str:
    """Return the name of the package that made a thing."""
    return type(thing).__module__.partition(".")[0]


def _file_of(array: Any) -> Path | None:
    """Return an array's file, or its folder, if it is in any here."""
    if library_of(array) == "h5py":
        return Path(array.file.filename).absolute()
    # A local store has its folder as `root` in zarr 3, and as `path` in zarr 2 and by fsspec
    store = getattr(array, "store", None)
    root = Path(str(getattr(store, "root", None) or getattr(store, "path", None)))
    return root / array.path if library_of(array) == "zarr" and root.is_dir() else None


def voxel_type(dtype: Any) -> np.dtype[Any]:
    """Return the type that voxels of a type are held as: widened, where kernels do not read it."""
    kind = np.dtype(dtype).newbyteorder("=").name
    if _WIDENED.get(kind, kind) not in VOXEL_TYPES:
        raise InvalidVolumeError(
            f"voxels of type {dtype} are not supported: convert to one of {', '.join(VOXEL_TYPES)}"
        )
    return np.dtype(_WIDENED.get(kind, kind))


def held(values: Any) -> NDArray[Any]:
    """Return values as a volume holds them: widened without loss, native, C-contiguous."""
    array = np.asarray(values)
    if array.dtype.kind in "iu" and array.dtype.itemsize == 8 and array.size:
        widest = max(abs(int(array.min())), abs(int(array.max())))
        if widest > 2**53:
            raise InvalidVolumeError(
                f"voxels of type {array.dtype} hold values up to {widest}, which float64 cannot "
                "represent exactly: scale them, or convert them yourself"
            )
    return np.ascontiguousarray(array, dtype=voxel_type(array.dtype))
