"""What a transfer function makes of a deferred VDI, in float64 (docs/dev/conventions.md).

On a device: ``lib/values.cl``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.deferred import DeferredVDI, Floats
from pyvista_vdi.model.packing import Arrays
from pyvista_vdi.model.transfer_function import OPAQUE_OPTICAL_DEPTH, TransferFunction
from pyvista_vdi.model.vdi import VDI, with_arrays

#: Straight colours and optical depths of supersegments.
Media = tuple[NDArray[np.float32], NDArray[np.float32]]


#: Cells of the tables that a transfer function is integrated in, over the range of values: a window
#: of a fiftieth of it has 327.
CELLS = 1 << 14

#: Whole numbers of this stand for opacities on devices: sums over all cells stay below 2^63.
_UNITS = 2.0**40


def classify(
    deferred: DeferredVDI,
    transfer_function: TransferFunction,
    media: Callable[[ValuesLook], Media] | None = None,
) -> VDI:
    """Return the VDI that a transfer function makes of what is kept (docs/dev/conventions.md).

    The opacity of a step of the march, and its colour weighted by opacity, are their means over the
    values of :func:`spread_of_values`. The VDI's arrays are made when they are asked for, by
    ``media`` if it is given; a raycast asks for none. Errors are those of
    :meth:`DeferredVDI.classified`.
    """
    for name, asked in (
        ("shading", transfer_function.shading),
        ("gradient opacity", transfer_function.gradient_opacities),
    ):
        if asked is not None:
            raise UnsupportedError(
                f"{name} needs gradients, which a DeferredVDI does not keep: leave it out, or "
                "generate with the transfer function and classification='baked'"
            )

    # A step's opacity, and the colour times it, at the low end of the range and in cells of it
    low, high = deferred.value_range
    unit = transfer_function.unit_distance or deferred.unit_distance
    values = low + (np.arange(-1, CELLS) + 0.5).clip(0) / CELLS * (high - low)
    first, last = transfer_function.scalar_range
    nodes = np.arange(len(transfer_function.opacities))
    place = np.where(values > last, nodes[-1], 0.0)
    if last > first:
        place = (values - first) / (last - first) * nodes[-1]
    columns = (*transfer_function.colors.T, transfer_function.opacities)
    *rgb, opacity = (np.interp(place, nodes, each.astype(np.float64)) for each in columns)
    with np.errstate(divide="ignore"):
        of_step = -np.expm1(np.log1p(-opacity) * deferred.sample_distance / unit)
    of_cells = np.stack([*(of_step * each for each in rgb), of_step], axis=1)
    metadata = {
        **deferred.metadata,
        "opacity_unit_distance": unit,
        "transfer_function": transfer_function.to_dict(),
        "deferred": deferred.about,
    }
    return with_arrays(deferred, ValuesLook(deferred, of_cells, media), metadata=metadata)


@dataclass(frozen=True, eq=False)
class ValuesLook:
    """Values and the transfer function that a VDI shows of them.

    ``of_cells``: (step opacity times colour, step opacity) at the low end of the range, and of
    cells of it, float64 (1 + CELLS, 4). ``media``: what makes straight colours and optical depths
    of it on a device; :meth:`media_of` by default.
    """

    deferred: DeferredVDI
    of_cells: Floats
    media: Callable[[ValuesLook], Media] | None = None

    def arrays(self) -> Arrays:
        """Return the arrays: what is transparent is left out."""
        color, optical_depth = self.media_of() if self.media is None else self.media(self)
        arrays = self.deferred.arrays._replace(color=color, optical_depth=optical_depth)
        rows = np.flatnonzero(optical_depth > 0)
        if len(rows) == len(optical_depth):
            return arrays
        return arrays.take(np.searchsorted(rows, arrays.offsets.view(np.int64)), rows)

    def media_of(self, rows: Any = slice(None)) -> Media:
        """Return straight colours, float32 (n, 3), and optical depths, float32 (n,); in float64."""
        deferred, of_cells = self.deferred, self.of_cells
        integrals = np.zeros((CELLS + 1, 4))
        np.cumsum(of_cells[1:], axis=0, out=integrals[1:])

        def integral(place: Floats) -> Floats:
            """Return integrals up to places in cells: within a cell the extinction is the same."""
            cell = np.minimum(place.astype(np.int64), CELLS - 1)
            share = (place - cell)[:, np.newaxis]
            return integrals[cell] * (1 - share) + integrals[cell + 1] * share

        mean, spread = (a[rows].astype(np.float64) for a in (deferred.mean, deferred.spread))
        low, high, even, above = spread_of_values(mean, spread)
        means = (1 - even - above)[:, np.newaxis] * of_cells[0]
        for first, last, share in ((low, high, even), (high, np.ones_like(high), above)):
            # Over a cell at least
            widening = np.maximum(0.5 / CELLS - (last - first) / 2, 0)
            ends = [np.clip(x, 0, 1) * CELLS for x in (first - widening, last + widening)]
            between = integral(ends[1]) - integral(ends[0])
            means += between * (share / (ends[1] - ends[0]))[:, np.newaxis]
        of_step = np.minimum(means[:, 3], -np.expm1(-OPAQUE_OPTICAL_DEPTH))
        optical_depth = (-np.log1p(-of_step) * deferred.steps[rows]).astype(np.float32)
        straight = means[:, :3] / np.maximum(means[:, 3:], np.finfo(np.float64).tiny)
        return np.clip(straight, 0, 1).astype(np.float32), optical_depth

    def integrals(self) -> NDArray[np.float32]:
        """Return what kernels take of a transfer function, float32 (CELLS + 2, 2, 4).

        The low end of the range, then the integrals over cells up to each. Pairs of a large part
        and what it leaves. Where nothing is added, nothing changes: sums are of whole numbers.
        """
        units = np.rint(self.of_cells * _UNITS).astype(np.int64)
        table = np.zeros((CELLS + 2, 4), np.int64)
        table[0] = units[0]
        np.cumsum(units[1:], axis=0, out=table[2:])
        whole = table / _UNITS
        large = whole.astype(np.float32)
        return np.stack([large, (whole - large).astype(np.float32)], axis=1)


def spread_of_values(mean: Floats, spread: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return how values from 0 to 1 with this mean and spread are taken to lie.

    Low and high end of those that are spread evenly and their share, and the share of those that
    are spread evenly from there to 1; the others are 0. All are in the first lot unless they would
    leave the range. At the low end some are then 0, as air is; at the high end they lie closer
    above the mean than below it.
    """
    reach, tiny = np.sqrt(3) * spread, np.finfo(np.float64).tiny
    inside = reach < np.minimum(mean, 1 - mean)
    at_low = ~inside & (mean <= 0.5)
    below = np.minimum(3 * spread**2 / np.maximum(1 - mean, tiny), mean)
    to = np.minimum(1.5 * (spread**2 / np.maximum(mean, tiny) + mean), 1)
    low = np.where(inside, mean - reach, np.where(at_low, 0, mean - below))
    high = np.where(inside, mean + reach, np.where(at_low, to, mean))
    above = np.where(inside | at_low, 0, below / np.maximum(1 - mean + below, tiny))
    even = np.where(at_low, 2 * mean / np.maximum(to, tiny), 1 - above)
    return low, high, np.where(inside, 1, even), above
