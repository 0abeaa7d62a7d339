"""Small volumes for scripts: fresh ones in each call, without any symmetry."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pyvista as pv


@functools.cache
def _values(n: tuple[int, int, int], seed: int = 0) -> np.ndarray:
    """Three soft balls of different sizes and heights, 0 to 1, indexed [z, y, x]."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, each) for each in n[::-1]), indexing="ij")
    balls = [
        (0.3, 0.1, 0.2, 0.95, 1.0),
        (-0.5, -0.45, -0.3, 0.75, 0.7),
        (-0.3, 0.6, 0.55, 0.6, 0.45),
    ]
    out = np.zeros_like(x)
    for i, (a, b, c, radius, height) in enumerate(balls):
        shift = 0.25 * seed * (i - 1)
        square = (x - a - shift) ** 2 + (y - b + shift) ** 2 + (z - c) ** 2
        out = np.maximum(out, height * np.clip(1 - square / radius**2, 0, 1))
    return out


def values(n: int | tuple[int, int, int] = 24, seed: int = 0) -> np.ndarray:
    """Return 0 to 1, indexed [z, y, x]."""
    n = (n, n, n) if isinstance(n, int) else n
    return _values(n, seed).copy()


def grid(
    n: int | tuple[int, int, int] = 24,
    *,
    high: float = 255.0,
    dtype: Any = np.float32,
    seed: int = 0,
    name: str = "values",
    **shape: Any,
) -> pv.ImageData:
    """Return a uniform grid of bounds near -1 to 1."""
    n = (n, n, n) if isinstance(n, int) else n
    step = 2 / (max(n) - 1)
    spacing = shape.pop("spacing", (step,) * 3)
    image = pv.ImageData(dimensions=n, spacing=spacing)
    image.origin = shape.pop(
        "origin", tuple(-(a - 1) * s / 2 for a, s in zip(n, spacing, strict=True))
    )
    for key, value in shape.items():
        setattr(image, key, value)
    image[name] = (values(n, seed) * high).ravel().astype(dtype)
    return image
