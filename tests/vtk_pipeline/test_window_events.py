"""Each row of docs/dev/window_events.md: what a window shows, by pictures and status."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import CLASSIFICATION, LOOKS, soft_ball
from skimage.metrics import structural_similarity
from watched_windows import (
    LONG,
    MOVING,
    WINDOW,
    finish,
    frame,
    frames,
    frames_until,
    picture_of,
    small_vdi,
    threads,
    turned,
    watched,
)

import pyvista_vdi as pvdi
from pyvista_vdi.errors import DeviceError, VDIWarning
from pyvista_vdi.quality import background
from pyvista_vdi.vtk_pipeline.drawing import driver
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

pytestmark = pytest.mark.gl


def auto(plotter, **options):
    """A ball as ``add_vdi`` draws it by default, in a window that is watched."""
    return watched(plotter, **{"draw": "auto", "regenerate": "auto", **options})


def off_screen(plotter, **options):
    """The same in a window that nobody watches."""
    actor = plotter.add_vdi(soft_ball(), **{**LOOKS, **options})
    plotter.camera_position = ((6, 0, 0), (0, 0, 0), (0, 0, 1))
    plotter.show(auto_close=False)
    return actor


def differs(a, b):
    return np.abs(a - b).max() > 8


def looks_like(picture, actor, plotter):
    """Whether a picture, perhaps of fewer rays, is that of the ball with the colours of now."""
    looks = {**CLASSIFICATION, "cmap": actor.mapper.lookup_table.cmap.name}
    truth = picture_of(soft_ball(), plotter, **looks)
    return structural_similarity(picture, truth, channel_axis=2, data_range=255) > 0.96


#: A rate that no volume's full frames keep.
NEVER_KEPT = 1e6


def test_first(plotter, gate):
    actor = auto(plotter)
    assert (actor.status.drawn, actor.status.generation) == ("volume", 0)
    finish()
    frames(plotter, 2)
    assert actor.status.progress is None, "its own frames keep the rate"
    actor.mapper.SetTargetFrameRate(NEVER_KEPT)
    frame(plotter)
    assert actor.status.progress == 0.0
    other = pv.Plotter(window_size=WINDOW)
    still = off_screen(other)
    assert (still.status.drawn, still.status.generation) == ("volume", 0)
    assert still.status.progress is None
    np.testing.assert_array_equal(frame(plotter), frame(other))
    other.close()


def test_ready(plotter, gate):
    actor = watched(plotter)
    turned(plotter, 40)
    actor.mapper.GetSource().SetCamera(plotter.camera)
    before = frame(plotter)
    assert (actor.status.progress, actor.status.generation) == (0.0, 1)
    gate.set()
    *earlier, last = frames_until(plotter, lambda: actor.status.generation == 2)
    assert all(np.array_equal(picture, before) for picture in earlier)
    np.testing.assert_array_equal(last, picture_of(actor.vdi, plotter))


def test_moves(plotter, coarsest):
    actor = auto(plotter)
    turned(plotter, 3, MOVING)
    assert actor.status.mode == "preview"
    actor.mapper.SetInteractiveOffScreen(False)
    turned(plotter, 3, MOVING)
    assert actor.status.mode == "full"


def test_no_vdi_is_made_while_a_hand_moves_and_what_serves_goes_on_at_rest(
    plotter, gate, no_estimates, monkeypatch
):
    monkeypatch.setattr(driver, "SETTLED", LONG)  # however long a frame takes
    actor = auto(plotter, draw="vdi")
    no_estimates.ssim = 0.5
    turned(plotter, 60)
    frames_until(plotter, lambda: actor.status.progress is not None)
    turned(plotter, 0.1, MOVING)
    gate.set()
    for _ in range(3):  # it waits
        turned(plotter, 0.1, MOVING)
    assert (actor.status.generation, actor.status.progress) == (1, 0.0)
    frames_until(plotter, lambda: actor.status.generation == 2)
    assert actor.status.angle == pytest.approx(0.4)
    actor.mapper.lookup_table.cmap = "inferno"
    assert looks_like(turned(plotter, 1, MOVING), actor, plotter)
    assert actor.status.progress is None
    frame(plotter)
    assert actor.status.progress is not None


@pytest.mark.parametrize("show", [auto, watched, off_screen])
def test_changes(plotter, gate, show):
    actor = show(plotter, target_fps=1)  # which a busy machine keeps
    before = frame(plotter)
    actor.mapper.lookup_table.cmap = "inferno"
    after = frame(plotter)
    assert differs(after, before)
    assert looks_like(after, actor, plotter)
    assert actor.status.stand_in == (show is watched)
    assert (actor.status.progress is None) == (show is not watched)


def test_changes_again(plotter, gate):
    actor = watched(plotter)
    for cmap in ("inferno", "bone", "viridis_r"):
        actor.mapper.lookup_table.cmap = cmap
        assert looks_like(frame(plotter), actor, plotter)
        assert len(threads()) == 1
    gate.set()
    frames_until(plotter, lambda: actor.status.generation == 2)
    assert looks_like(frame(plotter), actor, plotter), "another one was shown"
    assert actor.status.progress is None


def test_taken_back(plotter, gate):
    actor = watched(plotter)
    before, vdi = frame(plotter), actor.vdi
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.status.progress == 0.0
    actor.prop.interpolation_type = "nearest"
    np.testing.assert_array_equal(frame(plotter), before)
    assert (actor.status.progress, actor.vdi) == (None, vdi)


def test_fails(plotter, monkeypatch):
    actor = watched(plotter)
    tries = []

    def fail(*_, **__):
        tries.append(1)
        raise DeviceError("no more")

    making = background.generate_vdi
    monkeypatch.setattr(background, "generate_vdi", fail)
    actor.mapper.lookup_table.cmap = "inferno"
    with pytest.warns(VDIWarning, match="cannot be made: DeviceError: no more") as said:
        frames_until(plotter, lambda: said)
    frames(plotter, 3)  # warnings are errors: it is not said again
    assert len(tries) == 1
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    finish()
    frame(plotter)
    assert len(tries) == 2
    monkeypatch.setattr(background, "generate_vdi", making)  # undo() would end off-screen, too
    actor.regenerate()
    assert not differs(frame(plotter), picture_of(actor.vdi, plotter))


@pytest.mark.parametrize("show", [watched, off_screen])
def test_clips(plotter, show):
    actor = show(plotter)
    vdi, before = actor.vdi, frame(plotter)
    plane = vtkPlane()
    plane.SetNormal(0, 1, 0)
    actor.mapper.AddClippingPlane(plane)
    clipped = frame(plotter)
    actor.opacity_multiplier = 0.3
    thin = frame(plotter)
    assert differs(clipped, before)
    assert differs(thin, clipped)
    assert (actor.vdi is vdi, actor.status.progress) == (True, None)


def test_picture(plotter, coarsest):
    actor = watched(plotter)
    full = turned(plotter, 20)
    turned(plotter, -20, MOVING)
    turned(plotter, 20, MOVING)
    assert actor.status.mode == "preview"
    shot = plotter.screenshot(return_img=True).astype(int)
    assert actor.status.mode == "full"
    np.testing.assert_array_equal(shot, full)
    turned(plotter, 5, MOVING)
    assert actor.status.mode == "preview"


def test_two_renderers(gate):
    gate.set()
    plotter = pv.Plotter(window_size=WINDOW, shape=(1, 2))
    actor = plotter.add_vdi(soft_ball(), draw="vdi", **LOOKS)
    plotter.subplot(0, 1)
    plotter.add_actor(actor)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    vdi = actor.vdi
    turned(plotter, 60)
    assert (actor.vdi is vdi, actor.status.progress) == (True, None)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.vdi is not vdi
    assert gate.begun == 0
    plotter.close()


@pytest.mark.extension("series")
def test_plays(plotter):
    actor = plotter.add_vdi(pvdi.VDISeries([small_vdi() for _ in range(3)]))
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    actor.player.play(rate=200)
    seen = set()
    frames_until(plotter, lambda: seen.add(actor.player.step) or len(seen) == 3)
    actor.player.pause()
    finish("series")
    step = actor.player.step
    frames(plotter, 3)
    assert actor.player.step == step


def test_closed(gate):
    plotter = pv.Plotter(window_size=WINDOW)
    actor = auto(plotter, target_fps=NEVER_KEPT)
    frames_until(plotter, lambda: actor.status.progress == 0.0)
    plotter.close()
    assert actor.status.progress is None
    assert not threads()


def test_again(plotter):
    first = pv.Plotter(window_size=WINDOW)
    actor = watched(first)
    before = frame(first)
    first.close()
    plotter.add_actor(actor)
    plotter.camera_position = ((6, 0, 0), (0, 0, 0), (0, 0, 1))
    plotter.show(auto_close=False)
    np.testing.assert_array_equal(frame(plotter), before)
    assert actor.status.generation == 1
