"""Where points lie: maps to the world, and the unit of lengths, for every format alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import UnsupportedError


def to_world(steps: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """Return the map from point index (x, y, z) to the world, (4, 4).

    ``steps``: from point to point, three lengths or, in three columns, vectors. ``origin``: where
    the first point lies.
    """
    place, along = np.eye(4), np.asarray(steps, dtype=np.float64)
    place[:3, :3] = np.diag(along) if along.ndim == 1 else along
    place[:3, 3] = origin
    return place


def one_unit(units: Sequence[Any]) -> str:
    """Return the unit of lengths along all axes; UnsupportedError if they differ."""
    if len({*units}) > 1:
        raise UnsupportedError(
            f"it has lengths in {', '.join(map(str, units))} along its axes: write them in one unit"
        )
    return str(units[0] or "")
