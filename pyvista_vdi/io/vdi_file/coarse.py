"""The coarse level that a page draws first: a VDI of few lists of the same view."""

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.vdi import VDI, length_per_depth, with_arrays


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
    offsets, rows = rows_of(vdi, taken, counts)
    old = [(2 * p + 1) / n - 1 for p, n in zip((x, y), vdi.window_size, strict=True)]
    stretch = length_per_depth(camera, window, *new) / length_per_depth(
        camera, vdi.window_size, *old
    )
    tau = vdi.optical_depth[rows] * np.repeat(stretch.ravel(), counts)
    arrays = vdi.arrays.take(offsets, rows)._replace(optical_depth=tau.astype(np.float32))
    return with_arrays(vdi, arrays, camera=camera, window_size=window, metadata={})


def rows_of(
    vdi: VDI, lists: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return offsets of some lists one after the other, and which supersegments are theirs."""
    offsets = np.concatenate([[0], np.cumsum(counts)])
    rows = np.repeat(vdi.offsets.view(np.int64)[lists] - offsets[:-1], counts)
    return offsets, rows + np.arange(offsets[-1])
