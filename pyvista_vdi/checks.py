"""What callers give for numbers, as numbers: NaN or nothing where it is none.

Range checks that are written so that NaN fails them then refuse it, in the words of the one who
asked for it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def as_float(value: Any) -> float:
    """Return ``value`` as a float, NaN where it is no number: range checks then refuse it."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def as_range(values: Any) -> tuple[float, float]:
    """Return two numbers as floats, NaN where they are no numbers or not two."""
    try:
        low, high = values
    except (TypeError, ValueError):
        return math.nan, math.nan
    return as_float(low), as_float(high)


def as_floats(values: Any) -> NDArray[np.float64]:
    """Return numbers as a new float64 array, of shape (0,) where they are none."""
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)
