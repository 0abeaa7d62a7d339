"""Over, opacity over a length, split and merge of homogeneous segments, in float64 NumPy.

The laws of docs/conventions.md#a-supersegment-is-a-homogeneous-medium and
docs/conventions.md#merging-samples-into-a-supersegment. A *segment* is a homogeneous medium between
two depths; what it absorbs is its optical depth tau, never its opacity, which rounds to 1.
Colours are straight RGB in segments and premultiplied in images.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError

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
    """Return the opacity of a medium, alpha = 1 - exp(-tau).

    ``optical_depth``: tau >= 0, any shape; infinity is opaque. Returns: float64, 0 to 1, of the
    same shape; exact for small tau, where 1 - exp would cancel.
    """
    return np.asarray(-np.expm1(-_not_negative("optical_depth", optical_depth)))


def optical_depth(opacity: ArrayLike) -> Array:
    """Return the optical depth of an opacity, tau = -log1p(-alpha); infinite where alpha is 1.

    ``opacity``: 0 to 1, any shape. Returns: float64 of the same shape. Raises InvalidArgumentError
    if a value lies outside [0, 1] or is NaN.
    """
    alpha = np.asarray(opacity, dtype=np.float64)
    if not ((alpha >= 0) & (alpha <= 1)).all():
        raise InvalidArgumentError(f"opacity must lie between 0 and 1; got {_shown(alpha)}")
    with np.errstate(divide="ignore"):  # log1p(-1) is meant
        return np.asarray(np.abs(-np.log1p(-alpha)))  # abs: -log1p(-0) is -0


def transmittance(optical_depth: ArrayLike) -> Array:
    """Return the share of light that passes, exp(-tau) = 1 - alpha.

    ``optical_depth``: tau >= 0, any shape. Returns: float64, 0 to 1, of the same shape.
    """
    return np.asarray(np.exp(-_not_negative("optical_depth", optical_depth)))


def optical_depth_over_length(
    optical_depth: ArrayLike, length: ArrayLike, whole_length: ArrayLike
) -> Array:
    """Return tau l / L, what a ray meets that crosses length l of a segment of length L.

    ``optical_depth``: tau over the whole length. ``length``: l >= 0, the length crossed; may exceed
    L where the ray is oblique. Model units. ``whole_length``: l > 0, the length over which tau was
    measured; the same unit. Returns: float64, the extinction tau / L times the length
    (Beer-Lambert). Raises InvalidArgumentError if an argument is negative or NaN, or L is zero.
    """
    whole = np.asarray(whole_length, dtype=np.float64)
    if not (whole > 0).all():
        raise InvalidArgumentError(f"whole_length must be positive; got {_shown(whole)}")
    tau = _not_negative("optical_depth", optical_depth)
    return np.asarray(tau * (_not_negative("length", length) / whole))


def over(front: ArrayLike, back: ArrayLike) -> Array:
    """Composite ``front`` over ``back`` (Porter and Duff 1984, the paper's reference 10).

    ``front``, ``back`` (float, shape (..., 4)): premultiplied RGBA. Returns: float64 (..., 4),
    premultiplied RGBA: ``front + (1 - front alpha) back``. Associative.
    """
    near, far = np.asarray(front, dtype=np.float64), np.asarray(back, dtype=np.float64)
    return np.asarray(near + (1 - near[..., 3:]) * far)


def composite(color: ArrayLike, optical_depth: ArrayLike) -> Array:
    """Composite homogeneous media, front to back, onto nothing.

    ``color`` (float, shape (n, 3)): straight RGB of each medium, the nearest first.
    ``optical_depth`` (float, shape (n,)): tau of each on this ray. Returns: float64 (4,),
    premultiplied RGBA. The same as n times :func:`over`, but formed from sums of optical depths, so
    that no rounding of 1 - alpha enters: medium k contributes ``exp(-(tau_0 + ... + tau_(k-1))) (1
    - exp(-tau_k))`` of its colour.
    """
    tau = _not_negative("optical_depth", optical_depth)
    rgb = np.asarray(color, dtype=np.float64).reshape(len(tau), 3)
    before = np.concatenate(([0.0], np.cumsum(tau)))
    share = transmittance(before[:-1]) * opacity(tau)
    return np.append(share @ rgb, opacity(before[-1]))


def split(segment: Segment, depth: float) -> tuple[Segment, Segment]:
    """Cut a segment in two at a depth.

    ``segment``: what to cut. ``depth``: where; strictly between its front and its back. Returns:
    The nearer and the farther part, of the same colour, with tau in proportion to length:
    composited again they are the whole. Raises InvalidArgumentError if ``depth`` does not lie
    inside.
    """
    if not segment.front < depth < segment.back:
        raise InvalidArgumentError(
            f"a segment from {segment.front} to {segment.back} cannot be split at {depth}: "
            "give a depth strictly between its front and its back"
        )
    near = segment.optical_depth * ((depth - segment.front) / (segment.back - segment.front))
    return (
        Segment(segment.front, depth, segment.color, near),
        Segment(depth, segment.back, segment.color, segment.optical_depth - near),
    )


def merge(near: Segment, far: Segment, weighting: str = "transmittance") -> Segment:
    """Replace two neighbours by one homogeneous segment that spans both.

    ``near``, ``far``: the nearer and the farther; they touch, or what lies between them is empty.
    ``weighting`` ("transmittance", "optical_depth"): ``"transmittance"``: the colour that makes the
    merged segment look exactly as the two looked along this ray. ``"optical_depth"``: the mean
    weighted by tau, unbiased from other directions. They agree in the limit of thin segments and
    where the colours are equal. Returns: From the nearer front to the farther back; optical depths
    add. Raises InvalidArgumentError if the two overlap or are in the wrong order, or ``weighting``
    is unknown.
    """
    if not near.back <= far.front:
        raise InvalidArgumentError(
            f"cannot merge a segment from {near.front} to {near.back} with one from {far.front} "
            f"to {far.back}: the nearer must end before the farther begins"
        )
    weights = _merge_weights(near.optical_depth, far.optical_depth, weighting)
    color = (weights[0] * near.color + weights[1] * far.color) / (weights[0] + weights[1])
    return Segment(near.front, far.back, color, near.optical_depth + far.optical_depth)


def _merge_weights(near: float, far: float, weighting: str) -> tuple[float, float]:
    """Return what the nearer and the farther colour count for; never both zero."""
    if weighting not in WEIGHTINGS:
        raise InvalidArgumentError(
            f"weighting must be one of {', '.join(WEIGHTINGS)}; got {weighting!r}"
        )
    if near == far == 0:
        return 1.0, 1.0  # nothing is seen of either
    if weighting == "optical_depth":
        return float(near), float(far)
    return float(opacity(near)), float(transmittance(near) * opacity(far))


def _not_negative(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if not (array >= 0).all():  # written so that NaN fails
        raise InvalidArgumentError(f"{name} must not be negative or NaN; got {_shown(array)}")
    return array


def _shown(array: Array) -> str:
    return np.array2string(array, threshold=8)
