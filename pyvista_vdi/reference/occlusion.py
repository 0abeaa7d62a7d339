"""Ambient occlusion in float64: as it is defined, and on the grid that the device computes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.ambient_occlusion import OcclusionGrid, spread_directions
from pyvista_vdi.model.volume import Volume

Array = NDArray[np.float64]

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
        self.open = self._marched(opacity, grid)

    def factors(self, position: Array) -> Array:
        """Return the factor of the colour at grid coordinates, float64 (n,)."""
        open_ = _trilinear(self.open, position / self._cell)
        return open_ / (open_ + self._strength * (1 - open_))

    @staticmethod
    def _marched(opacity: Array, grid: OcclusionGrid) -> Array:
        around = np.pad(opacity, [(m + 1, m + 1) for m in grid.margin[::-1]])
        z, y, x = (axis.ravel() for axis in np.indices(opacity.shape))
        node = np.stack([x, y, z], axis=1) + np.array(grid.margin) + 1
        total = np.zeros(len(node))
        for offsets in grid.offsets:
            transmittance = np.ones(len(node))
            for offset in offsets:
                transmittance *= 1 - _trilinear(around, node + offset)
            total += transmittance
        return (total / len(grid.offsets)).reshape(opacity.shape)


def _trilinear(values: Array, position: Array) -> Array:
    top = np.array(values.shape[::-1]) - 1
    cell = np.clip(np.floor(position).astype(np.int64), 0, top - 1)
    share = position - cell
    total = np.zeros(len(position))
    for corner in itertools.product((0, 1), repeat=3):
        weight = np.where(corner, share, 1 - share).prod(axis=1)
        x, y, z = (cell + corner).T
        total += weight * values[z, y, x]
    return total
