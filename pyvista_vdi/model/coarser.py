"""A VDI of fewer lists, which stands for another until that has been read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI


def coarser(vdi: VDI, step: int = 4) -> VDI:
    """Return a VDI of every ``step``-th list along each edge, of the same view.

    A list of the result is the one of ``vdi`` that the middle of its pixel lies in. The medium of
    its supersegments is the same, so their optical depths follow the length along the new middle.

    ``vdi``: what it stands for. ``step``: lists along an edge that one takes the place of. Returns:
    Of ⌈W / step⌉ by ⌈H / step⌉ lists, exact and without metadata.
    """
    camera, (width, height) = vdi.camera, vdi.window_size
    window = (-(-width // step), -(-height // step))
    # Middles of the new pixels in list coordinates of both; the viewports' shapes differ where
    # the window is no multiple of the step
    grown = np.divide(camera.half_extent(window), camera.half_extent(vdi.window_size))
    new = [(2 * np.arange(n) + 1) / n - 1 for n in window]
    places = [
        np.floor(((middles + centre) * g - centre + 1) / 2 * n).astype(np.int64)
        for middles, centre, g, n in zip(
            new, camera.window_center, grown, vdi.window_size, strict=True
        )
    ]
    inside = [(p >= 0) & (p < n) for p, n in zip(places, vdi.window_size, strict=True)]
    x, y = (np.clip(p, 0, n - 1) for p, n in zip(places, vdi.window_size, strict=True))
    taken = (y[:, np.newaxis] * width + x).ravel()
    counts = np.where(np.outer(*inside[::-1]).ravel(), vdi.counts.reshape(-1)[taken], 0)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    starts = vdi.offsets.view(np.int64)[taken]
    rows = np.repeat(starts - offsets[:-1], counts) + np.arange(offsets[-1])
    old = [(2 * p + 1) / n - 1 for p, n in zip((x, y), vdi.window_size, strict=True)]
    stretch = _length_per_depth(camera, window, *new) / _length_per_depth(
        camera, vdi.window_size, *old
    )
    tau = vdi.optical_depth[rows] * np.repeat(stretch.ravel(), counts)
    return VDI(
        camera,
        window,
        offsets,
        vdi.front[rows],
        vdi.back[rows],
        vdi.color[rows],
        tau.astype(np.float32),
        vdi.bounds,
        depth_origin=vdi.depth_origin,
    )


def _length_per_depth(
    camera: Camera, window: tuple[int, int], u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return model lengths of a world unit of depth along rays through (u, v); (v, u)."""
    constant, along_u, along_v = camera.ray_coefficients(window)[1] @ (
        np.linalg.inv(camera.model_to_view)[:3, :3].T
    )
    return np.linalg.norm(
        constant + u[:, np.newaxis] * along_u + v[:, np.newaxis, np.newaxis] * along_v, axis=-1
    )
