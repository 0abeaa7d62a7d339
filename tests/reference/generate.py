"""From a volume to samples, to an image and to a plain VDI, in float64."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.transfer_function import OPAQUE_OPTICAL_DEPTH, TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import bounds_corners
from pyvista_vdi.model.volume import Volume
from reference.compositing import Segment, composite, merge
from reference.raycast import HalfSpace, Ray, clip, inside_box, pixel_ray
from reference.shading import (
    NodeOcclusion,
    cut_where_unlike,
    gradient_factors,
    lit_colors,
    mean_transmittance,
    trilinear,
)

Array = NDArray[np.float64]

#: What decides where lists are cut; the engine's names.
CRITERIA = ("least-error", "homogeneity")

#: How far outside the grid, in points, a position may lie by float64 rounding alone.
GRID_TOLERANCE = 1e-9


class RaySamples(NamedTuple):
    """The samples of one ray, nearest first; every float64 array has one entry per sample.

    ``pixel`` is (x, y), y = 0 at the bottom. ``begin`` and ``end`` are view depths of V_O between
    which each step lies, world units; ``position`` grid coordinates (x, y, z) of the midpoints, in
    points; ``length`` that of each step, model units; ``color`` straight RGB; ``optical_depth`` tau
    of each step.
    """

    pixel: tuple[int, int]
    begin: Array
    end: Array
    position: Array
    length: Array
    color: Array
    optical_depth: Array


def samples(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    sample_distance: float | None = None,
    lights: Lights | None = None,
    ambient_occlusion: AmbientOcclusion | None = None,
) -> Iterator[RaySamples]:
    """Yield the samples of every pixel's ray, bottom row first, from left to right.

    Samples lie at the midpoints of steps of model length ``sample_distance``, half the smallest
    spacing by default, from where the ray enters the grid, the last step being shorter, so that the
    steps' lengths add up to the ray's length in the grid whatever its directions are:
    docs/dev/conventions.md#from-a-volume-to-the-medium. In perspective a ray begins at the eye at
    the earliest; one that misses the grid has no samples. One headlight lights a shaded volume by
    default.
    """
    width, height = check_window_size(window_size)
    step = min(volume.spacing) / 2 if sample_distance is None else float(sample_distance)
    if not (math.isfinite(step) and step > 0):
        raise InvalidArgumentError(
            f"sample_distance must be a positive length in model units; got {sample_distance!r}"
        )
    to_index = np.linalg.inv(volume.index_to_model)
    occlusion = node_occlusion(volume, transfer_function, ambient_occlusion, step)
    for y in range(height):
        row = []
        for x in range(width):
            ray = pixel_ray(camera, (width, height), x, y)
            start = to_index[:3, :3] @ ray.origin + to_index[:3, 3]
            slope = to_index[:3, :3] @ ray.direction
            per_depth = float(np.linalg.norm(ray.direction))  # model units per unit of view depth
            edges = _steps(start, slope, volume, camera.parallel_projection, step / per_depth)
            position = start + slope * ((edges[:-1] + edges[1:]) / 2)[:, None]
            row.append((edges, position, np.diff(edges) * per_depth))
        # One call for a row: a ray has few samples, and NumPy's calls take longer than they do
        _, positions, lengths = zip(*row, strict=True)
        medium = medium_at(
            volume,
            transfer_function,
            np.concatenate(positions),
            np.concatenate(lengths),
            camera,
            lights,
            occlusion,
        )
        ends = np.cumsum([len(length) for length in lengths])[:-1]
        media = zip(*(np.split(values, ends) for values in medium), strict=True)
        for x, ((edges, position, length), (color, tau)) in enumerate(zip(row, media, strict=True)):
            yield RaySamples((x, y), edges[:-1], edges[1:], position, length, color, tau)


def volume_image(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    sample_distance: float | None = None,
    lights: Lights | None = None,
    ambient_occlusion: AmbientOcclusion | None = None,
) -> Array:
    """Return the direct volume rendering: all samples composited, nothing ended early.

    float64 (H, W, 4), premultiplied RGBA, top row first; parameters as for :func:`samples`.
    """
    width, height = check_window_size(window_size)
    image = np.zeros((height, width, 4))
    rays = samples(
        volume, camera, window_size, transfer_function, sample_distance, lights, ambient_occlusion
    )
    for ray in rays:
        x, y = ray.pixel
        image[height - 1 - y, x] = composite(ray.color, ray.optical_depth)
    return image


def build_vdi(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    sample_distance: float | None = None,
    *,
    max_supersegments: int = 20,
    criterion: str = "least-error",
    weighting: str = "transmittance",
    lights: Lights | None = None,
    ambient_occlusion: AmbientOcclusion | None = None,
) -> VDI:
    """Return a plain VDI: neighbouring samples merged, or cut, until the budget is kept.

    Every sample that is not transparent begins as a supersegment of its own. By the criterion
    least-error, while a list is over budget, the two neighbours whose merging displaces the least
    optical depth become one: with e the extinction times (r, g, b, 1), the cost is the sum of abs(e
    - mean e) over length, what lies between the two (e = 0) included. Merging sees opacity as well
    as colour, so black material that changes density is not homogeneous. By homogeneity, lists are
    cut by :func:`.shading.cut_where_unlike`. Rendered at V_O the result equals :func:`volume_image`
    for any budget, with colours weighted by transmittance (see
    :func:`reference.compositing.merge`).

    Depths are relative to the nearest depth of the bounds where the eye is outside them. Parameters
    are as for :func:`samples`; InvalidArgumentError if ``max_supersegments`` is not positive or the
    criterion is unknown.
    """
    if criterion not in CRITERIA:
        raise InvalidArgumentError(
            f"criterion must be one of {', '.join(CRITERIA)}; got {criterion!r}"
        )
    if max_supersegments < 1:
        raise InvalidArgumentError(
            f"max_supersegments must be a whole number of at least 1; got {max_supersegments!r}"
        )
    depth_origin = near_depth(volume.bounds, camera)
    lists = []
    rays = samples(
        volume, camera, window_size, transfer_function, sample_distance, lights, ambient_occlusion
    )
    for ray in rays:
        runs = [
            Segment(float(t0), float(t1), color, float(tau))
            for t0, t1, color, tau in zip(
                ray.begin, ray.end, ray.color, ray.optical_depth, strict=True
            )
            if tau > 0
        ]
        per_reference = (
            float(ray.length[0] / (ray.end[0] - ray.begin[0])) / min(volume.spacing)
            if runs
            else 0.0
        )
        lists.append(_cut(runs, criterion, max_supersegments, per_reference, weighting))
    return vdi_of_lists(lists, camera, window_size, volume.bounds, depth_origin, criterion)


def near_depth(bounds: Sequence[float], camera: Camera) -> float:
    """Return the nearest view depth of axis-aligned bounds, 0 where the eye is not before them."""
    matrix = camera.model_to_view
    near = float((bounds_corners(bounds) @ matrix[2, :3] + matrix[2, 3]).min())
    return near if near > 0 or camera.parallel_projection else 0.0


def medium_at(
    volume: Volume,
    transfer_function: TransferFunction,
    position: Array,
    length: Array,
    camera: Camera | None = None,
    lights: Lights | None = None,
    occlusion: NodeOcclusion | None = None,
) -> tuple[Array, Array]:
    """Return colour and optical depth of steps whose midpoints have given grid coordinates.

    ``volume``: what to sample. ``transfer_function``: classification and interpolation.
    ``position``: grid coordinates (x, y, z), in points, float64 (n, 3); transparent outside [0,
    dimensions - 1]. ``length``: of each step, float64 (n,), model units. ``camera``: the view; a
    shaded volume needs one. ``lights``: what a shaded volume is lit by; one headlight by default.
    ``occlusion``: what :func:`node_occlusion` returned. Returns: ``color``, straight RGB, float64
    (n, 3). Returns: ``optical_depth``, float64 (n,): ``-log1p(-a) length / U``; where a is 1, no
    less than 30. A gradient opacity g makes of the opacity alpha of this g alpha. Raises
    InvalidArgumentError if the volume is shaded and there is no camera.
    """
    top = np.array(volume.dimensions) - 1
    outside = ((position < -GRID_TOLERANCE) | (position > top + GRID_TOLERANCE)).any(axis=1)
    inside = np.clip(position, 0, top)
    interpolate = trilinear if transfer_function.interpolation == "linear" else _nearest
    scalar = interpolate(volume.scalars, inside)
    color, alpha = classify(transfer_function, scalar)
    if volume.rgba:
        channels = [interpolate(volume.array[..., c], inside) for c in range(3)]
        color = np.stack(channels, axis=1) / 255

    unit = transfer_function.unit_distance or volume.default_unit_distance
    with np.errstate(divide="ignore"):  # log1p(-1): opaque
        tau = np.abs(-np.log1p(-alpha)) * (length / unit)
    tau = np.where(alpha == 1, OPAQUE_OPTICAL_DEPTH, tau)

    if transfer_function.gradient_opacities is not None or transfer_function.shading is not None:
        # Take differences of the scalar from a voxel behind to a voxel ahead; with NaN they are 0
        columns = []
        for axis in np.eye(3):
            ahead, behind = (np.clip(inside + s * axis, 0, top) for s in (1, -1))
            columns.append(interpolate(volume.scalars, ahead) - interpolate(volume.scalars, behind))
        differences = np.stack(columns, axis=1)
        differences = np.where(np.isnan(differences), 0.0, differences)
        factor = gradient_factors(volume, transfer_function, differences)
        tau = np.where(factor < 1, -np.log1p(factor * np.expm1(-tau)), tau)
        if transfer_function.shading is not None:
            if camera is None:
                raise InvalidArgumentError("a shaded volume is seen by a camera: give one")
            lights = Lights() if lights is None else lights
            color = lit_colors(
                volume, camera, transfer_function.shading, lights, inside, differences, color
            )
    if occlusion is not None:
        color = color * occlusion.factors(inside)[:, None]
    unseen = outside | np.isnan(scalar)
    if volume.blanked is not None:
        # Leave out what lies in blank octants
        nearest = np.floor(inside + 0.5).astype(np.int64)
        octant = (inside >= nearest) @ np.array([1, 2, 4])
        x, y, z = nearest.T
        unseen |= (volume.blanked[z, y, x] >> octant & 1).astype(bool)
    return color, np.where(unseen, 0.0, tau)


def node_occlusion(
    volume: Volume,
    transfer_function: TransferFunction,
    ambient_occlusion: AmbientOcclusion | None,
    sample_distance: float | None = None,
) -> NodeOcclusion | None:
    """Return the occlusion on a coarse grid, as the device computes it; ``None`` for none.

    ``volume``, ``transfer_function``: what is occluded, by itself. ``ambient_occlusion``: radius,
    directions and strength. ``sample_distance``: length of the volume's own steps, model units;
    half the smallest spacing by default.
    """
    if ambient_occlusion is None:
        return None
    step = min(volume.spacing) / 2 if sample_distance is None else sample_distance
    grid = OcclusionGrid(volume, ambient_occlusion)
    depth = _optical_depth(volume, transfer_function)
    return NodeOcclusion(volume, grid, depth, step, ambient_occlusion.strength)


def ambient_transmittance(
    volume: Volume,
    transfer_function: TransferFunction,
    position: Array,
    radius: float,
    directions: int = 1024,
    step: float | None = None,
) -> Array:
    """Return the mean transmittance around points, by its definition and without a grid: 0 to 1.

    ``position`` are grid coordinates (x, y, z) in points, float64 (n, 3); ``radius`` how far to
    look and ``step`` the length of a step (half the smallest spacing by default), model units;
    ``directions`` how many of them the mean is taken over.
    """
    step = min(volume.spacing) / 2 if step is None else step
    depth = _optical_depth(volume, transfer_function)
    return mean_transmittance(volume, depth, position, radius, directions, step)


def _optical_depth(
    volume: Volume, transfer_function: TransferFunction
) -> Callable[[Array, float], Array]:
    unlit = transfer_function.replace(shading=None)

    def optical_depth(position: Array, length: float) -> Array:
        return medium_at(volume, unlit, position, np.full(len(position), length))[1]

    return optical_depth


def classify(transfer_function: TransferFunction, scalar: Array) -> tuple[Array, Array]:
    """Return colour, float64 (n, 3), and opacity, float64 (n,), of scalars; 0 for NaN.

    Both are linear between the table's equidistant nodes and constant beyond its ends.
    """
    low, high = transfer_function.scalar_range
    last = len(transfer_function.opacities) - 1
    known = np.where(np.isnan(scalar), low, scalar)
    if low == high:
        node = np.where(known > high, float(last), 0.0)
    else:
        node = np.clip((known - low) / (high - low), 0.0, 1.0) * last
    floor = np.minimum(np.floor(node), max(last - 1, 0)).astype(np.int64)
    above = np.minimum(floor + 1, last)
    share = node - floor

    colors = transfer_function.colors.astype(np.float64)
    opacities = transfer_function.opacities.astype(np.float64)
    color = colors[floor] + share[:, None] * (colors[above] - colors[floor])
    alpha = opacities[floor] + share * (opacities[above] - opacities[floor])
    nan = np.isnan(scalar)
    return np.where(nan[:, None], 0.0, color), np.where(nan, 0.0, alpha)


def _nearest(array: NDArray[np.generic], position: Array) -> Array:
    x, y, z = np.floor(position + 0.5).astype(np.int64).T
    return np.asarray(array[z, y, x], dtype=np.float64)


def _steps(start: Array, slope: Array, volume: Volume, parallel: bool, stride: float) -> Array:
    """Return the view depths where the steps of a ray begin and end; at least one entry.

    ``start + t slope`` are grid coordinates at view depth t, ``stride`` a step's view depth.
    """
    nx, ny, nz = volume.dimensions
    limits = inside_box(Ray(start, slope), (0, nx - 1, 0, ny - 1, 0, nz - 1))
    if not parallel:
        limits.append(HalfSpace(0.0, 1.0))
    span = clip(limits)
    if span is None:
        return np.zeros(1)
    t0, t1 = span
    # A last step shorter than rounding is none
    count = max(1, math.ceil((t1 - t0) / stride - 1e-9))
    return np.append(t0 + np.arange(count) * stride, t1)


def _cut(
    runs: list[Segment], criterion: str, budget: int, per_reference: float, weighting: str
) -> list[Segment]:
    """Bring a ray's runs to the budget; ``per_reference``: voxels per unit of view depth."""
    if criterion == "homogeneity":
        return cut_where_unlike(runs, budget, per_reference, weighting)
    return _within_budget(runs, budget, weighting)


def _within_budget(runs: list[Segment], budget: int, weighting: str) -> list[Segment]:
    """Merge neighbours at least cost until there are no more than ``budget``."""
    merged = list(runs)
    parts = [[run] for run in runs]  # what each was made of
    costs = [_merge_cost(a + b) for a, b in itertools.pairwise(parts)]
    while len(merged) > budget:
        k = int(np.argmin(costs))
        merged[k : k + 2] = [merge(merged[k], merged[k + 1], weighting)]
        parts[k : k + 2] = [parts[k] + parts[k + 1]]
        del costs[k]
        for j in (k - 1, k):  # both neighbours' costs have changed
            if 0 <= j < len(costs):
                costs[j] = _merge_cost(parts[j] + parts[j + 1])
    return merged


def _merge_cost(parts: list[Segment]) -> float:
    """Return the optical depth, per colour and in all, that one mean of ``parts`` displaces."""
    length = np.array([part.back - part.front for part in parts])
    amount = np.array([part.optical_depth * np.append(part.color, 1.0) for part in parts])
    whole = parts[-1].back - parts[0].front
    mean = amount.sum(axis=0) / whole
    gap = max(0.0, whole - float(length.sum()))
    return float(np.abs(amount - length[:, None] * mean).sum() + gap * mean.sum())


def vdi_of_lists(
    lists: list[list[Segment]],
    camera: Camera,
    window_size: Sequence[int],
    bounds: Sequence[float],
    depth_origin: float,
    criterion: str,
) -> VDI:
    """Store segments, in view depth, as a valid VDI: rounded to float32 and still disjoint."""
    front, back = [], []
    for segments in lists:
        end = np.float32(-np.inf)
        for segment in segments:
            begin = max(np.float32(segment.front - depth_origin), end)
            end = max(
                np.float32(segment.back - depth_origin), np.nextafter(begin, np.float32(np.inf))
            )
            front.append(begin)
            back.append(end)
    flat = [segment for segments in lists for segment in segments]
    return VDI(
        camera,
        window_size,
        np.concatenate(([0], np.cumsum([len(segments) for segments in lists]))).astype(np.uint64),
        np.array(front, dtype=np.float32),
        np.array(back, dtype=np.float32),
        # Means of colours in [0, 1] may round beyond it
        np.clip(np.array([segment.color for segment in flat]).reshape(-1, 3), 0, 1),
        np.array([segment.optical_depth for segment in flat]),
        bounds,
        depth_origin=depth_origin,
        metadata={"criterion": f"reference: {criterion}"},
    )
