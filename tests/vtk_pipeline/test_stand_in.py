"""Changes in a watched window: the volume itself is drawn until there is a VDI of it."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import CLASSIFICATION, LOOKS, add_judge, soft_ball
from skimage.metrics import structural_similarity
from watched_windows import WINDOW, finish, frame, frames_until, picture_of, watched

from pyvista_vdi.device import programs
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.vtk_pipeline.drawing import images
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane, vtkPropPicker

pytestmark = pytest.mark.gl


def shot(plotter):
    """A screenshot, int (H, W, 3)."""
    return np.asarray(plotter.screenshot(return_img=True)).astype(int)


def alike(one, other):
    return structural_similarity(one, other, channel_axis=2, data_range=255)


def test_changes_faster_than_vdis_are_all_shown(plotter, gate, coarsest):
    volume = soft_ball()
    values = volume["v"].copy()
    actor = watched(plotter, volume)
    before = frame(plotter)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.status.stand_in
    actor.prop.interpolation_type = "nearest"  # undone: the old VDI is back
    np.testing.assert_array_equal(frame(plotter), before)
    assert (actor.status.stand_in, actor.status.generation) == (False, 1)
    old = actor.vdi
    for scale in (0.8, 0.5, 0.9):
        volume["v"][:] = scale * values
        coarse = frame(plotter)
        assert actor.status.mode == "preview"
        assert actor.status.stand_in
        full = picture_of(volume, plotter, **CLASSIFICATION)
        # A sixteenth of the pixels, interpolated; the other steps are at .8 and less
        assert alike(coarse, full) > 0.97
        assert np.abs(shot(plotter) - full).max() <= 2  # rounding of supersegments and volume
        assert actor.status.mode == "full"
    large = np.asarray(plotter.screenshot(return_img=True, scale=2)).astype(int)
    assert actor.status.stand_in
    assert large.shape[:2] == (2 * WINDOW[1], 2 * WINDOW[0])
    small = large.reshape(WINDOW[1], 2, WINDOW[0], 2, 3).mean(axis=(1, 3))
    assert alike(small, full) > 0.99
    assert actor.vdi is old
    assert actor.status.generation == 1
    gate.set()
    frames_until(plotter, lambda: actor.status.generation == 2)
    assert not actor.status.stand_in
    np.testing.assert_array_equal(frame(plotter), picture_of(actor.vdi, plotter))


def test_a_stand_in_is_vtks_picture_of_the_volume(plotter, gate):
    """From a view that no VDI was made for, with new colours, behind a mesh and clipped."""
    actor = watched(plotter)
    plotter.add_mesh(pv.Sphere(radius=0.5, center=(0.6, 0.3, 0.2)), color="red")
    plotter.camera.Azimuth(50)
    actor.prop.interpolation_type = "linear"
    actor.mapper.lookup_table.cmap = "inferno"
    plane = vtkPlane()
    plane.SetOrigin(0, 0.1, 0)
    plane.SetNormal(0, 1, 0)
    actor.mapper.AddClippingPlane(plane)
    frame(plotter)
    picture = shot(plotter)
    assert actor.status.stand_in
    judge = pv.Plotter(window_size=WINDOW)
    other = add_judge(judge, soft_ball(), cmap="inferno")
    other.mapper.AddClippingPlane(plane)
    judge.add_mesh(pv.Sphere(radius=0.5, center=(0.6, 0.3, 0.2)), color="red")
    judge.camera = plotter.camera.copy()
    judge.show(auto_close=False)
    assert alike(picture, shot(judge)) > 0.98


def test_a_neighbour_that_overlaps_is_drawn_as_well(plotter, gate):
    moved = soft_ball()
    moved.origin = (-1, 0, -1)
    watched(plotter, moved)
    actor = plotter.add_vdi(soft_ball(), regenerate="never", **LOOKS)
    actor.mapper.SetInteractiveOffScreen(True)
    before = frame(plotter)
    actor.mapper.lookup_table.cmap = "inferno"
    frame(plotter)
    picture = shot(plotter)
    assert actor.status.stand_in
    right = picture[:, WINDOW[0] * 7 // 8 :]
    assert np.abs(picture - before).max() > 40
    assert np.abs(right - before[:, WINDOW[0] * 7 // 8 :]).max() <= 1
    assert np.ptp(right) > 40, "the neighbour is not there"


def test_where_the_volume_cannot_stand_in_the_old_vdi_is_drawn(plotter, gate, monkeypatch):
    actor = watched(plotter)
    before = frame(plotter)

    def refuse(*_, **__):
        raise DeviceMemoryError("no room")

    monkeypatch.setattr(images, "DeviceVolume", refuse)
    actor.mapper.lookup_table.cmap = "inferno"
    np.testing.assert_array_equal(frame(plotter), before)
    gate.set()
    frames_until(plotter, lambda: actor.status.generation == 2)
    assert np.abs(frame(plotter) - before).max() > 40


def test_full_where_no_rate_is_to_be_kept_and_picked_as_the_vdi(plotter, gate):
    actor = watched(plotter, target_fps=0)
    actor.mapper.lookup_table.cmap = "inferno"
    frame(plotter)
    assert (actor.status.mode, actor.status.stand_in) == ("full", True)
    picker = vtkPropPicker()
    picker.Pick(WINDOW[0] // 2, WINDOW[1] // 2, 0, plotter.renderer)
    assert picker.GetViewProp() is actor


def test_the_first_change_waits_for_no_compiler(plotter, gate, monkeypatch):
    volume = soft_ball()
    volume["v"] = (volume["v"] / 2).astype(np.int8)  # which no other test here has had compiled
    actor = watched(plotter, volume)
    finish("stand-in")
    monkeypatch.setattr(programs, "build", None)
    volume["v"][:] //= 2
    frame(plotter)
    assert actor.status.stand_in
