"""Takes a simulation's blocks, step by step, and writes what they look like."""

from __future__ import annotations

import operator
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.large.on_mpi import generate_on_mpi, mpi, together
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.grid import Grid
from pyvista_vdi.model.options import GENERATION_NAMES, GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.series.writer import SeriesWriter


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
    device : optional
        Of this rank, see :func:`pyvista_vdi.list_devices`.
    **options
        What :func:`pyvista_vdi.generate` takes, classification included. ``clim`` must be given, so
        that colours mean the same in all steps. ``precision`` is ``"8-byte"`` by default.

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
    TypeError
        If a keyword is unknown.

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
        camera: Any,
        window_size: Sequence[int],
        dimensions: Sequence[int],
        spacing: Sequence[float] = (1.0, 1.0, 1.0),
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        comm: Any = None,
        every: int = 1,
        device: Any = None,
        **options: Any,
    ) -> None:
        if comm is None:
            comm = mpi().COMM_WORLD
        if not as_float(every) >= 1:
            raise InvalidArgumentError(f"every must be 1 or more steps; got {every!r}")
        self._path, self._comm, self._every, self._device = str(path), comm, every, device
        self._series = self._path.lower().endswith(".vdis")
        if not self._series and not _numbered(self._path):
            raise InvalidArgumentError(
                f"{self._path!r} is neither a series (x.vdis) nor has it a place for the step's "
                "number: step_{:04d}.vdi"
            )
        self._camera = Camera.from_any(camera)
        self._size = check_window_size(window_size)
        looks = {name: value for name, value in options.items() if name not in GENERATION_NAMES}
        if looks.get("clim") is None and "transfer_function" not in looks:
            raise InvalidArgumentError(
                "clim=(low, high) is missing: no step knows the range of the others"
            )
        self._looks = Classification(looks, "InSitu", GENERATION_NAMES)
        chosen = {name: value for name, value in options.items() if name in GENERATION_NAMES}
        self._options = GenerationOptions(**{"precision": "8-byte", **chosen})
        try:
            x, y, z = (operator.index(n) for n in dimensions)
        except (TypeError, ValueError) as error:
            raise InvalidArgumentError(
                f"dimensions must be three whole numbers, along x, y and z; got {dimensions!r}"
            ) from error
        of = Volume(np.zeros((2, 2, 2), np.uint8), spacing, origin)  # checks them
        self._grid = Grid((x, y, z), of.spacing, of.origin, of.direction)
        self._function: TransferFunction | None = None
        self._writer: SeriesWriter | None = None
        self._step = 0
        self.seconds: list[float] = []

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
        DeviceError
            On all ranks, if one of them fails.
        """
        number, self._step = self._step, self._step + 1
        if number % self._every:
            return
        start = time.perf_counter()
        if self._function is None:
            with together(self._comm, "reading the values"):
                own = Volume(values, self._grid.spacing, self._grid.origin)
                self._function = self._looks.transfer_function(own)
        vdi = generate_on_mpi(
            values,
            first,
            self._grid,
            self._camera,
            self._size,
            self._function,
            self._options,
            comm=self._comm,
            device=self._device,
            metadata={"classification": self._looks.describe(), "time": at},
        )
        with together(self._comm, f"writing step {number}"):  # or the others would wait for ever
            if vdi is not None and not self._series:
                vdi.save(Path(self._path.format(number)))
            elif vdi is not None:
                if self._writer is None:
                    self._writer = SeriesWriter(self._path, precision=self._options.precision)
                self._writer.append(vdi, at)
        self.seconds.append(time.perf_counter() - start)

    def close(self) -> None:
        """Finish the series' file; what was appended is readable before."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def __enter__(self) -> InSitu:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _numbered(path: str) -> bool:
    """Whether a name has a place for the number of the step."""
    try:
        return path.format(0) != path.format(1)
    except (IndexError, KeyError, ValueError):  # braces that are none, or more than one
        return False
