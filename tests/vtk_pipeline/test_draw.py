"""What is raycast where the volume is at hand: its VDI or itself, and with how many rays."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, add_judge, shown, soft_ball
from skimage.metrics import structural_similarity
from watched_windows import MOVING, WINDOW, finish, frame, small_vdi, watched

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.quality.costs import Costs
from pyvista_vdi.quality.rate import HEADROOM

pytestmark = pytest.mark.gl

VIEW = ((5, 2, 3), (0, 0, 0), (0, 0, 1))


def alike(a, b):
    return structural_similarity(a, b, channel_axis=2, data_range=255)


def beside(plotter, add, **options):
    """Another plotter of the same view, to which something was added."""
    other = pv.Plotter(window_size=WINDOW, **options)
    actor = add(other)
    other.camera = plotter.camera.copy()
    return other, actor


def test_the_volume_is_drawn_as_by_vtk_and_no_vdi_is_made(plotter):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, draw="volume", interpolation="linear", **LOOKS)
    plotter.camera_position = VIEW
    seen = shown(plotter)
    assert actor.status.drawn == "volume"
    assert not actor.status.stand_in
    assert actor.mapper.GetVDI() is None
    judge, _ = beside(plotter, lambda other: add_judge(other, volume))
    assert alike(seen, shown(judge)) > 0.995
    judge.close()
    # Another view, and other voxels, at once
    plotter.camera.azimuth = 120
    turned = shown(plotter)
    assert np.abs(turned - seen).max() > 8
    volume["v"][:] = 0.5 * volume["v"]
    assert np.abs(shown(plotter) - turned).max() > 8
    assert actor.mapper.GetVDI() is None


def test_a_shaded_volume_is_lit_from_where_it_is_seen(plotter):
    """A headlight goes with the camera; what is baked into a VDI does not."""

    def add(plotter):
        plotter.remove_all_lights()
        plotter.add_light(pv.Light(light_type="headlight"))
        looks = {**LOOKS, "shade": True, "interpolation": "linear"}
        return plotter.add_vdi(soft_ball(), draw="volume", **looks)

    actor = add(plotter)
    plotter.camera_position = VIEW
    plotter.show(auto_close=False)
    plotter.camera.azimuth = 150
    turned = shown(plotter)
    other, _ = beside(plotter, add)
    np.testing.assert_array_equal(turned, shown(other))
    other.close()
    assert actor.status.drawn == "volume"


@pytest.fixture
def chosen(monkeypatch):
    """Every choice between VDI and volume is ``chosen.way``; ``chosen.asked`` has what it knew."""

    class Chosen:
        way = "volume"
        asked = ()

    def better(costs, angle, pixels, seconds, ssim, bound):
        Chosen.asked = angle, pixels, seconds
        return Chosen.way

    monkeypatch.setattr(Costs, "better", better)
    return Chosen


def test_auto_draws_what_was_chosen_and_brightness_does_not_jump(plotter, chosen):
    chosen.way = "vdi"
    actor = watched(plotter, draw="auto", interpolation="linear", max_supersegments=64)
    assert actor.vdi is not None  # asked for
    by_vdi = frame(plotter)
    assert actor.status.drawn == "vdi"
    chosen.way = "volume"
    plotter.renderer.Modified()
    by_volume = frame(plotter)
    assert actor.status.drawn == "volume"
    assert "the volume itself" in str(actor.status)
    assert not actor.status.stand_in
    assert alike(by_vdi, by_volume) > 0.999
    # Mean brightness: half of 1/255
    assert abs(by_vdi.mean() - by_volume.mean()) < 0.5
    angle, pixels, seconds = chosen.asked
    assert angle < 1e-3
    assert 0 < pixels <= WINDOW[0] * WINDOW[1]
    assert seconds is None  # at rest
    plotter.camera.azimuth = 40
    frame(plotter, MOVING)
    angle, _, seconds = chosen.asked
    assert angle == pytest.approx(40, abs=0.1)
    assert seconds == pytest.approx(1 / 30 / HEADROOM)


def test_auto_goes_by_what_frames_take(plotter, monkeypatch):
    """Clocks are set: a VDI's rays cost a thousand times a volume's, far from its view."""
    took = Costs.took

    def slow(costs, way, angle, pixels, _):
        return took(costs, way, angle, pixels, 1e-9 * pixels * (1000 if way == "vdi" else 1))

    monkeypatch.setattr(Costs, "took", slow)
    actor = watched(plotter, draw="auto")
    assert actor.vdi is not None
    finish()  # pictures of the volume tell what its rays take
    plotter.camera.azimuth = 60
    frame(plotter)
    frame(plotter)
    assert actor.status.drawn == "volume"
    actor.mapper.SetDraw("vdi")
    frame(plotter)
    assert actor.status.drawn == "vdi"


def test_the_first_frame_of_a_volume_in_motion_is_no_slower_than_a_picture_has_told(
    plotter, chosen, monkeypatch
):
    took = Costs.took
    monkeypatch.setattr(  # a millisecond per ray
        Costs, "took", lambda costs, way, angle, *_: took(costs, way, angle, 1.0, 1e-3)
    )
    actor = watched(plotter, draw="vdi")
    finish()
    actor.mapper.SetDraw("auto")
    plotter.camera.azimuth = 40
    frame(plotter, MOVING)
    assert actor.status.drawn == "volume"
    assert actor.status.samples == 30 * 26  # the floor: a sixteenth


def test_volumes_that_overlap_are_drawn_by_their_vdis(plotter, chosen):
    actor = plotter.add_vdi(soft_ball(), **LOOKS)
    plotter.show(auto_close=False)
    assert actor.status.drawn == "volume"
    other = plotter.add_vdi(soft_ball(12), **LOOKS)
    for each in (actor, other):
        each.mapper.SetInteractiveOffScreen(True)
    plotter.camera.azimuth = 40
    frame(plotter)
    frame(plotter)
    assert {actor.status.drawn, other.status.drawn} == {"vdi"}


def test_a_vdi_without_its_volume_is_all_there_is(plotter):
    vdi = small_vdi()
    with pytest.raises(UnsupportedError, match="draw='volume' draws the volume"):
        plotter.add_vdi(vdi, draw="volume")
    plotter.add_vdi(vdi, draw="auto")
    plotter.show(auto_close=False)


def test_fewer_rays_as_by_vtks_mappers(plotter):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, **LOOKS)
    plotter.camera_position = VIEW
    full = shown(plotter)
    actor.mapper.SetImageSampleDistance(2)
    assert actor.mapper.GetImageSampleDistance() == 2
    few = shown(plotter)
    assert actor.status.share == pytest.approx(1 / 4, rel=0.02)
    judge, theirs = beside(plotter, lambda other: add_judge(other, volume))
    exact = shown(judge)
    theirs.mapper.SetImageSampleDistance(2)
    judged = alike(shown(judge), exact)
    judge.close()
    # As near its own full picture as VTK's is
    assert alike(few, full) > min(judged, 0.99) - 0.005
    assert np.abs(few - full).max() > 0
    for wrong in (0.5, 101, float("nan"), True, "2x"):
        with pytest.raises(InvalidArgumentError):
            actor.mapper.SetImageSampleDistance(wrong)
