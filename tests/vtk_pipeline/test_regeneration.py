"""Windows that somebody watches: VDIs made behind the frames, by estimates and by changes."""

from __future__ import annotations

import gc
import time

import numpy as np
import pytest
import pyvista as pv
from watched_windows import (
    LONG,
    MOVING,
    WINDOW,
    coarse,
    frame,
    frames,
    frames_until,
    picture_of,
    threads,
    turned,
    watched,
)

import pyvista_vdi as pvdi

pytestmark = pytest.mark.gl


def asking(plotter, actor):
    """Ask for a VDI of the view, in the background."""
    actor.mapper.GetSource().SetCamera(plotter.camera)
    frame(plotter)


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
    assert actor.status.progress is None
    no_estimates.ssim = 0.89
    plotter.camera.Azimuth(5)
    frames_until(plotter, lambda: actor.vdi is not old)
    assert actor.status.ssim is None, "nothing is known of the new one"
    asked, new = no_estimates.asked, actor.vdi
    frames(plotter, 3)
    assert no_estimates.asked == asked
    assert actor.vdi is new, "a VDI of this very view would be the same again"


def test_auto_with_the_real_estimate(plotter):
    actor = coarse(plotter, regenerate="auto", settings=pvdi.Settings(regenerate_below=0.9999))
    old = actor.vdi
    plotter.camera.Azimuth(60)
    frames_until(plotter, lambda: actor.vdi is not old)
    np.testing.assert_array_equal(frame(plotter), picture_of(actor.vdi, plotter))


def in_the_middle():
    """A plotter for which a VDI is being made."""
    plotter = pv.Plotter(window_size=WINDOW)
    actor = watched(plotter)
    turned(plotter, 30)
    asking(plotter, actor)
    assert actor.status.progress == 0.0
    assert len(threads()) == 1
    return plotter


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
    actor = watched(plotter)
    turned(plotter, 30, MOVING)
    asking(plotter, actor)
    frames_until(plotter, lambda: actor.status.generation == 2)
    plotter.screenshot()
    plotter.close()
