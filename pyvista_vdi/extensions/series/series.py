"""The series of VDIs: one for each time step."""

from __future__ import annotations

import math
import os
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, overload

import numpy as np

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, InvalidVDIError
from pyvista_vdi.extensions.series.archive import Archive
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import IN_PLACE, Look
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.inputs import as_vdi, each_of
from pyvista_vdi.model.vdi import VDI

#: Steps with other colours that are kept, as those that were decoded last are.
_KEPT = 4


class VDISeries(VDICollection):
    """The VDIs of one scene at several times: a sequence of :class:`VDI` or :class:`DeferredVDI`.

    Made by :func:`pyvista_vdi.generate_series`, by :func:`pyvista_vdi.read` from a ``.vdis`` folder
    or file, whose steps are read when they are asked for, or by :meth:`of` from VDIs at hand. It can
    be read from several threads at once, and pickled: one that was read, as its path.

    Parameters
    ----------
    steps : sequence of VDI or DeferredVDI
        One per time; at least one.
    times : sequence of float
        Ascending, of any unit.
    volumes : sequence, optional
        What the steps were made from, where that is still at hand; one per time.

    Raises
    ------
    InvalidArgumentError
        If there is no step, or times are not as many, or do not ascend.

    Attributes
    ----------
    times : tuple of float
        The steps' times.
    volumes : sequence or None
        As above.
    """

    times: tuple[float, ...]

    def __init__(
        self, steps: Sequence[VDI], times: Sequence[float], volumes: Sequence[Any] | None = None
    ) -> None:
        self.times = checked_times(times)
        if not isinstance(steps, Sequence):
            raise InvalidArgumentTypeError(
                f"steps must be a sequence of VDIs, got {type(steps).__name__}: pass a list"
            )
        if not len(steps) == len(self.times) > 0:
            raise InvalidArgumentError(
                f"a series has a time for each step, and at least one; got {len(steps)} steps "
                f"and {len(self.times)} times"
            )
        self.volumes = volumes
        self._steps = steps
        self._maker: Callable[..., VDI] | None = None  # of a step's volume, for another view

    @classmethod
    def of(cls, vdis: Iterable[VDI], times: Iterable[float] | None = None) -> VDISeries:
        """Return a series of VDIs in memory.

        Parameters
        ----------
        vdis : iterable of VDI or DeferredVDI
            One per time, or their VTK form; those that keep values all of one range.
        times : iterable of float, optional
            Ascending; 0, 1, 2 … by default.

        Raises
        ------
        InvalidArgumentError
            See :class:`VDISeries`.
        InvalidVDIError
            If one is no VDI, or keeps values where another does not, or of another range.
        """
        if isinstance(vdis, VDI | DeferredVDI):
            raise InvalidVDIError("a series is made of several VDIs: pass them in a list")
        steps: Any = tuple(as_step(vdi) for vdi in each_of(vdis))
        for i, step in enumerate(steps):
            check_range(step, range_of(steps[0]), f"step {i}")
        return cls(steps, range(len(steps)) if times is None else checked_times(times))

    @cached_property
    def _first(self) -> Any:
        """What knows the first step's view, without its arrays where it is of a file."""
        return self._steps.info() if isinstance(self._steps, Archive) else self[0]

    @property
    def camera(self) -> Camera:
        """The generating view V_O of the first step."""
        return self._first.camera  # type: ignore[no-any-return]

    @property
    def window_size(self) -> tuple[int, int]:
        """W and H of the first step: lists along each edge of the viewport."""
        return self._first.window_size  # type: ignore[no-any-return]

    @property
    def bounds(self) -> tuple[float, float, float, float, float, float]:
        """The first step's bounds in the model frame."""
        return self._first.bounds  # type: ignore[no-any-return]

    def __len__(self) -> int:
        return len(self.times)

    @overload
    def __getitem__(self, index: int) -> VDI: ...
    @overload
    def __getitem__(self, index: slice) -> VDISeries: ...
    def __getitem__(self, index: int | slice) -> VDI | VDISeries:
        if isinstance(index, slice):
            chosen = range(len(self))[index]
            volumes = None if self.volumes is None else Called(self.volumes.__getitem__, chosen)
            part = VDISeries(Called(self._steps.__getitem__, chosen), self.times[index], volumes)
            part._maker = self._maker
            return part
        return self._steps[range(len(self))[index]]

    def __iter__(self) -> Iterator[VDI]:
        return (self[i] for i in range(len(self)))

    def _mapped(self, function: Callable[[VDI], VDI]) -> VDISeries:
        """Return a series of what a function makes of each step, when that is asked for."""
        return VDISeries(Made(function, self, _KEPT), self.times)

    def nearest(self, time: float) -> int:
        """Return the index of the step whose time is nearest; of two, the earlier.

        Parameters
        ----------
        time : float
            Any time; beyond the ends the first or the last step is nearest.

        Raises
        ------
        InvalidArgumentError
            If it is no number.
        """
        time = checked_time(time)
        after = bisect_left(self.times, time)
        candidates = [i for i in (after - 1, after) if 0 <= i < len(self)]
        return min(candidates, key=lambda i: abs(self.times[i] - time))

    def generate(
        self, step: int, camera: Any = None, window_size: Sequence[int] | None = None
    ) -> VDI:
        """Return a step's VDI for another view, made as that of the series was.

        Parameters
        ----------
        step : int
            Its index.
        camera : Camera or vtkCamera or pyvista.Camera, optional
            The generating view; the series' by default.
        window_size : (int, int), optional
            Lists along each edge; those of the series by default.

        Raises
        ------
        InvalidArgumentError
            If the volumes are not at hand: of files they are not.

        See Also
        --------
        pyvista_vdi.generate : has the other errors.
        """
        if self.volumes is None or self._maker is None:
            raise InvalidArgumentError(
                "the volumes of this series are not at hand: make it by generate_series from a "
                "sequence or a function, or generate a VDI of the step's volume"
            )
        return self._maker(self.volumes[step], camera=camera, window_size=window_size)

    def save(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write one ``.vdis`` file, for sending, or a page that plays it.

        It appears whole or not at all; :func:`pyvista_vdi.read` opens both. A folder, which grows
        step by step, is written by :class:`pyvista_vdi.SeriesWriter`.

        Parameters
        ----------
        path : path-like
            The target; its name ends in ``.vdis``, or in ``.html``.
        **options
            ``precision``, by default the first step's, and ``"8-byte"`` in a page;
            ``compression`` (``"zstd"``, and ``"deflate"`` in a page) and ``level`` as for
            :class:`pyvista_vdi.SeriesWriter`; and ``progress``, called with the finished fraction.
            For pages ``title``, ``background``, ``controls`` and ``autoplay`` as well.

        Returns
        -------
        pathlib.Path
            The file.

        Raises
        ------
        VDIFileError
            If the target cannot be written.
        InvalidArgumentError
            If an option is out of its range, or one is a look, which :meth:`classified` takes.
        """
        return registry.method("VDISeries.save")(self, path, **options)  # type: ignore[no-any-return]

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> Any:
        """Return what a notebook shows: a viewer, or a picture."""
        text = {"text/plain": repr(self)}
        if self.value_range is not None:  # pages show colours
            return text
        return registry.method("VDISeries._repr_mimebundle_", lambda *_: text)(
            self, include, exclude
        )

    def __repr__(self) -> str:
        width, height = self.window_size
        ends = self.value_range
        kept = "" if ends is None else f", values from {ends[0]:g} to {ends[1]:g}"
        return (
            f"VDISeries({len(self)} steps, times {self.times[0]:g} to {self.times[-1]:g}, "
            f"{width} x {height} lists{kept})"
        )


class Called(Sequence[Any]):
    """What a function returns for each of some indices, when it is asked for."""

    def __init__(self, function: Callable[[int], Any], chosen: range) -> None:
        self._function, self._chosen = function, chosen

    def __len__(self) -> int:
        return len(self._chosen)

    def __getitem__(self, index: Any) -> Any:
        chosen = self._chosen[index]
        return (
            Called(self._function, chosen) if isinstance(index, slice) else self._function(chosen)
        )


class Made(Called):
    """What a function makes of each of several VDIs; those that were asked for last are kept."""

    def __init__(self, function: Callable[[VDI], VDI], vdis: Sequence[VDI], kept: int) -> None:
        super().__init__(lru_cache(kept)(lambda i: function(vdis[i])), range(len(vdis)))
        self._given = function, vdis, kept

    def __reduce__(self) -> Any:
        return type(self), self._given


def as_step(vdi: Any) -> Any:
    """Return a VDI, its VTK form or a DeferredVDI as such; InvalidVDIError if it is none."""
    return vdi if isinstance(vdi, DeferredVDI) else as_vdi(vdi)


def range_of(vdi: Any) -> tuple[float, float] | None:
    """Return the range of the values that a VDI keeps, or is said to; None if it has colours."""
    return getattr(vdi, "value_range", None)


def check_range(vdi: Any, first: tuple[float, float] | None, which: str) -> None:
    """Raise InvalidVDIError unless a VDI keeps values of the first one's range, or as little."""
    if (ends := range_of(vdi)) != first:
        said, of_first = (
            "has colours" if k is None else f"keeps values from {k[0]} to {k[1]}"
            for k in (ends, first)
        )
        raise InvalidVDIError(
            f"the VDIs of one series or set keep values of one range, or all have colours: {which} "
            f"{said}, and the first {of_first}; generate them with the same value_range"
        )


def refuse_look(vdis: VDICollection, options: Iterable[str]) -> None:
    """Raise InvalidArgumentError if a look is among the options that a file is written with."""
    look = ", ".join(name for name in options if name in (*Look.declared, *IN_PLACE))
    if look:
        raise InvalidArgumentError(
            f"save() takes no look, got {look}: "
            + (
                "these VDIs have their colours already"
                if vdis.value_range is None
                else f"what keeps values is written as it is; give {look} to classified(), and "
                "save what it returns"
            )
        )


def checked_times(times: Iterable[float]) -> tuple[float, ...]:
    """Return times as floats, or raise InvalidArgumentError where they do not ascend."""
    if not np.iterable(times) or isinstance(times, str | bytes):
        raise InvalidArgumentTypeError(f"times must be numbers, one for each step; got {times!r}")
    checked = tuple(checked_time(time) for time in times)
    for before, after in pairwise(checked):
        if not before < after:
            raise InvalidArgumentError(f"times must ascend; got {before} and then {after}")
    return checked


def checked_time(time: Any) -> float:
    """Return a time as a float, or raise InvalidArgumentError where it is no finite number."""
    try:
        value = float(np.asarray(time).reshape(()))
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        raise InvalidArgumentError(f"a time must be a finite number; got {time!r}")
    return value
