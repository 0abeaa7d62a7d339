"""Volume to a VDI that keeps values, by the same marches: a transfer function that keeps them."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.checks import as_range
from pyvista_vdi.model.options import Deferral, GenerationOptions, GenerationRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import DeferredVDI, lengths_of, made_vdi
from pyvista_vdi.model.volume import Volume

#: Optical depth of a voxel's length of what is kept: so little that float32 sums it up as a length,
#: whatever lies before it: 1 - 2^-36 n is 1 for the voxels n of any ray.
_PER_VOXEL = 2.0**-36
#: Table cells over the range of values. Values beyond it by less than one fade out.
_CELLS = 4096
#: What values and their squares weigh in the error of merging beside the share: nothing that
#: counts where that tells values apart.
_BESIDE = 2.0**-8
#: What the low end of the range counts by default beside all above it, so that air, which piles up
#: there, is seldom in one supersegment with what borders on it.
_LOW_END = 2.0**-4
#: Spreads below what float32 holds of a mean of squares are none; shares this near to 1 are 1.
_LEAST_SPREAD = 5e-4
_WHOLE = 1e-3
#: Supersegments that are converted at a time.
_PIECE = 2**16


def unclassified(interpolation: str) -> TransferFunction:
    """Return what stands in a request for the transfer function that is chosen afterwards."""
    return TransferFunction([[0] * 3], [0], (0, 1), interpolation=interpolation)


@dataclass(frozen=True)
class _LengthOptions(GenerationOptions):
    """Options under which merging counts lengths alone, of a medium of :data:`_PER_VOXEL`."""

    @property
    def finest_error(self) -> float:
        """As little as the features of such a medium are, squared."""
        return super().finest_error * _PER_VOXEL**2


def generate_deferred(
    request: GenerationRequest,
    deferral: Deferral,
    generate: Callable[[GenerationRequest], Any] = generate_vdi,
) -> Any:
    """Make a deferred VDI; of the request's transfer function the interpolation counts.

    ``generate`` makes the VDI of a request: here, in blocks, or by workers; where it makes none, as
    on all of MPI's ranks but one, there is no deferred one either, and None is returned. Raises
    what :func:`kept_range` and ``generate`` do.
    """
    volume, options = request.volume, request.options
    low, high = kept_range(volume, options, deferral)
    given = {each.name: getattr(options, each.name) for each in fields(options)}
    made = generate(
        request.replace(
            transfer_function=_keeping(request, (low, high)),
            # Served from everywhere: what V_O sees makes no difference
            options=_LengthOptions(**{**given, "precision": "exact", "view_cone": 90.0}),
        )
    )
    if made is None:
        return None

    # Take what the channels of the table have become, means by length, a piece at a time
    per_length = _PER_VOXEL / min(volume.spacing)
    lengths = lengths_of(made)
    color, spread = np.zeros_like(made.color), np.empty_like(made.optical_depth)
    for start in range(0, len(spread), _PIECE):
        piece = slice(start, start + _PIECE)
        mean, square = made.color[piece, 1:].T.astype(np.float64) / _BESIDE
        np.clip(mean, 0, 1, out=mean)
        deviation = np.sqrt(np.maximum(square / 4 - (mean - 0.5) ** 2, 0))
        spread[piece] = np.where(deviation < _LEAST_SPREAD, 0, np.minimum(deviation, 0.5))
        share = made.optical_depth[piece] / (per_length * lengths[piece])
        color[piece, 0], color[piece, 2] = mean, np.where(share > 1 - _WHOLE, 1, share)
    metadata: dict[str, Any] = dict(made.metadata)
    for name in ("transfer_function", "opacity_unit_distance", "view_cone"):
        metadata.pop(name)
    arrays = made.arrays._replace(color=color, optical_depth=spread)
    lists = made_vdi(arrays, made, metadata=metadata)
    about = {
        "version": 1,
        "value_range": (low, high),
        "unit_distance": volume.default_unit_distance,
        "sample_distance": metadata["sample_distance"],
    }
    return DeferredVDI(lists, about).with_precision(options.precision)


def kept_range(
    volume: Volume, options: GenerationOptions, deferral: Deferral
) -> tuple[float, float]:
    """Return the range of values that is kept.

    InvalidArgumentError if it cannot be used, UnsupportedError for what cannot be deferred.
    """
    if volume.rgba:
        raise UnsupportedError(
            "RGBA volumes have colours of their own, so that nothing is left to be classified "
            "afterwards: leave classification='deferred' out"
        )
    if options.ambient_occlusion is not None:
        raise UnsupportedError(
            "ambient occlusion follows from opacities, which a deferred VDI does not have: leave "
            "ambient_occlusion out, or classification='deferred'"
        )
    if deferral.value_range is not None:  # which has been checked
        return as_range(deferral.value_range)
    low, high = volume.finite_range()
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InvalidArgumentError(
            f"value_range must be two finite scalars, low < high; got {(low, high)}, as the "
            "volume's: give value_range=(low, high)"
        )
    return low, high


def _keeping(request: GenerationRequest, value_range: tuple[float, float]) -> TransferFunction:
    """Return the transfer function whose colours are values: its opacity is that of lengths.

    Entries: one below the range and one above, which are transparent, and between them the share
    of the range below the value, the value, and its square about the middle.
    """
    low, high = value_range
    place = np.arange(-1, _CELLS + 2) / _CELLS
    share = np.clip(place, 0, 1)
    integral = np.zeros_like(share)
    np.cumsum(np.diff(share), out=integral[1:])
    integral[place > 0] += _LOW_END
    columns = (integral / integral[-1], _BESIDE * share, _BESIDE * 4 * (share - 0.5) ** 2)
    kept = (place >= 0) & (place <= 1)
    cell = (high - low) / _CELLS
    return TransferFunction(
        np.clip(np.stack(columns, axis=1), 0, 1),
        np.where(kept, _PER_VOXEL, 0.0),
        (low - cell, high + cell),
        unit_distance=min(request.volume.spacing),
        interpolation=request.transfer_function.interpolation,
    )
