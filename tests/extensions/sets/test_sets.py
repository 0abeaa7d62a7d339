"""Sets in memory: which VDI a view shows, what is blended, and what generates them."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import Cancelled, InvalidArgumentError, InvalidVDIError
from pyvista_vdi.extensions.sets.generate import orbit, spread
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.quality.view_error import angle_from_generating_view

SIZE = (64, 36)
VIEW = pvdi.Camera((0, 0, 90), (10, 10, 10), (0, 1, 0))


def _table():
    shades = np.linspace(0, 1, 16)
    colors = np.stack([shades, shades**2, 1 - shades], axis=1)
    return pvdi.TransferFunction(colors, shades * 0.3, (0.0, 255.0))


def _generate(volume, views, **options):
    return pvdi.generate_set(volume, views, SIZE, **{"transfer_function": _table(), **options})


@pytest.fixture(scope="module")
def volume():
    z, y, x = np.mgrid[-1:1:20j, -1:1:22j, -1:1:24j]
    waves = np.sin(6 * x) * np.cos(5 * y) * np.sin(4 * z + 1)
    inside = x**2 + y**2 + z**2 < 0.9
    return pvdi.Volume((127 * (1 + waves) * inside).astype(np.uint8), (1.0, 1.0, 1.1))


@pytest.fixture(scope="module")
def around(volume):
    return filling_camera(volume.bounds, SIZE)


@pytest.fixture(scope="module")
def made(volume, default_runtime):
    return _generate(volume, 24, max_supersegments=8)


def directions(n):
    """Directions that are spread over the sphere."""
    return spread(n, (0, 0, 1), 180)


def test_directions_are_spread_within_an_angle_of_an_axis():
    # The best covering that is known of 32 points: 22.7 degrees
    nearest = (directions(25600) @ directions(32).T).max(axis=1)
    assert np.degrees(np.arccos(nearest.min())) < 28
    axis = np.array([1.0, -2.0, 0.5])
    for n in (1, 7):
        found = spread(n, axis, 40)
        assert np.allclose(np.linalg.norm(found, axis=1), 1)
        cosines = found @ axis / np.linalg.norm(axis)
        assert cosines[0] == pytest.approx(1)
        assert cosines.min() >= np.cos(np.radians(40)) - 1e-12


def test_the_nearest_is_that_of_the_least_angle(made, around):
    for view in orbit(around, made.bounds, directions(30)):
        angles = [angle_from_generating_view(vdi, view) for vdi in made]
        assert np.allclose(made.distances(view), angles, atol=1e-6)
        assert made.nearest(view) == int(np.argmin(angles))


def test_weights_add_up_and_nothing_jumps_on_a_path(made, around):
    # In steps of .05 degrees a distance changes by that at most, a share by twice that over the
    # reach: at least a few hundredths of a degree but where three others are as near
    path = [made.weights(around.azimuth(azimuth)) for azimuth in np.arange(0, 20, 0.05)]
    dense = np.zeros((len(path), len(made)))
    for step, weights in enumerate(path):
        assert 1 <= len(weights) <= 3
        dense[step, [i for i, _ in weights]] = [w for _, w in weights]
    assert np.allclose(dense.sum(axis=1), 1)
    assert np.abs(np.diff(dense, axis=0)).max() < 0.1


def test_a_picture_is_the_weighted_mean(made, around):
    blended = 0
    for view in orbit(around, made.bounds, directions(30)):
        weights = made.weights(view)
        mean = sum(w * pvdi.render(made[i], view, SIZE).astype(float) for i, w in weights)
        blended += len(weights) > 1
        assert np.allclose(pvdi.render(made, view), mean, atol=1e-6)
    assert blended > 3  # or the test shows nothing


def test_a_vdi_of_a_set_is_what_generate_makes(made, volume):
    vdi = made[0]
    how = {"settings": pvdi.Settings(view_cone=30), "precision": "8-byte", "max_supersegments": 8}
    alone = pvdi.generate(volume, vdi.camera, vdi.window_size, transfer_function=_table(), **how)
    assert vdi.equals(alone)


def test_views_are_spread_in_a_cone_or_those_that_are_given(volume, around, default_runtime):
    heard = []
    made = _generate(volume, 7, camera=around, half_angle=25, lists=0.5, progress=heard.append)
    assert heard == [(k + 1) / 7 for k in range(7)]
    angles = made.distances(around)
    assert angles[0] == pytest.approx(0, abs=1e-6)
    assert 15 < angles.max() <= 25
    assert made.camera == around
    for vdi in made:  # all of the volume has lists, half as dense along an edge
        assert np.prod(vdi.window_size) <= 0.25 * np.prod(SIZE)
    path = [VIEW.azimuth(angle) for angle in (0, 40)]
    given = _generate(volume, path, max_supersegments=2)
    assert [camera.position for camera in given.cameras] == [view.position for view in path]


@pytest.mark.parametrize(
    ("changes", "error", "said"),
    [
        ({"views": []}, InvalidArgumentError, "no view"),
        ({"views": 0}, InvalidArgumentError, "views"),
        ({"half_angle": 181}, InvalidArgumentError, "half_angle"),
        ({"lists": 0}, InvalidArgumentError, "lists"),
        ({"views": [VIEW], "camera": VIEW}, InvalidArgumentError, "camera and half_angle"),
        ({"quality": "high"}, TypeError, "quality"),
        ({"progress": lambda _: False}, Cancelled, None),
    ],
)
def test_arguments_out_of_range_are_named(changes, error, said, volume):
    arguments = {"window_size": SIZE, "transfer_function": _table(), **changes}
    with pytest.raises(error, match=said):
        pvdi.generate_set(volume, **arguments)


def test_what_is_no_set_is_refused(made):
    with pytest.raises(InvalidArgumentError, match="at least one"):
        pvdi.VDISet([])
    with pytest.raises(InvalidVDIError, match="in a list"):
        pvdi.VDISet(made[0])
    z = pvdi.Volume(np.zeros((3, 3, 3), np.uint8))
    other = pvdi.generate(z, VIEW, (4, 4), transfer_function=_table())
    with pytest.raises(InvalidVDIError, match="bounds"):
        pvdi.VDISet([made[0], other])
    with pytest.raises(IndexError, match=r"is out of range: there are \d+ VDIs"):
        made[len(made)]
    made = pvdi.VDISet(list(made))
    made.blend = 181
    with pytest.raises(InvalidArgumentError, match="blend must be degrees, 0 to 180; got 181"):
        made.weights(VIEW)
