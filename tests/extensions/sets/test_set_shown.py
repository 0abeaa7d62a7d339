"""Sets of VDIs in scenes: the nearest VDI is drawn, blended with its neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from plugin_scenes import CLASSIFICATION, soft_ball
from watched_windows import finish, frame, picture_of, turned

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.model.standard_cases import filling_camera


@pytest.fixture(scope="module")
def once(default_runtime):
    return pvdi.generate_set(soft_ball(12), 12, (60, 50), max_supersegments=4, **CLASSIFICATION)


@pytest.fixture
def made(once):
    """The same set, which may be blended otherwise without the others' seeing it."""
    return pvdi.VDISet(list(once), window_size=once.window_size)


def shown(plotter, vdi_set, **options):
    actor = plotter.add_vdi(vdi_set, show_scalar_bar=False, **options)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    return actor


def test_each_view_is_drawn_by_the_vdi_nearest_to_it(plotter, made):
    made.blend = 0
    actor = shown(plotter, made, regenerate="never")
    seen = set()
    for _ in range(8):
        picture = turned(plotter, 41)
        nearest = made.nearest(plotter.camera)
        seen.add(nearest)
        assert actor.vdi is made[nearest]
        np.testing.assert_array_equal(picture, picture_of(made[nearest], plotter))
    assert len(seen) > 3
    assert actor.collection is made
    x, y = (edge // 2 for edge in plotter.window_size)
    hit, alone = (
        actor.pick(x, y),
        pvdi.pick(made[nearest], plotter.camera, (x, y), plotter.window_size),
    )
    assert (hit.list, hit.supersegment) == (alone.list, alone.supersegment)
    # The frame's view comes of VTK's matrices
    np.testing.assert_allclose(hit.position, alone.position, rtol=1e-9)


def test_between_two_a_blend_is_drawn(plotter, made):
    made.blend = 60
    plotter.window_size = (241, 203)  # with fewer pixels blends differ by fewer steps
    shown(plotter, made, regenerate="never")
    picture = turned(plotter, 17)
    weights = made.weights(plotter.camera)
    assert len(weights) > 1
    mean = sum(w * picture_of(made[i], plotter).astype(float) for i, w in weights)
    # Each picture, and their blend, is rounded by a step of 1/255 at most
    assert np.abs(picture - mean).max() <= 2
    alone = picture_of(made[weights[0][0]], plotter).astype(float)
    assert np.abs(alone - mean).max() > 8


def test_a_set_from_a_file_is_read_ahead_as_far_as_memory_goes(plotter, made, tmp_path):
    actor = shown(plotter, pvdi.read(made.save(tmp_path / "a.vdiset")), regenerate="never")
    finish("set")
    held = actor.mapper.driver.input
    assert len(held.on_devices()) == 1 + 8
    held.memory = 1.0
    for _ in range(3):
        turned(plotter, 50)
        finish("set")
    assert len(held.on_devices()) == 1 + 3  # as many as are blended
    np.testing.assert_array_equal(frame(plotter), picture_of(held.collection, plotter))


DEFERRED = {"classification": "deferred", "value_range": (1, 250), "precision": "8-byte"}
SIZE, LOOK = (60, 50), {"cmap": "bone", "opacity": [0, 0.2, 0.9], "clim": (20, 220)}
CAMERA = filling_camera((-1, 1, -1, 1, -1, 1), SIZE)


@pytest.fixture(scope="module")
def views(default_runtime):
    views = (CAMERA, CAMERA.azimuth(30))
    return [pvdi.generate(soft_ball(12), view, SIZE, **DEFERRED) for view in views]


@pytest.fixture(scope="module")
def saved(views, tmp_path_factory):
    return pvdi.VDISet(views).save(tmp_path_factory.mktemp("set") / "ball.vdiset")


@pytest.mark.filterwarnings("ignore:the transfer function shows values outside")
def test_what_is_read_and_rendered_is_that_of_each_view(views, saved, tmp_path):
    found = pvdi.read(saved)
    assert all(one.equals(other) for one, other in zip(found, views, strict=True))
    assert found.value_range == (1, 250)
    baked = pvdi.VDISet([view.classified(**LOOK) for view in views])
    view = CAMERA.azimuth(12)
    expected = pvdi.render(baked, view)
    assert np.array_equal(pvdi.render(found.classified(**LOOK), view), expected)
    assert np.array_equal(pvdi.render(found, view, **LOOK), expected)
    for refused in (pvdi.render, pvdi.render_depth, lambda *_: found.save(tmp_path / "a.html")):
        with pytest.raises(InvalidVDIError, match="no colours yet"):
            refused(found, view)
    with pytest.raises(InvalidVDIError, match="number 1 has colours"):
        pvdi.VDISet([views[0], baked[1]])
    with pytest.raises(TypeError, match="unexpected keyword argument .classification"):
        pvdi.generate_set(soft_ball(12), window_size=SIZE, classification="deferred")
