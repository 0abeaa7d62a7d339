"""Small volumes for scripts: fresh ones in each call, without any symmetry."""

import functools

import numpy as np
import pyvista as pv

#: Centre, radius and height of soft balls.
BALLS = (
    (0.3, 0.1, 0.2, 0.95, 1.0),
    (-0.5, -0.45, -0.3, 0.75, 0.7),
    (-0.3, 0.6, 0.55, 0.6, 0.45),
)


@functools.cache
def _values(n, seed):
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, each) for each in n[::-1]), indexing="ij")
    out = np.zeros_like(x)
    for i, (a, b, c, radius, height) in enumerate(BALLS):
        shift = 0.25 * seed * (i - 1)
        square = (x - a - shift) ** 2 + (y - b + shift) ** 2 + (z - c) ** 2
        out = np.maximum(out, height * np.clip(1 - square / radius**2, 0, 1))
    return out


def values(n=24, seed=0):
    """Return three balls of different sizes, 0 to 1, indexed [z, y, x]."""
    return _values((n, n, n) if isinstance(n, int) else n, seed).copy()


def grid(n=24, *, high=255.0, dtype=np.float32, seed=0, name="values", **shape):
    """Return a uniform grid of bounds near -1 to 1."""
    n = (n, n, n) if isinstance(n, int) else n
    spacing = shape.pop("spacing", (2 / (max(n) - 1),) * 3)
    image = pv.ImageData(dimensions=n, spacing=spacing)
    image.origin = [-(a - 1) * s / 2 for a, s in zip(n, spacing, strict=True)]
    for key, value in shape.items():
        setattr(image, key, value)
    image[name] = (values(n, seed) * high).ravel().astype(dtype)
    return image
