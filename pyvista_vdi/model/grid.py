"""Where the points of a uniform grid are, whether or not their values are at hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


class Geometry:
    """What follows from a uniform grid's points, spacing, origin and direction."""

    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]
    direction: NDArray[np.float64]
    dimensions: tuple[int, int, int]
    #: What the opacity unit distance is by default, if not that of these points: a level of a
    #: multi-scale store has the finest level's, so that all levels look the same; model units.
    unit_distance: float | None = None

    @property
    def index_to_model(self) -> NDArray[np.float64]:
        """Point index (x, y, z) to model coordinates, float64 (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.direction * np.asarray(self.spacing)
        matrix[:3, 3] = self.origin
        return matrix

    @property
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
        x0, x1, y0, y1, z0, z1 = self.bounds
        return float(np.linalg.norm([x1 - x0, y1 - y0, z1 - z0]))

    @property
    def default_unit_distance(self) -> float:
        """The opacity unit distance that ``Plotter.add_volume`` takes by default, model units."""
        if self.unit_distance is not None:
            return self.unit_distance
        return self.length / (float(np.mean(self.dimensions)) - 1)


@dataclass(frozen=True)
class Grid(Geometry):
    """A uniform grid without its values.

    ``dimensions``: points along x, y and z. ``spacing``, ``origin``: as of a
    :class:`~pyvista_vdi.model.volume.Volume`, model units. ``direction`` (float64 (3, 3)): columns
    are the directions of the index axes. ``unit_distance``: in place of
    :attr:`default_unit_distance`.
    """

    dimensions: tuple[int, int, int]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]
    direction: NDArray[np.float64]
    unit_distance: float | None = None

    @classmethod
    def of(cls, geometry: Geometry) -> Grid:
        """Return the grid of a volume."""
        return cls(
            geometry.dimensions,
            geometry.spacing,
            geometry.origin,
            geometry.direction,
            geometry.unit_distance,
        )
