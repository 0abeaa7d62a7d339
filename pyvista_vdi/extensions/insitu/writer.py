"""Takes a simulation's blocks, step by step, and writes what they look like."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Sequence
from pathlib import Path
from string import Formatter
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.extensions.large.on_mpi import (
    checked_ranks,
    generate_on_mpi,
    mpi,
    require_same,
    together,
)
from pyvista_vdi.extensions.series.series import checked_time
from pyvista_vdi.extensions.series.writer import (
    SeriesWriter,
    check_goes_on,
    checked_way,
    refused,
)
from pyvista_vdi.generation.deferred import generate_deferred, unclassified
from pyvista_vdi.io import read as read_vdi
from pyvista_vdi.model.arguments import names_of, records_of
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_range, as_whole, not_taken, three_wholes
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.deferred import importance_points
from pyvista_vdi.model.options import Deferral, GenerationOptions, GenerationRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import CameraLike, DeviceLike, WindowSize
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Grid, Volume

_RECORDS = (Deferral, GenerationOptions)


class InSitu:
    """Writes VDIs of a simulation while it runs. All ranks make one, and call it together.

    Parameters
    ----------
    path : path-like
        ``x.vdis``, a series that others read while it grows, or a name with a place for the number
        of the step, ``"step_{:04d}.vdi"``. Rank 0 alone writes.
    camera : pyvista.Camera or vtkCamera or Camera
        The generating view V_O.
    window_size : (int, int)
        Width and height in pixels.
    dimensions : (int, int, int)
        Points of the whole grid along x, y and z.
    spacing, origin : (float, float, float)
        Of the whole grid, as for :class:`Volume`.
    comm : mpi4py.MPI.Comm, optional
        The ranks; all of them by default.
    every : int
        Steps from one that is written to the next.
    append : bool, default: False
        Go on with what an earlier run has written, for a simulation that is started again: times
        must be above that of the last step, camera, window size and classification the same.
        Numbers of single files go on, too.
    overwrite : bool, default: False
        Replace what an earlier run has written.
    device : optional
        Of this rank, see :func:`pyvista_vdi.list_devices`.
    **options
        What :func:`pyvista_vdi.generate` takes, classification included. ``clim`` must be given, so
        that colours mean the same in all steps; or ``classification="deferred"`` and
        ``value_range``, so that colours can be chosen after the run (docs/deferred.md).
        ``precision`` is ``"8-byte"`` by default.

    Attributes
    ----------
    seconds : list of float
        What each step that was written has cost this rank.

    Raises
    ------
    MissingDependencyError
        If ``comm`` is not given and mpi4py is not installed.
    InvalidArgumentError
        If an argument is out of its range.
    VDIFileError
        If a file cannot be written, or is there already and neither ``append`` nor ``overwrite`` is
        given.
    TypeError
        If a keyword is unknown.

    Notes
    -----
    Errors are raised on all ranks, whichever was given what is wrong.

    Examples
    --------
    >>> points = (256, 256, 256)
    >>> with InSitu("run.vdis", camera, size, points, clim=(0, 1)) as show:  # doctest: +SKIP
    ...     for step in range(1000):
    ...         solver.advance()
    ...         show(solver.values, solver.first, solver.time)
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        camera: CameraLike,
        window_size: WindowSize,
        dimensions: Sequence[int],
        spacing: Sequence[float] = (1.0, 1.0, 1.0),
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        comm: Any = None,
        every: int = 1,
        append: bool = False,
        overwrite: bool = False,
        device: DeviceLike | None = None,
        **options: Any,
    ) -> None:
        self._comm = comm = mpi().COMM_WORLD if comm is None else checked_ranks(comm)
        self._device, self._closed, self._step = device, False, 0
        self._function: TransferFunction | None = None
        self._writer: SeriesWriter | None = None
        self._before: VDI | None = None  # of single files: what the run goes on behind
        self.seconds: list[float] = []
        with together(comm, "InSitu", InvalidArgumentError):
            self._path = _checked_path(path)
            self._every = _checked_every(every)
            self._check(camera, window_size, dimensions, spacing, origin, dict(options))
            append, overwrite = checked_way(append, overwrite)
        require_same(comm, every=self._every, kind_of_file=self._series)
        with together(comm, "InSitu"):
            if comm.rank == 0:
                self._begin(append, overwrite)
        self._step = max(comm.allgather(self._step))

    @property
    def _series(self) -> bool:
        return self._path.lower().endswith(".vdis")

    def _check(
        self,
        camera: Any,
        window_size: Sequence[int],
        dimensions: Sequence[int],
        spacing: Sequence[float],
        origin: Sequence[float],
        options: dict[str, Any],
    ) -> None:
        """Take what is asked for, or raise."""
        self._camera = Camera.from_any(camera)
        self._size = check_window_size(window_size)
        others = names_of(*_RECORDS)
        looks = {name: value for name, value in options.items() if name not in others}
        self._deferral, self._options = records_of(
            options, "InSitu", *_RECORDS, defaults={"precision": "8-byte"}
        )
        missing = looks.get("clim") is None and "transfer_function" not in looks
        if self._deferral.deferred:
            missing = self._deferral.value_range is None
        if missing:
            raise InvalidArgumentError(
                f"{'value_range' if self._deferral.deferred else 'clim'}=(low, high) is missing: "
                "no step knows the range of the others"
            )
        self._looks = Classification.composited(looks, "InSitu", others)
        if self._deferral.deferred:
            self._looks.require_no_look()
            ends = as_range(self._deferral.value_range)  # what cannot be is refused before the run
            importance_points(self._deferral.importance, ends)
            self._function = unclassified(self._looks.interpolation)
        points = three_wholes(dimensions, "dimensions must be the points along x, y and z", 2)
        of = Volume(np.zeros((2, 2, 2), np.uint8), spacing, origin)  # checks them
        self._grid = Grid(points, of.spacing, of.origin, of.direction)

    def _begin(self, append: bool, overwrite: bool) -> None:
        """Begin the file, or find where single files go on; on the first rank."""
        if self._series:
            self._writer = SeriesWriter(
                self._path, precision=self._options.precision, append=append, overwrite=overwrite
            )
            return
        numbers = [] if overwrite else _numbers(self._path)
        if not numbers:
            return
        last = Path(self._path.format(numbers[-1]))
        if not append:
            raise refused(last, f", and {len(numbers) - 1} others of its kind")
        self._before = read_vdi(last)
        self._step = (numbers[-1] // self._every + 1) * self._every

    def __call__(self, values: NDArray[Any], first: Sequence[int], at: float) -> None:
        """Write a step, unless it is one that is left out.

        Parameters
        ----------
        values : numpy.ndarray, shape (nz, ny, nx)
            This rank's own points, without ghosts.
        first : (int, int, int)
            Index x, y, z of the first of them in the whole grid.
        at : float
            The simulation's time.

        Raises
        ------
        InvalidArgumentError, InvalidVolumeError
            If an argument cannot be used, or the time is not above that of the step before.
        VDIFileError
            If it is closed, or the step cannot be written.
        DeviceError
            If one of the ranks fails.

        Notes
        -----
        Errors are raised on all ranks, and name the one that they come from.
        """
        number, self._step = self._step, self._step + 1
        if number % self._every:
            return
        start = time.perf_counter()
        with together(self._comm, f"step {number}", InvalidArgumentError):
            if self._closed:
                raise VDIFileError(
                    f"{self._path} is closed: no step can be written; make another InSitu with "
                    "append=True to go on"
                )
            at = self._checked_time(at)
            own: Any = None  # read where something follows from all of it
            ends = (np.nan, np.nan)
            if self._function is None or self._deferral.deferred:
                own = Volume(values, self._grid.spacing, self._grid.origin).load()
            if self._function is None:
                self._function = self._looks.transfer_function_of(own)
            if self._deferral.deferred and np.isfinite(own.array).any():
                ends = own.finite_range()
        assert self._function is not None
        if self._deferral.deferred:
            low, high = zip(*self._comm.allgather(ends), strict=True)
            ends = (float(np.fmin.reduce(low)), float(np.fmax.reduce(high)))

        def make(asked: GenerationRequest) -> Any:
            return generate_on_mpi(
                values,
                first,
                self._grid,
                self._camera,
                self._size,
                asked.transfer_function,
                asked.options,
                comm=self._comm,
                device=self._device,
                metadata=asked.metadata,
            )

        whole: Any = SimpleNamespace(
            spacing=self._grid.spacing,
            default_unit_distance=self._grid.default_unit_distance,
            rgba=own is not None and own.rgba,
            chunks=None,
            finite_range=lambda: ends,
        )
        request = GenerationRequest(
            whole,
            self._function,
            self._camera,
            self._size,
            self._options,
            metadata={"classification": self._looks.describe(), "time": at},
        )
        with together(self._comm, f"step {number}"):
            deferred = self._deferral.deferred
            vdi = generate_deferred(request, self._deferral, make) if deferred else make(request)
        with together(self._comm, f"writing step {number}"):  # or the others would wait for ever
            if vdi is not None and self._writer is not None:
                self._writer.append(vdi, at)
            elif vdi is not None:
                if self._before is not None:
                    check_goes_on(self._path, self._before, vdi)
                vdi.save(Path(self._path.format(number)))
                self._before = None
        self.seconds.append(time.perf_counter() - start)

    def _checked_time(self, at: Any) -> float:
        """Return the time of the next step, or raise InvalidArgumentError."""
        if self._writer is not None and at is not None:
            return self._writer.checked_time(at)
        time, before = checked_time(at), self._before and self._before.metadata.get("time")
        if isinstance(before, int | float) and not time > before:
            raise InvalidArgumentError(
                f"times must ascend; got {time} after {before}, that of the last step"
            )
        return time

    def close(self) -> None:
        """End the run: no step comes after, and others may write."""
        self._closed = True
        if self._writer is not None:
            self._writer.close()

    def __enter__(self) -> InSitu:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:  # maybe on this rank alone
            self.close()
            return
        with together(self._comm, "closing the file"):
            self.close()


def _checked_path(path: Any) -> str:
    """Return the name of a series, or one with a place for the number of the step."""
    name = str(path) if isinstance(path, str | os.PathLike) else ""
    try:
        numbered = name.format(0) != name.format(1)
    except (AttributeError, IndexError, KeyError, ValueError):  # no braces, or more than one
        numbered = False
    if not numbered and not name.lower().endswith(".vdis"):
        raise InvalidArgumentError(
            f"{path!r} is neither a series (x.vdis) nor has it a place for the step's "
            "number: step_{:04d}.vdi"
        )
    return name


def _checked_every(every: Any) -> int:
    number = as_whole(every)
    if not number >= 1:
        raise not_taken(every)(f"every must be a whole number of steps from 1; got {every!r}")
    return int(number)


def _numbers(path: str) -> list[int]:
    """Return the numbers of the files that are there of a name with a place for a number."""
    folder, name = Path(path).parent, Path(path).name
    texts = [text for text, *_ in Formatter().parse(name)]
    before, after = (re.escape(text) for text in (texts[0], "".join(texts[1:])))
    found = (
        re.fullmatch(rf"{before}0*(\d+){after}", file.name)
        for file in (folder.iterdir() if folder.is_dir() else ())
    )
    numbers = sorted(int(match[1]) for match in found if match)
    return [number for number in numbers if Path(path.format(number)).is_file()]
