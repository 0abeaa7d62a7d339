"""Volumes in stores of chunks: zarr, OME-Zarr and HDF5; the metadata are read, no voxel is.

zarr and h5py are optional, and imported where a store of theirs is opened.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi import registry
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
    VDIError,
)
from pyvista_vdi.io.coordinates import attributes_of, meant_of_nexus
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.chunk_ranges import ZARR_FILES
from pyvista_vdi.model.chunked import closed, opened
from pyvista_vdi.model.levels import required_level
from pyvista_vdi.model.volume import Grid, Volume, chunked_array
from pyvista_vdi.model.whole_file import as_path

_HDF5 = (".h5", ".hdf5", ".he5")

#: The axes of OME-Zarr, in their order.
_AXES = ("t", "c", "z", "y", "x")
#: Those of an array that does not name them, by their number.
_UNNAMED = {3: _AXES[2:], 4: ("t", *_AXES[2:]), 5: _AXES}

#: Lengths in metres, by the names that OME-Zarr takes of UDUNITS-2.
_UNITS = {
    "angstrom": 1e-10,
    "picometer": 1e-12,
    "nanometer": 1e-9,
    "micrometer": 1e-6,
    "micron": 1e-6,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "decimeter": 1e-1,
    "meter": 1.0,
    "kilometer": 1e3,
    "inch": 0.0254,
}

#: What libraries and metadata that break their format raise.
_BROKEN = (OSError, KeyError, IndexError, TypeError, ValueError, AttributeError, RuntimeError)


@dataclass(frozen=True)
class Level:
    """One array of a store, and where its points are.

    Attributes
    ----------
    path : str
        In the store.
    array : zarr.Array or h5py.Dataset
        As the library has it, with all its axes.
    grid : Grid
        Of its points along x, y and z.
    """

    path: str
    array: Any
    grid: Grid

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "array": closed(self.array)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, array=opened(state["array"]))


@dataclass(frozen=True)
class Store:
    """What the metadata of a store say.

    Attributes
    ----------
    path : str
        As it was opened.
    levels : tuple of Level
        From the finest to the coarsest.
    axes : tuple of str
        ``t``, ``c``, ``z``, ``y``, ``x`` or others, in the order of the arrays.
    unit : str
        Of lengths; empty where it is not known.
    channels : tuple of str
        Names, where they are known.
    kind : str
        What it is, such as ``"OME-Zarr 0.5"``.
    clock : (float, float)
        Time from step to step, and that of the first.
    named : bool
        Whether it names its axes.
    """

    path: str
    levels: tuple[Level, ...]
    axes: tuple[str, ...]
    unit: str = ""
    channels: tuple[str, ...] = ()
    kind: str = "zarr"
    clock: tuple[float, float] = (1.0, 0.0)
    named: bool = True

    @property
    def times(self) -> tuple[float, ...]:
        """Of its time steps: 0, 1, 2 … where it does not say them."""
        shape = dict(zip(self.axes, self.levels[0].array.shape, strict=True))
        step, first = self.clock
        return tuple(first + step * i for i in range(shape.get("t", 1)))

    def index(self, time: int, channel: int | str) -> tuple[int | slice, ...]:
        """Return what is taken of its arrays: a number along time and channel, all of z, y, x."""
        if isinstance(channel, str):
            if channel not in self.channels:
                raise InvalidArgumentError(
                    f"{self.path} has no channel {channel!r}: its channels are "
                    f"{', '.join(self.channels) or 'not named, give a number'}"
                )
            channel = self.channels.index(channel)
        wanted = {"t": ("time", time), "c": ("channel", channel)}
        shape = dict(zip(self.axes, self.levels[0].array.shape, strict=True))
        for axis, (name, number) in wanted.items():
            count = shape.get(axis, 1)
            if not isinstance(number, (int, np.integer)) or not 0 <= number < count:
                raise InvalidArgumentError(
                    f"{self.path} has {count} along {name}, 0 to {count - 1}; got {number!r}"
                )
        for axis, count in shape.items():
            if axis not in _AXES and count != 1:
                raise UnsupportedError(
                    f"{self.path} has {count} points along an axis {axis!r}, which is neither "
                    "time, channel, z, y nor x: give a Volume of an indexed dask array instead"
                )
        return tuple(
            slice(None) if axis in "zyx" else int(wanted.get(axis, ("", 0))[1])
            for axis in self.axes
        )


class StoredVolume(Volume):
    """A level of a store as a volume whose voxels are read chunk by chunk.

    Made by :func:`open_volume`. Colours and opacities are the same for all levels, if ``clim`` is
    given: lengths are the same, and opacities refer to the finest level's distance of voxels.

    Attributes
    ----------
    store : Store
        What the store says of itself: its levels, axes, unit and channels.
    level : int
        Which one this is; 0 is the finest.
    why : str
        Why it was chosen.
    time : int
        Which step it is.
    channel : int or str
        Which channel it is.
    """

    def __init__(
        self, store: Store, level: int, why: str, time: int = 0, channel: int | str = 0
    ) -> None:
        chosen, index = store.levels[level], store.index(time, channel)
        grid = chosen.grid
        number: Any = index[store.axes.index("c")] if "c" in store.axes else 0
        super().__init__(
            chunked_array(chosen.array, index),
            grid.spacing,
            grid.origin,
            grid.direction,
            name=store.channels[number] if number < len(store.channels) else "values",
        )
        self.store, self.level, self.why = store, level, why
        self.time, self.channel, self.unit = time, channel, store.unit
        self.unit_distance = store.levels[0].grid.default_unit_distance

    def at_level(
        self,
        level: int | str = "auto",
        camera: Camera | None = None,
        window_size: Sequence[int] | None = None,
    ) -> StoredVolume:
        """Return another level, chosen as :func:`open_volume` does."""
        number, why = _chosen(self.store, level, camera, window_size)
        return StoredVolume(self.store, number, why, self.time, self.channel)

    def at_time(self, time: int) -> StoredVolume:
        """Return another time step, by its index: ``store.times`` has as many."""
        return StoredVolume(self.store, self.level, self.why, time, self.channel)

    def describe(self) -> str:
        """Return which level it is, and why, as one line."""
        nx, ny, nz = self.dimensions
        return (
            f"level {self.level} of {len(self.store.levels)} ({nx} x {ny} x {nz} points): "
            f"{self.why}"
        )


def is_store(path: str | os.PathLike[str]) -> bool:
    """Whether a path looks like one that :func:`open_volume` opens, by its name or its files."""
    outer, inner = _parts(path)
    if inner or outer.rstrip("/\\").lower().endswith((".zarr", *_HDF5)):
        return True
    return os.path.isdir(outer) and any(  # noqa: PTH112 - pathlib's raises for too long names
        (Path(outer) / name).is_file() for name in ZARR_FILES
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
    """Open a store; arguments as of :func:`open_volume`."""
    outer, inner = _parts(path)
    named = outer.rstrip("/\\").lower()
    hdf5 = named.endswith(_HDF5) or (os.path.isfile(outer) and not named.endswith(".zarr"))  # noqa: PTH113
    store = _open_hdf5(outer, inner) if hdf5 else _open_zarr(outer, inner)
    number, why = _chosen(store, level, camera, window_size)
    no_time = np.array_equal(time, 0)  # whatever else it is, a number or not
    either = "t" in store.axes and "c" not in store.axes and not store.named
    if either and no_time and not isinstance(channel, str):
        time, channel = channel, 0  # of four axes without names the first may be either
    return StoredVolume(store, number, why, time, channel)


def _parts(path: str | os.PathLike[str]) -> tuple[str, str]:
    as_path(path)
    outer, _, inner = os.fspath(path).partition("::")
    return outer, inner.strip("/")


def _chosen(
    store: Store, level: int | str, camera: Any, window_size: Sequence[int] | None
) -> tuple[int, str]:
    count = len(store.levels)
    if not (isinstance(level, str) and level == "auto"):
        if not isinstance(level, (int, np.integer)) or not 0 <= level < count:
            raise InvalidArgumentError(
                f'level must be "auto" or from 0, the finest, to {count - 1}, as {store.path} has '
                f"{count}; got {level!r}"
            )
        return int(level), "asked for"
    if (camera is None) != (window_size is None):
        raise InvalidArgumentError(
            "a level is chosen for a camera and a window_size: give both, or neither for the finest"
        )
    if camera is None or window_size is None:
        return 0, "the finest, as no view was given" if count > 1 else "the only one"
    grids = [one.grid for one in store.levels]
    return required_level(grids, Camera.from_any(camera), window_size, store.unit)


def _open_hdf5(path: str, inner: str) -> Store:
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
        return array_store(path, _only(path, inner, found), "HDF5")
    except BaseException as error:
        file.close()  # whoever keeps the error would keep it from being written
        if isinstance(error, _BROKEN) and not isinstance(error, VDIError):
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


def _only(path: str, inner: str, found: Mapping[str, Any]) -> tuple[str, Any]:
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
    axes, are_named = _axis_names(array)
    _check_axes(f"{path}::{name}", axes)
    attributes = attributes_of(array, axes)
    unit, spacing = attributes.get("unit of length", ""), attributes.get("spacing")
    if "element_size_um" in attributes:
        unit, spacing = "micrometer", attributes["element_size_um"]
    try:
        shape = [n for n, axis in zip(array.shape, axes, strict=True) if axis in "zyx"]
        grid = _grid(shape, spacing, attributes.get("origin"))
    except _BROKEN as error:
        raise InvalidVolumeError(
            f"{path}::{name}: element_size_um, spacing and origin must be three numbers, along "
            f"z, y and x ({error})"
        ) from error
    return Store(path, (Level(name, array, grid),), axes, unit, (), kind, named=are_named)


def _check_axes(path: str, axes: tuple[str, ...]) -> None:
    if tuple(axis for axis in axes if axis in "zyx") != ("z", "y", "x"):
        raise UnsupportedError(
            f"{path} has the axes {', '.join(axes)}: z, y, x must be among them in this order; "
            "give pyvista_vdi.Volume a transposed dask array instead"
        )


def _axis_names(array: Any) -> tuple[tuple[str, ...], bool]:
    """Return the names that zarr 3, xarray or HDF5 have for an array's axes; whether they do."""
    names: Any = getattr(getattr(array, "metadata", None), "dimension_names", None)
    names = names or array.attrs.get("_ARRAY_DIMENSIONS")
    if "axistags" in array.attrs:  # of ilastik and vigra
        names = [axis["key"] for axis in json.loads(array.attrs["axistags"])["axes"]]
    names = names or [dimension.label for dimension in getattr(array, "dims", ())]
    short = [{"time": "t", "channel": "c"}.get(str(n).lower(), str(n).lower()) for n in names]
    if len(short) == array.ndim and set(short) >= {"z", "y", "x"}:
        return tuple(short), True
    if array.ndim not in _UNNAMED:
        raise InvalidVolumeError(
            f"a volume has three axes, before them time and channel; got shape {array.shape}"
        )
    return _UNNAMED[array.ndim], False


def _grid(shape: Sequence[int], spacing: Any = None, origin: Any = None) -> Grid:
    """Return the grid of points whose numbers are given along z, y and x."""
    numbers = [(1.0,) * 3 if spacing is None else spacing, (0.0,) * 3 if origin is None else origin]
    along = [np.asarray(n, dtype=np.float64).ravel()[-3:][::-1].tolist() for n in numbers]
    (x, y, z), (at_x, at_y, at_z) = along
    nz, ny, nx = shape
    turn = np.diag(np.sign([x, y, z]))  # coordinates may fall
    return Grid((nx, ny, nz), (abs(x), abs(y), abs(z)), (at_x, at_y, at_z), turn)


def _open_zarr(path: str, inner: str) -> Store:
    try:
        import zarr
    except ImportError as error:
        raise MissingDependencyError(
            f"{path} needs zarr ({error}): pip install 'pyvista-vdi[zarr]'"
        ) from error
    if int(zarr.__version__.split(".")[0]) < 3 and (Path(path) / "zarr.json").exists():
        raise UnsupportedError(
            f"{path} is of zarr's format 3, as OME-Zarr 0.5 is, and zarr {zarr.__version__} reads "
            "format 2 alone: install zarr 3, which needs Python 3.11 or newer"
        )
    try:
        # Other processes, and this one in another folder, open the same one
        node: Any = zarr.open(path if "://" in path else os.path.abspath(path), mode="r")  # noqa: PTH100
        node = node[inner] if inner else node
    except Exception as error:  # each version and each kind of store has errors of its own
        raise InvalidVolumeError(
            f"{path}{'::' + inner if inner else ''} cannot be read as zarr: {error or 'not there'}"
        ) from error
    if hasattr(node, "shape"):
        return array_store(path, (inner, node), "zarr")
    attributes = node.attrs.asdict()
    if "bioformats2raw.layout" in {*attributes, *attributes.get("ome", {})} and "0" in node:
        node, inner = node["0"], f"{inner}/0".strip("/")
        attributes = node.attrs.asdict()
    described = attributes.get("ome", attributes)
    if "plate" in described or "well" in described:
        raise UnsupportedError(f"{path} is a plate of many images: open one, such as {path}::A/1/0")
    if "multiscales" not in described:
        before = f"{inner}/" if inner else ""
        try:
            arrays = {before + name: array for name, array in node.arrays() if array.ndim > 2}
        except _BROKEN as error:
            raise InvalidVolumeError(f"{path} cannot be read as zarr: {error}") from error
        return array_store(path, _only(path, "", arrays), "zarr")
    try:
        return _multiscale(path, node, described, "ome" in attributes)
    except _BROKEN as error:
        if isinstance(error, (InvalidVolumeError, UnsupportedError)):
            raise
        raise InvalidVolumeError(
            f"the metadata of {path} break OME-Zarr ({type(error).__name__}: {error}): write them "
            "anew, or open an array of it by its name, as x.zarr::0"
        ) from error


def _multiscale(path: str, group: Any, described: Mapping[str, Any], in_ome: bool) -> Store:
    image = described["multiscales"][0]
    version = str((described if in_ome else image).get("version", "0.4"))
    if version not in (("0.5",) if in_ome else ("0.4",)):
        raise UnsupportedError(
            f"{path} is of OME-Zarr {version}: 0.4 and 0.5 are read; open an array of it by its "
            f"name instead ({path}::0), which knows no spacing"
        )
    kinds = {"time": "t", "channel": "c"}
    axes = tuple(kinds.get(axis.get("type"), axis["name"]) for axis in image["axes"])
    _check_axes(path, axes)
    # Bring lengths along z, y, x to one unit, that along x
    units = [axis.get("unit") for axis in image["axes"][-3:]]
    factors = np.ones(3)
    if len(set(units)) > 1:
        if any(name not in _UNITS for name in units):
            raise UnsupportedError(
                f"{path} has lengths in {', '.join(map(str, units))} along z, y, x, of which one "
                "is not known: write them in one unit"
            )
        lengths = np.array([_UNITS[str(name)] for name in units])
        factors = lengths / lengths[-1]
    levels, clock = [], (1.0, 0.0)
    for entry in image["datasets"]:
        array = group[entry["path"]]
        of_all = image.get("coordinateTransformations", ())
        steps = [*entry["coordinateTransformations"], *of_all]
        scale, translation = _placed(path, len(axes), steps)
        grid = _grid(array.shape[-3:], scale[-3:] * factors, translation[-3:] * factors)
        levels.append(Level(entry["path"], array, grid))
        if "t" in axes and scale[axes.index("t")] > 0:
            clock = float(scale[axes.index("t")]), float(translation[axes.index("t")])
    names = [channel.get("label") for channel in described.get("omero", {}).get("channels", ())]
    channels = tuple(map(str, names)) if all(names) else ()
    kind = f"OME-Zarr {version}"
    return Store(path, tuple(levels), axes, units[-1] or "", channels, kind, clock)


def _placed(
    path: str, count: int, steps: Sequence[Mapping[str, Any]]
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return the scale and the translation that transformations, one after another, make."""
    scale, translation = np.ones(count), np.zeros(count)
    for step in steps:
        kind = step["type"]
        if kind == "identity":
            continue
        if kind not in ("scale", "translation") or kind not in step:
            raise UnsupportedError(
                f"{path} places its voxels by a transformation of type {kind!r}: scale and "
                "translation with numbers are read"
            )
        numbers = np.asarray(step[kind], dtype=np.float64)
        if numbers.shape != (count,):
            raise ValueError(f"{kind} has {numbers.size} numbers for {count} axes")
        if kind == "scale":
            scale, translation = scale * numbers, translation * numbers
        else:
            translation = translation + numbers
    return scale, translation
