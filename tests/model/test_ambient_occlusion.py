"""Ambient occlusion as an argument, and the grid and the directions that follow from it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pyvista_vdi import AmbientOcclusion, Volume, api
from pyvista_vdi.model.ambient_occlusion import OcclusionGrid, spread_directions


def grid_of(shape, radius, spacing=(1, 1, 1), direction=None):
    volume = Volume(np.zeros(shape[::-1], np.uint8), spacing, direction=direction)
    return volume, OcclusionGrid.of(volume, AmbientOcclusion(radius))


def test_what_is_taken():
    assert AmbientOcclusion.from_any(None) is None
    assert AmbientOcclusion.from_any(False) is None
    assert AmbientOcclusion.from_any(True) == AmbientOcclusion()
    assert AmbientOcclusion.from_any(3) == AmbientOcclusion(radius=3.0)
    assert AmbientOcclusion.from_any(np.float32(0.5)) == AmbientOcclusion(radius=0.5)
    assert AmbientOcclusion.from_any(AmbientOcclusion(2, 0.5)).strength == 0.5
    assert AmbientOcclusion.from_any(AmbientOcclusion(strength=0)) is None


@pytest.mark.parametrize("n", [12, 32, 129])
def test_directions_are_spread_evenly(n):
    directions = spread_directions(n)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    np.testing.assert_array_equal(directions, spread_directions(n))
    # As many on one side as on another, and no two together: the mean distance to the nearest is
    # sqrt(4 pi / n) for a square lattice
    assert np.linalg.norm(directions.mean(axis=0)) < 2 / n
    apart = np.linalg.norm(directions[:, None] - directions, axis=2) + 9 * np.eye(n)
    assert apart.min() > 0.75 * math.sqrt(4 * math.pi / n)


def test_the_radius_is_a_share_of_the_diagonal_unless_given():
    volume, _ = grid_of((11, 11, 11), 1)
    assert AmbientOcclusion().radius_in(volume) == pytest.approx(0.05 * 10 * math.sqrt(3))
    assert AmbientOcclusion(2).radius_in(volume) == 2
    assert AmbientOcclusion(1e9).radius_in(volume) == volume.length
    assert AmbientOcclusion(2).to_dict(volume) == {"radius": 2, "strength": 0.1, "directions": 32}


def test_cells_are_an_eighth_of_the_radius_or_a_voxel():
    _, grid = grid_of((400, 300, 200), 32, spacing=(1, 2, 4))
    assert grid.cell == (4, 2, 1)
    assert grid.nodes == (101, 151, 200)
    assert grid.offsets.shape == (32, 8, 3)
    assert grid.step == 4
    assert grid.samples == (4, 4, 2)
    _, fine = grid_of((400, 300, 200), 2)
    assert fine.cell == (1, 1, 1)
    assert fine.step == 0.25
    _, far = grid_of((129, 129, 129), 200)
    assert far.cell == (4, 4, 4)
    assert far.offsets.shape[1] == 50


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


def test_its_memory_is_part_of_the_estimate():
    volume = Volume(np.zeros((60, 60, 60), np.uint8))
    plain = api.estimate(volume, (64, 48))
    occluded = api.estimate(volume, (64, 48), ambient_occlusion=4.0)
    assert plain.occlusion == 0
    assert occluded.occlusion == 4 * (60**3 + 68**3)  # the nodes, and they with a margin of 4
    assert occluded.total == plain.total + occluded.occlusion
