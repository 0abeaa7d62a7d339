"""Where points lie: maps to the world, and units of length, for every format alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Powers of ten that prefixes of units stand for.
_POWERS = {"k": 3, "d": -1, "c": -2, "m": -3, "u": -6, "µ": -6, "n": -9, "p": -12}
_POWERS |= {"kilo": 3, "deci": -1, "centi": -2, "milli": -3, "micro": -6, "nano": -9, "pico": -12}

#: Units of length in metres, as OME-Zarr and OME-TIFF write them.
METRES = {"m": 1.0, "meter": 1.0, "Å": 1e-10, "angstrom": 1e-10, "micron": 1e-6, "inch": 0.0254}
METRES |= {
    prefix + ("m" if len(prefix) == 1 else "meter"): float(f"1e{power}")
    for prefix, power in _POWERS.items()
}


def to_world(steps: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """Return the map from point index (x, y, z) to the world, (4, 4).

    ``steps``: from point to point, three lengths or, in three columns, vectors. ``origin``: where
    the first point lies.
    """
    place, along = np.eye(4), np.asarray(steps, dtype=np.float64)
    place[:3, :3] = np.diag(along) if along.ndim == 1 else along
    place[:3, 3] = origin
    return place


def in_one_unit(lengths: Sequence[float], units: Sequence[str]) -> tuple[list[float], str]:
    """Return lengths along x, y and z in the unit of the first, where all are of length."""
    metres = [METRES.get(unit, 0.0) for unit in units]
    if len({*units}) == 1 or not all(metres):
        return [*lengths], one_unit(units)
    return [n * m / metres[0] for n, m in zip(lengths, metres, strict=True)], units[0]


def one_unit(units: Sequence[str]) -> str:
    """Return the unit of lengths along x, y and z: of each, where they differ."""
    return units[0] if len({*units}) == 1 else ", ".join(unit or "1" for unit in units)
