"""The exact image of any VDI from any view, in float64: the oracle (docs/dev/conventions.md).

A VDI's medium is piecewise constant, so nothing is sampled: a ray is cut where it crosses from one
list to the next, each piece is intersected with every supersegment of its list by a linear scan,
and what is met is composited front to back.
"""

from __future__ import annotations

import copy
import functools
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.vdi import VDI
from reference.compositing import composite, optical_depth_over_length

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


#: Nearest view depth of V_O, in diagonals of the bounds, that a ray is followed to in perspective:
#: list coordinates are undefined at the eye (docs/dev/conventions.md#lengths).
NEAR_LIMIT = 1e-6


class Line(NamedTuple):
    """A piece of a straight line in the view space of V_O.

    P(t) = origin + t direction for t in [t0, t1]; one unit of t is ``unit_length`` model units.
    """

    origin: Array
    direction: Array
    t0: float
    t1: float
    unit_length: float


class Lists:
    """A VDI in float64, with what does not depend on the ray.

    ``vdi``: what to look at. ``opacity_multiplier``: factor of the optical depths.
    ``optical_depth``: tau, float64 (n,), multiplied. ``front``, ``back``: view depth of the faces
    in V_O, float64 (n,), world units, depth origin added. ``length``: l, float64 (n,): length of
    each supersegment on its list's centre ray, model units. ``viewport``: float64 (4, 4), view
    space of V_O to (u d, v d, Z, d).
    """

    def __init__(self, vdi: VDI, opacity_multiplier: float = 1.0) -> None:
        self.vdi = vdi
        self.optical_depth = vdi.optical_depth.astype(np.float64) * opacity_multiplier
        self.viewport = vdi.camera.viewport_matrix(vdi.window_size)
        self.front = vdi.front.astype(np.float64) + vdi.depth_origin
        self.back = vdi.back.astype(np.float64) + vdi.depth_origin
        self.offsets = vdi.offsets.astype(np.int64)
        scale = np.repeat(centre_ray_scale(vdi).ravel(), np.diff(self.offsets))
        thickness = vdi.back.astype(np.float64) - vdi.front.astype(np.float64)
        self.length = thickness * scale

    def displaced(self, shift: Array) -> Lists:
        """Return a copy with both faces moved outwards by ``shift``, float64 (n,), world units.

        Negative: inwards, but a supersegment never gets thinner than nothing. L stays: it comes
        from the stored depths themselves; only the crossings are found from rounded ones.
        """
        moved = copy.copy(self)
        moved.front = self.front - shift
        moved.back = np.maximum(self.back + shift, moved.front)
        return moved


def centre_ray_scale(vdi: VDI) -> Array:
    """Return the model length of one world unit of view depth along each list's centre ray.

    Returns: float64 (H, W), bottom row first; for the identity as model transform ``sqrt(1 + (u_c
    t_x)^2 + (v_c t_y)^2)``, in parallel projection 1
    (docs/dev/conventions.md#a-supersegment-is-a-homogeneous-medium).
    """
    width, height = vdi.window_size
    scale = np.empty((height, width))
    _, direction = vdi.camera.ray_coefficients(vdi.window_size)
    to_model = np.linalg.inv(vdi.camera.model_to_view)[:3, :3]
    constant, along_u, along_v = direction @ to_model.T
    u = (2 * np.arange(width) + 1) / width - 1
    for y in range(height):
        v = (2 * y + 1) / height - 1
        scale[y] = np.linalg.norm(constant + np.outer(u, along_u) + v * along_v, axis=1)
    return scale


def near_limit(vdi: VDI) -> float:
    """Return the smallest view depth of V_O that rays are followed to; world units.

    :data:`NEAR_LIMIT` times the diagonal of the bounds, carried into the world by the model
    transform's largest stretch.
    """
    extent = np.subtract(vdi.bounds[1::2], vdi.bounds[::2])
    stretch = float(np.linalg.norm(vdi.camera.model_transform[:3, :3], ord=2))
    return NEAR_LIMIT * stretch * float(np.linalg.norm(extent))


def render(
    vdi: VDI,
    camera: Camera,
    window_size: Sequence[int] | None = None,
    *,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
) -> Array:
    """Return the exact image of a VDI from any view.

    Parameters
    ----------
    vdi : VDI
        What to look at.
    camera : Camera
        V_N; its model transform places the VDI's model frame in its world.
    window_size : (int, int), optional
        Width and height of the image; the VDI's own by default.
    opaque_depth : array_like of float, shape (H, W), optional
        Top row first: view depth of V_N, world units, at which the ray ends.
    clipping_planes : array_like of float, shape (k, 6), optional
        Origin and normal of each, world coordinates; the side the normal points to is kept.
    cropping : Cropping or what makes one, optional
        Which regions of the model frame are drawn.
    opacity_multiplier : float
        Factor of every optical depth.

    Returns
    -------
    numpy.ndarray
        float64 (H, W, 4), premultiplied RGBA, top row first.
    """
    width, height = check_window_size(vdi.window_size if window_size is None else window_size)
    pixels = [(x, height - 1 - row) for row in range(height) for x in range(width)]
    colors = render_pixels(
        vdi,
        camera,
        (width, height),
        pixels,
        opaque_depth=opaque_depth,
        clipping_planes=clipping_planes,
        cropping=cropping,
        opacity_multiplier=opacity_multiplier,
    )
    return colors.reshape(height, width, 4)


def render_pixels(
    vdi: VDI,
    camera: Camera,
    window_size: Sequence[int],
    pixels: Sequence[tuple[int, int]],
    *,
    nudge: tuple[float, float] = (0.0, 0.0),
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
) -> Array:
    """Return the exact colour of some pixels, float64 (len(pixels), 4), premultiplied RGBA.

    ``pixels`` are ``(x, y)``, y = 0 at the bottom; ``nudge`` moves every ray on the window, in
    pixels of V_N; the rest is as for :func:`render`.
    """
    lists = Lists(vdi, opacity_multiplier)
    view = Rays(vdi, camera, window_size, opaque_depth, clipping_planes, cropping)
    colors = np.zeros((len(pixels), 4))
    for k, pixel in enumerate(pixels):
        colors[k] = composite_lines(lists, view.lines(pixel, nudge))
    return colors


class Rays(NamedTuple):
    """The rays of a view that may meet a VDI, as :func:`render` is asked for them."""

    vdi: VDI
    camera: Camera
    window_size: Sequence[int]
    opaque_depth: ArrayLike | None = None
    clipping_planes: ArrayLike | None = None
    cropping: Any = None

    def lines(self, pixel: tuple[int, int], nudge: tuple[float, float] = (0.0, 0.0)) -> list[Line]:
        """Return the parts of a pixel's ray that may meet the medium, in their order.

        There is one at most, unless something is cropped. A ray begins at the viewer's eye in
        perspective; in parallel projection, whose eye is infinitely far, it has no beginning: VTK
        too fits its near plane to what is drawn.
        """
        vdi, camera = self.vdi, self.camera
        width, height = check_window_size(self.window_size)
        x, y = pixel
        ray = pixel_ray(camera, (width, height), x + nudge[0], y + nudge[1])
        # Limit the ray by the bounds, the clipping planes, the viewer's eye and opaque depth
        limits = inside_box(ray, vdi.bounds) + inside_planes(ray, camera, self.clipping_planes)
        if not camera.parallel_projection:
            limits.append(HalfSpace(0.0, 1.0))
        if self.opaque_depth is not None:
            depth = np.asarray(self.opaque_depth, dtype=np.float64)
            if depth.shape != (height, width):
                raise InvalidArgumentError(
                    f"opaque_depth must have shape (H, W) = ({height}, {width}); got {depth.shape}"
                )
            end = float(depth[height - 1 - y, x])
            if end < np.inf:
                limits.append(HalfSpace(end, -1.0))
        # Limit it by V_O's viewport, -d <= u d <= d, and in perspective by Z > 0
        to_view, to_viewport = vdi.camera.model_to_view, vdi.camera.viewport_matrix(vdi.window_size)
        origin = to_view[:3, :3] @ ray.origin + to_view[:3, 3]
        direction = to_view[:3, :3] @ ray.direction
        at, slope = to_viewport @ np.append(origin, 1.0), to_viewport @ np.append(direction, 0.0)
        for axis, sign in itertools.product((0, 1), (1.0, -1.0)):
            limits.append(
                HalfSpace(float(at[3] + sign * at[axis]), float(slope[3] + sign * slope[axis]))
            )
        if not vdi.camera.parallel_projection:
            limits.append(HalfSpace(float(at[2]) - near_limit(vdi), float(slope[2])))
        span = clip(limits)
        if span is None:
            return []
        length = float(np.linalg.norm(ray.direction))
        parts = kept_parts(ray, *span, Cropping.from_any(self.cropping))
        return [Line(origin, direction, *part, length) for part in parts]


def kept_parts(
    ray: Ray, t0: float, t1: float, cropping: Cropping | None
) -> list[tuple[float, float]]:
    """Return the parts of [t0, t1] in which a ray of the model frame runs through kept regions."""
    if cropping is None:
        return [(t0, t1)]
    planes = np.reshape(cropping.planes, (3, 2))
    # Nothing lies between a low plane and a high one below it
    planes[:, 1] = planes.max(axis=1)
    origin, direction = (np.dot(cropping.normals, along) for along in (ray.origin, ray.direction))
    with np.errstate(divide="ignore", invalid="ignore"):  # a plane that is never reached
        t = ((planes - origin[:, None]) / direction[:, None]).ravel()
    cuts = np.unique(np.concatenate([[t0], t[(t > t0) & (t < t1)], [t1]]))
    parts: list[tuple[float, float]] = []
    for begin, end in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
        point = origin + (begin + end) / 2 * direction
        i, j, k = (int(np.searchsorted(planes[axis], point[axis], "right")) for axis in range(3))
        if not cropping.regions >> (i + 3 * j + 9 * k) & 1:
            continue
        if parts and parts[-1][1] == begin:
            parts[-1] = (parts[-1][0], end)
        else:
            parts.append((begin, end))
    return parts


def composite_lines(lists: Lists, lines: Sequence[Line]) -> Array:
    """Return what the medium along several lines, one behind the other, looks like together."""
    color = np.zeros(4)
    for line in lines:
        color += (1 - color[3]) * composite_line(lists, line)  # over
    return color


def composite_line(lists: Lists, line: Line) -> Array:
    """Return what the medium along a line looks like from its beginning.

    ``lists``: the medium. ``line``: where to look, within V_O's half space Z > 0 in perspective;
    what lies outside its viewport is empty. Returns: float64 (4,), premultiplied RGBA.
    """
    crossed = crossings(lists, line)
    tau = optical_depth_over_length(
        lists.optical_depth[crossed.member], crossed.length, lists.length[crossed.member]
    )
    return composite(lists.vdi.color[crossed.member], tau)


class Crossings(NamedTuple):
    """The supersegments that a line passes through, in the order in which it meets them.

    ``member``: int64 (n,), indices of supersegments; one may be met in several pieces. ``length``:
    float64 (n,), what is crossed of each, model units. ``begin``, ``end``: float64 (n,), where, as
    t of the line.
    """

    member: NDArray[np.int64]
    length: Array
    begin: Array
    end: Array


def crossings(lists: Lists, line: Line) -> Crossings:
    """Intersect a line with a medium; arguments as for :func:`composite_line`."""
    # Homogeneous viewport coordinates (u d, v d, Z, d) are linear in t: h(t) = at + t slope
    at = lists.viewport @ np.append(line.origin, 1.0)
    slope = lists.viewport @ np.append(line.direction, 0.0)

    # Cut it where it crosses a border between lists: u d = border d, with both linear in t
    width, height = lists.vdi.window_size
    found = [np.array([line.t0, line.t1])]
    for axis, edge in enumerate((width, height)):
        border = 2 * np.arange(edge + 1) / edge - 1
        offset, rise = at[axis] - border * at[3], slope[axis] - border * slope[3]
        with np.errstate(divide="ignore", invalid="ignore"):  # a border that is never reached
            t = -offset / rise
        found.append(t[(t > line.t0) & (t < line.t1)])
    cuts = np.unique(np.concatenate(found))

    # Find each piece's list; a border belongs to the higher index (docs/dev/conventions.md#borders)
    t = (cuts[:-1] + cuts[1:]) / 2
    d = at[3] + t * slope[3]
    x = np.floor(((at[0] + t * slope[0]) / d + 1) / 2 * width)
    y = np.floor(((at[1] + t * slope[1]) / d + 1) / 2 * height)
    within = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    owner = np.where(within, y * width + x, -1).astype(np.int64)

    # Every supersegment of every list that the line passes through, in the order it meets them
    inside = np.flatnonzero(owner >= 0)
    begin, end = lists.offsets[owner[inside]], lists.offsets[owner[inside] + 1]
    count = end - begin
    piece = np.repeat(inside, count)
    rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    forward = np.repeat(begin, count) + rank
    backward = np.repeat(end, count) - 1 - rank
    member = backward if slope[2] < 0 else forward

    # The share of each piece that lies between the two faces
    depth = at[2] + cuts * slope[2]
    share = _share_between(depth[piece], depth[piece + 1], lists.front[member], lists.back[member])
    hit = share > 0
    member, piece, share = member[hit], piece[hit], share[hit]
    whole = cuts[piece + 1] - cuts[piece]
    near = lists.back[member] if slope[2] < 0 else lists.front[member]
    with np.errstate(divide="ignore", invalid="ignore"):  # across the depth: the whole piece
        before = (near - depth[piece]) / (depth[piece + 1] - depth[piece])
    before = np.clip(np.where(np.isfinite(before), before, 0.0), 0.0, 1.0 - share)
    first = cuts[piece] + before * whole
    return Crossings(member, share * whole * line.unit_length, first, first + share * whole)


def _share_between(first: Array, last: Array, front: Array, back: Array) -> Array:
    """Return the share of a piece from depth ``first`` to ``last`` that lies in [front, back).

    By intervals, never by (face - first) / slope alone: a piece may run across the view direction.
    """
    low, high = np.minimum(first, last), np.maximum(first, last)
    overlap = np.minimum(high, back) - np.maximum(low, front)
    within = (front <= low) & (low < back)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(overlap / (high - low), 0.0, 1.0)
    return np.where(high > low, share, within.astype(np.float64))
