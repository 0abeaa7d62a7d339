"""What a store's metadata say, and a level of it as a volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.chunked import closed, opened
from pyvista_vdi.model.levels import required_level
from pyvista_vdi.model.volume import Grid, Volume, chunked_array

#: The axes of OME-Zarr, in their order.
AXES = ("t", "c", "z", "y", "x")

#: Why a level was taken that somebody has chosen.
_ASKED_FOR = "asked for"


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
            if axis not in AXES and count != 1:
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
        number, why = chosen_level(self.store, level, camera, window_size)
        return StoredVolume(self.store, number, why, self.time, self.channel)

    def in_view(self, *cameras: Any, window_size: Sequence[int]) -> StoredVolume:
        """Return the finest level that one of several views requires.

        It is this one if somebody has asked for it.
        """
        if self.why == _ASKED_FOR or len(self.store.levels) == 1:
            return self
        each = (self.at_level("auto", camera, window_size) for camera in cameras)
        return min(each, key=lambda one: one.level)

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


def chosen_level(
    store: Store, level: int | str, camera: Any, window_size: Sequence[int] | None
) -> tuple[int, str]:
    """Return the level of a store that is asked for, or that a view requires, and why."""
    count = len(store.levels)
    if not (isinstance(level, str) and level == "auto"):
        if not isinstance(level, (int, np.integer)) or not 0 <= level < count:
            raise InvalidArgumentError(
                f'level must be "auto" or from 0, the finest, to {count - 1}, as {store.path} has '
                f"{count}; got {level!r}"
            )
        return int(level), _ASKED_FOR
    if (camera is None) != (window_size is None):
        raise InvalidArgumentError(
            "a level is chosen for a camera and a window_size: give both, or neither for the finest"
        )
    if camera is None or window_size is None:
        return 0, "the finest, as no view was given" if count > 1 else "the only one"
    grids = [one.grid for one in store.levels]
    return required_level(grids, Camera.from_any(camera), window_size, store.unit)
