"""What a ray meets first in a VDI: a single ray, walked on the host in float64.

The same laws as the kernels' (docs/dev/conventions.md): a ray is cut where it crosses from one list
to the next, each piece is clipped by interval to the supersegments of its list, and what it crosses
of one absorbs in proportion to its length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import Number, as_float, as_range
from pyvista_vdi.model.options import FrameRequest, Options, option
from pyvista_vdi.model.vdi import VDI, DeferredVDI

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True)
class Pick:
    """A supersegment that a ray has hit.

    Attributes
    ----------
    position : tuple of float
        Where the ray enters it, world coordinates.
    depth : float
        View depth of that point: its distance from the eye along the view direction, world units.
    list : (int, int)
        Column and row of the list in V_O's window; row 0 is the bottom one.
    index : int
        Which supersegment of the list it is; 0 is nearest to V_O.
    supersegment : int
        Its place in the VDI's arrays.
    color : tuple of float
        Its straight RGB, 0 to 1.
    optical_depth : float
        tau of the length of it that the ray crosses.
    accumulated_optical_depth : float
        tau of the ray from its beginning up to where it leaves the supersegment.
    value : float, optional
        Mean of the values that it holds, where the VDI keeps them (:class:`DeferredVDI`).
    """

    position: tuple[float, float, float]
    depth: float
    list: tuple[int, int]
    index: int
    supersegment: int
    color: tuple[float, float, float]
    optical_depth: float
    accumulated_optical_depth: float
    value: float | None = None

    @property
    def opacity(self) -> float:
        """Opacity of the length of it that the ray crosses."""
        return -math.expm1(-self.optical_depth)

    @property
    def accumulated_opacity(self) -> float:
        """Opacity of the ray from its beginning up to where it leaves the supersegment."""
        return -math.expm1(-self.accumulated_optical_depth)


@dataclass(frozen=True)
class FirstHit(Options):
    """What counts as a hit.

    opacity_threshold: opacity that the hit has to reach, 0 to below 1
        The default is ``vtkCellPicker``'s for volumes. With 0, whatever absorbs light is hit.
    accumulated: compare the opacity of the ray from its beginning, 1 - exp(-(tau_0 + ... + tau_k))
        The hit is the first supersegment with which the ray has become as opaque as that. ``False``
        compares each supersegment's own, 1 - exp(-tau_k) over the length that the ray crosses of
        it, and looks through haze; but it depends on how finely the lists are cut, and where the
        ray runs across the lists, it crosses little of each.
    """

    opacity_threshold: float = option(0.05, Number("an opacity", high=1, below=True))
    accumulated: bool = True

    @property
    def optical_depth(self) -> float:
        """Optical depth at which the threshold is reached."""
        return -math.log1p(-self.opacity_threshold)

    def first(self, optical_depths: Floats) -> int | None:
        """Return which of the media that a ray meets is hit; ``None`` if none is."""
        met = np.cumsum(optical_depths) if self.accumulated else optical_depths
        reached = (met > 0) & (met >= self.optical_depth)
        return int(np.argmax(reached)) if reached.any() else None


def pick_vdi(
    vdi: VDI,
    request: FrameRequest,
    pixel: Sequence[float],
    hit: FirstHit,
    deferred: DeferredVDI | None = None,
) -> Pick | None:
    """Return the first supersegment on a pixel's ray that is hit: see :func:`pyvista_vdi.pick`.

    The request's ``opaque_depth`` is that of this ray, a number. ``deferred``: what the VDI
    was classified from.
    """
    camera, options = request.camera, request.options
    (x, y), (width, height) = as_range(pixel), request.window_size
    if not (-0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5):
        raise InvalidArgumentError(
            f"pixel must be (x, y) inside the window of {width} x {height}, y = 0 at the bottom; "
            f"got {pixel!r}"
        )
    ray = _Ray.of_pixel(vdi, camera, (x, y), request.window_size)
    span = ray.span(vdi, request)
    if span is None:
        return None
    cropping = options.cropping
    kept = np.array([span])
    if cropping is not None:
        kept = cropping.parts_of_ray(ray.origin, ray.direction, *span)
    met = _media_along(vdi, ray, *span, kept, options.opacity_multiplier)
    k = hit.first(met.optical_depth)
    if k is None:
        return None
    row, column = divmod(int(met.list[k]), vdi.window_size[0])
    supersegment = int(met.supersegment[k])
    value = None
    if deferred is not None:  # whose list has also what was left out
        begin, end = map(int, deferred.offsets[met.list[k] : met.list[k] + 2])
        away = np.abs(deferred.front[begin:end] - vdi.front[supersegment])
        low, high = deferred.value_range
        value = low + (high - low) * float(deferred.mean[begin + int(np.argmin(away))])
    at_model = np.append(ray.origin + met.enters[k] * ray.direction, 1.0)
    return Pick(
        position=_triple((camera.model_transform @ at_model)[:3]),
        depth=float(met.enters[k] + ray.window.reference_depth),
        list=(column, row),
        index=supersegment - vdi.list_at(column, row).start,
        supersegment=supersegment,
        color=_triple(vdi.color[supersegment]),
        optical_depth=float(met.optical_depth[k]),
        accumulated_optical_depth=float(met.optical_depth[: k + 1].sum()),
        value=value,
    )


@dataclass(frozen=True)
class _Ray:
    """A pixel's ray, P(t) = origin + t direction in the model frame; t as in ``rays.PixelRays``.

    ``at + t slope`` are its homogeneous coordinates (u d, v d, Z, d) in V_O's viewport.
    """

    pixel: Floats  # (1, a, b)
    window: rays.PixelRays
    origin: Floats
    direction: Floats
    at: Floats
    slope: Floats

    @classmethod
    def of_pixel(
        cls, vdi: VDI, camera: Camera, pixel: tuple[float, float], size: tuple[int, int]
    ) -> _Ray:
        x, y = pixel
        weights = np.array([1.0, x + 0.5 - size[0] / 2, y + 0.5 - size[1] / 2])
        window = rays.pixel_rays(camera, size, vdi.bounds)
        origin, direction = weights @ window.origin, weights @ window.direction
        to_viewport = vdi.camera.viewport_matrix(vdi.window_size) @ vdi.camera.model_to_view
        return cls(
            weights,
            window,
            origin,
            direction,
            to_viewport @ np.append(origin, 1.0),
            to_viewport @ np.append(direction, 0.0),
        )

    def span(self, vdi: VDI, request: FrameRequest) -> tuple[float, float] | None:
        """Return first and last t where there may be a medium; ``None`` where there is none."""
        planes = request.options.clipping_planes
        of_view = rays.view_planes(request.camera, self.window, planes)
        table = np.vstack([rays.box_planes(self.window, vdi.bounds), of_view])
        (u, v, depth, d), (du, dv, ddepth, dd) = self.at, self.slope
        value = [*(table[:, :3] @ self.pixel), d + u, d - u, d + v, d - v]
        slope = [*(table[:, 3:] @ self.pixel), dd + du, dd - du, dd + dv, dd - dv]
        if not vdi.camera.parallel_projection:
            value.append(depth - rays.nearest_depth(vdi.camera, vdi.bounds))
            slope.append(ddepth)
        if request.opaque_depth is not None:
            end = as_float(request.opaque_depth)
            if math.isnan(end):
                raise InvalidArgumentError(
                    "opaque_depth must be a view depth in world units, or inf; "
                    f"got {request.opaque_depth!r}"
                )
            value.append(end - self.window.reference_depth)
            slope.append(-1.0)
        return _where_positive(np.array(value), np.array(slope))


class _Media(NamedTuple):
    """What a ray crosses, in the order in which it meets it; arrays of equal length."""

    list: Integers
    supersegment: Integers
    enters: Floats  # t
    optical_depth: Floats  # of the length crossed


def _media_along(
    vdi: VDI, ray: _Ray, first: float, last: float, kept: Floats, multiplier: float
) -> _Media:
    """Return every supersegment that a ray crosses between two t, in the parts that are kept."""
    # Cut the ray where it enters another list, and find the list of each piece by its middle
    crossings = [np.array([first, last])]
    for axis, edge in enumerate(vdi.window_size):
        border = 2 * np.arange(edge + 1) / edge - 1
        with np.errstate(divide="ignore", invalid="ignore"):  # a border that is never reached
            t = -(ray.at[axis] - border * ray.at[3]) / (ray.slope[axis] - border * ray.slope[3])
        crossings.append(t[(t > first) & (t < last)])
    cuts = np.unique(np.concatenate(crossings))
    u, v, _, d = ray.at[:, None] + ray.slope[:, None] * ((cuts[:-1] + cuts[1:]) / 2)
    column, row = (
        np.clip(np.floor((c / d + 1) / 2 * edge), 0, edge - 1).astype(np.int64)
        for c, edge in zip((u, v), vdi.window_size, strict=True)
    )
    wide, high = vdi.window_size
    lists = row * wide + column

    # All supersegments of these lists, each list from the end that the ray comes from
    begin, end = vdi.offsets[lists].astype(np.int64), vdi.offsets[lists + 1].astype(np.int64)
    count = end - begin
    piece = np.repeat(np.arange(len(lists)), count)
    rank = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    depth, rises = ray.at[2], ray.slope[2]
    member = begin[piece] + rank if rises >= 0 else end[piece] - 1 - rank

    # Clip each by interval to its piece
    front = vdi.front[member].astype(np.float64) + vdi.depth_origin
    back = vdi.back[member].astype(np.float64) + vdi.depth_origin
    enters, leaves = cuts[piece], cuts[piece + 1]
    if rises == 0:
        leaves = np.where((front <= depth) & (depth < back), leaves, enters)
    else:
        with np.errstate(over="ignore"):  # a face that is hardly ever reached
            at_front, at_back = (front - depth) / rises, (back - depth) / rises
        enters = np.maximum(enters, np.minimum(at_front, at_back))
        leaves = np.minimum(leaves, np.maximum(at_front, at_back))
    begins = np.maximum(enters[:, None], kept[:, 0])
    drawn = np.maximum(np.minimum(leaves[:, None], kept[:, 1]) - begins, 0.0)
    crossed = drawn.sum(axis=1) > 0
    piece, member, begins, drawn = piece[crossed], member[crossed], begins[crossed], drawn[crossed]
    enters = begins[np.arange(len(begins)), np.argmax(drawn > 0, axis=1)] if len(begins) else begins

    # tau l / L (docs/dev/conventions.md, "A supersegment is a homogeneous medium")
    length = multiplier * drawn.sum(axis=1) * np.linalg.norm(ray.direction)
    thickness = vdi.back[member].astype(np.float64) - vdi.front[member].astype(np.float64)
    across, up = column[piece] + 0.5 - wide / 2, row[piece] + 0.5 - high / 2
    centre = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds).direction
    directions = np.stack([np.ones(len(piece)), across, up], axis=1) @ centre
    whole = thickness * np.linalg.norm(directions, axis=1)
    return _Media(lists[piece], member, enters, vdi.optical_depth[member] * (length / whole))


def _where_positive(value: Floats, slope: Floats) -> tuple[float, float] | None:
    """Return the t between which every ``value + t slope`` is positive; ``None`` if none is."""
    if (value[slope == 0] < 0).any():
        return None
    rising, falling = slope > 0, slope < 0
    first = float(np.max(-value[rising] / slope[rising], initial=-np.inf))
    last = float(np.min(-value[falling] / slope[falling], initial=np.inf))
    return (first, last) if first < last else None


def _triple(values: ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(values, dtype=np.float64).tolist()
    return x, y, z
