"""A scalar that changes in time, as a simulation hands it in: values at points, by numpy alone."""

from __future__ import annotations

import numpy as np

N = 40
STEPS, SIZE = 25, (160, 120)
GRID = {"spacing": (2 / (N - 1),) * 3, "origin": (-1.0, -1.0, -1.0)}
#: What is kept, and three looks that were not known when it was.
KEPT = {"classification": "deferred", "value_range": (0.02, 1.2), "interpolation": "linear"}
LOOKS = {
    "ramp": {"cmap": "viridis", "opacity": [0, 0.3], "clim": (0.02, 1.2)},
    "window": {"cmap": "bone", "opacity": [0, 0.5], "clim": (0.3, 0.7)},
    "peak": {"cmap": "plasma", "opacity": [0, 0, 0.6, 0, 0], "clim": (0.1, 1.1)},
}


def values_at(step: int, z: slice = slice(None)) -> np.ndarray:
    """Two drops that turn about each other and meet, with ripples; float32, indexed [z, y, x]."""
    axis = np.linspace(-1, 1, N)
    z, y, x = np.meshgrid(axis[z], axis, axis, indexing="ij")
    turn, apart = 0.1 * step, 0.5 - 0.01 * step
    found = 0.05 * (1 + np.sin(9 * x + turn) * np.cos(7 * y) * np.sin(8 * z))
    for side in (-1, 1):
        cx, cy, cz = side * apart * np.cos(turn), side * apart * np.sin(turn), 0.2 * side
        found += np.exp(-9 * ((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2))
    return found.astype(np.float32)
