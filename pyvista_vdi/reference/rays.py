"""Rays of a view in the model frame, and cutting them by half spaces; float64."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera

Array = NDArray[np.float64]


class Ray(NamedTuple):
    """P(t) = origin + t direction in the model frame; t is the view depth of its own view.

    View depth is the distance from the eye along the view direction, world units; ``direction``
    is therefore no unit vector: its length is the model length of one world unit of depth.
    """

    origin: Array
    direction: Array


class HalfSpace(NamedTuple):
    """Where ``offset + t slope >= 0``: what is left of a ray by one plane."""

    offset: float
    slope: float


def pixel_ray(camera: Camera, window_size: Sequence[int], x: float, y: float) -> Ray:
    """Return the ray through a point of the window.

    ``camera``: the view; its model transform leads into the model frame. ``window_size``: width and
    height in pixels. ``x``, ``y``: pixel coordinates; y = 0 is the bottom row, and whole numbers
    are pixel centres (pixel i covers i - 1/2 to i + 1/2 here). Returns: In the model frame,
    parametrised by view depth.
    """
    u = (2 * x + 1) / window_size[0] - 1
    v = (2 * y + 1) / window_size[1] - 1
    origin, direction = camera.ray_coefficients(window_size)
    at = np.array([1.0, u, v])
    inverse = _view_to_model(camera)
    return Ray(inverse[:3, :3] @ (at @ origin) + inverse[:3, 3], inverse[:3, :3] @ (at @ direction))


@functools.lru_cache(64)
def _view_to_model(camera: Camera) -> NDArray[np.floating[Any]]:
    return np.linalg.inv(camera.model_to_view)


def clip(half_spaces: Iterable[HalfSpace]) -> tuple[float, float] | None:
    """Return the parameters between which a ray lies in all half spaces.

    Returns: First and last t, the first smaller; ``None`` where nothing is left. Infinite where no
    half space limits the ray.
    """
    t0, t1 = -math.inf, math.inf
    for offset, slope in half_spaces:
        if slope > 0:
            t0 = max(t0, -offset / slope)
        elif slope < 0:
            t1 = min(t1, -offset / slope)
        elif offset < 0:  # parallel to the plane and outside
            return None
    return (t0, t1) if t0 < t1 else None


def inside_box(ray: Ray, bounds: Sequence[float]) -> list[HalfSpace]:
    """Return the six half spaces of axis-aligned bounds (x0, x1, y0, y1, z0, z1), model frame."""
    planes = []
    for axis in range(3):
        o, d = float(ray.origin[axis]), float(ray.direction[axis])
        planes.append(HalfSpace(o - bounds[2 * axis], d))
        planes.append(HalfSpace(bounds[2 * axis + 1] - o, -d))
    return planes


def inside_planes(ray: Ray, camera: Camera, clipping_planes: ArrayLike | None) -> list[HalfSpace]:
    """Return the half spaces that clipping planes keep.

    ``ray``: in the model frame of ``camera``. ``camera``: its model transform leads to the world.
    ``clipping_planes`` (float, shape (k, 6)): origin and normal of each, world coordinates; the
    side the normal points to is kept.
    """
    if clipping_planes is None:
        return []
    planes = np.asarray(clipping_planes, dtype=np.float64)
    if planes.ndim != 2 or planes.shape[1] != 6:
        raise InvalidArgumentError(
            f"clipping_planes must have shape (k, 6), origin and normal; got {planes.shape}"
        )
    to_world = camera.model_transform
    origin = to_world[:3, :3] @ ray.origin + to_world[:3, 3]
    direction = to_world[:3, :3] @ ray.direction
    return [
        HalfSpace(float(plane[3:] @ (origin - plane[:3])), float(plane[3:] @ direction))
        for plane in planes
    ]
