"""What a transfer function makes of a deferred VDI (docs/dev/conventions.md): ``lib/values.cl``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.packing import Arrays
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI, made_vdi

#: Straight colours and optical depths of supersegments.
Media = tuple[NDArray[np.float32], NDArray[np.float32]]

#: Cells of the tables that a transfer function is integrated in, over the range of values: a window
#: of a fiftieth of it has 327.
CELLS = 1 << 14

#: Whole numbers of this stand for opacities on devices: sums over all cells stay below 2^63.
_UNITS = 2.0**40


@dataclass(frozen=True, eq=False)
class ValuesLook:
    """Values and the transfer function that a VDI shows of them.

    ``integrals``: what kernels take of a transfer function, float32 (CELLS + 2, 2, 4): the low end
    of the range, then the integrals over cells up to each, in pairs of a large part and what it
    leaves. ``media_of``: what makes straight colours and optical depths of some supersegments.
    """

    deferred: DeferredVDI
    integrals: NDArray[np.float32]
    media_of: Callable[[ValuesLook, Any], Media]

    def arrays(self) -> Arrays:
        """Return the arrays: what is transparent is left out."""
        color, optical_depth = self.media_of(self, slice(None))
        arrays = self.deferred.arrays._replace(color=color, optical_depth=optical_depth)
        rows = np.flatnonzero(optical_depth > 0)
        if len(rows) == len(optical_depth):
            return arrays
        return arrays.take(np.searchsorted(rows, arrays.offsets.view(np.int64)), rows)


def classify(
    deferred: DeferredVDI,
    transfer_function: TransferFunction,
    media_of: Callable[[ValuesLook, Any], Media],
) -> VDI:
    """Return the VDI that a transfer function makes of what is kept (docs/dev/conventions.md).

    The VDI's arrays are made when they are asked for, by ``media_of``; a raycast asks for none.
    Errors are those of :meth:`DeferredVDI.classified`.
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

    # Look up colours and opacities at the low end of the range and in cells of it
    low, high = deferred.value_range
    values = low + (np.arange(-1, CELLS) + 0.5).clip(0) / CELLS * (high - low)
    first, last = transfer_function.scalar_range
    nodes = np.arange(len(transfer_function.opacities))
    place = np.where(values > last, nodes[-1], 0.0)
    if last > first:
        place = (values - first) / (last - first) * nodes[-1]
    columns = (*transfer_function.colors.T, transfer_function.opacities)
    *rgb, opacity = (np.interp(place, nodes, each.astype(np.float64)) for each in columns)
    # Sum up a step's opacity, and the colour times it, in whole numbers: where nothing is added,
    # nothing changes
    unit = transfer_function.unit_distance or deferred.unit_distance
    with np.errstate(divide="ignore"):
        of_step = -np.expm1(np.log1p(-opacity) * deferred.sample_distance / unit)
    of_cells = np.stack([*(of_step * each for each in rgb), of_step], axis=1)
    units = np.rint(of_cells * _UNITS).astype(np.int64)
    table = np.zeros((CELLS + 2, 4), np.int64)
    table[0] = units[0]
    np.cumsum(units[1:], axis=0, out=table[2:])
    whole = table / _UNITS
    large = whole.astype(np.float32)
    integrals = np.stack([large, (whole - large).astype(np.float32)], axis=1)
    metadata = {
        **deferred.metadata,
        "opacity_unit_distance": unit,
        "transfer_function": transfer_function.to_dict(),
        "deferred": deferred.about,
    }
    return made_vdi(ValuesLook(deferred, integrals, media_of), deferred, metadata=metadata)
