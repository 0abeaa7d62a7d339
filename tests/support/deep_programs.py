"""Two VDIs of which oiiotool (OpenImageIO) has made deep images, which are in ``tests/io/files``.

They were made of images with an older attribute of ours, which is not read: they are as any
program's.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pyvista_vdi import VDI, Camera

RECORDED = Path(__file__).parents[1] / "io" / "files"
VIEW = Camera((0.5, -0.25, 4), (0.5, 0, -1), (0, 1, 0), view_angle=40)
SIZE = (8, 6)
BOUNDS = {"a": (-1.9, 1.1, -1.2, 1.2, -1.0, 1.1), "b": (-0.2, 3.3, -1.4, 1.4, -1.7, 0.4)}


def pair() -> tuple[VDI, VDI]:
    """Return two VDIs of one view whose media overlap; no box holds the other's."""
    return _half(0, 5, 0.0, 2.5, "a"), _half(3, 8, 0.7, 3.25, "b")


def _half(first: int, last: int, deeper: float, origin: float, name: str) -> VDI:
    """Return a VDI with three supersegments in each list of some columns."""
    rng = np.random.default_rng(first)
    counts = np.zeros(SIZE[::-1], int)
    counts[1:5, first:last] = 3
    n = int(counts.sum())
    front = np.tile([3.0, 3.5, 4.25], n // 3) + deeper + 0.2 * rng.random(n)
    back = front + np.tile([0.25, 0.5, 0.5], n // 3)
    tau = rng.random(n) * np.tile([0.5, 1.0, 2.0], n // 3) + 1e-3
    tau[5] = 12.0  # what opacities in float32 round
    return VDI(
        VIEW,
        SIZE,
        np.concatenate([[0], np.cumsum(counts.ravel())]),
        front - origin,
        back - origin,
        rng.random((n, 3)),
        tau,
        BOUNDS[name],
        depth_origin=origin,
        metadata={"name": name},
    )
