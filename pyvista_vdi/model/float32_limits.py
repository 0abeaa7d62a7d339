"""Borders beyond which another arithmetic takes over, or a scene is refused.

They are derived in docs/dev/numerics.md, "Two arithmetics".
"""

import numpy as np
from numpy.typing import DTypeLike

#: Media on a ray from which on opacity is summed up from 0, and from which on sums carry what
#: each addition rounds off.
MANY_MEDIA, VERY_MANY_MEDIA = 1024, 8192

#: Most steps across a volume.
MOST_STEPS = 2**19

#: Most times its transfer function's range that a scalar may be, when the kernels read it as it
#: is: interpolation rounds it 9 times (3 stages of 3), a nearest point's scalar is rounded once.
_MOST_RANGES = {"linear": 64.0, "nearest": 576.0}

#: Scalar ranges, and sizes of scalars, that leave their differences' products normal numbers.
_SMALLEST_RANGE, _LARGEST_SCALAR = 2.0**-100, 2.0**100

#: Largest magnitude of voxels whose differences float32 holds.
LARGEST_VOXEL = 2.0**126

#: Grid coordinates up to which positions on a ray are computed in float32 alone, from where the
#: rays are formed: the last times the points of the longest axis, but within the first two.
NEAR_ENTRY, FAR_ENTRY, ENTRY_PER_POINT = 256.0, 2048.0, 4.0

#: Largest specular power of a cosine as it is.
LARGEST_POWER = 100.0

#: Optical depths of one step, through any opacity of at least 2^-24, whose sums float32 holds.
_LARGEST_STEP = 2.0**96


def scalars_suit_float32(low: float, high: float, dtype: DTypeLike, interpolation: str) -> bool:
    """Whether kernels may read voxels as they are, for a transfer function over low..high.

    Otherwise they are taken relative to the range, on the host in float64.
    """
    floats = np.dtype(dtype).kind == "f"
    if low == high:  # only whether a scalar is above counts
        with np.errstate(over="ignore"):
            exact = float(np.float32(low)) == low
        return not floats or (exact and abs(low) >= _SMALLEST_RANGE)
    largest, span = max(abs(low), abs(high)), high - low
    if floats and not (span >= _SMALLEST_RANGE and largest <= _LARGEST_SCALAR):
        return False
    return largest <= _MOST_RANGES[interpolation] * span


def summation(media: float) -> int:
    """Return how kernels sum up whose rays may meet so many media: ``-D COMPENSATED``."""
    return 0 if media <= MANY_MEDIA else 1 if media <= VERY_MANY_MEDIA else 2


def lists_are_far(depth: float, thickness: float, extent: float) -> bool:
    """Whether depths in lists need be relative to each ray (``-D DOUBLE_FLOAT_RAYS``).

    ``depth`` is the largest that is rounded, ``thickness`` that of what the thickest list holds,
    from its first front to its last back, and ``extent`` that of the bounds; world units. Below
    2^-23 extents nothing tells what a ray crosses.
    """
    return extent * 2.0**-23 < thickness < depth / 128


def held_unit_distance(unit_distance: float, sample_distance: float) -> float:
    """Return an opacity unit distance by which no step's optical depth leaves float32.

    What is denser is as opaque, and what is thinner is as transparent.
    """
    return min(max(unit_distance, sample_distance / _LARGEST_STEP), sample_distance * _LARGEST_STEP)
