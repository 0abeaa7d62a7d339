"""A view on a screen, and how far two of them are apart."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners


@dataclass(frozen=True)
class View:
    """A camera, with the actor's matrix in it, and the viewport's size in pixels."""

    camera: Camera
    size: tuple[int, int]

    def distance(self, other: "View", bounds: tuple[float, ...]) -> float:
        """Return by how much the corners of a volume's bounds differ between two pictures.

        Largest distance of a corner's places in the two pictures, each from the picture's centre
        ray and in its own pixels, over half this picture's height. 0 for the same view; about the
        angle in radians where an object that fills the picture is turned; infinite where a corner
        is behind an eye. It sees turning, panning, zooming and resizing alike.
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
