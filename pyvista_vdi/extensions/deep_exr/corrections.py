"""What a reader computes of the standard channels, and the corrections that make it exact.

Everything here is made of operations that IEEE 754 rounds, so that a file reads back to the last
bit on another machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.deep_exr.linear_light import to_display

#: Predictions smaller than this are taken as 0, so that no processor's treatment of denormal
#: numbers enters them.
_SMALLEST = 2.0**-60

STANDARD = ("A", "B", "G", "R", "Z", "ZBack")
DEPTH_BITS = ("bits.front", "bits.back")
COLOR_BITS = ("bits.red", "bits.green", "bits.blue")
OURS = ("tau", *DEPTH_BITS, *COLOR_BITS)


def channel_names(exact: bool, offset: float) -> tuple[str, ...]:
    """Return the channels of a file of ours; corrections of depths where there is an offset."""
    ours = ("tau", *COLOR_BITS, *(DEPTH_BITS if offset != 0 else ()))
    return (*STANDARD, *(ours if exact else ()))


def is_correction(name: str) -> bool:
    """Whether a channel holds corrections."""
    return name in DEPTH_BITS + COLOR_BITS


def relative(depth: NDArray[np.float32], offset: float) -> NDArray[np.float32]:
    """Return view depth less the offset, rounded once."""
    if offset == 0:
        return depth
    less = depth.astype(np.float64) - offset
    with np.errstate(over="ignore"):
        return np.where(np.abs(less) < _SMALLEST, 0, less).astype(np.float32)


def straight(
    color: NDArray[np.float32], alpha: NDArray[np.float32], linear: bool
) -> NDArray[np.float32]:
    """Return a premultiplied colour over its opacity as displayed; 0 where that says nothing."""
    enough = (alpha >= _SMALLEST) & (color >= _SMALLEST)
    ratio = np.divide(color, alpha, out=np.zeros_like(color), where=enough)
    return to_display(ratio).astype(np.float32) if linear else ratio


def correction(exact: NDArray[np.float32], predicted: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the difference of bit patterns modulo 2**32, with the sign in the lowest bit."""
    step = np.ascontiguousarray(exact).view(np.int32) - predicted.view(np.int32)
    return ((step << 1) ^ (step >> 31)).view(np.uint32)


def corrected(predicted: NDArray[np.float32], bits: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Return the exact value of a prediction and its correction."""
    step = (bits >> np.uint32(1)) ^ (np.uint32(0) - (bits & np.uint32(1)))
    return (predicted.view(np.uint32) + step).view(np.float32)


def whole_numbers(bits: NDArray[Any]) -> NDArray[np.uint32]:
    """Return corrections as they were written, where another program made floats of them.

    OpenImageIO's programs make all channels of a deep image of one type, and scale whole numbers
    to 0..1. Up to 2**23 they come back; the checksums tell whether all have.
    """
    if bits.dtype.kind == "u":
        return bits.astype(np.uint32, copy=False)
    scaled = np.rint(bits.astype(np.float64) * (2.0**32 - 1))
    good = (scaled >= 0) & (scaled < 2.0**32)
    return np.where(good, scaled, 0).astype(np.uint32)


def exact_colors(channels: Mapping[str, NDArray[Any]], linear: bool) -> NDArray[np.float32]:
    """Return the straight colours (n, 3) of channels as they were written."""
    alpha = channels["A"]
    columns = [
        corrected(straight(channels[name], alpha, linear), whole_numbers(channels[bits]))
        for name, bits in zip("RGB", COLOR_BITS, strict=True)
    ]
    return np.stack(columns, axis=1)
