"""Ambient occlusion: how much of the light from all around reaches a point of a volume.

The paper's supersegments hold colours "potentially determined with global lighting techniques,
such as ambient occlusion" (section 2). Computed is docs/dev/conventions.md, "Ambient occlusion".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import Number
from pyvista_vdi.model.volume import Grid

#: Steps that a radius is cut into at least.
_LEAST_STEPS = 8

_CHECKS = {
    "radius": Number("a length in model units", open_ended=True, none=True),
    "strength": Number(high=1),
    "directions": Number(low=12, high=4096, whole=True),
}


@dataclass(frozen=True)
class AmbientOcclusion:
    """Darkening of what is hidden from the light around it.

    Light comes from all around, from the distance ``radius``, and the medium in between takes some
    of it: A is the mean over all directions of the transmittance along ``radius``. What takes it is
    not black, but as bright as the sample is itself, but for the share ``strength`` that it
    swallows: the sample's colour is multiplied by f = A + (1 - strength) (1 - A) f, so that
    f = A / (A + strength (1 - A)).

    Attributes
    ----------
    radius : float, optional
        How far something hides, model units; by default 0.05 of the bounds' diagonal.
    strength : float
        Share of the light that what hides swallows, 0 to 1. 0 darkens nothing; 1 is a sky over
        black matter: an even opaque surface then keeps 0.15 of its colour, and 0.53 at the default.
    directions : int
        How many directions the mean is taken over, 12 to 4096.

    Notes
    -----
    That what surrounds a point is as bright as the point itself is how A. J. Stewart and
    M. S. Langer ("Toward accurate recovery of shape from shading under diffuse lighting", IEEE
    Transactions on Pattern Analysis and Machine Intelligence 19(9), 1997) account for the light
    that surfaces throw on each other. Without it every dense volume would be dark, because
    what is seen of it lies inside it.
    """

    radius: float | None = None
    strength: float = 0.1
    directions: int = 32

    def __post_init__(self) -> None:
        for name, check in _CHECKS.items():
            kept = check(getattr(self, name), f"the {name} of ambient occlusion")
            object.__setattr__(self, name, kept)

    @classmethod
    def from_any(cls, value: Any) -> AmbientOcclusion | None:
        """Return what a user calls ambient occlusion: True, a radius; None where there is none."""
        if value is None or value is False:
            return None
        if isinstance(value, int | float | np.number):
            return cls() if value is True else cls(value)  # type: ignore[arg-type]
        if isinstance(value, cls):
            return value if value.strength > 0 else None
        raise InvalidArgumentError(
            "ambient_occlusion must be True, a radius in model units or a "
            f"pyvista_vdi.AmbientOcclusion; got {value!r}"
        )

    def radius_in(self, volume: Grid) -> float:
        """Return the radius in a volume, model units; beyond its diagonal nothing occludes."""
        return min(0.05 * volume.length if self.radius is None else self.radius, volume.length)


class OcclusionGrid:
    """The grid on which the occlusion of a volume is computed, and the marches from its nodes.

    Node (i, j, k) lies at the volume's index position ``(i, j, k) * cell``. Occlusion changes over
    lengths of the radius, so cells are an eighth of it where that is more than a voxel.

    ``cell``: voxels from node to node along x, y and z. ``nodes``: nodes along x, y and z; the last
    of them may lie beyond the volume. ``step``: length of a step, model units. ``offsets``:
    midpoints of the steps from the node along each direction, in cells; float64 (directions, steps,
    3). ``margin``: cells that the marches reach beyond the nodes, along x, y and z, either way.
    ``padded``: nodes with the margin on both sides. ``samples`` along each edge of the box around a
    node whose mean opacity the node gets: half a voxel apart, as marches by default, in cells of
    one or two voxels; then no more. ``nbytes``: on a device while the occlusion is computed; what
    stays is the nodes' float32.
    """

    def __init__(self, volume: Grid, occlusion: AmbientOcclusion) -> None:
        radius = occlusion.radius_in(volume)
        spacing, points = np.array(volume.spacing), np.array(volume.dimensions)
        wanted = np.floor(radius / _LEAST_STEPS / spacing * (1 + 1e-9))
        coarsest = np.maximum((points - 1) // 32, 1)  # 32 cells along an axis are kept
        cell = np.clip(wanted, 1, coarsest).astype(int)
        steps = max(_LEAST_STEPS, math.ceil(radius / (cell * spacing).min() * (1 - 1e-9)))
        to_cells = np.linalg.inv(volume.direction * (spacing * cell))
        self.step = radius / steps
        along = (np.arange(steps) + 0.5) * self.step
        directions = spread_directions(occlusion.directions) @ to_cells.T
        nodes = -(-(points - 1) // cell) + 1
        self.offsets = directions[:, None, :] * along[None, :, None]
        margin = np.floor(np.abs(self.offsets).max(axis=(0, 1))).astype(int) + 1
        sizes = (cell, nodes, margin, nodes + 2 * margin, np.minimum(2 * cell, 4))
        lists: Iterator[tuple[int, ...]] = (tuple(each.tolist()) for each in sizes)
        self.cell, self.nodes, self.margin, self.padded, self.samples = lists
        self.nbytes = 4 * (math.prod(self.padded) + math.prod(self.nodes))


def spread_directions(n: int) -> NDArray[np.float64]:
    """Return n unit vectors spread evenly, float64 (n, 3): a spherical Fibonacci lattice.

    R. Swinbank, R. J. Purser, "Fibonacci grids", Q. J. R. Meteorol. Soc. 132(619), 2006.
    """
    i = np.arange(n)
    z = 1 - (2 * i + 1) / n
    angle = i * math.pi * (3 - math.sqrt(5))
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
