"""World scale, origin, anisotropy, and the matrix of an actor."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import raycast_volume, render_vdi
from extreme_scenes import BOUND, WINDOW, check_scene, field_volume, transfer, turned, view

from pyvista_vdi import reference
from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.generation.generate import generate_vdi

pytestmark = pytest.mark.extremes


def scaled(scale, offset=0.0):
    """A world, and an origin so many extents away."""
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = np.array([1, -0.7, 0.3]) * scale * offset
    return matrix


def nightly(*world):
    return pytest.param(*world, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("scale", "offset"),
    [
        (1.0, 0.0),
        (1e-9, 1e7),
        (1e9, 1e7),
        (1e-16, 0.0),  # just within float32
        (1e16, 0.0),
        *(nightly(*world) for world in [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7), (1e-3, 1e5)]),
    ],
)
def test_world_scale_and_origin(runtime, worst, scale, offset):
    """From a cell in metres to a galaxy in whatever, at an origin up to 1e7 extents away."""
    volume = field_volume(scale, offset)
    views = turned(view(volume), volume, (25, 180))
    check_scene(runtime, worst, volume, transfer(unit_distance=scale), view(volume), views)


MATRICES = {
    "tiny": scaled(1e-9, 1e7),
    "huge": scaled(1e9, 1e7),
    "just within float32": scaled(1e-16),
    "just within float32, too": scaled(1e16),
    "mirrored": np.diag([-1, 1, 1, 1.0]),
    "scaled": np.diag([0.03, 1, 30, 1.0]),
    "sheared": np.array([[1, 5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
    "all of it": np.array([[-0.1, 5, 0, 9], [0, 1, 0.1, 1], [0, 0, 10, -3], [0, 0, 0, 1.0]]),
}


@pytest.mark.parametrize("name", MATRICES)
def test_actors_matrices(runtime, worst, name):
    volume = field_volume()
    zoom = np.ptp(np.abs(np.linalg.eigvals(MATRICES[name][:3, :3]))) > 0 or name == "sheared"
    camera = view(volume, transform=MATRICES[name], zoom=zoom)
    views = turned(camera, volume, (0, 8) if zoom else (0, 90), zoom=zoom)
    check_scene(runtime, worst, volume, transfer(), camera, views)


def test_a_vdi_in_another_world(runtime, worst):
    """The new view's matrix places the model elsewhere, a million times larger."""
    volume = field_volume()
    elsewhere = turned(view(volume, transform=scaled(1e6)), volume, (0, 90))
    check_scene(runtime, worst, volume, transfer(), view(volume), elsewhere)


@pytest.mark.parametrize("spacing", [(1, 1, 1000), (1000, 1, 1), (1, 0.001, 1)], ids=str)
def test_plates_and_needles(runtime, worst, spacing):
    """Cells a thousand times as long as wide."""
    volume = field_volume(spacing)
    camera = view(volume, zoom=True)
    function = transfer(unit_distance=5 * min(spacing))
    # A plate is a staircase of lists: rays in its plane, at larger angles, may pass between them
    views = turned(camera, volume, (0, 8), zoom=True)
    check_scene(runtime, worst, volume, function, camera, views)


@pytest.mark.parametrize("exponent", [-36, -25, 25, 36])
@pytest.mark.parametrize("by", ["spacing", "matrix"])
def test_worlds_beyond_float32_are_refused(runtime, exponent, by):
    scale = 10.0**exponent
    volume = field_volume(scale if by == "spacing" else 1.0)
    camera = view(volume, transform=scaled(scale) if by == "matrix" else None)
    with pytest.raises(InvalidCameraError, match=r"beyond float32: scale the spacing \(or"):
        generate_vdi(volume, camera, WINDOW, transfer(), device=runtime)
    # A VDI that another program made there is refused, too
    made = reference.build_vdi(volume, camera, WINDOW, transfer())
    with pytest.raises(InvalidCameraError, match="beyond float32"):
        render_vdi(made, camera, device=runtime)


@pytest.mark.parametrize("exponent", [-30, 30])
def test_direct_rendering_goes_further_than_lists(runtime, worst, exponent):
    volume = field_volume(10.0**exponent)
    image = raycast_volume(volume, view(volume), WINDOW, transfer(), device=runtime)
    exact = reference.volume_image(volume, view(volume), WINDOW, transfer())
    assert exact[..., 3].max() > 0.5
    worst("volume", np.abs(image - exact).max())
    assert np.abs(image - exact).max() <= BOUND
