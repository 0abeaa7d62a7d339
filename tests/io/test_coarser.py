"""A VDI of fewer lists: the same medium, a picture near the fine one."""

from __future__ import annotations

import numpy as np
import pytest
from extreme_scenes import slabs_vdi
from ray_scenes import rebuilt
from reference.raycast import centre_ray_scale

from pyvista_vdi import VDI, Camera
from pyvista_vdi.io.vdi_file.writer import coarser

BOUNDS = (-1, 1, -1, 1, -1, 1)
STRETCHED = np.diag([1.0, 2.0, 3.0, 1.0])


def ball(window, camera):
    """A VDI of a ball of extinction 1, one supersegment per list, exact along centre rays."""
    width, height = window
    origin, direction = camera.ray_coefficients(window)
    u = (2 * np.arange(width) + 1) / width - 1
    v = (2 * np.arange(height) + 1) / height - 1
    grid = np.stack([np.ones((height, width)), *np.meshgrid(u, v)], axis=-1)
    o, d = grid @ origin, grid @ direction
    to_model = np.linalg.inv(camera.model_to_view)
    o, d = o @ to_model[:3, :3].T + to_model[:3, 3], d @ to_model[:3, :3].T
    a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
    hit = b * b > a * c
    root = np.sqrt(np.where(hit, b * b - a * c, 0))
    front, back = ((-b - root) / a)[hit], ((-b + root) / a)[hit]
    tau = (back - front) * np.sqrt(a)[hit]
    color = np.repeat([[0.9, 0.5, 0.2]], len(front), axis=0)
    offsets = np.concatenate([[0], np.cumsum(hit.ravel())])
    return VDI(camera, window, offsets, front, back, color, tau, (-1, 1, -1, 1, -1, 1))


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("window", [(64, 36), (65, 38)])
def test_the_medium_is_the_same(window, parallel):
    camera = Camera(
        (3, -8, 4),
        (0, 0, 0),
        (0, 0, 1),
        view_angle=60,
        parallel_projection=parallel,
        parallel_scale=4,
        window_center=(0.1, -0.2),
        model_transform=STRETCHED,
    )
    fine = ball(window, camera)
    small = coarser(fine)
    assert small.window_size == (16, -(-window[1] // 4)) if window[0] == 64 else (17, 10)
    assert small.n_supersegments > 5
    lengths = (small.back - small.front) * np.repeat(
        centre_ray_scale(small).ravel(), np.diff(small.offsets).astype(int)
    )
    # float32 depths of about 10, thicknesses of about 1, and tau in float32
    np.testing.assert_allclose(small.optical_depth, lengths, rtol=1e-5)


def test_lists_are_those_in_the_middle():
    fine = slabs_vdi(
        Camera((0, 0, 9), (0, 0, 0), (0, 1, 0)), [1, 1.5], 1, window=(8, 8), bounds=BOUNDS
    )
    places = np.arange(64)
    taken = coarser(rebuilt(fine, front=fine.front + places, back=fine.back + places)).front - 1
    np.testing.assert_array_equal(taken, [18, 22, 50, 54])
