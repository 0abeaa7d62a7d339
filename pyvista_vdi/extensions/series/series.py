"""The series of VDIs, one for each time step; and its files, ``.vdis`` and pages."""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any, overload

import numpy as np

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidArgumentTypeError,
    InvalidVDIError,
    VDIFileError,
)
from pyvista_vdi.extensions.series.archive import SERIES, Archive, Called
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI, DeferredVDI


class Several(VDICollection):
    """The VDIs of a series or a set, at hand, or made or read when they are asked for."""

    _vdis: Any

    def __len__(self) -> int:
        return len(self._vdis)

    def _mapped(self, function: Callable[[VDI], VDI]) -> Any:
        found = copy.copy(self)
        found._vdis = Called(function, self, kept=8)
        return found


class VDISeries(Several):
    """The VDIs of one scene at several times: a sequence of :class:`VDI` or :class:`DeferredVDI`.

    Made by :func:`pyvista_vdi.generate_series`, by :func:`pyvista_vdi.read` of a ``.vdis`` folder
    or file, whose steps are read when they are asked for, or from VDIs at hand. It can be read from
    several threads at once, and pickled: one that was read, as its path.

    Parameters
    ----------
    steps : iterable of VDI or DeferredVDI
        One per time, at least one, or their VTK form; those that keep values all of one range. A
        sequence that is neither list nor tuple is asked for a step when that is needed.
    times : iterable of float, optional
        Ascending, of any unit; 0, 1, 2 … by default.

    Raises
    ------
    InvalidArgumentError
        If there is no step, or times are not as many, or do not ascend.
    InvalidVDIError
        If one is no VDI, or keeps values where another does not, or of another range.

    Attributes
    ----------
    times : tuple of float
        The steps' times.
    """

    times: tuple[float, ...]
    kind, drawn_by = SERIES, "pyvista_vdi.extensions.series.shown:SeriesInput"

    def __init__(self, steps: Iterable[VDI], times: Iterable[float] | None = None) -> None:
        self._vdis = as_steps(steps, "a series")
        self.times = checked_times(range(len(self)) if times is None else times)
        #: What a file says of it beside its steps.
        self.about = {"times": self.times}
        if not len(self) == len(self.times) > 0:
            raise InvalidArgumentError(
                f"a series has a time for each step, and at least one; got {len(self)} "
                f"steps and {len(self.times)} times"
            )

    @cached_property
    def _first(self) -> Any:
        """The first step, or what its file says of it."""
        return self._vdis.info() if isinstance(self._vdis, Archive) else self[0]

    @property
    def camera(self) -> Camera:  # type: ignore[override]
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

    @overload
    def __getitem__(self, index: int) -> VDI: ...
    @overload
    def __getitem__(self, index: slice) -> VDISeries: ...
    def __getitem__(self, index: int | slice) -> VDI | VDISeries:
        if isinstance(index, slice):
            chosen = Called(self._vdis.__getitem__, range(len(self))[index])
            return VDISeries(chosen, self.times[index])
        return self._vdis[self._place(index, "steps")]  # type: ignore[no-any-return]

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
        return int(np.abs(np.subtract(self.times, checked_time(time))).argmin())

    def __repr__(self) -> str:
        width, height = self.window_size
        return (
            f"VDISeries({len(self)} steps, times {self.times[0]:g} to {self.times[-1]:g}, "
            f"{width} x {height} lists)"
        )


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDISeries:
    """Read a series; its steps are read when they are asked for."""
    steps = Archive(path, SERIES)
    if not len(steps):
        raise VDIFileError(f"{path} has no finished step: none has been written yet")
    Pieces(progress, 1)()
    return VDISeries(steps, times_of(steps))


def times_of(steps: Archive) -> tuple[float, ...]:
    """Return the times of a stored series."""
    try:
        return checked_times(steps.about["times"])
    except InvalidArgumentError as error:
        steps.refuse(f"its times cannot be ({error})")


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a series says about itself, without its arrays: errors as for :func:`read`."""
    return Archive(path, SERIES).info()


def as_steps(vdis: Any, what: str) -> Any:
    """Return several VDIs that have colours, or keep values of one range, as such.

    A sequence that makes or reads them when they are asked for is returned as it is.
    """
    if isinstance(vdis, str | bytes | os.PathLike) or not np.iterable(vdis):
        raise InvalidVDIError(f"{what} is made of several VDIs: pass them in a list")
    if isinstance(vdis, Sequence) and not isinstance(vdis, list | tuple):
        return vdis
    steps = tuple(v if isinstance(v, DeferredVDI) else as_vdi(v) for v in vdis)
    for i, step in enumerate(steps):
        check_range(step, getattr(steps[0], "value_range", None), f"number {i}")
    return steps


def check_range(vdi: Any, first: tuple[float, float] | None, which: str) -> None:
    """Raise InvalidVDIError unless a VDI keeps values of the first one's range, or as little."""
    if (ends := getattr(vdi, "value_range", None)) != first:
        said, of_first = (
            "has colours" if k is None else f"keeps values from {k[0]} to {k[1]}"
            for k in (ends, first)
        )
        raise InvalidVDIError(
            f"the VDIs of one series or set keep values of one range, or all have colours: {which} "
            f"{said}, and the first {of_first}; generate them with the same value_range"
        )


def checked_times(times: Iterable[float]) -> tuple[float, ...]:
    """Return times as floats, or raise InvalidArgumentError where they do not ascend."""
    if not np.iterable(times) or isinstance(times, str | bytes):
        raise InvalidArgumentTypeError(f"times must be numbers, one for each step; got {times!r}")
    checked = tuple(map(checked_time, times))
    for before, after in pairwise(checked):
        if not before < after:
            raise InvalidArgumentError(f"times must ascend; got {before} and then {after}")
    return checked


def checked_time(time: Any) -> float:
    """Return a time as a float, or raise InvalidArgumentError where it is no finite number."""
    if not math.isfinite(value := as_float(time)):
        raise InvalidArgumentError(f"a time must be a finite number; got {time!r}")
    return value
