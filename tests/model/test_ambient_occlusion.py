"""Ambient occlusion as an argument, and the grid and the directions that follow from it."""

from __future__ import annotations

import numpy as np

from pyvista_vdi import AmbientOcclusion, Volume
from pyvista_vdi.model.ambient_occlusion import OcclusionGrid
from pyvista_vdi.model.options import GenerationOptions


def grid_of(shape, radius, spacing=(1, 1, 1), direction=None):
    volume = Volume(np.zeros(shape[::-1], np.uint8), spacing, direction=direction)
    return volume, OcclusionGrid(volume, AmbientOcclusion(radius))


def test_every_voxel_lies_between_nodes_and_every_step_within_the_margin():
    turned = [[0, -1, 0], [0.8, 0, 0.6], [-0.6, 0, 0.8]]
    volume, grid = grid_of((40, 171, 90), 30, spacing=(3, 0.7, 1.1), direction=turned)
    last = (np.array(grid.nodes) - 1) * grid.cell
    points = np.array(volume.dimensions) - 1
    assert (last >= points).all()
    assert (last - grid.cell < points).all()
    floor = np.floor(grid.offsets)
    assert (floor >= -np.array(grid.margin)).all()
    assert (floor + 1 <= grid.margin).all()
    # Offsets are model lengths: the midpoint of the last step is half a step short of the radius
    to_model = volume.index_to_model[:3, :3] * grid.cell
    length = np.linalg.norm(grid.offsets[:, -1] @ to_model.T, axis=1)
    np.testing.assert_allclose(length, 30 - grid.step / 2)


def test_its_memory_is_known():
    volume = Volume(np.zeros((60, 60, 60), np.uint8))
    assert GenerationOptions().occlusion_bytes(volume) == 0
    taken = GenerationOptions(ambient_occlusion=4.0).occlusion_bytes(volume)
    assert taken == 4 * (60**3 + 68**3)  # the nodes, and they with a margin of 4
