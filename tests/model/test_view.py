"""The window that covers a volume, on the screen's own pixel grid; the level a view requires."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from hypothesis import assume, given
from hypothesis import strategies as st

from pyvista_vdi import Camera
from pyvista_vdi.model.view import bounds_corners, covering_view, required_level
from pyvista_vdi.model.volume import Grid

BOUNDS = (-1, 1, -2, 2, -0.5, 0.5)
BOX = bounds_corners(BOUNDS)


def pixels(camera, size, points):
    """Pixel coordinates in a window, from the lower left corner: an independent projection."""
    points = np.column_stack([points, np.ones(len(points))])
    x, y, z, _ = camera.view_matrix @ camera.model_transform @ points.T
    half_width, half_height = camera.half_extent(size)
    depth = np.ones_like(z) if camera.parallel_projection else z
    u = x / (depth * half_width) - camera.window_center[0]
    v = y / (depth * half_height) - camera.window_center[1]
    return np.stack([(u + 1) / 2 * size[0], (v + 1) / 2 * size[1]], axis=1)


sizes = st.tuples(st.integers(8, 900), st.integers(8, 900))


@given(strategies.GENERATORS, sizes)
def test_pixels_are_the_screens_and_the_volume_is_inside(rng, size):
    camera = strategies.camera_around(rng, BOUNDS, strategies.random_transform(rng), distance=4)
    wide, lists = covering_view(camera, size, BOX)
    assume(np.prod(lists) < 3 * np.prod(size))  # up to 4, lists are pixels
    # An arbitrary point moves by a whole number of pixels between the two windows
    points = np.vstack([BOX, [[0.1, 0.2, 0.3], [5.0, -3.0, 0.2]]])[:9]
    screen, ours = pixels(camera, size, points), pixels(wide, lists, points)
    shift = screen - ours
    # float64 rounding of coordinates in pixels, up to ~1e5 here, and of the angle's tangent
    slack = 1e-9 * (1 + np.abs(screen).max() + max(lists))
    np.testing.assert_allclose(shift, np.broadcast_to(np.round(shift[0]), shift.shape), atol=slack)
    assert (ours[:8] >= -1e-5).all()
    assert (ours[:8] <= np.asarray(lists) + 1e-5).all()
    # ... and no row or column of lists is to spare
    assert (ours[:8].min(axis=0) < 1 + slack).all()
    assert (ours[:8].max(axis=0) > np.asarray(lists) - 1 - slack).all()
    # eye and direction are the same
    assert wide.position == camera.position
    np.testing.assert_array_equal(wide.axes, camera.axes)


@pytest.mark.parametrize(
    ("camera", "lists"),
    [
        (Camera((0.1, 0.2, 0.3), (0, 0, -3), (0, 1, 0)), None),  # inside
        (Camera((0, 0, 0.5005), (0, 0, -3), (0, 1, 0)), None),  # on the face
        (Camera((0.9, 1.5, 4.0), (1.9, 1.5, 4), (0, 1, 0)), None),  # reaches behind the eye
        # Parallel projection sees what is beside the eye
        (Camera((0, 0, 0.1), (0, 0, -1), (0, 1, 0), parallel_projection=True), (100, 200)),
        (Camera((0, 0, 1e6), (0.1, 0.1, 0), (0, 1, 0)), (1, 1)),  # smaller than a pixel
    ],
)
def test_what_covers_special_views(camera, lists):
    edge = 101 if lists == (1, 1) else 100  # of an odd window the middle is that of a pixel
    found = covering_view(camera, (edge, edge), BOX)
    assert (found if lists is None else found[1]) == lists


#: A cube from -1 to 1 at four levels: voxels of 2/64, 2/32, 2/16 and 2/8.
LEVELS = [Grid((n + 1,) * 3, (2 / n,) * 3, (-1.0,) * 3, np.eye(3)) for n in (64, 32, 16, 8)]
#: tan(45 degrees) = 1: at depth Z the window is 2 Z high.
FROM_TEN = Camera(position=(0, 0, 10), focal_point=(0, 0, 0), view_up=(0, 1, 0), view_angle=90)


# Half a list's width at 9 is 9 / lists; voxels are .03125, .0625, .125, .25
@pytest.mark.parametrize(
    ("lists", "level"),
    [(1000, 0), (145, 0), (143, 1), (73, 1), (71, 2), (37, 2), (35, 3), (9, 3)],
)
def test_level_is_the_coarsest_that_is_no_coarser_than_half_a_list(lists, level):
    for size in ((lists, lists), (2 * lists, lists)):
        assert required_level(LEVELS, FROM_TEN, size) == level


def test_in_the_volume_the_finest_and_past_it_the_coarsest():
    inside = FROM_TEN.replace(position=(0, 0, 0.5), focal_point=(0, 0, -1))
    assert required_level(LEVELS, inside, (9, 9)) == 0
    away = FROM_TEN.replace(focal_point=(0, 0, 20))
    assert required_level(LEVELS, away, (9000, 9000)) == 3
    plate = [Grid((n + 1, n + 1, 2), (8 / n, 8 / n, 0.01), (-4, -4, 0), np.eye(3)) for n in (64, 8)]
    across = Camera((0, -10, 0.005), (0, 0, 0.2), (0, 0, 1), view_angle=20)
    assert required_level(plate, across, (1000, 1000)) == 0
