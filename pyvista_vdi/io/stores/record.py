"""What a store's metadata say, and a level of it as a volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.chunked import ChunkedArray, Reopened
from pyvista_vdi.model.view import required_level
from pyvista_vdi.model.volume import Grid, Volume

#: The axes of OME-Zarr, in their order.
AXES = ("t", "c", "z", "y", "x")


@dataclass(frozen=True)
class Level(Reopened):
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
    """

    path: str
    levels: tuple[Level, ...]
    axes: tuple[str, ...]
    unit: str = ""
    channels: tuple[str, ...] = ()
    kind: str = "zarr"
    clock: tuple[float, float] = (1.0, 0.0)

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

    Made by :func:`read_volume`. Colours and opacities are the same for all levels, if ``clim`` is
    given: lengths are the same, and opacities refer to the finest level's distance of voxels.

    Attributes
    ----------
    store : Store
        What the store says of itself: its levels, axes, unit and channels.
    level : int
        Which one this is; 0 is the finest.
    asked : bool
        Whether somebody has asked for this level, so that views do not choose another.
    time : int
        Which step it is.
    channel : int or str
        Which channel it is.
    """

    def __init__(
        self, store: Store, level: int | str = "auto", time: int = 0, channel: int | str = 0
    ) -> None:
        count = len(store.levels)
        self.asked = not (isinstance(level, str) and level == "auto")
        if self.asked and not (isinstance(level, (int, np.integer)) and 0 <= level < count):
            raise InvalidArgumentError(
                f'level must be "auto" or from 0, the finest, to {count - 1}, as {store.path} has '
                f"{count}; got {level!r}"
            )
        self.level = int(level) if self.asked else 0
        chosen, index = store.levels[self.level], store.index(time, channel)
        grid = chosen.grid
        number: Any = index[store.axes.index("c")] if "c" in store.axes else 0
        super().__init__(
            ChunkedArray(chosen.array, index=index),
            grid.spacing,
            grid.origin,
            grid.direction,
            name=store.channels[number] if number < len(store.channels) else "values",
        )
        self.store, self.time, self.channel, self.unit = store, time, channel, store.unit
        self.unit_distance = store.levels[0].grid.default_unit_distance

    def in_view(self, *cameras: Any, window_size: Sequence[int]) -> StoredVolume:
        """Return the finest level that one of several views requires.

        The coarsest whose voxels are still as fine as half a list's width where the volume is
        nearest to a view; this level if somebody has asked for it.
        """
        if self.asked or len(self.store.levels) == 1:
            return self
        grids = [one.grid for one in self.store.levels]
        views = map(Camera.from_any, cameras)
        level = min(required_level(grids, view, window_size) for view in views)
        other = StoredVolume(self.store, level, self.time, self.channel)
        other.asked = False
        return other

    def at_time(self, time: int) -> StoredVolume:
        """Return another time step, by its index: ``store.times`` has as many."""
        other = StoredVolume(self.store, self.level, time, self.channel)
        other.asked = self.asked
        return other

    def describe(self) -> str:
        """Return which level it is, as one line."""
        nx, ny, nz = self.dimensions
        return f"level {self.level} of {len(self.store.levels)}: {nx} x {ny} x {nz} points"
