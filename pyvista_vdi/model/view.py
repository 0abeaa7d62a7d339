"""Views of a box: the window that covers it, what of it they see, and how far two are apart."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.model.camera import MAX_WINDOW_EDGE, Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Grid

#: Most lists that a covering view may have, as a multiple of the window's pixels.
MAX_LISTS_PER_PIXEL = 4.0

#: A corner this little beyond a pixel's border, in pixels, does not need another row of lists.
SLACK = 1e-6


@dataclass(frozen=True)
class View:
    """A camera, with the actor's matrix in it, and the viewport's size in pixels."""

    camera: Camera
    size: tuple[int, int]

    def distance(self, other: "View", bounds: tuple[float, ...]) -> float:
        """Return the largest distance of a corner's places in two pictures, in half heights.

        About the angle in radians where an object that fills the picture is turned; infinite where
        a corner is behind an eye.
        """
        if self == other:
            return 0.0
        places = []
        for view in (self, other):
            pixels = projected(view.camera, view.size, bounds_corners(bounds))
            if pixels is None:
                return math.inf
            places.append(pixels + (np.array(view.camera.window_center) - 1) / 2 * view.size)
        return float(np.linalg.norm(places[0] - places[1], axis=1).max()) / (self.size[1] / 2)


def covering_view(
    camera: Camera, window_size: Sequence[int], corners: ArrayLike
) -> tuple[Camera, tuple[int, int]] | None:
    """Return a view, and its size, whose window covers the hull of corners, and nothing else.

    Eye, direction, the pixels' size and their borders stay as they are on the screen, so that
    V_N = V_O hits every list on its centre ray. Where that took more lists than
    :data:`MAX_LISTS_PER_PIXEL` times the window's pixels, they become larger. ``None`` where no
    window can cover the corners: see :func:`projected`.

    With t the tangents of the half angles and c the window centre, the pixel rectangle [x0, x1) of
    width w in a window of width W has t' = t w / W and c' t' = t (c + (x0 + x1) / W - 1); the same
    in y, and with s for t in parallel projection (docs/dev/conventions.md#list-coordinates).
    """
    size = np.asarray(window_size, dtype=np.float64)
    pixels = projected(camera, window_size, np.asarray(corners, dtype=np.float64))
    if pixels is None:
        return None
    low = np.floor(pixels.min(axis=0) + SLACK)
    high = np.maximum(np.ceil(pixels.max(axis=0) - SLACK), low + 1)
    # Take as many lists as allowed, each a square
    extent, most = high - low, MAX_LISTS_PER_PIXEL * size.prod()
    pitch = max(1.0, math.sqrt(extent.prod() / most), extent.max() / MAX_WINDOW_EDGE)
    lists = np.ceil(extent / pitch - SLACK)
    while not (lists.prod() <= most or (lists == 1).any()):
        pitch *= 1.01  # rounding up both edges may pass the limit by less than two rows
        lists = np.ceil(extent / pitch - SLACK)
    grown = (lists * pitch - extent) / 2
    low, high = low - grown, high + grown

    half = np.asarray(camera.half_extent(window_size))
    new_half = half * (high - low) / size
    middle = half * (np.asarray(camera.window_center) + (low + high) / size - 1)
    width, height = (int(n) for n in lists)
    lens: dict[str, float] = {"parallel_scale": new_half[1]}
    if not camera.parallel_projection:
        angle = math.degrees(2 * math.atan(new_half[1]))
        lens = {"view_angle": angle, "use_horizontal_view_angle": False}
    return camera.replace(window_center=middle / new_half, **lens), (width, height)


def coverage(vdi: VDI, camera: Camera, window_size: Sequence[int]) -> float:
    """Return the share of a view's rays through the volume that the VDI has all of, 0 to 1.

    Below 1 a part of the volume that the view shows lies outside V_O's window, or behind V_O's eye.
    Of 33 x 33 rays that reach from edge to edge of V_N's window, and of those through the corners
    of the bounds; 1 where none of them meets the volume.

    V_O's window and what lies before its eye are convex: they contain a part of a ray if they
    contain its two ends.
    """
    corners = bounds_corners(vdi.bounds)
    if _has(vdi, corners).all():  # as with coverage="bounds"
        return 1.0
    u, v, _, w = in_viewport(camera, window_size, corners)
    across = np.linspace(-1.0, 1.0, 33)
    places = np.reshape(np.meshgrid(across, across), (2, -1))
    places = np.hstack([places, np.stack([u, v])[:, w > 0] / w[w > 0]])
    places = places[:, (np.abs(places) <= 1).all(axis=0)]
    # Points and directions in view space, taken to the model frame
    to_model = np.linalg.inv(camera.model_to_view)
    rays_of = np.vstack([np.ones(places.shape[1]), places]).T
    origins, directions = (rays_of @ part for part in camera.ray_coefficients(window_size))
    origins = to_model[:3, :3] @ origins.T + to_model[:3, 3:]
    directions = to_model[:3, :3] @ directions.T
    # The part of each that lies within the bounds, and before the eye
    low, high = np.reshape(vdi.bounds, (3, 2)).T[:, :, np.newaxis]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort(np.stack([low - origins, high - origins]) / directions, axis=0)
    ends = np.nan_to_num(ends, nan=0.0, posinf=np.inf, neginf=-np.inf)
    first, last = ends[0].max(axis=0), ends[1].min(axis=0)
    if not camera.parallel_projection:
        first = np.maximum(first, 0.0)
    meets = last > first
    near, far = (origins[:, meets] + t[meets] * directions[:, meets] for t in (first, last))
    return float(np.mean(_has(vdi, near.T) & _has(vdi, far.T))) if meets.any() else 1.0


def nearest_depth(grid: Grid, camera: Camera, window_size: Sequence[int]) -> float | None:
    """Return the view depth of the visible part of a grid's box that is nearest to the eye.

    World units, 0 where the eye is in the box; ``None`` where nothing of it is in the window.
    """
    from scipy.optimize import linprog  # it has scikit-image's

    to_view = camera.model_to_view @ grid.index_to_model
    to_view[:3, :3] *= np.subtract(grid.dimensions, 1)  # the box is [0, 1]³ then
    u, v, _, w = camera.viewport_matrix(window_size) @ to_view
    planes = np.stack([w + u, w - u, w + v, w - v])  # of the window, not negative inside
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    depth = to_view[2] / np.linalg.norm(to_view[2, :3])
    found = linprog(depth[:3], -planes[:, :3], planes[:, 3], bounds=(0, 1))
    return max(0.0, float(to_view[2] @ [*found.x, 1])) if found.success else None


def required_level(levels: Sequence[Grid], camera: Camera, window_size: Sequence[int]) -> int:
    """Return which of the levels of a volume, the finest first, a view requires.

    It is the coarsest whose voxels are still as fine as half a list's width where the volume is
    nearest to V_O: between the lists, what a finer one has more is hardly seen. Edges of voxels
    count along the axes in which a level is coarser: many stores keep their few planes in all.
    """
    depth = nearest_depth(levels[0], camera, window_size)
    if depth is None:  # V_O sees nothing of the volume
        return len(levels) - 1
    width = min(2 * np.divide(camera.half_extent(window_size), window_size))
    width *= 1.0 if camera.parallel_projection else depth
    to_view = camera.model_to_view[:3, :3]
    # Distances of neighbouring points along x, y and z, world units; what is less than 1 % is none
    edges = [np.linalg.norm(to_view @ each.index_to_model[:3, :3], axis=0) for each in levels]
    fine = [now[now > 1.01 * edges[0]].max(initial=0) <= width / 2 for now in edges]
    return fine.index(False) - 1 if False in fine else len(levels) - 1


def _has(vdi: VDI, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which model points, (n, 3), lie in V_O's window, or outside by no more than 1e-5."""
    u, v, _, w = in_viewport(vdi.camera, vdi.window_size, points)
    return np.asarray(np.maximum(np.abs(u), np.abs(v)) <= w + 1e-5 * np.abs(w).max())


#: Which of the six numbers of bounds are x, y and z of each corner, int (3, 8).
_CORNERS = np.array(np.meshgrid([0, 1], [2, 3], [4, 5])).reshape(3, 8)


def bounds_corners(bounds: ArrayLike) -> NDArray[np.float64]:
    """Return the eight corners of axis-aligned bounds (x0, x1, y0, y1, z0, z1), float64 (8, 3)."""
    return np.asarray(bounds, dtype=np.float64)[_CORNERS].T


def in_viewport(
    camera: Camera, window_size: Sequence[int], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return homogeneous viewport coordinates (u d, v d, Z, d) of model points, float64 (4, n)."""
    matrix = camera.viewport_matrix(window_size) @ camera.model_to_view
    return np.asarray(matrix[:, :3] @ points.T + matrix[:, 3:])


def projected(
    camera: Camera, window_size: Sequence[int], corners: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return points in pixels from the window's lower left corner.

    None if one is behind the eye or closer than a thousandth of all points' diagonal, where what
    they cover on the screen has no useful size.
    """
    u, v, depth, d = in_viewport(camera, window_size, corners)
    if not camera.parallel_projection:
        world = corners @ camera.model_transform[:3, :3].T
        diagonal = float(np.linalg.norm(np.ptp(world, axis=0)))
        if depth.min() <= 1e-3 * diagonal:
            return None
    return np.asarray((np.stack([u / d, v / d], axis=1) + 1) / 2 * window_size)
