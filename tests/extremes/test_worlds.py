"""World scale, origin, anisotropy, and the matrix of an actor."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from drawing import raycast_volume, render_vdi
from extreme_scenes import BOUND, WINDOW, check_scene, field_volume, transfer, turned, view

from pyvista_vdi import reference
from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.generation.generate import generate_vdi

pytestmark = pytest.mark.extremes

SCALES = (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9)
OFFSETS = (0.0, 1e3, 1e5, 1e7)
QUICK = {(1e-9, 1e7), (1e9, 1e7), (1.0, 0.0)}


@pytest.mark.parametrize(
    ("scale", "offset"),
    [
        pytest.param(*case, marks=() if case in QUICK else pytest.mark.slow)
        for case in itertools.product(SCALES, OFFSETS)
    ],
)
def test_world_scale_and_origin(runtime, worst, scale, offset):
    """From a cell in metres to a galaxy in whatever, at an origin up to 1e7 extents away."""
    volume = field_volume(scale, offset)
    views = turned(
        view(volume), volume, (25, 180) if (scale, offset) in QUICK else (0, 25, 90, 180)
    )
    check_scene(runtime, worst, volume, transfer(unit_distance=scale), view(volume), views)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_world_scale_by_the_actor_s_matrix(runtime, worst, scale):
    volume = field_volume()
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = np.array([1, -0.7, 0.3]) * scale * 1e7
    camera = view(volume, transform=matrix)
    check_scene(runtime, worst, volume, transfer(), camera, turned(camera, volume, (0, 90)))


def test_a_vdi_in_another_world(runtime, worst):
    """The new view's matrix places the model elsewhere, a million times larger."""
    volume = field_volume()
    matrix = np.diag([1e6, 1e6, 1e6, 1.0])
    elsewhere = view(volume, transform=matrix)
    check_scene(
        runtime, worst, volume, transfer(), view(volume), turned(elsewhere, volume, (0, 90))
    )


@pytest.mark.parametrize("exponent", [-36, -30, -25, 25, 30, 36])
@pytest.mark.parametrize("by", ["spacing", "matrix"])
def test_worlds_beyond_float32_are_refused(runtime, exponent, by):
    scale = 10.0**exponent
    volume = field_volume(scale if by == "spacing" else 1.0)
    matrix = np.diag([scale, scale, scale, 1.0]) if by == "matrix" else None
    camera = view(volume, transform=matrix)
    with pytest.raises(InvalidCameraError, match=r"beyond float32: scale the spacing \(or"):
        generate_vdi(volume, camera, WINDOW, transfer(), device=runtime)
    # A VDI that another program made there is refused, too
    made = reference.build_vdi(volume, camera, WINDOW, transfer())
    with pytest.raises(InvalidCameraError, match="beyond float32"):
        render_vdi(made, camera, device=runtime)


@pytest.mark.parametrize("exponent", [-16, 16])
@pytest.mark.parametrize("by", ["spacing", "matrix"])
def test_worlds_just_within_float32(runtime, worst, exponent, by):
    scale = 10.0**exponent
    volume = field_volume(scale if by == "spacing" else 1.0)
    matrix = np.diag([scale, scale, scale, 1.0]) if by == "matrix" else None
    camera = view(volume, transform=matrix)
    check_scene(runtime, worst, volume, transfer(), camera, turned(camera, volume, (0, 90)))


@pytest.mark.parametrize("exponent", [-30, 30])
def test_direct_rendering_goes_further_than_lists(runtime, worst, exponent):
    volume = field_volume(10.0**exponent)
    image = raycast_volume(volume, view(volume), WINDOW, transfer(), device=runtime)
    exact = reference.volume_image(volume, view(volume), WINDOW, transfer())
    assert exact[..., 3].max() > 0.5
    worst("volume", np.abs(image - exact).max())
    assert np.abs(image - exact).max() <= BOUND


@pytest.mark.parametrize("spacing", [(1, 1, 1000), (1000, 1, 1), (1, 0.001, 1)], ids=str)
def test_plates_and_needles(runtime, worst, spacing):
    """Cells a thousand times as long as wide."""
    volume = field_volume(spacing)
    camera = view(volume, zoom=True)
    function = transfer(unit_distance=5 * min(spacing))
    # A plate is a staircase of lists: rays in its plane, at larger angles, may pass between them
    views = turned(camera, volume, (0, 8), zoom=True)
    check_scene(runtime, worst, volume, function, camera, views)


MATRICES = {
    "mirrored": np.diag([-1, 1, 1, 1.0]),
    "scaled": np.diag([0.03, 1, 30, 1.0]),
    "sheared": np.array([[1, 5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
    "all of it": np.array([[-0.1, 5, 0, 9], [0, 1, 0.1, 1], [0, 0, 10, -3], [0, 0, 0, 1.0]]),
}


@pytest.mark.parametrize("name", MATRICES)
def test_actors_matrices(runtime, worst, name):
    volume = field_volume()
    camera = view(volume, transform=MATRICES[name], zoom=True)
    views = turned(camera, volume, (0, 8), zoom=True)
    check_scene(runtime, worst, volume, transfer(), camera, views)
