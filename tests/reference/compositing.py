"""Compositing, split and merge of homogeneous segments, in float64 NumPy.

The laws of docs/dev/conventions.md#a-supersegment-is-a-homogeneous-medium and
docs/dev/conventions.md#merging-samples-into-a-supersegment. A *segment* is a homogeneous medium
between two depths; what it absorbs is its optical depth tau, never its opacity, which rounds to 1.
Colours are straight RGB in segments and premultiplied in images.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: How the colour of a merged segment is weighted; see :func:`merge`.
WEIGHTINGS = ("transmittance", "optical_depth")


class Segment(NamedTuple):
    """A homogeneous medium between two depths on a ray, ``front < back``, in any unit of length.

    ``color``: straight RGB, float64 (3,). ``optical_depth``: tau >= 0 from front to back.
    """

    front: float
    back: float
    color: Array
    optical_depth: float


def opacity(optical_depth: ArrayLike) -> Array:
    """Return 1 - exp(-tau); exact for small tau, where 1 - exp would cancel."""
    return np.asarray(-np.expm1(-np.asarray(optical_depth, dtype=np.float64)))


def optical_depth_over_length(
    optical_depth: ArrayLike, length: ArrayLike, whole_length: ArrayLike
) -> Array:
    """Return tau l / L, what a ray meets that crosses length l of a segment of length L."""
    return np.asarray(optical_depth) * (np.asarray(length) / whole_length)


def composite(color: ArrayLike, optical_depth: ArrayLike) -> Array:
    """Composite homogeneous media, the nearest first, onto nothing: premultiplied RGBA, (4,).

    The same as *over* n times (Porter and Duff 1984, the paper's reference 10), but formed from
    sums of optical depths, so that no rounding of 1 - alpha enters: medium k contributes
    ``exp(-(tau_0 + ... + tau_(k-1))) (1 - exp(-tau_k))`` of its colour.
    """
    tau = np.asarray(optical_depth, dtype=np.float64)
    rgb = np.asarray(color, dtype=np.float64).reshape(len(tau), 3)
    before = np.concatenate(([0.0], np.cumsum(tau)))
    return np.append((np.exp(-before[:-1]) * opacity(tau)) @ rgb, opacity(before[-1]))


def split(segment: Segment, depth: float) -> tuple[Segment, Segment]:
    """Cut a segment in two at a depth strictly inside; tau is shared in proportion to length."""
    near = segment.optical_depth * ((depth - segment.front) / (segment.back - segment.front))
    return (
        segment._replace(back=depth, optical_depth=near),
        segment._replace(front=depth, optical_depth=segment.optical_depth - near),
    )


def merge(near: Segment, far: Segment, weighting: str = "transmittance") -> Segment:
    """Replace two neighbours by one homogeneous segment that spans both; optical depths add.

    ``weighting``: by ``"transmittance"`` the merged segment looks exactly as the two looked along
    this ray; by ``"optical_depth"`` the colour is the mean weighted by tau, unbiased from other
    directions. They agree in the limit of thin segments and where the colours are equal.
    """
    first, second = float(near.optical_depth), float(far.optical_depth)
    weights = [first, second]
    if weights == [0, 0]:
        weights = [1.0, 1.0]  # nothing is seen of either
    elif weighting == "transmittance":
        weights = [float(opacity(first)), float(np.exp(-first) * opacity(second))]
    color = (weights[0] * near.color + weights[1] * far.color) / (weights[0] + weights[1])
    return Segment(near.front, far.back, color, near.optical_depth + far.optical_depth)
