"""A volume in a file, as an adapter finds it, and the :class:`Volume` that is made of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidVolumeError, UnsupportedError
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.volume import Volume

#: The command line's names of choices.
_OPTIONS = {"time": "time-index", "channel": "channel"}


class Lazy:
    """An array of which the shape and the type are known, and which a function reads.

    ``read`` is called with nothing, or with the index where it reads parts.
    """

    def __init__(
        self,
        shape: Sequence[int],
        dtype: DTypeLike,
        read: Callable[..., Any],
        *,
        in_parts: bool = False,
    ) -> None:
        self.shape, self.dtype = tuple(int(n) for n in shape), np.dtype(dtype)
        self._read, self._in_parts = read, in_parts

    def __getitem__(self, index: Any) -> Any:
        """Read it, and return a part."""
        return self._read(index) if self._in_parts else np.asarray(self._read())[index]


def stack(
    files: Sequence[Path], read: Callable[[Path], NDArray[Any]], *, mixed: bool = False
) -> Lazy:
    """Return slices, a file each, as an array along z; slices of another size are refused.

    ``mixed``: slices may be of several types, and the array is of one that holds all.
    """
    first = read(files[0])

    def all_of_them() -> NDArray[Any]:
        array = np.empty((len(files), *first.shape), first.dtype)
        for i, file in enumerate(files):
            one = read(file)
            if one.shape != first.shape or (one.dtype != first.dtype and not mixed):
                raise InvalidVolumeError(
                    f"{file} is {form(one)}, and {files[0].name} is {form(first)}: the slices of a "
                    "volume have one size and one type"
                )
            array = array.astype(np.promote_types(array.dtype, one.dtype), copy=False)
            array[i] = one
        return array

    return Lazy((len(files), *first.shape), first.dtype, all_of_them)


def form(picture: NDArray[Any]) -> str:
    """Return a picture's size and type for people."""
    return f"{' x '.join(map(str, picture.shape))} {picture.dtype}"


@dataclass(frozen=True, eq=False)
class VolumeInFile:
    """A volume in a file: what the file says of it; its voxels are not read.

    Attributes
    ----------
    array : array_like
        With ``shape`` and ``dtype``; reads what it is indexed by.
    axes : str
        A letter for each of its axes: ``x``, ``y``, ``z``, ``t`` (time), ``c`` (channel) or ``s``
        (components of colours); others must have one point.
    to_world : numpy.ndarray
        Point index (x, y, z) to the file's coordinates, float64 (4, 4).
    name : str
        What it is called in the file; empty where the file does not say.
    unit : str
        Of lengths; empty where the file does not say.
    channels : tuple of str
        Their names, where they are known.
    level : int
        Of detail; 0 is the finest.
    meant : bool
        Whether the file says that it is the one to show.
    taken : callable, optional
        Makes the volume, where the array is not all there is.
    """

    array: Any
    axes: str = "zyx"
    to_world: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    name: str = ""
    unit: str = ""
    channels: tuple[str, ...] = ()
    level: int = 0
    meant: bool = False
    taken: Callable[[], Volume] | None = None

    def along(self, axis: str) -> int:
        """Return the number of points along an axis: 1 where it has none of that letter."""
        return int(self.array.shape[self.axes.index(axis)]) if axis in self.axes else 1

    @property
    def dimensions(self) -> tuple[int, int, int]:
        """Number of points along x, y and z."""
        return self.along("x"), self.along("y"), self.along("z")

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of its voxels."""
        return np.dtype(self.array.dtype)

    @property
    def spacing(self) -> tuple[float, float, float]:
        """Distance of points along x, y and z."""
        x, y, z = np.linalg.norm(self.to_world[:3, :3], axis=0).tolist()
        return x, y, z

    def __str__(self) -> str:
        size = " x ".join(map(str, self.dimensions))
        more = [f"{self.along('t')} times"] if self.along("t") > 1 else []
        if (n := self.along("c")) > 1:
            more += [f"{n} channels" + (f" ({', '.join(self.channels)})" if self.channels else "")]
        spacing = ", ".join(f"{n:g}" for n in self.spacing)
        more += [f"spacing {spacing} {self.unit}".strip()]
        named = f"{self.name!r}: " if self.name else ""
        return f"{named}{size} {self.dtype}, {', '.join(more)}"


def volume_of(
    found: VolumeInFile,
    file: Path,
    channel: int | str | None,
    time: int | None,
    spacing: Sequence[float] | None,
    origin: Sequence[float] | None,
) -> Volume:
    """Read a volume that a file holds: of one time, one channel, placed as asked for."""
    if found.taken is not None:
        for name, value in (("channel", channel), ("time", time)):
            if value is not None:
                raise InvalidArgumentError(f"{file} has no {name}s: leave {name}= out")
        return placed(found.taken(), spacing, origin)
    # Index what is not along x, y and z
    chosen = {"t": _chosen(file, "time", found.along("t"), time, ())}
    if found.along("c") > 1 or "s" not in found.axes or channel is None:
        chosen["c"] = _chosen(file, "channel", found.along("c"), channel, found.channels)
    else:
        names = ("red", "green", "blue", "alpha")[: found.along("s")]
        chosen["s"] = _chosen(file, "channel", found.along("s"), channel, names)
    for axis, n in zip(found.axes, found.array.shape, strict=True):
        if axis not in "xyztcs" and n != 1:
            raise UnsupportedError(
                f"{file} has {n} points along an axis {axis!r}, which is neither x, y, z, time nor "
                f"channel: write one of them to a file of its own"
            )
    kept = [a for a in found.axes if a in "zyx" or (a == "s" and a not in chosen)]
    if sorted(set(kept) & set("xyz")) != ["x", "y", "z"]:
        raise InvalidVolumeError(
            f"{file} has the axes {', '.join(found.axes)}, of shape {tuple(found.array.shape)}: a "
            "volume has three"
        )
    index = tuple(slice(None) if a in kept else chosen.get(a, 0) for a in found.axes)
    count = np.prod([found.along(a) for a in kept], dtype=object)
    require_free_memory(count * found.dtype.itemsize, f"the volume in {file}", "take less")
    values = found.array[index]
    if isinstance(values, np.ndarray):
        order = [kept.index(a) for a in ("z", "y", "x", "s") if a in kept]
        values = values.transpose(order)
    if values.ndim == 4:
        values = _grey(values, file)
    # Place it by its map from point index to world coordinates
    steps = found.to_world[:3, :3]
    lengths = np.linalg.norm(steps, axis=0)
    cell = abs(np.linalg.det(steps))
    if not (np.isfinite(found.to_world).all() and cell > 1e-9 * np.prod(lengths) > 0):
        raise InvalidVolumeError(
            f"{file} states an orientation that cannot be inverted: {found.to_world[:3].tolist()}"
        )
    names = found.channels
    at = chosen.get("c", 0)
    name = names[at] if len(names) > at else found.name or "values"
    volume = Volume(values, lengths, found.to_world[:3, 3], steps / lengths, name=name)
    volume.unit = found.unit
    return placed(volume, spacing, origin)


def _chosen(
    file: Path, what: str, count: int, asked: int | str | None, names: tuple[str, ...]
) -> int:
    """Return the number of a time or a channel that is asked for, or of the only one."""
    said = f"{count} {what}s, {', '.join(names) if names else f'0 to {count - 1}'}"
    if asked is None:
        if count > 1:
            raise UnsupportedError(
                f"{file} holds {said}, and a volume is one: choose one by {what}=0 "
                f"(--{_OPTIONS[what]} 0)"
            )
        return 0
    if isinstance(asked, str):
        if asked not in names:
            raise InvalidArgumentError(f"{file} has no {what} {asked!r}: it holds {said}")
        return names.index(asked)
    if isinstance(asked, bool) or not isinstance(asked, int | np.integer) or not 0 <= asked < count:
        raise InvalidArgumentError(f"{file} holds {said}; got {what}={asked!r}")
    return int(asked)


def placed(
    volume: Volume, spacing: Sequence[float] | None, origin: Sequence[float] | None
) -> Volume:
    """Return a volume with another spacing or origin, where one is given."""
    if spacing is None and origin is None:
        return volume
    other = Volume(
        volume.array,
        volume.spacing if spacing is None else spacing,
        volume.origin if origin is None else origin,
        volume.direction,
        name=volume.name,
        blanked=volume.blanked,
    )
    other.unit = volume.unit if spacing is None else ""  # another spacing may be in another
    return other


def _grey(array: NDArray[Any], file: Path) -> NDArray[Any]:
    """Return scalars where colours are all grey and opaque, as many programs write them."""
    if array.shape[3] == 1:
        return np.ascontiguousarray(array[..., 0])
    n_colors = array.shape[3] - 1 + array.shape[3] % 2  # without opacity
    most = 1 if array.dtype.kind == "f" else np.iinfo(array.dtype).max
    opaque = n_colors == array.shape[3] or bool((array[..., -1] == most).all())
    if opaque and all((array[..., 0] == array[..., i]).all() for i in range(1, n_colors)):
        return np.ascontiguousarray(array[..., 0])
    if array.shape[3] == 4 and array.dtype == np.uint8:
        return array
    raise UnsupportedError(
        f"the voxels of {file} are coloured, {array.shape[3]} components of type {array.dtype}: "
        "choose one by channel=0, or write them as grey values, or as 8-bit RGBA whose fourth "
        "component is the opacity"
    )
