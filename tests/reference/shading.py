"""Gradient opacity and shading of samples, in float64: what VTK's GPU volume mapper computes."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.ambient_occlusion import OcclusionGrid, spread_directions
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.lighting import Light, Lights, Shading
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from reference.compositing import Segment, merge

Array = NDArray[np.float64]


def gradient_factors(
    volume: Volume, transfer_function: TransferFunction, differences: Array
) -> Array:
    """Return the factor of each sample's opacity, float64 (n,), 1 without gradient opacity.

    ``volume``: its spacing and its range of scalars. ``transfer_function``: with or without
    gradient opacities. ``differences``: of the scalar, from a voxel behind to a voxel ahead along
    x, y and z; float64 (n, 3).
    """
    factors, limits = transfer_function.gradient_opacities, transfer_function.gradient_range
    if factors is None or limits is None:
        return np.ones(len(differences))
    spacing = np.array(volume.spacing)
    per_mean_spacing = differences / (2 * spacing) * spacing.mean()
    low, high = volume.finite_range()
    magnitude = np.minimum(np.linalg.norm(per_mean_spacing, axis=1), (high - low) / 4)
    nodes = np.linspace(*limits, len(factors))
    return np.interp(magnitude, nodes, factors.astype(np.float64))


def lit_colors(
    volume: Volume,
    camera: Camera,
    shading: Shading,
    lights: Lights,
    position: Array,
    differences: Array,
    color: Array,
) -> Array:
    """Return the colours that samples send to the eye, float64 (n, 3), clamped to [0, 1].

    ``volume``, ``camera``: where the samples, the eye and the lights are. ``shading``, ``lights``:
    what reflects what; without any light everything is black. ``position``: grid coordinates (x, y,
    z) in points, float64 (n, 3). ``differences``: as for :func:`gradient_factors`. ``color``: from
    the transfer function, float64 (n, 3).
    """
    to_model = volume.index_to_model
    to_view = camera.model_to_view @ to_model
    if lights.headlight_only:
        # Angles are those of the model frame, whatever the actor's matrix does to them
        (light,) = lights.lights
        eye = np.linalg.inv(camera.model_transform) @ np.append(camera.position, 1.0)
        view = _unit(position @ to_model[:3, :3].T + to_model[:3, 3] - eye[:3])
        facing = (_normals(to_model, differences) * view).sum(axis=1)
        reflected = np.maximum(2 * facing**2 - 1, 0)
        if lights.two_sided:
            facing = np.abs(facing)
        diffuse = shading.diffuse * facing[:, None] * np.array(light.diffuse) * color
        highlight = np.where(reflected > 0, reflected**shading.specular_power, 0.0)
        specular = shading.specular * highlight[:, None] * np.array(light.specular)
        sent = shading.ambient * color + np.where(facing[:, None] > 0, diffuse + specular, 0.0)
    else:
        sent = _by_lights(camera, shading, lights, to_view, position, differences, color)
    return np.clip(sent, 0.0, 1.0)


def _by_lights(
    camera: Camera,
    shading: Shading,
    lights: Lights,
    to_view: Array,
    position: Array,
    differences: Array,
    color: Array,
) -> Array:
    place = position @ to_view[:3, :3].T + to_view[:3, 3]
    normal = _normals(to_view, differences)
    view = _unit(place)
    ambient = np.zeros(3)
    diffuse, specular = np.zeros_like(color), np.zeros_like(color)
    for light in lights.lights:
        ambient = ambient + light.intensity * np.array(light.ambient)
        direction, strength = _arriving(light, camera, place)
        strength = strength * light.intensity
        facing = (normal * direction).sum(axis=1)
        if lights.two_sided:
            facing = np.abs(facing)
        mirrored = _unit(2 * facing[:, None] * normal - direction)
        reflected = (view * mirrored).sum(axis=1)
        if lights.two_sided and light.positional:
            reflected = np.abs(reflected)
        highlight = np.where(reflected > 0, np.maximum(reflected, 0) ** shading.specular_power, 0.0)
        strength = np.where(facing > 0, strength, 0.0)
        diffuse += (strength * facing)[:, None] * np.array(light.diffuse)
        specular += (strength * highlight)[:, None] * np.array(light.specular)
    return (
        shading.ambient * ambient
        + shading.diffuse * diffuse * color
        + (shading.specular * specular)
    )


def _arriving(light: Light, camera: Camera, place: Array) -> tuple[Array, Array]:
    """Return the unit direction in which light arrives, (n, 3), and its strength, (n,)."""
    origin, axis = light.in_view(camera)
    if not light.positional:
        return np.broadcast_to(axis, place.shape), np.ones(len(place))
    distance = np.linalg.norm(place - origin, axis=1)
    direction = _unit(place - origin)
    a, b, c = light.attenuation
    strength = 1 / (a + b * distance + c * distance**2)
    if light.cone_angle <= 90:
        inside = direction @ axis
        in_cone = inside >= np.cos(np.radians(light.cone_angle))
        strength = np.where(in_cone, strength * np.maximum(inside, 0) ** light.exponent, 0.0)
    return direction, strength


def _normals(index_to_frame: Array, differences: Array) -> Array:
    """Return unit vectors towards where the scalar grows, (n, 3); zero where it does not."""
    return _unit(differences @ np.linalg.inv(index_to_frame[:3, :3]))


def _unit(vectors: Array) -> Array:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0)


#: Optical depth of steps of a length, model units, around grid coordinates, float64 (n, 3).
OpticalDepth: TypeAlias = Callable[[Array, float], Array]


def mean_transmittance(
    volume: Volume,
    optical_depth: OpticalDepth,
    position: Array,
    radius: float,
    directions: int,
    step: float,
) -> Array:
    """Return the mean over directions of the transmittance along ``radius``, float64 (n,).

    ``volume``: its grid. ``optical_depth``: what is in it. ``position``: grid coordinates (x, y, z)
    in points, float64 (n, 3). ``radius``, ``step``: how far to march, and a step's length at most;
    model units. ``directions``: how many of them.
    """
    to_index = np.linalg.inv(volume.index_to_model[:3, :3])
    steps = math.ceil(radius / step)
    length = radius / steps
    along = (np.arange(steps) + 0.5)[:, None] * length
    total = np.zeros(len(position))
    for direction in spread_directions(directions) @ to_index.T:
        midpoints = position[:, None] + along * direction
        tau = optical_depth(midpoints.reshape(-1, 3), length)
        total += np.exp(-tau.reshape(-1, steps).sum(axis=1))
    return total / directions


class NodeOcclusion:
    """The occlusion on a grid's nodes, and factors of colours from it.

    ``volume``: what is occluded, by itself. ``grid``: nodes and marches. ``optical_depth``: of the
    volume's own steps. ``sample_distance``: their length, model units. ``strength``: see
    :class:`~pyvista_vdi.AmbientOcclusion`. ``open``: mean transmittance around each node, float64
    (nz, ny, nx).
    """

    def __init__(
        self,
        volume: Volume,
        grid: OcclusionGrid,
        optical_depth: OpticalDepth,
        sample_distance: float,
        strength: float,
    ) -> None:
        self._cell = np.array(grid.cell)
        self._strength = strength
        z, y, x = (axis.ravel() for axis in np.indices(grid.nodes[::-1]))
        within = [(np.arange(n) + 0.5) / n - 0.5 for n in grid.samples]  # of a cell's edge
        around = np.array(list(itertools.product(*within)))
        position = (np.stack([x, y, z], axis=1)[:, None] + around) * self._cell
        tau = optical_depth(position.reshape(-1, 3), sample_distance)
        opacity = -np.expm1(-tau * grid.step / sample_distance)
        opacity = opacity.reshape(*grid.nodes[::-1], len(around)).mean(axis=-1)
        # March from every node through the mean opacities of the nodes around it
        padded = np.pad(opacity, [(m + 1, m + 1) for m in grid.margin[::-1]])
        node = np.stack([x, y, z], axis=1) + np.array(grid.margin) + 1
        total = np.zeros(len(node))
        for offsets in grid.offsets:
            transmittance = np.ones(len(node))
            for offset in offsets:
                transmittance *= 1 - trilinear(padded, node + offset)
            total += transmittance
        self.open = (total / len(grid.offsets)).reshape(opacity.shape)

    def factors(self, position: Array) -> Array:
        """Return the factor of the colour at grid coordinates, float64 (n,)."""
        open_ = trilinear(self.open, position / self._cell)
        return open_ / (open_ + self._strength * (1 - open_))


def trilinear(values: NDArray[Any], position: Array) -> Array:
    """Interpolate values at grid coordinates (x, y, z); NaN where a corner of the cell is NaN."""
    top = np.array(values.shape[::-1]) - 1
    cell = np.clip(np.floor(position).astype(np.int64), 0, top - 1)
    share = position - cell
    total = np.zeros(len(position))
    for corner in itertools.product((0, 1), repeat=3):
        weight = np.where(corner, share, 1 - share).prod(axis=1)
        x, y, z = (cell + corner).T
        total += weight * np.asarray(values[z, y, x], dtype=np.float64)
    return total


def cut_where_unlike(
    runs: Sequence[Segment],
    limit: int,
    per_reference: float,
    weighting: str = "transmittance",
) -> list[Segment]:
    """Cut where the medium differs too much from its mean so far (Frey et al. 2013).

    The threshold is the least, to a thousandth, that keeps the budget, ``limit``, on this ray,
    whose ``runs`` come nearest first; what lies between two of them is empty, and nothing is
    dropped. ``per_reference``: reference lengths (the smallest spacing) per unit of the segments'
    depths; ``weighting`` as for :func:`reference.compositing.merge`.
    """
    if len(runs) <= limit:
        return list(runs)
    low, high = 0.0, 2 * max(float(np.linalg.norm(feature(run, per_reference))) for run in runs)
    while high - low > 1e-3 * high:
        middle = (low + high) / 2
        if len(merge_alike(runs, middle, per_reference, weighting)) > limit:
            low = middle
        else:
            high = middle
    return merge_alike(runs, high, per_reference, weighting)


def merge_alike(
    runs: Sequence[Segment], threshold: float, per_reference: float, weighting: str
) -> list[Segment]:
    """Merge front to back while the next run differs from the mean so far by at most ``threshold``.

    What is compared is :func:`feature`. An empty stretch is taken in if it differs by no more.
    """
    merged = list(runs[:1])
    for run in runs[1:]:
        last = merged[-1]
        mean = feature(last, per_reference)
        gap = run.front > last.back
        if gap and np.linalg.norm(mean) > threshold:
            merged.append(run)
            continue
        if gap:
            mean = feature(last._replace(back=run.front), per_reference)
        if np.linalg.norm(feature(run, per_reference) - mean) > threshold:
            merged.append(run)
        else:
            merged[-1] = merge(last, run, weighting)
    return merged


def feature(run: Segment, per_reference: float) -> Array:
    """Return opacity-weighted colour and opacity of one reference length of a medium.

    The opacity is taken as s / (s + 1), where s is the optical depth of a reference length.
    """
    length = (run.back - run.front) * per_reference
    return run.optical_depth / (run.optical_depth + length) * np.append(run.color, 1.0)
