"""What is raycast where the volume is at hand: its VDI or itself, and with how many rays."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, add_judge, soft_ball
from skimage.metrics import structural_similarity
from watched_windows import MOVING, WINDOW, frame, no_estimates, watched  # noqa: F401

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.quality.ways import Ways
from pyvista_vdi.vtk_pipeline.interaction import regeneration
from pyvista_vdi.vtk_pipeline.interaction.window_clock import HEADROOM

pytestmark = pytest.mark.gl


def shot(plotter):
    plotter.render()
    return np.asarray(plotter.screenshot(return_img=True)).astype(int)


def alike(a, b):
    return structural_similarity(a, b, channel_axis=2, data_range=255)


def test_the_volume_is_drawn_as_by_vtk_and_no_vdi_is_made(plotter):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, draw="volume", interpolation="linear", **LOOKS)
    plotter.camera_position = ((5, 2, 3), (0, 0, 0), (0, 0, 1))
    plotter.show(auto_close=False)
    seen = shot(plotter)
    assert actor.status.drawn == "volume"
    assert not actor.status.stand_in
    assert actor.mapper.GetVDI() is None
    judge = pv.Plotter(window_size=WINDOW)
    add_judge(judge, volume)
    judge.camera = plotter.camera.copy()
    judge.show(auto_close=False)
    assert alike(seen, shot(judge)) > 0.995
    judge.close()
    # Another view, and other voxels, at once
    plotter.camera.azimuth = 120
    turned = shot(plotter)
    assert np.abs(turned - seen).max() > 8
    volume["v"][:] = 0.5 * volume["v"]
    assert np.abs(shot(plotter) - turned).max() > 8
    assert actor.mapper.GetVDI() is None


def test_a_shaded_volume_is_lit_from_where_it_is_seen(plotter):
    """A headlight goes with the camera; what is baked into a VDI does not."""
    volume = soft_ball()
    looks = {**LOOKS, "shade": True, "interpolation": "linear"}
    plotter.remove_all_lights()
    plotter.add_light(pv.Light(light_type="headlight"))
    actor = plotter.add_vdi(volume, draw="volume", **looks)
    plotter.camera_position = ((5, 2, 3), (0, 0, 0), (0, 0, 1))
    plotter.show(auto_close=False)
    plotter.camera.azimuth = 150
    turned = shot(plotter)
    other = pv.Plotter(window_size=WINDOW)
    other.remove_all_lights()
    other.add_light(pv.Light(light_type="headlight"))
    other.add_vdi(volume, draw="volume", **looks)
    other.camera = plotter.camera.copy()
    other.show(auto_close=False)
    np.testing.assert_array_equal(turned, shot(other))
    other.close()
    assert actor.status.drawn == "volume"


def known(monkeypatch, way):
    """Let every choice be one way."""
    asked = []

    def choose(self, angle, pixels, seconds, ssim=None, bound=0.0):
        asked.append((angle, pixels, seconds))
        self._way = way[0]
        return self._way

    monkeypatch.setattr(Ways, "choose", choose)
    return asked


def test_auto_draws_what_was_chosen_and_brightness_does_not_jump(plotter, monkeypatch):
    way = ["vdi"]
    asked = known(monkeypatch, way)
    actor = watched(plotter, draw="auto", interpolation="linear", max_supersegments=64)
    assert frame(plotter).shape[:2] == WINDOW[::-1]
    by_vdi = frame(plotter)
    assert actor.status.drawn == "vdi"
    way[0] = "volume"
    plotter.renderer.Modified()
    by_volume = frame(plotter)
    assert actor.status.drawn == "volume"
    assert "the volume itself" in str(actor.status)
    assert not actor.status.stand_in
    assert alike(by_vdi, by_volume) > 0.999
    # Mean brightness: half of 1/255
    assert abs(by_vdi.mean() - by_volume.mean()) < 0.5
    angle, pixels, seconds = asked[-1]
    assert angle < 1e-3
    assert 0 < pixels <= WINDOW[0] * WINDOW[1]
    assert seconds is None  # at rest
    plotter.camera.azimuth = 40
    frame(plotter, MOVING)
    angle, _, seconds = asked[-1]
    assert angle == pytest.approx(40, abs=0.1)
    assert seconds == pytest.approx(1 / 30 / HEADROOM)


def test_in_motion_errors_are_estimated_of_vdis_that_are_drawn(
    plotter,
    monkeypatch,
    no_estimates,  # noqa: F811
):
    way = ["volume"]
    known(monkeypatch, way)
    monkeypatch.setattr(regeneration, "_ESTIMATE_PERIOD_IN_MOTION", 0.0)
    no_estimates.ssim = 0.99
    actor = watched(plotter, draw="auto", regenerate="auto")
    worker = actor.mapper.painter.upkeep.regeneration._estimation._worker

    def asked():
        for _ in range(3):
            plotter.camera.azimuth += 40
            frame(plotter, MOVING)
            worker.join()
        return no_estimates.asked

    before = asked()
    assert asked() == before, "frames of the volume have no error"
    way[0] = "vdi"
    assert asked() > before


def test_the_first_frame_of_a_volume_in_motion_is_no_slower_than_a_picture_has_told(
    plotter, monkeypatch
):
    known(monkeypatch, ["volume"])
    actor = watched(plotter, draw="auto")
    upkeep = actor.mapper.painter.upkeep
    upkeep._preparation.join()
    upkeep.ways = Ways()
    upkeep.ways.took("volume", 0.0, 1.0, 1e-3)  # a millisecond per ray
    plotter.camera.azimuth = 40
    frame(plotter, MOVING)
    assert actor.status.drawn == "volume"
    assert actor.status.samples == 60 * 51  # the floor: a sixteenth


def test_auto_goes_by_what_frames_take(plotter, monkeypatch):
    """Clocks are set: a VDI's rays cost a thousand times a volume's, far from V_O."""
    took = Ways.took

    def dear(self, way, angle, pixels, seconds):
        took(self, way, angle, pixels, 1e-9 * pixels * (1000 if way == "vdi" else 1))

    monkeypatch.setattr(Ways, "took", dear)
    actor = watched(plotter, draw="auto")
    actor.mapper.painter.upkeep.ways.took("volume", 0.0, 1e4, 1.0)
    plotter.camera.azimuth = 60
    frame(plotter)
    frame(plotter)
    assert actor.status.drawn == "volume"
    actor.mapper.SetDraw("vdi")
    frame(plotter)
    assert actor.status.drawn == "vdi"


def test_off_screen_and_beside_another_vdi_the_vdi_is_drawn(plotter, monkeypatch):
    known(monkeypatch, ["volume"])
    actor = plotter.add_vdi(soft_ball(), **LOOKS)
    plotter.show(auto_close=False)
    assert actor.status.drawn == "vdi"
    other = plotter.add_vdi(soft_ball(12), **LOOKS)
    for each in (actor, other):
        each.mapper.SetInteractiveOffScreen(True)
    plotter.camera.azimuth = 40
    frame(plotter)
    frame(plotter)
    assert {actor.status.drawn, other.status.drawn} == {"vdi"}


def test_a_vdi_without_its_volume_is_all_there_is(plotter):
    vdi = pvdi.generate(
        soft_ball(12), pvdi.Camera((5, 4, 3), (0, 0, 0), (0, 0, 1)), (40, 30), cmap="bone"
    )
    with pytest.raises(UnsupportedError, match="draw='volume' draws the volume"):
        plotter.add_vdi(vdi, draw="volume")
    plotter.add_vdi(vdi, draw="auto")
    plotter.show(auto_close=False)


def test_fewer_rays_as_by_vtks_mappers(plotter):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, **LOOKS)
    plotter.camera_position = ((5, 2, 3), (0, 0, 0), (0, 0, 1))
    plotter.show(auto_close=False)
    full = shot(plotter)
    actor.mapper.SetImageSampleDistance(2)
    assert actor.mapper.GetImageSampleDistance() == 2
    coarse = shot(plotter)
    assert actor.status.share == pytest.approx(1 / 4, rel=0.02)
    judge = pv.Plotter(window_size=WINDOW)
    theirs = add_judge(judge, volume)
    judge.camera = plotter.camera.copy()
    judge.show(auto_close=False)
    exact = shot(judge)
    theirs.mapper.SetImageSampleDistance(2)
    judged = alike(shot(judge), exact)
    judge.close()
    # As near its own full picture as VTK's is
    assert alike(coarse, full) > min(judged, 0.99) - 0.005
    assert np.abs(coarse - full).max() > 0
    for wrong in (0.5, 101, float("nan"), True, "2x"):
        with pytest.raises(InvalidArgumentError):
            actor.mapper.SetImageSampleDistance(wrong)
