"""Takes a simulation's blocks, step by step, and writes what they look like."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.extensions.large.blocks import ends_of
from pyvista_vdi.extensions.large.on_mpi import (
    SharedGrid,
    generate_on_mpi,
    ranks_of,
    require_same,
    together,
)
from pyvista_vdi.extensions.series.series import checked_time
from pyvista_vdi.extensions.series.writer import SeriesWriter
from pyvista_vdi.generation.deferred import generate_deferred, unclassified
from pyvista_vdi.model.arguments import records_of
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import Number, as_vector
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import Deferral, GenerationOptions, GenerationRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import CameraLike, DeviceLike, WindowSize
from pyvista_vdi.model.volume import Grid, Volume

_RECORDS = (Classification, Deferral, GenerationOptions)


class InSitu(AbstractContextManager["InSitu"]):
    """Writes a series of VDIs of a simulation while it runs. All ranks call it together.

    Parameters
    ----------
    path : path-like
        ``x.vdis``, the folder of a series, which others read while it grows: as of
        :class:`~pyvista_vdi.SeriesWriter`. Rank 0 alone writes.
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
        Continue what an earlier run has written, for a simulation that is started again: times
        must be above that of the last step, camera, window size and classification the same.
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
        If the series cannot be written, or is there already and neither ``append`` nor
        ``overwrite`` is given.
    TypeError
        If a keyword is unknown.

    Notes
    -----
    Errors are raised on all ranks, whichever was given what is wrong, and name it.

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
        self._comm = comm = ranks_of(comm)
        self._path, self._device, self._closed, self._step = path, device, False, 0
        self._grid: dict[str, Any] = {}
        self._function: TransferFunction | None = None
        self._writer: SeriesWriter | None = None
        self.seconds: list[float] = []
        with together(comm, "InSitu", InvalidArgumentError):
            steps = Number("a whole number of steps", 1, whole=True, name="every")
            self._every = steps(every)
            self._camera = Camera.from_any(camera)
            self._size = check_window_size(window_size)
            count = Number("three whole numbers of points", 2, whole=True, name="dimensions")
            x, y, z = map(count, as_vector(dimensions, "dimensions"))
            of = Volume(np.zeros((2, 2, 2), np.uint8), spacing, origin)  # checks them
            self._grid = asdict(Grid((x, y, z), of.spacing, of.origin, of.direction))
            self._check(options)
        require_same(
            comm,
            every=self._every,
            camera=self._camera.to_dict(),
            window_size=self._size,
            grid=self._grid,
            deferral=self._deferral,
            # What devices may take differs, and lights are those of the first rank
            options=replace(self._options, memory_limit=None, lights=Lights()),
        )
        with together(comm, "InSitu"):
            if comm.rank == 0:
                precision = self._options.precision
                self._writer = SeriesWriter(
                    path, precision=precision, append=append, overwrite=overwrite
                )

    def _check(self, looks: dict[str, Any]) -> None:
        """Take what generate takes, or raise."""
        self._looks, self._deferral, self._options = records_of(
            looks, "InSitu", *_RECORDS, defaults={"precision": "8-byte"}
        )
        missing = self._looks.clim is None and self._looks.transfer_function is None
        if self._deferral.deferred:
            missing = self._deferral.value_range is None
        if missing:
            raise InvalidArgumentError(
                f"{'value_range' if self._deferral.deferred else 'clim'}=(low, high) is missing: "
                "no step knows the range of the others"
            )
        if self._deferral.deferred:
            self._looks.require_no_look()
            self._function = unclassified(self._looks.interpolation)

    def __call__(self, values: NDArray[Any], first: Sequence[int], at: float) -> None:
        """Write a step, unless it is one that is left out.

        Parameters
        ----------
        values : numpy.ndarray, shape (nz, ny, nx)
            This rank's own points, without ghosts. Blocks are those of a grid of blocks: all
            ranks' cuts along an axis are the same, and each has four points at least.
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
            at = checked_time(at)
            own = Volume(values, self._grid["spacing"], self._grid["origin"]).load()
            index = Number("three whole numbers, the index of a point", whole=True, name="first")
            x, y, z = map(index, as_vector(first, "first"))
            get_runtime(self._device)
            if self._function is None:
                self._function = self._looks.transfer_function_of(own)
            ends = ends_of(own.array)
        assert self._function is not None
        require_same(
            self._comm,
            values=(f"of type {own.array.dtype}", own.array.shape[3:]),
            transfer_function=self._function.to_dict(),
        )
        low, high = zip(*self._comm.allgather(ends), strict=True)
        ends = float(np.fmin.reduce(low)), float(np.fmax.reduce(high))
        grid: Any = SharedGrid(
            **self._grid, array=own.array, rgba=own.rgba, first=(x, y, z), ends=ends
        )
        request = GenerationRequest(
            grid,
            self._function,
            self._camera,
            self._size,
            self._options,
            self._device,
            metadata={"classification": self._looks.describe(), "time": at},
        )
        with together(self._comm, f"step {number}"):
            make = partial(generate_on_mpi, comm=self._comm)
            deferred = self._deferral.deferred
            vdi = generate_deferred(request, self._deferral, make) if deferred else make(request)
        with together(self._comm, f"writing step {number}"):  # or the others would wait for ever
            if self._writer is not None:
                self._writer.append(vdi, at)
        self.seconds.append(time.perf_counter() - start)

    def close(self) -> None:
        """End the run: no step comes after, and others may write."""
        self._closed = True
        if self._writer is not None:
            self._writer.close()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:  # maybe on this rank alone
            self.close()
            return
        with together(self._comm, "closing the file"):
            self.close()
