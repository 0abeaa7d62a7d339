"""The 8-byte supersegments as files store them: differences of codes, array by array."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.model.packing import (
    DEPTH_CODES,
    GRID,
    LEAST_STEP_EXPONENT,
    TAU_CODES,
    Codes,
    Packed8,
)


def stored_rows(packed: Packed8, name: str, first: int, last: int) -> NDArray[Any]:
    """Return rows of an array as files store it: see :func:`packed_of_stored`.

    Of ``front`` how far it is behind the back before it, in codes, and of ``back`` how far it is
    behind its front. The first gap of a list is 0, as its code is; that of row ``first`` is its
    front's code.
    """
    if name in ("origin", "stride"):
        return (packed.origins if name == "origin" else packed.strides)[first:last]
    front, back, tau, color = packed.codes(slice(first, last))
    if name == "back":
        return back - front
    if name == "optical_depth":
        return tau
    if name == "color":
        return color.astype("<u4").view(np.uint8).reshape(-1, 4)[:, 1:]
    gaps = np.append(front[:1], front[1:] - back[:-1])
    begin, end = np.searchsorted(packed.offsets, [first, last])
    gaps[packed.offsets[begin:end].astype(np.int64) - first] = 0
    return gaps


def packed_of_stored(
    step: float,
    offsets: NDArray[np.uint64],
    stored: Mapping[str, NDArray[Any]],
    chunk_rows: int,
) -> Packed8:
    """Return the 8-byte form of what a file stores, checked.

    ``step``: of the depth grid. ``stored``: what :func:`stored_rows` gives of every ``chunk_rows``
    rows, by its name. Raises InvalidVDIError if packing gives no such codes.
    """
    if (offsets[1:] < offsets[:-1]).any():
        raise InvalidVDIError("offsets must not decrease")
    counts = np.diff(offsets).astype(np.int64)
    mantissa, exponent = math.frexp(step)
    if not (mantissa == 0.5 and LEAST_STEP_EXPONENT < exponent <= 105):
        raise InvalidVDIError(f"the step of depths must be a power of two; got {step}")
    origins, strides = stored["origin"].astype(np.int64), stored["stride"].astype(np.int64)
    last = origins + strides * DEPTH_CODES
    if (np.abs(origins) > GRID).any() or (last > GRID + DEPTH_CODES + 1).any():
        raise InvalidVDIError("a list's depths lie beyond the VDI's grid")
    occupied = counts > 0
    if ((strides > 0) != occupied).any() or origins[~occupied].any():
        raise InvalidVDIError("the lists with a stride are not those with supersegments")
    # Add up the codes, which begin anew with every list and every chunk
    gaps, thicknesses = stored["front"].astype(np.int64), stored["back"].astype(np.int64)
    n, tau = len(gaps), stored["optical_depth"].astype(np.uint32)
    begins = np.zeros(n, bool)
    begins[offsets[:-1][occupied].astype(np.int64)] = True
    begins[::chunk_rows] = True
    runs, starts = np.cumsum(gaps + thicknesses), np.flatnonzero(begins)
    before = runs[starts] - gaps[starts] - thicknesses[starts]
    back = runs - np.repeat(before, np.diff(np.append(starts, n)))
    if n and not (thicknesses.min() > 0 and back.max() <= DEPTH_CODES and tau.max() <= TAU_CODES):
        raise InvalidVDIError("a supersegment has no thickness, or a code beyond its largest")
    color = np.pad(stored["color"], ((0, 0), (1, 0))).view("<u4").reshape(-1)
    codes = (back - thicknesses, back, tau, color)
    return Packed8(
        step,
        offsets,
        origins.astype(np.int32),
        strides.astype(np.uint16),
        Codes(*(code.astype(np.uint32, copy=False) for code in codes)).words(),
    )
