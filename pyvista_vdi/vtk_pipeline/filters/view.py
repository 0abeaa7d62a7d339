"""A view on the screen, and how far two of them are apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners


def as_array(matrix: Any) -> NDArray[np.float64]:
    """Return a ``vtkMatrix4x4`` as float64 (4, 4)."""
    return np.array(matrix.GetData(), dtype=np.float64).reshape(4, 4)


@dataclass(frozen=True)
class View:
    """A camera, with the actor's matrix in it, and the viewport's size in pixels."""

    camera: Camera
    size: tuple[int, int]

    @classmethod
    def of(cls, renderer: Any, model_transform: NDArray[np.float64]) -> View:
        """Return what a renderer shows an actor from.

        Raises
        ------
        UnsupportedError
            If its camera has what the optical model has no place for.
        """
        camera = Camera.from_any(renderer.GetActiveCamera(), model_transform=model_transform)
        width, height = renderer.GetSize()
        return cls(camera, (max(1, width), max(1, height)))

    def distance(self, other: View, bounds: tuple[float, ...]) -> float:
        """Return by how much the bounds' corners differ between two pictures.

        Parameters
        ----------
        other : View
            The other view.
        bounds : tuple of float
            Of the volume, model frame.

        Returns
        -------
        float
            Largest distance of a corner's places in the two pictures, each from the picture's
            centre ray and in its own pixels, over half this picture's height. 0 for the same view;
            about the angle in radians where an object that fills the picture is turned; infinite
            where a corner is behind an eye. It sees turning, panning, zooming and resizing alike.
        """
        if self == other:
            return 0.0
        places = [view._pixels(bounds) for view in (self, other)]
        if places[0] is None or places[1] is None:
            return math.inf
        apart = np.linalg.norm(places[0] - places[1], axis=1)
        return float(apart.max()) / (self.size[1] / 2)

    def _pixels(self, bounds: tuple[float, ...]) -> NDArray[np.float64] | None:
        """Return the corners' places in pixels from the centre ray, (8, 2); None behind the eye."""
        camera = self.camera
        corners = np.column_stack([bounds_corners(bounds), np.ones(8)])
        x, y, z, _ = camera.model_to_view @ corners.T
        per_unit = np.asarray(self.size) / 2 / camera.half_extent(self.size)
        places = np.column_stack([x, y]) * per_unit
        if camera.parallel_projection:
            return places
        return None if z.min() <= 0 else places / z[:, None]
