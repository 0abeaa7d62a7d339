"""List subsampling: a VDI of every k-th list, for pictures of few pixels from the side."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_whole
from pyvista_vdi.model.coverage import bounds_corners
from pyvista_vdi.model.vdi import VDI

#: Share of the way to the middle of the bounds at which their corners are looked at.
_INNER = 0.5


def subsampled_lists(vdi: VDI, along_x: int = 1, along_y: int = 1) -> VDI:
    """Return a VDI of every k-th list along each edge: the same lists, of the same rays.

    A list stands for its neighbours, too. From the side a ray crosses a k-th of the lists, which
    is about what it costs. docs/decisions/any_view.md says what that loses.

    ``vdi``: of any precision, which stays. ``along_x``, ``along_y``: every how many lists one is
    taken along the window's width and height. Returns: Without metadata. Its view is that of
    ``vdi``, stretched by its model transform, so that the middles of the pixels are those of the
    lists that were taken. Of the window's right and upper edge it may leave out less than half of
    one of its lists. Raises InvalidArgumentError if a step is not a whole number from 1 to the
    window's edge.
    """
    camera = vdi.camera
    for step, edge in zip((along_x, along_y), vdi.window_size, strict=True):
        if not 1 <= as_whole(step) <= edge:
            raise InvalidArgumentError(
                f"every k-th list is taken, k a whole number from 1 to {edge}; got {step!r}"
            )
    steps = int(along_x), int(along_y)
    x, y = (np.arange((k - 1) // 2, n, k) for k, n in zip(steps, vdi.window_size, strict=True))
    window = (len(x), len(y))
    # Viewport coordinates before: a times those after, plus b
    a = np.multiply(steps, window) / vdi.window_size
    b = (np.array([x[0], y[0]]) * 2 + 1 + np.multiply(steps, window) - steps) / vdi.window_size - 1
    grown = np.divide(camera.half_extent(window), camera.half_extent(vdi.window_size)) / a
    view = _stretched(camera, grown).replace(window_center=(camera.window_center + b) / a)

    taken = (y[:, np.newaxis] * vdi.window_size[0] + x).ravel()
    offsets, rows = _rows_of(vdi, taken, vdi.counts.reshape(-1)[taken])
    result = _of_rows(vdi, view, window, offsets, rows, vdi.optical_depth[rows])
    packing = vdi.packing
    if packing is not None:
        result.packing = replace(
            packing,
            origins=packing.origins[taken],
            strides=packing.strides[taken],
            words=packing.words[rows],
        )
    return result


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
    offsets, rows = _rows_of(vdi, taken, counts)
    old = [(2 * p + 1) / n - 1 for p, n in zip((x, y), vdi.window_size, strict=True)]
    stretch = length_per_depth(camera, window, *new) / length_per_depth(
        camera, vdi.window_size, *old
    )
    tau = vdi.optical_depth[rows] * np.repeat(stretch.ravel(), counts)
    return _of_rows(vdi, camera, window, offsets, rows, tau.astype(np.float32))


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


def _rows_of(
    vdi: VDI, lists: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return offsets of some lists one after the other, and which supersegments are theirs."""
    offsets = np.concatenate([[0], np.cumsum(counts)])
    rows = np.repeat(vdi.offsets.view(np.int64)[lists] - offsets[:-1], counts)
    return offsets, rows + np.arange(offsets[-1])


def _of_rows(
    vdi: VDI,
    view: Camera,
    window: tuple[int, int],
    offsets: NDArray[np.int64],
    rows: NDArray[np.int64],
    optical_depth: NDArray[np.float32],
) -> VDI:
    """Return the VDI of some supersegments, without metadata."""
    arrays: dict[str, Any] = {name: getattr(vdi, name)[rows] for name in ("front", "back", "color")}
    arrays |= {"bounds": vdi.bounds, "depth_origin": vdi.depth_origin}
    return VDI(view, window, offsets, optical_depth=optical_depth, **arrays)


def length_per_depth(
    camera: Camera, window: tuple[int, int], u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return model lengths of a world unit of depth along rays through (u, v); (v, u)."""
    constant, along_u, along_v = camera.ray_coefficients(window)[1] @ (
        np.linalg.inv(camera.model_to_view)[:3, :3].T
    )
    return np.linalg.norm(
        constant + u[:, np.newaxis] * along_u + v[:, np.newaxis, np.newaxis] * along_v, axis=-1
    )


def _stretched(camera: Camera, factors: NDArray[np.float64]) -> Camera:
    """Return a view whose view space is stretched along x and y; its model transform has it."""
    axes, eye = camera.axes, np.asarray(camera.position)
    stretch = axes.T @ np.diag([*factors, 1.0]) @ axes
    transform = camera.model_transform.copy()
    transform[:3, :3] = stretch @ transform[:3, :3]
    transform[:3, 3] = eye + stretch @ (transform[:3, 3] - eye)
    return camera.replace(model_transform=transform)
