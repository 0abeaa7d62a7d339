"""Windows that somebody watches: fewer pixels while a hand moves, full frames and pictures."""

from __future__ import annotations

import numpy as np
import pytest
from plugin_scenes import opaque_sphere
from watched_windows import (
    MOVING,
    WINDOW,
    frame,
    on_screen,
    small_vdi,
    turned,
    watched,
)

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline.vtk import (
    vtk_to_numpy,
    vtkGenericRenderWindowInteractor,
    vtkInteractorStyleTrackballCamera,
    vtkRenderer,
    vtkRenderWindow,
    vtkWindowToImageFilter,
)

pytestmark = pytest.mark.gl

ALL = WINDOW[0] * WINDOW[1]


def test_preview_while_the_rate_is_high_and_full_in_the_next_frame(plotter, coarsest):
    actor = watched(plotter)
    opaque_sphere(plotter)
    full = frame(plotter)
    assert (actor.status.mode, actor.status.share) == ("full", 1.0)
    # An image that is there is better than a preview
    np.testing.assert_array_equal(frame(plotter, MOVING), full)
    assert actor.status.mode == "full"
    preview = turned(plotter, 20, MOVING)
    status = actor.status
    assert status.mode == "preview"
    assert status.full_samples == ALL
    # a sixteenth of the pixels: VTK's image sample distance of 4, both edges rounded
    assert status.samples == 30 * 26
    rest = frame(plotter)
    assert actor.status.mode == "full"
    assert np.abs(rest - preview).max() > 8, "the preview is no coarser"
    # Here the preview differs by 1.1 of 255 on average
    assert np.abs(rest - preview).mean() < 2
    plotter.camera.Azimuth(-20)
    np.testing.assert_array_equal(frame(plotter), full)


def test_off_screen_windows_and_pictures_are_always_full(plotter, coarsest):
    actor = watched(plotter)
    full = turned(plotter, 20)
    shot = plotter.screenshot(return_img=True)
    large = plotter.screenshot(return_img=True, scale=2)
    depth = plotter.get_image_depth()
    turned(plotter, -20, MOVING)
    turned(plotter, 20, MOVING)
    assert actor.status.mode == "preview"
    np.testing.assert_array_equal(plotter.screenshot(return_img=True), shot)
    assert actor.status.mode == "full"
    np.testing.assert_array_equal(on_screen(plotter.render_window), full)
    turned(plotter, 1e-9, MOVING)  # so that no image is kept
    assert actor.status.mode == "preview", "previews go on after a screenshot"
    np.testing.assert_allclose(plotter.screenshot(return_img=True, scale=2), large, atol=1)
    turned(plotter, 1e-9, MOVING)
    assert actor.status.mode == "preview"
    np.testing.assert_allclose(plotter.get_image_depth(), depth, atol=1e-5)
    for again in range(2):  # VTK's own filter
        turned(plotter, 1e-9, MOVING)
        assert actor.status.mode == "preview"
        grab = vtkWindowToImageFilter()
        grab.SetInput(plotter.render_window)
        grab.ReadFrontBufferOff()
        plotter.render_window.GetInteractor().Enable()
        grab.Update()
        taken = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())
        taken = taken.reshape(full.shape)[::-1]
        np.testing.assert_array_equal(taken, full, err_msg=str(again))
    actor.mapper.SetInteractiveOffScreen(False)
    turned(plotter, 10, MOVING)
    assert actor.status.mode == "full"


def test_a_style_starts_and_ends_an_interaction(coarsest):
    actor, mapper = pvdi.VDIActor(), pvdi.VDIMapper()
    mapper.SetVDI(small_vdi())
    mapper.SetRegenerate("never")
    mapper.SetInteractiveOffScreen(True)
    actor.SetMapper(mapper)
    renderer, window = vtkRenderer(), vtkRenderWindow()
    renderer.AddVolume(actor)
    window.SetOffScreenRendering(1)
    window.SetSize(200, 160)
    window.AddRenderer(renderer)
    interactor = vtkGenericRenderWindowInteractor()
    interactor.SetRenderWindow(window)
    style = vtkInteractorStyleTrackballCamera()
    interactor.SetInteractorStyle(style)
    interactor.Initialize()
    window.Render()
    before = on_screen(window)
    assert actor.status.mode == "full"
    interactor.SetEventInformation(100, 80)
    interactor.LeftButtonPressEvent()
    modes = []
    for x in (104, 108, 112):
        interactor.SetEventInformation(x, 80)
        interactor.MouseMoveEvent()
        modes.append(actor.status.mode)
    interactor.LeftButtonReleaseEvent()
    assert modes == ["preview"] * 3
    assert actor.status.mode == "full", "the frame in which the button is released"
    assert actor.status.angle > 1
    assert np.abs(on_screen(window) - before).max() > 8
