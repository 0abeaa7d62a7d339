"""A scalar volume on a uniform grid: samples, spacing, origin, direction."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.model.checks import as_floats, as_vector
from pyvista_vdi.model.chunked import ChunkedArray, held, library_of
from pyvista_vdi.model.host_memory import require_host_memory


@dataclass(eq=False)
class Grid:
    """A uniform grid, without values.

    ``dimensions``: points along x, y and z. ``spacing``, ``origin``: as of a :class:`Volume`, model
    units. ``direction`` (float64 (3, 3)): columns are the directions of the index axes.
    ``unit_distance``: the opacity unit distance by default, if not that of these points: a level of
    a multi-scale store has the finest level's, so that all levels look the same; model units.
    """

    dimensions: tuple[int, int, int]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]
    direction: NDArray[np.float64]
    unit_distance: float | None = None

    @functools.cached_property
    def index_to_model(self) -> NDArray[np.float64]:
        """Point index (x, y, z) to model coordinates, float64 (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.direction * np.asarray(self.spacing)
        matrix[:3, 3] = self.origin
        matrix.setflags(write=False)
        return matrix

    @functools.cached_property
    def bounds(self) -> tuple[float, float, float, float, float, float]:
        """Axis-aligned bounds in the model frame: x0, x1, y0, y1, z0, z1; model units."""
        axes = self.index_to_model[:3, :3] * (np.asarray(self.dimensions) - 1)
        low = np.asarray(self.origin) + np.minimum(axes, 0).sum(axis=1)
        high = np.asarray(self.origin) + np.maximum(axes, 0).sum(axis=1)
        x, y, z = zip(low.tolist(), high.tolist(), strict=True)
        return (*x, *y, *z)

    @property
    def length(self) -> float:
        """Diagonal of :attr:`bounds`, model units (``pyvista.DataSet.length``)."""
        return float(np.linalg.norm(np.subtract(self.bounds[1::2], self.bounds[::2])))

    @property
    def default_unit_distance(self) -> float:
        """The opacity unit distance that ``Plotter.add_volume`` takes by default, model units."""
        if self.unit_distance is not None:
            return self.unit_distance
        return self.length / (float(np.mean(self.dimensions)) - 1)


class Volume(Grid):
    """Scalars, or colours with opacity, at the points of a uniform grid.

    The grid's model coordinates are ``origin + direction @ (spacing * (x, y, z))`` for the point
    with index ``array[z, y, x]``, as in ``vtkImageData``. The array is not copied where it is
    already contiguous, native and of a supported type; do not change it while it is in use.

    Parameters
    ----------
    array : array_like, shape (nz, ny, nx) or (nz, ny, nx, 4)
        Dask, zarr and h5py arrays are read chunk by chunk, where a part is needed. The scalars:
        uint8, int8, uint16, int16, uint32, int32, float32 or float64 (bool and
        float16 are widened; 64-bit integers become float64 when that is exact). Or straight RGBA,
        uint8, whose fourth component is the scalar. At least two points along each axis.
    spacing : array_like of float, shape (3,)
        Distance between neighbouring points along x, y, z; model units, positive.
    origin : array_like of float, shape (3,)
        Model coordinates of ``array[0, 0, 0]``.
    direction : array_like of float, shape (3, 3), optional
        Columns are the directions of the x, y and z index axes; identity by default.
    name : str
        What the scalars are called.

    Raises
    ------
    InvalidVolumeError
        If the array has another shape, is empty, only one point thick or of another type, or
        the grid is not finite, positive and invertible.
    """

    name: str
    #: Whether every point has a colour of its own; the scalar is the fourth component then.
    rgba: bool
    #: Whether the voxels are read chunk by chunk: VDIs are then made block by block.
    chunked: bool
    #: Of lengths, where a file says it.
    unit: str = ""
    #: What is not drawn, uint8 (nz, ny, nx), of a VTK image: a bit for each octant, half a voxel
    #: long, around each point. That above the point along x has 1 in its number, y 2, z 4.
    blanked: NDArray[np.uint8] | None = None

    def __init__(
        self,
        array: ArrayLike,
        spacing: ArrayLike = (1.0, 1.0, 1.0),
        origin: ArrayLike = (0.0, 0.0, 0.0),
        direction: ArrayLike | None = None,
        *,
        name: str = "values",
    ) -> None:
        if library_of(array) in ("dask", "zarr", "h5py") and hasattr(array, "chunks"):
            array = ChunkedArray(array)
        self.chunked = isinstance(array, ChunkedArray)
        self.array: Any = array
        if not self.chunked:
            try:
                values = np.asarray(array)
            except (TypeError, ValueError) as error:  # lists of different lengths
                raise InvalidVolumeError(f"a volume is an array of numbers: {error}") from error
            rgba = values.ndim == 4 and values.shape[-1] == 4 and values.dtype == np.uint8
            if values.ndim != 3 and not rgba:
                raise InvalidVolumeError(
                    "a volume is a three-dimensional array, one scalar per point, indexed "
                    f"[z, y, x], or RGBA as four uint8 per point; got shape {values.shape}"
                )
            self.array = held(values)
        self.rgba = self.array.ndim == 4
        nz, ny, nx = self.array.shape[:3]
        if min(nx, ny, nz) < 2:
            raise InvalidVolumeError(
                "the volume has only one plane of points, or none: its shape is "
                f"{self.array.shape[:3]} (z, y, x), and a volume needs at least two points along "
                "each axis"
            )
        self.dimensions = nx, ny, nz
        self.spacing = as_vector(spacing, "spacing", error=InvalidVolumeError)
        self.origin = as_vector(origin, "origin", error=InvalidVolumeError)
        matrix = np.eye(3) if direction is None else as_floats(direction)
        finite = matrix.shape == (3, 3) and np.isfinite(matrix).all()
        if not finite or abs(np.linalg.det(matrix)) < 1e-9:
            raise InvalidVolumeError(
                "direction must be 3 x 3 finite numbers, three independent directions as columns; "
                f"got {direction!r}"
            )
        matrix.setflags(write=False)
        self.direction = matrix
        self.name = str(name)
        if min(self.spacing) <= 0:
            raise InvalidVolumeError(
                f"spacing must be positive along each axis; got {self.spacing}: "
                "flip the array (or the direction matrix) instead of a negative spacing"
            )

    @staticmethod
    def from_vtk(image: Any, scalars: str | None = None, preference: str = "point") -> Volume:
        """Make a volume of a VTK image, to be drawn again and again.

        Parameters
        ----------
        image : vtkImageData or pyvista.ImageData
            Its origin, spacing, direction matrix and ghost arrays are honoured.
        scalars : str, optional
            Name of the array; the active scalars by default, else the only array there is.
        preference : {"point", "cell"}
            Which array, where points and cells both have one of that name.

        Returns
        -------
        Volume
            It shares memory with the point array where that is contiguous and of a type that
            kernels read; cell data become point data.

        Raises
        ------
        InvalidVolumeError
            If there are no such scalars, or not a grid of at least 2 x 2 x 2 points.
        UnsupportedError
            If it is another kind of grid, or the scalars have several components.
        """
        from_vtk = registry.method("Volume.from_vtk")
        return from_vtk(image, scalars, preference)  # type: ignore[no-any-return]

    def in_view(self, *cameras: Any, window_size: Sequence[int]) -> Volume:
        """Return what of several levels these views require: of one, itself."""
        return self

    def load(self, *cameras: Any, window_size: Sequence[int] = (1, 1)) -> Volume:
        """Return the volume in memory, of several levels the one that views require."""
        found = self.in_view(*cameras, window_size=window_size) if cameras else self
        if not found.chunked:
            return found
        remedy = "open a coarser level (level=..., --level), or generate a VDI, block by block"
        require_host_memory(found.array.nbytes, f"the volume {found.name}", remedy, free=True)
        array = found.array[:, :, :]
        loaded = Volume(array, found.spacing, found.origin, found.direction, name=found.name)
        loaded.unit_distance, loaded.unit = found.unit_distance, found.unit
        return loaded

    @property
    def scalars(self) -> NDArray[np.generic]:
        """What opacity depends on, (nz, ny, nx)."""
        return self.array[..., 3] if self.rgba else self.array

    def finite_range(self) -> tuple[float, float]:
        """Return the least and the largest scalar, NaN left out; InvalidVolumeError if all are."""
        low, high = self._range
        if np.isnan(low):
            raise InvalidVolumeError(
                f"every value of {self.name!r} is NaN: there is nothing to render; choose another "
                "array, or leave this volume out"
            )
        return low, high

    @functools.cached_property
    def _range(self) -> tuple[float, float]:
        if self.chunked:
            return self.array.ends  # type: ignore[no-any-return]
        low, high = np.fmin.reduce(self.scalars, axis=None), np.fmax.reduce(self.scalars, axis=None)
        return float(low), float(high)

    def __repr__(self) -> str:
        nx, ny, nz = self.dimensions
        kind = "RGBA" if self.rgba else self.array.dtype
        return f"Volume({nx} x {ny} x {nz} {kind}, spacing={self.spacing})"
