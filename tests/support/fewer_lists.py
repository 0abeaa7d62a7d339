"""A VDI of every k-th list, for pictures of few pixels from the side, and whether that pays."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.io.vdi_file.coarse import rows_of
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners
from pyvista_vdi.model.vdi import VDI, with_arrays

#: Share of the way to the middle of the bounds at which their corners are looked at.
_INNER = 0.5


def subsampled_lists(vdi: VDI, along_x: int, along_y: int) -> VDI:
    """Return a VDI of every k-th list along each edge: the same lists, of the same rays.

    A list stands for its neighbours, too. From the side a ray crosses a k-th of the lists, which
    is about what it costs. docs/decisions/any_view.md says what that loses.

    ``vdi``: of any precision, which stays. ``along_x``, ``along_y``: every how many lists one is
    taken along the window's width and height. Returns: Without metadata. Its view is that of
    ``vdi``, stretched by its model transform, so that the middles of the pixels are those of the
    lists that were taken. Of the window's right and upper edge it may leave out less than half of
    one of its lists.
    """
    camera, steps = vdi.camera, (along_x, along_y)
    x, y = (np.arange((k - 1) // 2, n, k) for k, n in zip(steps, vdi.window_size, strict=True))
    window = (len(x), len(y))
    # Viewport coordinates before: a times those after, plus b
    a = np.multiply(steps, window) / vdi.window_size
    b = (np.array([x[0], y[0]]) * 2 + 1 + np.multiply(steps, window) - steps) / vdi.window_size - 1
    grown = np.divide(camera.half_extent(window), camera.half_extent(vdi.window_size)) / a
    view = _stretched(camera, grown).replace(window_center=(camera.window_center + b) / a)

    taken = (y[:, np.newaxis] * vdi.window_size[0] + x).ravel()
    offsets, rows = rows_of(vdi, taken, vdi.counts.reshape(-1)[taken])
    packing = vdi.packing
    if packing is None:
        arrays: Any = vdi.arrays.take(offsets, rows)
    else:
        arrays = replace(
            packing,
            offsets=offsets.astype(np.uint64),
            origins=packing.origins[taken],
            strides=packing.strides[taken],
            words=packing.words[rows],
        )
    return with_arrays(vdi, arrays, camera=view, window_size=window, metadata={})


def lists_crossed(vdi: VDI, camera: Camera) -> NDArray[np.float64]:
    """Return how many lists rays of a view cross along the window's width and height, float64 (2,).

    The mean of nine rays that go through the bounds, over a length of half their diagonal.
    """
    corners = bounds_corners(vdi.bounds)
    middle = corners.mean(axis=0)
    points = np.vstack([middle, corners + _INNER * (middle - corners)])
    to_model = np.linalg.inv(camera.model_to_view)
    if camera.parallel_projection:
        directions = np.broadcast_to(to_model[:3, 2], points.shape)
    else:
        directions = points - to_model[:3, 3]
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    reach = np.linalg.norm(corners[-1] - corners[0]) / 4
    along = directions / np.where(lengths > 0, lengths, 1) * reach
    places = []
    to_window = vdi.camera.viewport_matrix(vdi.window_size) @ vdi.camera.model_to_view
    for ends in (points - along, points + along):
        places.append(np.column_stack([ends, np.ones(len(ends))]) @ to_window.T)
    seen = (places[0][:, 3] > 0) & (places[1][:, 3] > 0)
    if not seen.any():
        return np.zeros(2)
    first, last = (place[seen, :2] / place[seen, 3:] for place in places)
    crossed: Any = np.abs(last - first).mean(axis=0) * np.asarray(vdi.window_size) / 2
    return np.asarray(crossed, dtype=np.float64)


def _stretched(camera: Camera, factors: NDArray[np.float64]) -> Camera:
    """Return a view whose view space is stretched along x and y; its model transform has it."""
    axes, eye = camera.axes, np.asarray(camera.position)
    stretch = axes.T @ np.diag([*factors, 1.0]) @ axes
    transform = camera.model_transform.copy()
    transform[:3, :3] = stretch @ transform[:3, :3]
    transform[:3, 3] = eye + stretch @ (transform[:3, 3] - eye)
    return camera.replace(model_transform=transform)
