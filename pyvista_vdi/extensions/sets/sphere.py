"""Directions on a sphere, and the views of an orbit from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.quality.view_error import world_centre

Floats = NDArray[np.float64]

#: Points for each direction that stand for the sphere while directions are moved apart.
_POINTS_EACH = 40
#: Rounds of that.
_ROUNDS = 200
#: Above this share of the length along the axis of a view's up direction another one is up.
_TOO_STEEP = 0.98


def spread(n: int) -> Floats:
    """Return n unit vectors that are spread over the sphere, float64 (n, 3); always the same.

    They are a Fibonacci spiral's, each moved again and again towards the farthest point of those
    that it is nearest to: with 32 no direction is farther than 24 degrees from one of them.
    """
    directions, points = spiral(n), spiral(_POINTS_EACH * n)
    for step in np.linspace(0.3, 0.0, _ROUNDS, endpoint=False):
        cosines = points @ directions.T
        mine = cosines.argmax(axis=1)
        far = np.where(mine[:, None] == np.arange(n), cosines, 2.0).argmin(axis=0)
        directions = directions + step * (points[far] - directions)
        directions /= np.linalg.norm(directions, axis=1)[:, None]
    return directions


def spiral(n: int) -> Floats:
    """Return n unit vectors of a Fibonacci spiral, float64 (n, 3)."""
    k = np.arange(n) + 0.5
    z = 1 - 2 * k / n
    turn = np.pi * (1 + np.sqrt(5)) * k
    across = np.sqrt(1 - z**2)
    return np.stack([np.cos(turn) * across, np.sin(turn) * across, z], axis=1)


def orbit(camera: Camera, bounds: Sequence[float], directions: Any) -> list[Camera]:
    """Return views of a volume from directions, world coordinates, as far from it as a view is.

    They look at the centre of the bounds. Up is where ``camera`` has it, as well as that can be.
    """
    centre = world_centre(camera, bounds)
    distance = float(np.linalg.norm(np.asarray(camera.position) - centre))
    up = np.asarray(camera.view_up) / np.linalg.norm(camera.view_up)
    aside = camera.axes[2] - up * (up @ camera.axes[2])
    aside /= np.linalg.norm(aside)
    views = []
    for direction in np.asarray(directions, dtype=np.float64):
        steep = abs(direction @ up) > _TOO_STEEP
        views.append(
            camera.replace(
                position=centre + distance * direction,
                focal_point=centre,
                view_up=aside if steep else up,
                window_center=(0.0, 0.0),
            )
        )
    return views
