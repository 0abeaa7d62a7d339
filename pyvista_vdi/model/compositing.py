"""Opacity over a length, compositing, split and merge of homogeneous segments, in float64 NumPy.

The laws of docs/dev/conventions.md#a-supersegment-is-a-homogeneous-medium and
docs/dev/conventions.md#merging-samples-into-a-supersegment. A *segment* is a homogeneous medium
between two depths; what it absorbs is its optical depth tau, never its opacity, which rounds to 1.
Colours are straight RGB in segments and premultiplied in images.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import one_of

Array = NDArray[np.float64]

#: How the colour of a merged segment is weighted; see :func:`merge`.
WEIGHTINGS = ("transmittance", "optical_depth")


class Segment(NamedTuple):
    """A homogeneous medium between two depths on a ray.

    ``front``, ``back``: where it begins and ends, in any unit of length along the ray; ``front <
    back``. ``color``: straight RGB, float64 (3,). ``optical_depth``: tau >= 0 from front to back.
    """

    front: float
    back: float
    color: Array
    optical_depth: float


def opacity(optical_depth: ArrayLike) -> Array:
    """Return the opacity of a medium, alpha = 1 - exp(-tau), float64 of the same shape.

    Exact for small tau >= 0, where 1 - exp would cancel; infinity is opaque.
    """
    return np.asarray(-np.expm1(-_within("optical_depth", optical_depth)))


def optical_depth(opacity: ArrayLike) -> Array:
    """Return the optical depth of opacities, tau = -log1p(-alpha); infinite where alpha is 1."""
    alpha = _within("opacity", opacity, 1.0)
    with np.errstate(divide="ignore"):  # log1p(-1) is meant
        return np.asarray(np.abs(-np.log1p(-alpha)))  # abs: -log1p(-0) is -0


def transmittance(optical_depth: ArrayLike) -> Array:
    """Return the share of light that passes, exp(-tau) = 1 - alpha."""
    return np.asarray(np.exp(-_within("optical_depth", optical_depth)))


def optical_depth_over_length(
    optical_depth: ArrayLike, length: ArrayLike, whole_length: ArrayLike
) -> Array:
    """Return tau l / L, what a ray meets that crosses length l of a segment of length L.

    That is the extinction tau / L times the length (Beer-Lambert), which exceeds L where the ray is
    oblique. Lengths in the same unit; InvalidArgumentError if L is not positive, or one negative.
    """
    whole = _within("whole_length", whole_length)
    if not whole.all():
        raise InvalidArgumentError(f"whole_length must be positive; got {whole_length!r}")
    return _within("optical_depth", optical_depth) * (_within("length", length) / whole)


def composite(color: ArrayLike, optical_depth: ArrayLike) -> Array:
    """Composite homogeneous media, the nearest first, onto nothing: premultiplied RGBA, (4,).

    ``color`` (float, shape (n, 3)): straight RGB of each. ``optical_depth`` (float, shape (n,)):
    tau of each on this ray. The same as *over* n times (Porter and Duff 1984, the paper's reference
    10), but formed from sums of optical depths, so that no rounding of 1 - alpha enters: medium k
    contributes ``exp(-(tau_0 + ... + tau_(k-1))) (1 - exp(-tau_k))`` of its colour.
    """
    tau = _within("optical_depth", optical_depth)
    rgb = np.asarray(color, dtype=np.float64).reshape(len(tau), 3)
    before = np.concatenate(([0.0], np.cumsum(tau)))
    share = transmittance(before[:-1]) * opacity(tau)
    return np.append(share @ rgb, opacity(before[-1]))


def split(segment: Segment, depth: float) -> tuple[Segment, Segment]:
    """Cut a segment in two at a depth strictly inside, or raise InvalidArgumentError.

    Both parts have its colour, and tau in proportion to length: composited again they are the
    whole.
    """
    if not segment.front < depth < segment.back:
        raise InvalidArgumentError(
            f"a segment from {segment.front} to {segment.back} cannot be split at {depth}: "
            "give a depth strictly between its front and its back"
        )
    near = segment.optical_depth * ((depth - segment.front) / (segment.back - segment.front))
    return (
        segment._replace(back=depth, optical_depth=near),
        segment._replace(front=depth, optical_depth=segment.optical_depth - near),
    )


def merge(near: Segment, far: Segment, weighting: str = "transmittance") -> Segment:
    """Replace two neighbours by one homogeneous segment that spans both; optical depths add.

    They touch, or what lies between them is empty. ``weighting``: by ``"transmittance"`` the merged
    segment looks exactly as the two looked along this ray; by ``"optical_depth"`` the colour is the
    mean weighted by tau, unbiased from other directions. They agree in the limit of thin segments
    and where the colours are equal. InvalidArgumentError if the two overlap or are in the wrong
    order, or ``weighting`` is unknown.
    """
    if not near.back <= far.front:
        raise InvalidArgumentError(
            f"cannot merge a segment from {near.front} to {near.back} with one from {far.front} "
            f"to {far.back}: the nearer must end before the farther begins"
        )
    weights = [float(near.optical_depth), float(far.optical_depth)]
    if weights == [0, 0]:
        weights = [1.0, 1.0]  # nothing is seen of either
    elif one_of(weighting, "weighting", WEIGHTINGS) == "transmittance":
        first, second = near.optical_depth, far.optical_depth
        weights = [float(opacity(first)), float(transmittance(first) * opacity(second))]
    color = (weights[0] * near.color + weights[1] * far.color) / (weights[0] + weights[1])
    return Segment(near.front, far.back, color, near.optical_depth + far.optical_depth)


def _within(name: str, values: ArrayLike, most: float = np.inf) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if not ((array >= 0) & (array <= most)).all():  # written so that NaN fails
        got = np.array2string(array, threshold=8)
        rule = "lie between 0 and 1" if most == 1 else "not be negative or NaN"
        raise InvalidArgumentError(f"{name} must {rule}; got {got}")
    return array
