"""Which level of a multi-scale volume a view requires."""

import itertools
from collections.abc import Sequence

import numpy as np

from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.volume import Grid

#: How far beyond a plane a corner may lie by rounding; the volume is of size 1, planes of norm 1.
_ROUNDING = 1e-9

#: Edges of a voxel that differ by less are the same.
_COARSER = 1.01


def nearest_depth(grid: Grid, camera: Camera, window_size: Sequence[int]) -> float | None:
    """Return the view depth of the visible part of a grid's box that is nearest to the eye.

    ``grid``: of a volume. ``camera``: V_O. ``window_size``: lists of V_O along x and y. Returns:
    World units, 0 where the eye is in the box; ``None`` where nothing of it is in the window.
    """
    to_view = camera.model_to_view @ grid.index_to_model
    to_view[:3, :3] *= np.asarray(grid.dimensions) - 1  # the box is [0, 1]³ then
    viewport = camera.viewport_matrix(window_size) @ to_view
    box = np.concatenate([np.eye(4)[:3], np.eye(4)[3] - np.eye(4)[:3]])
    window = [viewport[3] + sign * viewport[axis] for axis in (0, 1) for sign in (1, -1)]
    planes = np.concatenate([box, window])  # the inside is where planes @ (x, y, z, 1) >= 0
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    # The least depth of a convex body is that of a corner, where three of its planes meet
    threes = np.array(list(itertools.combinations(planes, 3)))
    threes = threes[np.abs(np.linalg.det(threes[:, :, :3])) > _ROUNDING]
    corners = np.linalg.solve(threes[:, :, :3], -threes[:, :, 3:])[..., 0]
    corners = corners[(corners @ planes[:, :3].T + planes[:, 3] >= -_ROUNDING).all(axis=1)]
    if not len(corners):
        return None
    return max(0.0, float((corners @ to_view[2, :3] + to_view[2, 3]).min()))


def required_level(levels: Sequence[Grid], camera: Camera, window_size: Sequence[int]) -> int:
    """Return the level that a view requires.

    It is the coarsest whose voxels are still as fine as half a list's width where the volume is
    nearest to V_O: between the lists, what a finer one has more is hardly seen. Edges of voxels
    count along the axes in which a level is coarser: many stores keep their few planes in all.

    ``levels``: from the finest to the coarsest. ``camera``: V_O. ``window_size``: lists of V_O
    along x and y.
    """
    depth = nearest_depth(levels[0], camera, window_size)
    if depth is None:  # V_O sees nothing of the volume
        return len(levels) - 1
    size = np.asarray(check_window_size(window_size))
    width = float((2 * np.asarray(camera.half_extent(window_size)) / size).min())
    width *= 1.0 if camera.parallel_projection else depth
    to_view = camera.model_to_view[:3, :3]
    # Distances of neighbouring points along x, y and z, world units
    edges = [np.linalg.norm(to_view @ each.index_to_model[:3, :3], axis=0) for each in levels]
    chosen = 0
    for k, now in enumerate(edges):
        if now[now > _COARSER * edges[0]].max(initial=0) > width / 2:
            break
        chosen = k
    return chosen
