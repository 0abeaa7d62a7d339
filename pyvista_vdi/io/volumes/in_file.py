"""A volume in a file, as a format's function finds it, and the :class:`Volume` made of it."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidVolumeError, UnsupportedError
from pyvista_vdi.model.host_memory import aligned_empty, require_host_memory
from pyvista_vdi.model.volume import Volume

#: What to do with what is not read.
REMEDY = "read it by its own library, and give pyvista_vdi.Volume(array, spacing=, origin=)"


def head_of(file: Path) -> bytes:
    """Return a file's first bytes, unpacked where it is compressed by gzip."""
    with file.open("rb") as stream:
        head = stream.read(4096)
    if head.startswith(b"\x1f\x8b"):
        with suppress(zlib.error):  # it only begins so
            return zlib.decompressobj(wbits=31).decompress(head, 4096)
    return head


@dataclass
class Lazy:
    """An array of which the shape and the type are known, and which is read where it is indexed."""

    shape: Sequence[int]
    dtype: np.dtype[Any]
    read: Callable[[], NDArray[Any]]

    def __getitem__(self, index: Any) -> NDArray[Any]:
        return self.read()[index]


@dataclass(frozen=True, eq=False)
class VolumeInFile:
    """A volume in a file, and what the file says of it.

    Attributes
    ----------
    array : array_like
        Whatever has ``shape`` and ``dtype`` and can be indexed.
    axes : str
        A letter for each of its axes: ``x``, ``y``, ``z``, ``t`` (time), ``c`` (channel) or ``s``
        (components of colours); others must have one point.
    to_world : numpy.ndarray
        Point index (x, y, z) to the file's coordinates, float64 (4, 4).
    name, unit : str
        What it is called, and the unit of lengths; empty where the file does not say.
    channels : tuple of str
        Their names, where they are known.
    meant, volume : bool, callable
        Whether the file says that it is the one to show; what makes it, if not the array.
    """

    array: Any
    axes: str = "zyx"
    to_world: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    name: str = ""
    unit: str = ""
    channels: tuple[str, ...] = ()
    meant: bool = False
    volume: Callable[[], Volume] | None = None

    @property
    def dimensions(self) -> tuple[int, ...]:
        """Number of points along x, y and z."""
        along = dict(zip(self.axes, self.array.shape, strict=True))
        return tuple(int(along.get(axis, 1)) for axis in "xyz")

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of its voxels."""
        return np.dtype(self.array.dtype)

    @property
    def spacing(self) -> tuple[float, ...]:
        """Distance of points along x, y and z."""
        return tuple(np.linalg.norm(self.to_world[:3, :3], axis=0).tolist())

    def __str__(self) -> str:
        along, said = dict(zip(self.axes, self.array.shape, strict=True)), ", ".join(self.channels)
        more = [f"{along['t']} times"] if "t" in along else []
        if "c" in along:
            more.append(f"{along['c']} channels" + (f" ({said})" if said else ""))
        more.append(f"spacing {', '.join(f'{n:g}' for n in self.spacing)} {self.unit}".strip())
        named = f"{self.name!r}: " if self.name else ""
        return f"{named}{' x '.join(map(str, self.dimensions))} {self.dtype}, {', '.join(more)}"


def chosen(
    file: Path, what: str, names: Sequence[Any], asked: Any, how: str, listed: str = ""
) -> int:
    """Return the number of what is asked for by a name or a number, or of the only one."""
    if not names:
        raise InvalidVolumeError(f"{file} holds no {what} of three axes")
    count = len(names)
    listed = listed or (f"0 to {count - 1}" if isinstance(names, range) else ", ".join(names))
    if asked is None and count > 1:
        which = "and a volume is one: choose one by"
        raise UnsupportedError(f"{file} holds {count} {what}s, {listed}, {which} {how}")
    if asked is None or asked in names:
        return 0 if asked is None else names.index(asked)
    if isinstance(asked, bool | str) or not 0 <= asked < count:
        raise InvalidArgumentError(f"{file} has no {what} {asked!r}: it holds {listed}")
    return int(asked)


def volume_of(
    found: VolumeInFile, file: Path, channel: int | str | None, time: int | None
) -> Volume:
    """Read a volume that a file holds: of one time and one channel."""
    axes, shape = found.axes, tuple(found.array.shape)
    if channel is not None and "c" not in axes:  # of colours one component
        axes = axes.replace("s", "c")
    count = dict(zip(axes, shape, strict=True))
    times, channels = range(count.get("t", 1)), found.channels or range(count.get("c", 1))
    at = {
        "t": chosen(file, "time", times, time, "time=0 (--time-index 0)"),
        "c": chosen(file, "channel", channels, channel, "channel=0 (--channel 0)"),
    }
    kept = "".join(axis for axis in axes if axis in "zyxs")
    others = (n for axis, n in count.items() if axis not in "zyxstc")
    if sorted(kept.replace("s", "")) != [*"xyz"] or any(n > 1 for n in others):
        raise InvalidVolumeError(
            f"{file} has the axes {', '.join(axes)}, of shape {shape}: a volume has three, and "
            f"beside them times and channels; {REMEDY}"
        )
    if found.volume is not None:
        return found.volume()
    needed = np.prod([count[axis] for axis in kept], dtype=object) * found.dtype.itemsize
    require_host_memory(needed, f"the volume in {file}", "take less", free=True)
    read = found.array[tuple(slice(None) if a in kept else at.get(a, 0) for a in axes)]
    read = read.transpose([kept.index(a) for a in "zyxs" if a in kept])
    # Copy, as a file that shrinks under a map kills the process, to where CPU devices need no copy
    values = aligned_empty(read.shape, read.dtype.newbyteorder("="))
    values[...] = read
    values = _grey(values, file) if values.ndim == 4 else values
    turn = found.to_world[:3, :3] / [length or 1.0 for length in found.spacing]
    name = found.channels[at["c"]] if found.channels else found.name or "values"
    volume = Volume(values, found.spacing, found.to_world[:3, 3], turn, name=name)
    volume.unit = found.unit
    return volume


def placed(volume: Volume, spacing: Any, origin: Any) -> Volume:
    """Return a volume with another spacing or origin, where one is given."""
    if spacing is None and origin is None:
        return volume
    along = volume.spacing if spacing is None else spacing
    begin = volume.origin if origin is None else origin
    other = Volume(volume.array, along, begin, volume.direction, name=volume.name)
    other.blanked = volume.blanked
    other.unit = volume.unit if spacing is None else ""  # another spacing may be in another
    return other


def _grey(array: NDArray[Any], file: Path) -> NDArray[Any]:
    """Return scalars where colours are all grey and opaque, as many programs write them."""
    components = array.shape[3]
    colors = array[..., : components - 1 + components % 2]
    most = 1 if array.dtype.kind == "f" else np.iinfo(array.dtype).max
    if (colors == array[..., :1]).all() and (components % 2 or (array[..., -1] == most).all()):
        return np.ascontiguousarray(array[..., 0])
    if components == 4 and array.dtype == np.uint8:
        return array
    raise UnsupportedError(
        f"the voxels of {file} are coloured, {components} components of type {array.dtype}: choose "
        "one by channel=0, or write grey values, or 8-bit RGBA whose fourth component is opacity"
    )
