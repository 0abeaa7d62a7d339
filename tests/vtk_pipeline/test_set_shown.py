"""Sets of VDIs in scenes: the nearest VDI is drawn, blended with its neighbours, and more made."""

from __future__ import annotations

import time

import numpy as np
import pytest
from plugin_scenes import LOOKS, soft_ball
from watched_windows import LONG, MOVING, frame, picture_of

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.sets import generate

SIZE = (60, 50)
LOOK = {name: value for name, value in LOOKS.items() if name != "show_scalar_bar"}


@pytest.fixture(scope="module")
def made(default_runtime):
    with pytest.MonkeyPatch.context() as fewer:
        fewer.setattr(generate, "DIRECTIONS", 12)
        return pvdi.generate_set(
            soft_ball(12), "sphere", SIZE, target_ssim=0.8, lists=1, max_supersegments=4, **LOOK
        )


def _again(made):
    """The same set, which may grow without the others' seeing it."""
    again = pvdi.VDISet.of(list(made), window_size=made.window_size)
    again._maker = made._maker
    return again


def _shown(plotter, vdi_set, **options):
    actor = plotter.add_vdi(vdi_set, show_scalar_bar=False, **options)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    return actor


def test_each_view_is_drawn_by_the_vdi_nearest_to_it(plotter, made):
    made.blend = 0
    try:
        actor = _shown(plotter, made, regenerate="never")
        seen = set()
        for _ in range(8):
            plotter.camera.Azimuth(41)
            picture = frame(plotter)
            nearest = made.nearest(plotter.camera)
            seen.add(nearest)
            assert actor.vdi is made[nearest]
            np.testing.assert_array_equal(picture, picture_of(made[nearest], plotter))
        assert len(seen) > 3
        assert actor.vdi_set is made
    finally:
        made.blend = 6


def test_between_two_a_blend_is_drawn(plotter, made):
    made.blend = 60
    try:
        _shown(plotter, made, regenerate="never")
        plotter.camera.Azimuth(17)
        picture = frame(plotter)
        weights = made.weights(plotter.camera)
        assert len(weights) > 1
        mean = sum(w * picture_of(made[i], plotter).astype(float) for i, w in weights)
        # Each picture, and their blend, is rounded by a step of 1/255 at most
        assert np.abs(picture - mean).max() <= 2
        alone = picture_of(made[weights[0][0]], plotter).astype(float)
        assert np.abs(alone - mean).max() > 8
    finally:
        made.blend = 6


def test_a_set_from_a_file_is_decoded_ahead(plotter, made, tmp_path):
    read = pvdi.read(made.save(tmp_path / "a.vdiset"))
    actor = _shown(plotter, read, regenerate="never")
    shower = actor.mapper.painter.upkeep.shower
    end = time.monotonic() + LONG
    wanted = min(8, len(read))
    while len(shower._ready) < wanted:
        assert time.monotonic() < end, shower._ready
        time.sleep(0.01)
    nearest = set(np.argsort(read.distances(plotter.camera), kind="stable")[:wanted].tolist())
    assert nearest <= set(shower._ready)
    before = read._views.n_decoded
    plotter.camera.Azimuth(5)
    frame(plotter)
    assert read._views.n_decoded <= before + wanted
    actor.mapper.painter.release()
    assert not shower._ready
    frame(plotter)  # begins anew


def test_with_little_memory_what_is_drawn_stays(plotter, made):
    actor = _shown(plotter, made, regenerate="never")
    shower = actor.mapper.painter.upkeep.shower
    shower.memory = 1.0
    for _ in range(5):
        plotter.camera.Azimuth(50)
        frame(plotter)
        shower._decoder.join()
        drawn = {i for i, _ in made.weights(plotter.camera)}
        assert drawn <= set(shower._ready)
        assert len(shower._ready) <= len(drawn) + 1


def test_it_grows_where_the_picture_misses_the_target(plotter, made):
    grown = _again(made)
    actor = _shown(plotter, grown)
    shower, n = actor.mapper.painter.upkeep.shower, len(grown)
    plotter.camera.zoom(1.0)
    plotter.camera.position = np.asarray(plotter.camera.focal_point) + 0.4 * np.subtract(
        plotter.camera.position, plotter.camera.focal_point
    )
    frame(plotter, MOVING)
    assert not shower.growing  # while a hand moves
    shower.vdi_set._maker = _Hungry(made._maker)
    end = time.monotonic() + LONG
    while len(grown) == n:
        assert time.monotonic() < end
        frame(plotter)
        time.sleep(0.01)
    assert grown.nearest(plotter.camera) == n
    frame(plotter)
    assert actor.vdi is grown[n]
    assert len(made) == n


class _Hungry:
    """What finds every view lacking."""

    def __init__(self, maker):
        self._maker = maker

    def lacking(self, vdi_set, camera):
        return self._maker(camera)


def test_it_does_not_grow_where_the_target_is_reached(made, plotter):
    view = made.cameras[0]
    assert made.lacking(view) is None or made._maker.maker.ssim([(made[0], 1.0)], view) < 0.8
    never = _again(made)
    actor = _shown(plotter, never, regenerate="never")
    frame(plotter)
    assert not actor.mapper.painter.upkeep.shower.growing


def test_regenerate_adds_the_view_that_is_shown(plotter, made):
    grown = _again(made)
    actor = _shown(plotter, grown, regenerate="never")
    plotter.camera.Elevation(33)
    vdi = actor.regenerate()
    assert grown[-1] is vdi
    frame(plotter)
    assert actor.vdi is vdi
    from_file = pvdi.VDISet.of(list(made))
    actor.vdi_set = from_file
    frame(plotter)
    with pytest.raises(InvalidArgumentError, match="not at hand"):
        actor.regenerate()


def test_a_pick_is_that_of_the_nearest(plotter, made):
    actor = _shown(plotter, made, regenerate="never")
    plotter.camera.Azimuth(70)
    frame(plotter)
    x, y = (edge // 2 for edge in plotter.window_size)
    hit = actor.pick(x, y)
    nearest = made[made.nearest(plotter.camera)]
    alone = pvdi.pick(nearest, plotter.camera, (x, y), plotter.window_size)
    assert (hit.list, hit.supersegment) == (alone.list, alone.supersegment)
    # The frame's view comes of VTK's matrices
    np.testing.assert_allclose(hit.position, alone.position, rtol=1e-9)


def test_what_only_a_volume_can_honour_is_refused(plotter, made):
    with pytest.raises(UnsupportedError, match="cmap"):
        plotter.add_vdi(made, cmap="bone")
    actor = _shown(plotter, made)
    with pytest.raises(InvalidArgumentError, match="SetVDISet"):
        actor.mapper.SetVDISet([made[0]])
    assert actor.mapper.GetSeries() is None
