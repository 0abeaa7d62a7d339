"""Windows that somebody watches: VDIs made behind the frames, by estimates and by changes."""

from __future__ import annotations

import gc
import time

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import CLASSIFICATION, LOOKS, soft_ball
from watched_windows import (
    LONG,
    MOVING,
    WINDOW,
    coarse,
    finish,
    frame,
    frames,
    frames_until,
    picture_of,
    threads,
    turned,
    watched,
)

import pyvista_vdi as pvdi
from pyvista_vdi.errors import DeviceError, VDIWarning
from pyvista_vdi.quality import background
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

pytestmark = pytest.mark.gl


def beyond(degrees):
    """A policy that wants a VDI of each view so far from the last one's."""
    return lambda status: status.angle > degrees


@pytest.mark.parametrize("stereo", [False, True])
def test_each_frame_shows_one_generation(plotter, gate, stereo):
    wanted = [False]
    if stereo:
        plotter.render_window.SetStereoTypeToSplitViewportHorizontal()
        plotter.render_window.StereoRenderOn()
    actor = coarse(plotter, regenerate=lambda status: wanted[0])
    old = actor.vdi
    before = turned(plotter, 80)
    wanted[0] = True
    pictures = [frame(plotter) for _ in range(3)]
    wanted[0] = False
    assert actor.status.progress == 0.0
    assert actor.vdi is old
    gate.set()
    pictures += frames_until(plotter, lambda: actor.status.generation == 2)
    assert actor.vdi is not old
    assert actor.vdi.camera.position == pytest.approx(plotter.camera.position)
    assert actor.status.progress is None
    assert actor.status.angle < 1e-6
    after = picture_of(actor.vdi, plotter)
    assert np.abs(after - before).max() > 8, "the two VDIs cannot be told apart"
    np.testing.assert_array_equal(picture_of(old, plotter), before)
    *earlier, last = pictures
    assert all(np.array_equal(picture, before) for picture in earlier)
    np.testing.assert_array_equal(last, after)


def test_changed_property_and_data_are_made_behind_the_frames(plotter, gate):
    volume = soft_ball()
    actor = watched(plotter, volume)
    before, old = frame(plotter), actor.vdi
    aside = turned(plotter, 30)
    actor.mapper.lookup_table.cmap = "inferno"
    assert np.abs(frame(plotter) - aside).max() > 40  # the volume stands in
    assert actor.status.progress == 0.0
    assert actor.vdi is old
    gate.set()
    frames_until(plotter, lambda: actor.vdi is not old)
    assert actor.vdi.camera.position == old.camera.position, "'never' keeps the view"
    assert np.abs(frame(plotter) - aside).max() > 40
    new = actor.vdi
    volume["v"][:] = 0
    frames_until(plotter, lambda: actor.vdi is not new)
    assert actor.vdi.optical_depth.sum() == 0
    plotter.camera.Azimuth(-30)
    assert np.abs(frame(plotter) - before).max() > 40


def test_changed_data_take_the_current_view(plotter, no_estimates):
    actor = watched(plotter, regenerate="auto")
    old = actor.vdi
    plotter.camera.Azimuth(30)
    actor.prop.interpolation_type = "linear"
    frames_until(plotter, lambda: actor.vdi is not old)
    assert actor.vdi.camera.position == pytest.approx(plotter.camera.position)
    # asked for by name, a view is taken as it is
    newer = actor.vdi
    actor.mapper.GetSource().SetCamera(pvdi.Camera((0, 9, 0), (0, 0, 0), (0, 0, 1)))
    frames_until(plotter, lambda: actor.vdi is not newer)
    assert actor.vdi.camera.position == (0, 9, 0)


def test_changes_while_one_is_made_begin_another(plotter, gate):
    actor = watched(plotter)
    generations = actor.status.generation
    actor.mapper.lookup_table.cmap = "inferno"
    frames_until(plotter, lambda: gate.begun == 1)
    for _ in range(3):
        frame(plotter)  # which begin none, or three would have begun in the end
    actor.mapper.lookup_table.cmap = "bone"
    frames_until(plotter, lambda: gate.begun == 2)
    gate.set()
    frames_until(plotter, lambda: actor.status.generation > generations)
    assert gate.begun == 2
    colors = pvdi.vtk_pipeline.transfer_function_from_property(actor.prop).colors
    assert actor.vdi.metadata["transfer_function"]["colors"] == colors.tolist()
    assert actor.status.generation == generations + 1, "the first was shown"


def test_what_goes_on_is_given_up_for_what_is_asked_for(plotter, gate):
    """A change that is undone needs no VDI, and an explicit regeneration makes its own."""
    actor = watched(plotter)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.status.progress == 0.0
    actor.prop.interpolation_type = "nearest"
    frame(plotter)
    assert actor.status.progress is None
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.status.progress == 0.0
    plotter.camera.Azimuth(30)
    vdi = actor.regenerate()
    assert actor.status.progress is None
    frame(plotter)
    assert actor.vdi is vdi
    assert actor.status.progress is None


def test_auto_estimates_when_the_view_has_moved_and_regenerates_below_the_bound(
    plotter, no_estimates
):
    actor = coarse(plotter, regenerate="auto", settings=pvdi.Settings(regenerate_below=0.9))
    old = actor.vdi
    frames(plotter, 3)
    assert no_estimates.asked == 0, "nothing has moved"
    no_estimates.ssim = 0.91
    plotter.camera.Azimuth(30)
    frames_until(plotter, lambda: actor.status.ssim is not None)
    assert actor.status.ssim == 0.91
    frames(plotter, 3)
    assert no_estimates.asked == 1
    assert actor.vdi is old
    assert (actor.status.progress, threads("estimate")) == (None, [])
    no_estimates.ssim = 0.89
    plotter.camera.Azimuth(5)
    frames_until(plotter, lambda: actor.vdi is not old)
    assert actor.status.ssim is None, "nothing is known of the new one"
    asked, new = no_estimates.asked, actor.vdi
    frames(plotter, 3)
    assert no_estimates.asked == asked
    assert actor.vdi is new, "a VDI of this very view would be the same again"


def test_the_estimate_is_of_the_picture_that_is_shown(plotter, no_estimates):
    plane = vtkPlane()
    plane.SetOrigin(0.1, 0.2, 0.3)
    plane.SetNormal(0.6, 0.0, 0.8)
    planes = (-0.4, 0.3, -0.2, 0.5, -0.4, 0.2)
    actor = coarse(plotter, regenerate="auto", settings=pvdi.Settings(regenerate_below=0.9))
    old = actor.vdi
    actor.mapper.AddClippingPlane(plane)
    actor.mapper.SetCropping(1)
    actor.mapper.SetCroppingRegionPlanes(planes)
    actor.mapper.SetCroppingRegionFlagsToFence()
    actor.opacity_multiplier = 0.5
    frames(plotter, 3)
    assert no_estimates.asked == 0, "these changes need no new VDI"
    plotter.camera.Azimuth(30)
    frames_until(plotter, lambda: actor.status.ssim is not None)
    shown = no_estimates.shown
    assert no_estimates.camera == pvdi.Camera.from_any(plotter.camera)
    assert shown["cropping"] == pvdi.Cropping(planes, "fence")
    assert shown["opacity_multiplier"] == 0.5
    row = np.array(shown["clipping_planes"])[0]
    np.testing.assert_allclose(row[3:] / np.linalg.norm(row[3:]), (0.6, 0, 0.8), atol=1e-12)
    # any point of the plane says where it is
    assert (row[:3] - (0.1, 0.2, 0.3)) @ (0.6, 0, 0.8) == pytest.approx(0, abs=1e-9)
    actor.opacity_multiplier = 0.8
    actor.mapper.CroppingOff()
    frames(plotter, 3)
    assert no_estimates.asked == 1
    assert actor.vdi is old


def test_nothing_is_estimated_or_made_while_a_hand_moves(plotter, no_estimates, gate):
    actor = coarse(plotter, regenerate="auto", settings=pvdi.Settings(regenerate_below=0.9))
    no_estimates.ssim = 0.85
    for _ in range(5):
        turned(plotter, 10, MOVING)
    assert (no_estimates.asked, actor.status.progress) == (0, None)
    frames_until(plotter, lambda: actor.status.progress is not None)
    assert no_estimates.asked == 1


def test_auto_with_the_real_estimate(plotter):
    actor = coarse(plotter, regenerate="auto", settings=pvdi.Settings(regenerate_below=0.9999))
    old = actor.vdi
    plotter.camera.Azimuth(60)
    frames_until(plotter, lambda: actor.vdi is not old)
    np.testing.assert_array_equal(frame(plotter), picture_of(actor.vdi, plotter))


def test_what_is_made_for_a_view_that_was_left_is_given_up(plotter, gate):
    asked = [True]
    actor = coarse(plotter, regenerate=lambda status: asked.pop() if asked else False)
    turned(plotter, 60)
    assert actor.status.progress == 0.0
    turned(plotter, 10)
    assert actor.status.progress == 0.0, "still nearer to it than to the old"
    turned(plotter, -65)
    assert actor.status.progress is None, "the view has come back"
    gate.set()
    finish()
    frames(plotter, 3)
    assert actor.status.generation == 1


def test_callable_gets_the_status_of_the_frames_view(plotter):
    seen = []
    actor = watched(plotter, regenerate=lambda status: seen.append(status))
    turned(plotter, 25)
    assert seen[-1].angle == pytest.approx(25)
    assert seen[-1].vdi is actor.vdi
    before = len(seen)
    frame(plotter)
    assert len(seen) == before + 1
    assert actor.status.generation == 1


def test_off_screen_frames_wait_for_their_vdi_and_nothing_is_estimated(plotter, no_estimates):
    actor = plotter.add_vdi(soft_ball(), regenerate=beyond(20), **LOOKS)
    plotter.show(auto_close=False)
    old = actor.vdi
    turned(plotter, 15)
    assert actor.vdi is old
    turned(plotter, 15)
    assert actor.vdi is not old
    assert actor.status.angle < 1e-6
    old = actor.vdi
    actor.mapper.SetRegenerate("auto")
    for _ in range(3):
        turned(plotter, 40)
        assert not threads()
    assert (actor.vdi is old, no_estimates.asked) == (True, 0)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.vdi is not old, "made before the frame"


def test_a_vdi_drawn_in_two_views_belongs_to_neither(no_estimates):
    plotter = pv.Plotter(window_size=WINDOW, shape=(1, 2))
    plotter.subplot(0, 0)
    actor = plotter.add_vdi(soft_ball(), regenerate="auto", **LOOKS)
    plotter.subplot(0, 1)
    plotter.add_actor(actor)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    no_estimates.ssim = 0.1
    old = actor.vdi
    for _ in range(5):
        turned(plotter, 20)
    assert (actor.vdi is old, no_estimates.asked) == (True, 0)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.vdi is not old, "changed data are made in step"


def test_shallow_copies_share_a_source_and_keep_the_settings(plotter, no_estimates):
    actor = watched(plotter, regenerate="auto", settings=pvdi.Settings(regenerate_below=0.8))
    copy = actor.copy(deep=False)
    assert copy.mapper.GetInteractiveOffScreen()
    assert copy.mapper.GetTargetFrameRate() == 30
    assert copy.mapper.GetRegenerateBelow() == 0.8
    plotter.add_actor(copy)
    no_estimates.ssim = 0.1
    old = actor.vdi
    plotter.camera.Azimuth(20)
    for work in ("estimate", "generation", "generation"):
        frames(plotter, 3)
        finish(work)
    frames(plotter, 3)
    assert (actor.vdi is old, copy.vdi is old) == (True, True)


def test_what_fails_is_said_once_and_not_repeated(plotter, monkeypatch):
    actor = watched(plotter, regenerate=beyond(10))
    tries = []

    def failing(*_, **__):
        tries.append(1)
        raise DeviceError("no more")

    monkeypatch.setattr(background, "generate_vdi", failing)
    plotter.camera.Azimuth(40)
    before = actor.vdi
    with pytest.warns(VDIWarning, match="cannot be made anew: DeviceError: no more") as said:
        frames_until(plotter, lambda: said)
    for _ in range(5):
        frame(plotter)
        time.sleep(0.01)
    finish()
    assert len(tries) == 1
    assert actor.vdi is before
    monkeypatch.undo()
    actor.regenerate()
    frame(plotter)
    assert actor.vdi is not before


def test_what_cannot_be_made_any_more_is_said_and_the_old_stays(plotter):
    actor = watched(plotter)
    before = frame(plotter)
    actor.prop.SetTransferFunctionModeTo2D()
    with pytest.warns(VDIWarning, match="cannot be made anew: UnsupportedError: .*2D transfer"):
        frame(plotter)
    np.testing.assert_array_equal(frame(plotter), before)


def test_a_vdi_without_its_volume_says_once_for_each_cause_what_a_view_lacks(plotter):
    def vdi(view_cone, **changes):
        camera = pvdi.Camera((5, 4, 3), (0, 0, 0), (0, 0, 1), **changes)
        return pvdi.generate(
            soft_ball(12),
            camera,
            WINDOW,
            settings=pvdi.Settings(view_cone=view_cone),
            **CLASSIFICATION,
        )

    actor = plotter.add_vdi(vdi(50.0))
    plotter.camera_position = ((5, 4, 3), (0, 0, 0), (0, 0, 1))
    plotter.show(auto_close=False)
    plotter.camera.Azimuth(49)
    plotter.render()
    plotter.camera.Azimuth(20)
    with pytest.warns(VDIWarning, match="without its volume it cannot be made anew") as said:
        plotter.render()
    assert len(said) == 1
    plotter.camera.Azimuth(20)
    plotter.render()  # warnings are errors: it is not said again
    plotter.camera.Zoom(2.5)
    with pytest.warns(VDIWarning, match=r"2\.5 pixels of the view are as wide as one of the VDI's"):
        plotter.render()
    plotter.camera.Zoom(2)
    plotter.render()
    plotter.camera_position = ((5, 4, 3), (0, 0, 0), (0, 0, 1))
    plotter.camera.view_angle = 30
    actor.mapper.SetVDI(vdi(10.0, view_angle=16.0))
    with pytest.warns(VDIWarning, match=r"\d\d% of the view's rays through the volume leave"):
        plotter.render()
    assert 0.3 < actor.status.coverage < 0.9
    plotter.camera.Azimuth(20)
    with pytest.warns(VDIWarning, match="was to serve 10"):
        plotter.render()
    actor.mapper.SetRegenerate("never")
    actor.mapper.SetVDI(vdi(10.0))
    plotter.render()


def in_the_middle():
    """A plotter for which a VDI is being made."""
    plotter = pv.Plotter(window_size=WINDOW)
    actor = watched(plotter, regenerate=beyond(10))
    actor.show_status(plotter)
    turned(plotter, 30)
    assert actor.status.progress == 0.0
    assert len(threads()) == 1
    return plotter


def test_closing_in_the_middle_leaves_no_thread(gate):
    plotter = in_the_middle()
    plotter.close()
    assert not threads()


def test_forgetting_a_scene_in_the_middle_leaves_no_thread(gate, no_leaks):
    def scene():
        plotter = in_the_middle()
        plotter.clear()
        plotter.close()

    scene()
    gc.collect()
    end = time.monotonic() + LONG
    while threads():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_no_leaks_of_a_watched_scene(no_leaks):
    plotter = pv.Plotter(window_size=WINDOW)
    actor = watched(plotter, regenerate=beyond(10))
    actor.show_status(plotter)
    turned(plotter, 30, MOVING)
    frames_until(plotter, lambda: actor.status.generation == 2)
    plotter.screenshot()
    plotter.close()
