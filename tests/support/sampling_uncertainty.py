"""What float32 may make of a volume's samples: bounds on their optical depths and colours."""

from __future__ import annotations

import itertools

import numpy as np
import strategies
from reference.generate import medium_at, near_depth
from reference.ranges import ROUNDOFF
from reference.raycast import pixel_ray

#: Roundings of a grid coordinate: six coefficients and five multiply-adds in the pixel's position
#: and in depth, and depth's own four (entry, step number, step length, sum).
POSITION_ROUNDINGS = 16

#: Roundings of a scalar: trilinear interpolation in three fused stages of two each, and three of
#: the subtraction, scaling and splitting into node and share that classification does.
SCALAR_ROUNDINGS = 9

#: Roundings of an interpolated opacity or colour: difference, product, sum.
TABLE_ROUNDINGS = 3

#: Roundings of a step's optical depth after that: log1p (2, OpenCL C 7.4), length (4), product
#: and quotient, and its exponential and product in compositing.
STEP_ROUNDINGS = 12


class Uncertainty:
    """What one ray's samples may be in float32.

    Attributes
    ----------
    low, high : numpy.ndarray
        Smallest and largest optical depth of each sample, float64 (n,).
    color_spread : numpy.ndarray
        Largest difference between colours of one sample, float64 (n,).
    depth : float
        By how much a view depth may be off, world units.
    """

    def __init__(self, low, high, color_spread, depth):
        self.low, self.high, self.color_spread, self.depth = low, high, color_spread, depth

    @property
    def optical_depth(self):
        """Smallest and largest sum over the ray, each addition rounded."""
        grow = 1 + len(self.low) * ROUNDOFF
        return self.low.sum() / grow, self.high.sum() * grow

    @property
    def color(self):
        """Bound on the difference of the composited premultiplied RGBA, per channel.

        A sample's optical depth changes what it covers, by no more than the transmittance before
        it times the change; its colour counts as far as it is seen.
        """
        before = np.exp(-(np.cumsum(self.low) - self.low))
        seen = before * -np.expm1(-self.high)
        rounding = (len(self.low) + 4) * ROUNDOFF
        return float(before @ (self.high - self.low) + seen @ self.color_spread + rounding)


def uncertainties(volume, camera, window, transfer_function, rays):
    """The :class:`Uncertainty` of each of the rays of ``reference.samples``, all at once."""
    to_index = np.linalg.inv(volume.index_to_model)
    reach, per_depth, far = _magnitudes(volume, camera, window, to_index)
    scalars = np.abs([*transfer_function.scalar_range, *volume.finite_range()]).max()
    d_position = POSITION_ROUNDINGS * ROUNDOFF * reach
    d_scalar = SCALAR_ROUNDINGS * ROUNDOFF * scalars
    d_depth = POSITION_ROUNDINGS * ROUNDOFF * far
    d_length = d_depth * per_depth

    # The medium at every corner of the box of positions, and at scalars moved either way
    length = np.concatenate([ray.length for ray in rays])
    middle = np.concatenate([ray.position for ray in rays])
    color = np.concatenate([ray.color for ray in rays])
    seen = [(color, np.concatenate([ray.optical_depth for ray in rays]))]
    range_low, range_high = transfer_function.scalar_range
    for shift in (-d_scalar, d_scalar):
        moved = transfer_function.replace(scalar_range=(range_low + shift, range_high + shift))
        for corner in itertools.product((-1, 1), repeat=3):
            position = middle + d_position * np.array(corner)
            # An end of the ray may round to either side of the grid's boundary
            position = np.clip(position, 0, np.array(volume.dimensions) - 1)
            seen.append(medium_at(volume, moved, position, length))
    colors, taus = (np.array(part) for part in zip(*seen, strict=True))
    thickest = taus.max(axis=0)
    unit = transfer_function.unit_distance or volume.default_unit_distance
    # d tau / d a = 1 / (1 - a) / U per length, a within its own roundings
    worst = np.exp(np.minimum(thickest * unit / np.maximum(length, 1e-300), 40))
    slack = TABLE_ROUNDINGS * ROUNDOFF * worst * length / unit
    slack += STEP_ROUNDINGS * ROUNDOFF * thickest
    # The entry and exit move, and with them the first and the last step
    slack += thickest / np.maximum(length, d_length) * d_length
    ends = np.cumsum([len(ray.length) for ray in rays])[:-1]
    parts = (
        np.maximum(taus.min(axis=0) - slack, 0),
        thickest + slack,
        np.ptp(colors, axis=0).max(axis=1) + TABLE_ROUNDINGS * ROUNDOFF,
    )
    each = zip(*(np.split(part, ends) for part in parts), strict=True)
    return [Uncertainty(*part, d_depth) for part in each]


def _magnitudes(volume, camera, window, to_index):
    """Largest grid coordinate on a window corner's ray where forms are evaluated, the largest
    model length of a unit of view depth, and the largest view depth relative to the reference."""
    depths = strategies.view_depths(camera, volume.bounds)
    reference_depth = near_depth(volume.bounds, camera)
    reach, per_depth = 0.0, 0.0
    for x, y in itertools.product((0, window[0] - 1), (0, window[1] - 1)):
        ray = pixel_ray(camera, window, x, y)
        for depth in (reference_depth, depths[1]):
            point = to_index[:3, :3] @ (ray.origin + depth * ray.direction) + to_index[:3, 3]
            reach = max(reach, float(np.abs(point).max()))
        per_depth = max(per_depth, float(np.linalg.norm(ray.direction)))
    return reach, per_depth, depths[1] - reference_depth
