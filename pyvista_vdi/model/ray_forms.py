"""Rays as the kernels take them: affine forms of the pixel and of t (``opencl/lib/rays.cl``).

Their numbers are computed in float64, about the depth at which rays reach the data, so that an eye
or an origin far away costs the kernels' float32 nothing (docs/dev/conventions.md#rays).
"""

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidCameraError
from pyvista_vdi.model.camera import Camera, unit
from pyvista_vdi.model.checks import as_floats
from pyvista_vdi.model.cropping import AXES, Cropping
from pyvista_vdi.model.host_memory import aligned_empty
from pyvista_vdi.model.view import bounds_corners, projected

Floats: TypeAlias = NDArray[np.float64]

#: Depth before which nothing is looked up in perspective, in diagonals of the bounds ("Lengths").
NEAREST_DEPTH = 1e-6


class Rectangle(NamedTuple):
    """Pixels of a window, the last ones excluded; y = 0 is the bottom row."""

    x0: int
    x1: int
    y0: int
    y1: int

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.x1 - self.x0, self.y1 - self.y0

    @property
    def pixels(self) -> int:
        """How many there are."""
        return max(self.x1 - self.x0, 0) * max(self.y1 - self.y0, 0)


@dataclass(frozen=True)
class PixelRays:
    """The rays of all pixels of a window, in the model frame.

    ``P(t) = pixel @ origin + t * (pixel @ direction)`` with ``pixel = (1, a, b)``, a and b the
    offsets of the pixel's centre from the window's, in pixels, and t view depth less
    ``reference_depth``, world units. ``origin`` and ``direction``: float64 (3, 3), rows for 1, a
    and b; model units. ``depths``: the least and the largest view depth of the bounds that they
    are formed for.
    """

    origin: Floats
    direction: Floats
    reference_depth: float
    depths: tuple[float, float]

    def forms(self, rows: Floats) -> Floats:
        """Six numbers each of functions ``row[:3] . P + row[3]`` of model points P, (n, 6)."""
        normals = rows[:, :3, np.newaxis]
        forms = np.hstack([self.origin @ normals, self.direction @ normals])[:, :, 0]
        forms[:, 0] += rows[:, 3]
        return forms


def depth_range(camera: Camera, bounds: Sequence[float]) -> tuple[float, float]:
    """Return the least and the largest view depth of bounds in the model frame; world units."""
    row = camera.model_to_view[2]
    # About the bounds' centre, so that an origin far away does not cost the extent its digits
    box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
    centre, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
    middle = row[:3] @ centre + row[3]
    reach = np.abs(row[:3]) @ half
    return float(middle - reach), float(middle + reach)


def nearest_depth(camera: Camera, bounds: Sequence[float]) -> float:
    """Return the view depth before which nothing is looked up, world units.

    :data:`NEAREST_DEPTH` diagonals of the bounds, by the model transform's largest stretch; -inf in
    parallel projection.
    """
    if camera.parallel_projection:
        return -np.inf
    diagonal = float(np.linalg.norm(np.subtract(bounds[1::2], bounds[::2])))
    return NEAREST_DEPTH * diagonal * float(np.linalg.norm(camera.model_transform[:3, :3], 2))


def check_list_space(camera: Camera, bounds: Sequence[float]) -> None:
    """Refuse a generating view whose lists float32 cannot express (docs/dev/numerics.md).

    Lengths times reciprocal depths leave 1e-36 to 1e36 then, beyond which it loses digits.
    """
    near, far = (1.0, 1.0) if camera.parallel_projection else depth_range(camera, bounds)
    near = max(near, nearest_depth(camera, bounds))
    diagonal = float(np.linalg.norm(np.subtract(bounds[1::2], bounds[::2])))
    if not (0 < near <= far and diagonal > 0):
        return  # nothing is seen
    products = (1 / near / near, 1 / far / far, diagonal / near / far, diagonal)
    if min(products) < 1e-36 or max(products) > 1e36:
        raise InvalidCameraError(
            f"view depths from {near:.3g} to {far:.3g} world units, of bounds that are "
            f"{diagonal:.3g} model units across, are beyond float32: scale the spacing (or the "
            "actor's matrix), and the camera with it, towards 1"
        )


def pixel_rays(camera: Camera, window_size: Sequence[int], bounds: Sequence[float]) -> PixelRays:
    """Return the rays of a camera's window in the model frame.

    The reference depth is the bounds' near one where the eye is outside, 0 where they reach behind
    it.
    """
    width, height = window_size
    depths = depth_range(camera, bounds)
    depth = depths[0] if camera.parallel_projection else max(depths[0], 0.0)
    origin, direction = camera.ray_coefficients((width, height))
    per_pixel = np.array([[1.0], [2 / width], [2 / height]])  # (u, v) to pixel offsets
    origin = (origin + depth * direction) * per_pixel
    direction = direction * per_pixel
    to_model = inverse_affine(camera.model_to_view)
    linear = to_model[:3, :3].T
    origin = origin @ linear
    origin[0] += to_model[:3, 3]
    return PixelRays(origin, direction @ linear, depth, depths)


def inverse_affine(matrix: Floats) -> Floats:
    """Return the inverse of an affine float64 (4, 4) matrix."""
    inverse = np.eye(4)
    # Columns scaled to one, so that a world of 1e-9 or 1e9 is inverted as well as one of 1
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    inverse[:3, :3] = np.linalg.inv(matrix[:3, :3] / scale) / scale[:, None]
    inverse[:3, 3] = -inverse[:3, :3] @ matrix[:3, 3]
    return inverse


def box_planes(rays: PixelRays, bounds: ArrayLike, normals: ArrayLike = AXES) -> Floats:
    """Return the six forms that keep what is inside bounds along normals of the model frame."""
    low, high = np.reshape(bounds, (3, 2)).T
    rows = np.column_stack([normals, -low]), np.column_stack([np.negative(normals), high])
    return rays.forms(np.vstack(rows))


def view_planes(camera: Camera, rays: PixelRays, planes: Sequence[Sequence[float]]) -> Floats:
    """Return the forms that keep what is in front of the eye and of clipping planes of the world.

    In parallel projection there is none of the eye. See :attr:`RenderOptions.clipping_planes`.
    """
    table, matrix, rows = np.reshape(planes, (-1, 6)), camera.model_transform, []
    # Of unit normals: a form of one that float32 cannot hold would clip nothing
    for origin, normal in zip(table[:, :3], unit(table[:, 3:]), strict=True):
        rows.append([*(normal @ matrix[:3, :3]), normal @ (matrix[:3, 3] - origin)])
    forms = rays.forms(np.reshape(rows, (-1, 4)))
    if camera.parallel_projection:
        return forms
    return np.vstack([[rays.reference_depth, 0, 0, 1, 0, 0], forms])


def cropped(
    rays: PixelRays, cropping: Cropping | None, bounds: Sequence[float]
) -> tuple[Floats, Floats, int]:
    """Return how a kernel crops the rays through a box: by what it clips to, and what is left.

    First forms to clip to: a box, or nothing at all. Then six that are positive beyond the low and
    the high plane of each axis, for ``opencl/lib/cropping.cl``, and the regions that belong to
    them; none and 0 where clipping is enough.
    """
    none = np.empty((0, 6))
    if cropping is None:
        return none, none, 0
    box, planes = cropping.reach(bounds), np.reshape(cropping.planes, (3, 2))
    planes = np.maximum.accumulate(planes, axis=1)  # nothing is between a low one and less
    # Within the bounds, so that a plane far away costs float32 nothing
    cuts = np.clip(planes, box[:, :1], box[:, 1:])
    borders = np.column_stack([box[:, 0], cuts, box[:, 1]])
    x, y, z = np.diff(borders, axis=1) > 0
    there = x[:, None, None] & y[:, None] & z
    kept = (cropping.regions >> np.arange(27).reshape(3, 3, 3).T & 1) == 1
    places = np.argwhere(there & kept)
    if not len(places):
        return np.array([[-1.0, 0, 0, 0, 0, 0]]), none, 0  # a plane that keeps nothing
    if not (there & ~kept).any():
        return none, none, 0
    first, last = places.min(axis=0), places.max(axis=0) + 1
    if (there & ~kept)[tuple(map(slice, first, last))].any():  # what is kept is no box
        rows = np.column_stack([np.repeat(cropping.normals, 2, axis=0), -cuts.ravel()])
        return none, rays.forms(rows), cropping.regions
    ends = borders[range(3), first], borders[range(3), last]
    return box_planes(rays, np.stack(ends, axis=1), cropping.normals), none, 0


def direction_forms(rays: PixelRays, window_size: Sequence[int], multiplier: float = 1.0) -> Floats:
    """Return forms whose slopes are the rays' direction, times a factor, over a power of two.

    With that power as their value, see ``model_speed`` of ``lib/list_space.cl``. Slopes are
    about 1 then, and squares of theirs neither overflow nor vanish in float32, whatever the units.
    """
    slopes = multiplier * rays.direction.T
    _, exponent = np.frexp((np.abs(slopes) @ [1.0, *np.divide(window_size, 2)]).max())
    power = np.ldexp(1.0, int(np.clip(exponent, -126, 126)))
    return np.column_stack([np.tile([power, 0, 0], (3, 1)), slopes / power])


def packed(forms: Sequence[Floats]) -> NDArray[np.float32]:
    """Return forms as the kernels read them, float32 (n, 12); refuse what float32 cannot hold.

    Behind the six numbers of a form stands what float32 rounds off them: see ``lib/rays.cl``.
    """
    with np.errstate(over="ignore"):
        table = np.asarray(forms, dtype=np.float32)
    if not np.isfinite(table).all():
        raise InvalidCameraError(
            "the view cannot be expressed in float32: positions or distances exceed 1e38 model "
            "units; scale the data and the camera"
        )
    return np.hstack([table, np.subtract(forms, table, dtype=np.float64).astype(np.float32)])


def largest_value(
    rays: PixelRays, camera: Camera, window_size: Sequence[int], bounds: ArrayLike, forms: Floats
) -> float:
    """Return the largest magnitude of forms, first numbers too, on rays that meet the bounds."""
    places = projected(camera, window_size, bounds_corners(bounds))
    places = np.array([(0, 0), window_size]) if places is None else np.clip(places, 0, window_size)
    ends = np.array([places.min(axis=0), places.max(axis=0)]) - np.divide(window_size, 2)
    pixels = np.array([(1.0, a, b) for a in ends[:, 0] for b in ends[:, 1]])
    values, slopes = pixels @ forms[:, :3].T, pixels @ forms[:, 3:].T
    far = rays.depths[1] - rays.reference_depth
    return float(np.abs(np.vstack([forms[:, 0], values, values + far * slopes])).max())


def pixels_of_points(camera: Camera, window_size: Sequence[int], points: Floats) -> Rectangle:
    """Return a part of a window that the convex hull of model points lies in, float64 (n, 3).

    All of the window, if one of them is not in front of the eye; two pixels more than the points
    reach to otherwise.
    """
    if not len(points):
        return Rectangle(0, 0, 0, 0)
    at = projected(camera, window_size, points)
    if at is None or not np.isfinite(at).all():
        return Rectangle(0, window_size[0], 0, window_size[1])
    low = np.clip(np.floor(at.min(axis=0) - 2), 0, window_size)
    high = np.clip(np.ceil(at.max(axis=0) + 2), 0, window_size)
    return Rectangle(int(low[0]), int(high[0]), int(low[1]), int(high[1]))


def checked_opaque_depth(
    opaque_depth: ArrayLike | None, window_size: tuple[int, int], rays: PixelRays
) -> NDArray[np.float32] | None:
    """Return where each pixel's ray ends, as t: float32 (H, W), top row first; page-aligned."""
    if opaque_depth is None:
        return None
    wanted = f"opaque_depth must have shape (height, width) = {window_size[::-1]}"
    depth = opaque_depth
    if not (isinstance(depth, np.ndarray) and depth.dtype in (np.float32, np.float64)):
        depth = as_floats(opaque_depth)
    if depth.shape != window_size[::-1]:
        raise InvalidArgumentError(f"{wanted}; got {depth.shape}: {reprlib.repr(opaque_depth)}")
    ends = aligned_empty(depth.shape, np.float32)
    with np.errstate(over="ignore"):  # beyond float32 is as good as never
        np.subtract(depth, rays.reference_depth, out=ends, dtype=np.float64, casting="same_kind")
    if np.isnan(ends.min()):
        raise InvalidArgumentError("opaque_depth holds NaN: use inf where nothing is opaque")
    return ends
