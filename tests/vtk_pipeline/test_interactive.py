"""Windows that somebody watches: previews while a hand moves, VDIs made behind the frames.

Previews, estimates and regeneration act on each other in a watched window; the fixtures that hold
them up (gate, coarsest, no_estimates) serve all tests: hence more than 500 lines.
"""

from __future__ import annotations

import gc
import threading
import time

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, opaque_sphere, soft_ball
from skimage.io import imread
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import (
    vtkRenderer,
    vtkRenderWindow,
    vtkWindowToImageFilter,
)
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

import pyvista_vdi as pvdi
from pyvista_vdi.cli import main
from pyvista_vdi.device.ray_forms import pixel_rays
from pyvista_vdi.errors import DeviceError, InvalidArgumentError, VDIWarning
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.quality import background
from pyvista_vdi.quality.frame_rate import FrameRateController
from pyvista_vdi.vtk_pipeline.drawing import painter as painter_module
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, sampled
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.interaction import estimation, regeneration
from pyvista_vdi.vtk_pipeline.interaction.window_clock import reduced

pytestmark = pytest.mark.gl

#: Odd, so that no smaller image divides it.
WINDOW = (241, 203)
#: Seconds after which something that should have happened has not.
LONG = 600.0
MOVING, STILL = 30.0, 0.0001


@pytest.fixture
def plotter():
    plotter = pv.Plotter(window_size=WINDOW)
    yield plotter
    plotter.close()


@pytest.fixture
def gate(monkeypatch):
    """Holds up what is generated in the background, until it is set."""
    gate = threading.Event()
    generate_by_dial = background.generate_by_dial

    def gated(*arguments, device, **keywords):
        while not gate.is_set():
            device.give_way()
            time.sleep(0.001)
        return generate_by_dial(*arguments, device=device, **keywords)

    monkeypatch.setattr(background, "generate_by_dial", gated)
    yield gate
    gate.set()


@pytest.fixture
def coarsest(monkeypatch):
    """Every preview is as coarse as it may be, whatever frames take."""
    monkeypatch.setattr(FrameRateController, "choose", lambda controller, full: 1)


@pytest.fixture
def no_estimates(monkeypatch):
    """Counts estimates, and answers each at once with ``answer.ssim``."""

    class Answer:
        ssim = 1.0
        asked = 0

    answer = Answer()

    class Estimator:
        def __init__(self, *_, **__):
            pass

        def estimate(self, vdi, camera, size, **shown):
            answer.asked += 1
            answer.camera, answer.shown = camera, shown
            return estimation.ViewError(answer.ssim, 0.0, 0.0, 1.0, 1)

    monkeypatch.setattr(estimation, "ViewErrorEstimator", Estimator)
    return answer


def watched(plotter, volume=None, **options):
    """Add a ball to a plotter whose window counts as watched, and show it."""
    options = {"regenerate": "never", **LOOKS, **options}
    actor = plotter.add_vdi(soft_ball() if volume is None else volume, **options)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.camera_position = ((6, 0, 0), (0, 0, 0), (0, 0, 1))  # Azimuth turns by its degrees
    plotter.show(auto_close=False)
    return actor


def on_screen(window):
    """What the window shows, int (H, W, 3); nothing is drawn for it."""
    width, height = window.GetSize()
    pixels = vtkUnsignedCharArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 1, pixels, 0)
    return vtk_to_numpy(pixels).reshape(height, width, 3)[::-1].astype(int)


def frame(plotter, rate=STILL):
    """Draw a frame at an update rate, and return what the window shows then."""
    plotter.render_window.SetDesiredUpdateRate(rate)
    plotter.render()
    return on_screen(plotter.render_window)


def frames_until(plotter, happened):
    """Draw frames at rest until something is so; all pictures."""
    pictures = []
    end = time.monotonic() + LONG
    while not happened():
        assert time.monotonic() < end, "it has not happened"
        pictures.append(frame(plotter))
        time.sleep(0.005)
    return pictures


def generation_threads():
    return [t for t in threading.enumerate() if t.name.startswith("pyvista-vdi")]


def picture_of(vdi, plotter, **options):
    """What another plotter shows of a VDI that never changes, from this one's view."""
    other = pv.Plotter(window_size=plotter.window_size)
    other.add_vdi(vdi, show_scalar_bar=False, regenerate="never", **options)
    if plotter.render_window.GetStereoRender():
        other.render_window.SetStereoType(plotter.render_window.GetStereoType())
        other.render_window.StereoRenderOn()
    other.camera = plotter.camera.copy()
    other.show(auto_close=False)
    picture = frame(other)
    other.close()
    return picture


# -- previews --------------------------------------------------------------------------------------


def test_preview_while_the_rate_is_high_and_full_in_the_next_frame(plotter, coarsest):
    actor = watched(plotter)
    opaque_sphere(plotter)
    full = frame(plotter)
    assert (actor.status.mode, actor.status.share) == ("full", 1.0)
    plotter.camera.Azimuth(20)
    preview = frame(plotter, MOVING)
    status = actor.status
    assert status.mode == "preview"
    assert status.full_samples == WINDOW[0] * WINDOW[1]
    # a sixteenth of the pixels: VTK's image sample distance of 4, both edges rounded
    assert status.samples == 60 * 51
    turned = frame(plotter)
    assert actor.status.mode == "full"
    assert np.abs(turned - preview).max() > 8, "the preview is no coarser"
    # Here the preview differs by 0.9 of 255 on average; a picture of elsewhere by 9
    assert np.abs(turned - preview).mean() < 2
    plotter.camera.Azimuth(-20)
    np.testing.assert_array_equal(frame(plotter), full)


def test_preview_is_not_shifted_and_the_mesh_stays_crisp(plotter, coarsest):
    watched(plotter)
    ball = frame(plotter)
    plotter.camera.Azimuth(1e-6)
    preview = frame(plotter, MOVING)
    y, x = np.mgrid[: WINDOW[1], : WINDOW[0]]
    centres = []
    for picture in (ball, preview):
        weight = np.abs(picture - picture[0, 0]).sum(axis=2)
        centres.append(((weight * x).sum() / weight.sum(), (weight * y).sum() / weight.sum()))
    # Half a pixel of the preview is two pixels; seen is .02
    np.testing.assert_allclose(*centres, atol=0.1)
    mesh = plotter.add_mesh(
        pv.Sphere(radius=0.4, center=(1.2, 0, 0)), color="w", reset_camera=False
    )
    full = frame(plotter)
    plotter.camera.Azimuth(1e-6)
    preview = frame(plotter, MOVING)
    mesh.visibility = False
    inside = np.abs(full - frame(plotter)).sum(axis=2) > 200
    assert inside.sum() > 500
    # VTK draws the mesh; rays that were not cast at its pixels may tint it at its edge only
    assert np.median(np.abs(full - preview).max(axis=2)[inside]) == 0


def test_coarser_frames_have_the_same_rays():
    camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), view_angle=40, window_center=(0.2, -0.3))
    rng = np.random.default_rng(3)
    matrix = np.eye(4)
    matrix[:3] += rng.normal(scale=0.2, size=(3, 4))
    matrix[2, 3] -= 5
    for parallel in (False, True):
        camera = camera.replace(model_transform=matrix, parallel_projection=parallel)
        full = Frame((241, 203), (0, 0), camera, np.eye(4), np.zeros((2, 4)))
        coarse = full.coarser((60, 51))
        bounds = (-1, 1, -1, 1, -1, 1)
        lines = [pixel_rays(f.camera, f.size, bounds) for f in (full, coarse)]
        for i, j in ((0, 0), (59, 0), (13, 37), (59, 50)):
            # The same place of the viewport, in pixels from the centre of each
            u, v = 2 * (i + 0.5) / 60 - 1, 2 * (j + 0.5) / 51 - 1
            ends = []
            for ray, (width, height) in zip(lines, (full.size, coarse.size), strict=True):
                pixel = np.array([1, u * width / 2, v * height / 2])
                t = 0.7 - ray.reference_depth
                ends.append(pixel @ ray.origin + t * (pixel @ ray.direction))
            np.testing.assert_allclose(ends[1], ends[0], atol=1e-12)


def test_sampled_depth_is_that_at_the_centres():
    depth = np.arange(7 * 9, dtype=np.float32).reshape(7, 9)
    np.testing.assert_array_equal(sampled(depth, (9, 7)), depth)
    np.testing.assert_array_equal(sampled(depth, (3, 1)), [[28, 31, 34]])
    assert reduced((241, 203), 1.0) == (241, 203)
    assert reduced((1, 500), 0.01) == (1, 50)


def test_clipping_planes_cut_previews_as_they_cut_full_frames(plotter, coarsest):
    actor = watched(plotter)
    plane = vtkPlane()
    plane.SetNormal(1, 0.3, 0.1)
    actor.mapper.AddClippingPlane(plane)
    full = frame(plotter)
    plotter.camera.Azimuth(1e-6)
    preview = frame(plotter, MOVING)
    assert actor.status.mode == "preview"
    actor.mapper.RemoveAllClippingPlanes()
    whole = frame(plotter)
    assert np.abs(whole - full).max() > 40
    assert np.abs(preview - full).mean() < 0.2 * np.abs(whole - full).mean()


def test_cropping_cuts_previews_as_it_cuts_full_frames(plotter, coarsest):
    actor = watched(plotter, soft_ball(48))
    actor.mapper.SetCropping(1)
    actor.mapper.SetCroppingRegionPlanes(-0.4, 0.3, -0.2, 0.5, -0.4, 0.2)
    actor.mapper.SetCroppingRegionFlagsToCross()
    plotter.camera.Azimuth(1)
    preview = frame(plotter, MOVING)
    assert actor.status.mode == "preview"
    full = frame(plotter)
    assert actor.status.mode == "full"
    actor.mapper.CroppingOff()
    whole = frame(plotter)
    assert np.abs(whole - full).max() > 40
    # A fifth of the pixels along each edge: seen were a mean of 0.4, and 1.9 from the whole
    assert np.abs(preview - full).mean() < np.abs(whole - full).mean() / 3


def test_off_screen_windows_and_pictures_are_always_full(plotter, coarsest):
    actor = watched(plotter)
    plotter.camera.Azimuth(20)
    full = frame(plotter)
    shot = plotter.screenshot(return_img=True)
    large = plotter.screenshot(return_img=True, scale=2)
    depth = plotter.get_image_depth()
    plotter.camera.Azimuth(-20)
    frame(plotter, MOVING)
    plotter.camera.Azimuth(20)
    frame(plotter, MOVING)
    assert actor.status.mode == "preview"
    np.testing.assert_array_equal(plotter.screenshot(return_img=True), shot)
    assert actor.status.mode == "full"
    np.testing.assert_array_equal(on_screen(plotter.render_window), full)
    plotter.camera.Azimuth(1e-9)  # so that no image is kept
    frame(plotter, MOVING)
    assert actor.status.mode == "preview", "previews go on after a screenshot"
    np.testing.assert_allclose(plotter.screenshot(return_img=True, scale=2), large, atol=1)
    plotter.camera.Azimuth(1e-9)
    frame(plotter, MOVING)
    assert actor.status.mode == "preview"
    np.testing.assert_allclose(plotter.get_image_depth(), depth, atol=1e-5)
    actor.mapper.SetInteractiveOffScreen(False)
    plotter.camera.Azimuth(10)
    frame(plotter, MOVING)
    assert actor.status.mode == "full"


def test_movie_frames_and_vector_graphics_are_full(plotter, coarsest, tmp_path):
    actor = watched(plotter)
    modes = []
    paint = painter_module.Painter.begin

    def noting(painter, mapper):
        paint(painter, mapper)
        modes.append(painter.status().mode)

    painter_module.Painter.begin, before = noting, paint
    try:
        plotter.camera.Azimuth(10)
        frame(plotter, MOVING)
        assert modes.pop() == "preview"
        plotter.camera.Azimuth(10)
        plotter.open_gif(str(tmp_path / "movie.gif"))
        plotter.write_frame()
        assert modes == ["preview", "full"], "the frame on the screen, and the one that is kept"
        modes.clear()
        plotter.camera.Azimuth(10)
        plotter.save_graphic(str(tmp_path / "scene.svg"))
        assert modes[0] == "full"
    finally:
        painter_module.Painter.begin = before
    assert actor.status.mode == "full"


def test_a_screenshot_filter_of_vtk_gets_full_frames(plotter, coarsest):
    watched(plotter)
    plotter.camera.Azimuth(20)
    full = frame(plotter)
    plotter.camera.Azimuth(1e-9)
    frame(plotter, MOVING)
    for again in range(2):
        grab = vtkWindowToImageFilter()
        grab.SetInput(plotter.render_window)
        grab.ReadFrontBufferOff()
        plotter.render_window.GetInteractor().Enable()
        grab.Update()
        image = grab.GetOutput()
        width, height, _ = image.GetDimensions()
        taken = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1]
        np.testing.assert_array_equal(taken, full, err_msg=str(again))


def test_an_image_that_is_there_is_better_than_a_preview(plotter, coarsest):
    actor = watched(plotter)
    full = frame(plotter)
    np.testing.assert_array_equal(frame(plotter, MOVING), full)
    assert actor.status.mode == "full"


def test_a_style_starts_and_ends_an_interaction(coarsest):
    actor = pvdi.VDIActor()
    mapper = pvdi.VDIMapper()
    mapper.SetVDI(_small_vdi())
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


def _small_vdi(size=(60, 50), **options):
    keep = {k: v for k, v in LOOKS.items() if k != "show_scalar_bar"}
    camera = pvdi.Camera((5, 4, 3), (0, 0, 0), (0, 0, 1))
    return pvdi.generate(soft_ball(12), camera, size, **keep, **options)


def test_vtks_switches_turn_previews_off_and_bound_them(plotter, coarsest):
    actor = watched(plotter)
    mapper = actor.mapper
    assert mapper.GetInteractiveUpdateRate() == 1.0
    assert mapper.GetAutoAdjustSampleDistances()

    def share():
        plotter.camera.Azimuth(3)
        frame(plotter, MOVING)
        return actor.status.share

    assert share() < 0.1
    mapper.AutoAdjustSampleDistancesOff()
    assert share() == 1.0
    mapper.AutoAdjustSampleDistancesOn()
    mapper.SetInteractiveUpdateRate(MOVING + 1)
    assert share() == 1.0
    mapper.SetInteractiveUpdateRate(MOVING)
    mapper.SetMaximumImageSampleDistance(2.0)
    assert share() == pytest.approx(0.25, abs=0.01)
    mapper.SetMaximumImageSampleDistance(10.0)
    assert share() < 0.05
    mapper.SetTargetFrameRate(0)
    assert share() == 1.0
    mapper.SetTargetFrameRate(None)
    assert mapper.GetTargetFrameRate() is None
    plotter.camera.Azimuth(3)
    assert share() < 0.05


def test_several_vdis_and_two_eyes_share_a_frame(plotter, coarsest):
    first = watched(plotter)
    second = plotter.add_vdi(soft_ball(8), target_fps=None, regenerate="never", **LOOKS)
    second.mapper.SetInteractiveOffScreen(True)
    second.position = (1.5, 0, 0)
    plotter.render_window.SetStereoTypeToSplitViewportHorizontal()
    plotter.render_window.StereoRenderOn()
    frame(plotter)
    plotter.camera.Azimuth(10)
    preview = frame(plotter, MOVING)
    assert first.status.mode == second.status.mode == "preview"
    assert first.status.share == second.status.share
    full = frame(plotter)
    assert np.abs(full[:, :120] - full[:, 121:]).max() > 8, "the two eyes see the same"
    assert 0 < np.abs(full - preview).mean() < 2


def test_samples_follow_the_time_that_frames_take(plotter, monkeypatch):
    """With a clock that counts a microsecond per ray, 100 frames a second leave 10 000 rays."""
    from pyvista_vdi.vtk_pipeline.interaction import window_clock as interaction

    class Clock:
        now = 0.0

        def perf_counter(self):
            return self.now

    clock = Clock()
    render_vdi = painter_module.render_vdi

    def timed(vdi, request):
        clock.now += 1e-6 * request.size[0] * request.size[1]
        return render_vdi(vdi, request)

    monkeypatch.setattr(painter_module, "render_vdi", timed)
    for module in (interaction, painter_module, regeneration):
        monkeypatch.setattr(module, "time", clock)
    actor = watched(plotter, target_fps=100.0)
    for _ in range(8):
        plotter.camera.Azimuth(3)
        frame(plotter, MOVING)
    # the controller's threshold is a tenth, and the edges are rounded to whole pixels
    assert actor.status.samples == pytest.approx(10_000, rel=0.12)
    assert actor.status.fps == pytest.approx(100, rel=0.12)
    frame(plotter)
    assert actor.status.fps == pytest.approx(1e6 / (WINDOW[0] * WINDOW[1]))


# -- made anew in the background -------------------------------------------------------------------


def coarse(plotter, **options):
    """A ball with two supersegments per list: its VDIs of different views differ visibly."""
    actor = watched(plotter, max_supersegments=2, **options)
    plotter.render_window.SetDesiredUpdateRate(STILL)
    return actor


@pytest.mark.parametrize("stereo", [False, True])
def test_each_frame_shows_one_generation(plotter, gate, stereo):
    wanted = [False]
    if stereo:
        plotter.render_window.SetStereoTypeToSplitViewportHorizontal()
        plotter.render_window.StereoRenderOn()
    actor = coarse(plotter, regenerate=lambda status: wanted[0])
    old = actor.vdi
    plotter.camera.Azimuth(80)
    before = frame(plotter)
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
    kinds = [
        "old"
        if np.array_equal(picture, before)
        else "new"
        if np.array_equal(picture, after)
        else "?"
        for picture in pictures
    ]
    assert kinds == ["old"] * (len(kinds) - 1) + ["new"]


def test_changed_property_and_data_are_made_behind_the_frames(plotter, gate):
    volume = soft_ball()
    actor = watched(plotter, volume)
    before, old = frame(plotter), actor.vdi
    plotter.camera.Azimuth(30)
    turned = frame(plotter)
    actor.mapper.lookup_table.cmap = "inferno"
    np.testing.assert_array_equal(frame(plotter), turned)
    assert actor.status.progress == 0.0
    gate.set()
    frames_until(plotter, lambda: actor.vdi is not old)
    assert actor.vdi.camera.position == old.camera.position, "'never' keeps the view"
    assert np.abs(frame(plotter) - turned).max() > 40
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
    frame(plotter)
    first = actor.mapper.painter.upkeep.regeneration._background.key
    frame(plotter)
    assert actor.mapper.painter.upkeep.regeneration._background.key is first
    actor.mapper.lookup_table.cmap = "bone"
    frame(plotter)
    second = actor.mapper.painter.upkeep.regeneration._background.key
    assert second != first
    gate.set()
    frames_until(plotter, lambda: actor.status.generation > generations)
    colors = pvdi.vtk_pipeline.transfer_function_from_property(actor.prop).colors
    assert actor.vdi.metadata["transfer_function"]["colors"] == colors.tolist()
    assert actor.status.generation == generations + 1, "the first was shown"


def test_a_change_that_is_undone_is_given_up(plotter, gate):
    actor = watched(plotter)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.status.progress == 0.0
    actor.prop.interpolation_type = "nearest"
    frame(plotter)
    assert actor.status.progress is None


def test_auto_estimates_when_the_view_has_moved_and_regenerates_below_the_bound(
    plotter, no_estimates
):
    actor = coarse(plotter, regenerate="auto", regenerate_below=0.9)
    old = actor.vdi
    for _ in range(3):
        frame(plotter)
    assert no_estimates.asked == 0, "nothing has moved"
    no_estimates.ssim = 0.91
    plotter.camera.Azimuth(30)
    frames_until(plotter, lambda: actor.status.ssim is not None)
    assert actor.status.ssim == 0.91
    for _ in range(3):
        frame(plotter)
    assert no_estimates.asked == 1
    assert actor.vdi is old
    assert not actor.mapper.painter.upkeep.regeneration.busy
    no_estimates.ssim = 0.89
    plotter.camera.Azimuth(5)
    frames_until(plotter, lambda: actor.vdi is not old)
    assert actor.status.ssim is None, "nothing is known of the new one"
    asked, new = no_estimates.asked, actor.vdi
    for _ in range(3):
        frame(plotter)
    assert no_estimates.asked == asked
    assert actor.vdi is new, "a VDI of this very view would be the same again"


def test_the_estimate_is_of_the_picture_that_is_shown(plotter, no_estimates):
    plane = vtkPlane()
    plane.SetOrigin(0.1, 0.2, 0.3)
    plane.SetNormal(0.6, 0.0, 0.8)
    planes = (-0.4, 0.3, -0.2, 0.5, -0.4, 0.2)
    actor = coarse(plotter, regenerate="auto", regenerate_below=0.9)
    old = actor.vdi
    actor.mapper.AddClippingPlane(plane)
    actor.mapper.SetCropping(1)
    actor.mapper.SetCroppingRegionPlanes(planes)
    actor.mapper.SetCroppingRegionFlagsToFence()
    actor.opacity_multiplier = 0.5
    for _ in range(3):
        frame(plotter)
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
    for _ in range(3):
        frame(plotter)
    assert no_estimates.asked == 1
    assert actor.vdi is old


def test_an_estimate_that_ends_between_two_looks_is_not_asked_for_again(
    plotter, no_estimates, monkeypatch
):
    actor = coarse(plotter, regenerate="auto", regenerate_below=0.9)
    take, missed = estimation.Estimation.take, []

    def too_early(self):
        job = self._worker.job
        if job is None or missed:
            return take(self)
        self._worker.join()  # it ends right after this look
        assert not self._worker.running
        missed.append(job)
        return None

    monkeypatch.setattr(estimation.Estimation, "take", too_early)
    plotter.camera.Azimuth(30)
    frames_until(plotter, lambda: actor.status.ssim is not None)
    assert len(missed) == 1
    assert no_estimates.asked == 1


def test_auto_bears_more_while_the_view_moves(plotter, no_estimates, gate):
    actor = coarse(plotter, regenerate="auto", regenerate_below=0.9)
    no_estimates.ssim = 0.85
    plotter.camera.Azimuth(30)
    end = time.monotonic() + LONG
    while actor.status.ssim is None:
        frame(plotter, MOVING)
        assert time.monotonic() < end
    frame(plotter, MOVING)
    assert actor.status.progress is None
    frame(plotter)
    frames_until(plotter, lambda: actor.status.progress is not None)


def test_auto_with_the_real_estimate(plotter):
    actor = coarse(plotter, regenerate="auto", regenerate_below=0.9999)
    old = actor.vdi
    plotter.camera.Azimuth(60)
    frames_until(plotter, lambda: actor.vdi is not old)
    np.testing.assert_array_equal(frame(plotter), picture_of(actor.vdi, plotter))


def test_what_is_made_for_a_view_that_was_left_is_given_up(plotter, gate):
    asked = [True]
    actor = coarse(plotter, regenerate=lambda status: asked.pop() if asked else False)
    plotter.camera.Azimuth(60)
    frame(plotter)
    assert actor.status.progress == 0.0
    plotter.camera.Azimuth(10)
    frame(plotter)
    assert actor.status.progress == 0.0, "still nearer to it than to the old"
    plotter.camera.Azimuth(-65)
    frame(plotter)
    assert actor.status.progress is None, "the view has come back"
    gate.set()
    for _ in range(3):
        frame(plotter)
    assert actor.status.generation == 1


def test_callable_gets_the_status_of_the_frames_view(plotter):
    seen = []
    actor = watched(plotter, regenerate=lambda status: seen.append(status))
    plotter.camera.Azimuth(25)
    frame(plotter)
    assert seen[-1].angle == pytest.approx(25)
    assert seen[-1].vdi is actor.vdi
    before = len(seen)
    frame(plotter)
    assert len(seen) == before + 1
    assert actor.status.generation == 1


def test_callable_off_screen_is_asked_and_answered_in_step(plotter):
    actor = plotter.add_vdi(soft_ball(), regenerate=lambda status: status.angle > 20, **LOOKS)
    plotter.show(auto_close=False)
    old = actor.vdi
    plotter.camera.Azimuth(15)
    frame(plotter)
    assert actor.vdi is old
    plotter.camera.Azimuth(15)
    frame(plotter)
    assert actor.vdi is not old
    assert actor.status.angle < 1e-6
    assert not generation_threads()


def test_off_screen_auto_starts_nothing(plotter, no_estimates):
    actor = plotter.add_vdi(soft_ball(), regenerate="auto", **LOOKS)
    plotter.show(auto_close=False)
    old = actor.vdi
    for _ in range(3):
        plotter.camera.Azimuth(40)
        frame(plotter)
        assert not generation_threads()
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
        plotter.camera.Azimuth(20)
        frame(plotter)
    assert (actor.vdi is old, no_estimates.asked) == (True, 0)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.vdi is not old, "changed data are made in step"
    plotter.close()


def test_copies_share_a_source_and_keep_the_settings(plotter, no_estimates):
    actor = watched(plotter, regenerate="auto", regenerate_below=0.8)
    copy = actor.copy()
    assert copy.mapper.GetInteractiveOffScreen()
    assert copy.mapper.GetTargetFrameRate() == 30
    assert copy.mapper.GetRegenerateBelow() == 0.8
    plotter.add_actor(copy)
    no_estimates.ssim = 0.1
    old = actor.vdi
    plotter.camera.Azimuth(20)
    for _ in range(5):
        frame(plotter)
    assert (actor.vdi is old, copy.vdi is old) == (True, True)


def test_explicit_regeneration_gives_up_what_goes_on(plotter, gate):
    actor = watched(plotter)
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    assert actor.status.progress == 0.0
    plotter.camera.Azimuth(30)
    vdi = actor.regenerate()
    assert actor.status.progress is None
    frame(plotter)
    assert actor.vdi is vdi
    assert actor.status.progress is None


def test_what_fails_is_said_once_and_not_repeated(plotter, monkeypatch):
    actor = watched(plotter, regenerate=lambda status: status.angle > 10)
    tries = []

    def failing(*_, **__):
        tries.append(1)
        raise DeviceError("no more")

    monkeypatch.setattr(background, "generate_by_dial", failing)
    plotter.camera.Azimuth(40)
    before = actor.vdi
    with pytest.warns(VDIWarning, match="cannot be made anew: DeviceError: no more"):
        frames_until(plotter, lambda: actor.mapper.painter.upkeep.regeneration._failed)
    for _ in range(5):
        frame(plotter)
        time.sleep(0.01)
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


# -- without the volume ----------------------------------------------------------------------------


def test_a_vdi_without_its_volume_says_once_that_the_view_is_far(plotter):
    actor = plotter.add_vdi(_small_vdi(view_cone=50.0))
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
    actor.mapper.SetVDI(_small_vdi(view_cone=10.0))
    with pytest.warns(VDIWarning, match="was to serve 10"):
        plotter.render()
    actor.mapper.SetRegenerate("never")
    actor.mapper.SetVDI(_small_vdi(view_cone=10.0))
    plotter.render()


# -- settings --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"target_fps": -1}, "target_fps must be a number of frames per second, .*got -1"),
        ({"target_fps": "fast"}, "target_fps .*got 'fast'"),
        ({"target_fps": np.inf}, "target_fps .*got inf"),
        ({"target_fps": True}, "target_fps .*got True"),
        ({"regenerate": "always"}, "regenerate must be 'auto', 'never' or a callable.*'always'"),
        ({"regenerate": None}, "regenerate must be .*got None"),
        ({"regenerate_below": 1.5}, "regenerate_below must be an SSIM .*got 1.5"),
        ({"regenerate_below": "x"}, "regenerate_below must be an SSIM .*got 'x'"),
    ],
)
def test_nonsense_is_refused_by_name(plotter, arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        plotter.add_vdi(soft_ball(8), **arguments)
    assert not plotter.actors


def test_mapper_refuses_nonsense_too():
    mapper = pvdi.VDIMapper()
    with pytest.raises(InvalidArgumentError, match="interactive update rate .*got -1"):
        mapper.SetInteractiveUpdateRate(-1)
    with pytest.raises(InvalidArgumentError, match="target frame rate .*got nan"):
        mapper.SetTargetFrameRate(float("nan"))
    with pytest.raises(InvalidArgumentError, match="regenerate must be"):
        mapper.SetRegenerate("often")
    assert mapper.GetRegenerate() == "auto"


# -- status ----------------------------------------------------------------------------------------


def test_status_from_before_the_first_frame_on(plotter, gate):
    actor = plotter.add_vdi(soft_ball(), regenerate="never", **LOOKS)
    assert str(actor.status) == "no VDI drawn yet"
    assert (actor.status.vdi, actor.status.fps, actor.status.share) == (None, None, 0.0)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    status = actor.status
    assert (status.mode, status.generation, status.vdi) == ("full", 1, actor.vdi)
    assert status.fps > 0
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    text = str(actor.status)
    assert text.startswith(f"full: 100% of {WINDOW[0] * WINDOW[1]} pixels, ")
    assert "0° from the generating view, VDI no. 1, making the next: 0%" in text
    with pytest.raises(AttributeError):
        status.mode = "preview"


def test_corner_text_is_of_the_frame_that_shows_it(plotter, coarsest):
    actor = watched(plotter, status=True)
    annotation = actor.mapper.painter.texts._texts[0][0].Get()
    plotter.camera.Azimuth(20)
    frame(plotter, MOVING)
    texts, pictures = [], []
    for rate in (MOVING, STILL):
        pictures.append(frame(plotter, rate)[:60, :120])
        texts.append(annotation.GetText(2))
    assert texts[0].startswith("preview: 6%")
    assert texts[1].startswith("full: 100%")
    assert "20° from" in texts[1]
    frame(plotter)
    # It was laid out in that very frame: the next one, with the same text, shows the same
    annotation.SetText(2, texts[1])
    assert np.abs(pictures[0] - pictures[1]).max() > 100
    other = actor.show_status(corner="lower right")
    plotter.render()
    assert other.GetText(1).startswith("full")
    with pytest.raises(InvalidArgumentError, match="corner must be one of .*got 'middle'"):
        actor.show_status(corner="middle")
    lone = pvdi.VDIActor()
    lone.SetMapper(pvdi.VDIMapper())
    with pytest.raises(InvalidArgumentError, match="nothing shows this actor yet"):
        lone.show_status()


def test_command_line_passes_its_options_on(tmp_path, capsys):
    _small_vdi().save(tmp_path / "ball.vdi")
    file, picture = str(tmp_path / "ball.vdi"), tmp_path / "ball.png"
    options = ["--target-fps", "0", "--regenerate", "never"]
    assert main(["view", file, "--screenshot", str(picture), *options]) == 0
    plain = imread(picture).astype(int)
    assert main(["view", file, "--screenshot", str(picture), *options, "--status"]) == 0
    assert np.abs(imread(picture) - plain).max() > 100, "there is no text"
    assert main(["view", file, "--target-fps", "-3"]) == 2
    assert "frames per second, 0 or above; got '-3'" in capsys.readouterr().err
    assert main(["view", file, "--regenerate", "often"]) == 2


# -- views -----------------------------------------------------------------------------------------


def test_distance_of_views():
    bounds = (-1, 1, -1, 1, -1, 1)
    camera = Camera((0, 0, 10), (0, 0, 0), (0, 1, 0))
    view = View(camera, (300, 200))
    assert view.distance(view, bounds) == 0.0
    # 10 degrees about the vertical: the nearest corners move by about 9 tan(10 deg) at their depth
    turned = View(camera.azimuth(10), (300, 200))
    assert turned.distance(view, bounds) == pytest.approx(0.087, rel=0.2)
    assert view.distance(turned, bounds) == pytest.approx(turned.distance(view, bounds))
    panned = View(camera.replace(position=(1, 0, 10), focal_point=(1, 0, 0)), (300, 200))
    # 1 unit at depth 9, of a half height of 9 tan(15 deg)
    assert panned.distance(view, bounds) == pytest.approx(1 / (9 * np.tan(np.radians(15))))
    zoomed = View(camera.replace(view_angle=15), (300, 200))
    assert zoomed.distance(view, bounds) > 0.4
    assert View(camera, (600, 400)).distance(view, bounds) > 0.2
    inside = View(camera.replace(position=(0, 0, 0.5)), (300, 200))
    assert inside.distance(view, bounds) == np.inf
    assert inside.distance(inside, bounds) == 0.0
    parallel = camera.replace(parallel_projection=True, parallel_scale=2)
    a, b = View(parallel, (300, 200)), View(parallel.azimuth(10), (300, 200))
    assert 0.05 < a.distance(b, bounds) < 0.2


# -- the end ---------------------------------------------------------------------------------------


def test_closing_in_the_middle_leaves_no_thread(gate):
    plotter = pv.Plotter(window_size=WINDOW)
    actor = watched(plotter, regenerate=lambda status: status.angle > 10, status=True)
    plotter.camera.Azimuth(30)
    frame(plotter)
    assert actor.status.progress == 0.0
    assert len(generation_threads()) == 1
    plotter.close()
    assert not generation_threads()


def test_forgetting_a_scene_in_the_middle_leaves_no_thread(gate, no_leaks):
    def scene():
        plotter = pv.Plotter(window_size=WINDOW)
        watched(plotter, regenerate=lambda status: status.angle > 10, status=True)
        plotter.camera.Azimuth(30)
        frame(plotter)
        assert len(generation_threads()) == 1
        plotter.clear()
        plotter.close()

    scene()
    gc.collect()
    end = time.monotonic() + LONG
    while generation_threads():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_no_leaks_of_a_watched_scene(no_leaks):
    plotter = pv.Plotter(window_size=WINDOW)
    actor = watched(plotter, regenerate=lambda status: status.angle > 10, status=True)
    plotter.camera.Azimuth(30)
    frame(plotter, MOVING)
    frames_until(plotter, lambda: actor.status.generation == 2)
    plotter.screenshot()
    plotter.close()


def resident():
    with open("/proc/self/statm") as file:  # noqa: PTH123 - not a file that pathlib knows more of
        return int(file.read().split()[1]) * 4096


def regenerate_repeatedly(times):
    """Regenerate in the background again and again; bytes of memory per round, after the first."""
    plotter = pv.Plotter(window_size=(120, 100))
    actor = watched(plotter, soft_ball(16), regenerate=lambda status: status.angle > 10)
    start, runtime = None, pvdi.device.get_runtime()
    before = runtime.allocated
    for number in range(times):
        if number == times // 4:  # caches of drivers and allocators are warm
            gc.collect()
            start = resident()
        plotter.camera.Azimuth(30)
        frames_until(plotter, lambda number=number: actor.status.generation == number + 2)
    gc.collect()
    grown = resident() - start
    allocated, size = runtime.allocated - before, actor.vdi.nbytes
    plotter.camera.Azimuth(30)
    frame(plotter)  # in the middle of another
    plotter.close()
    assert not generation_threads()
    return grown / (times - times // 4), size, allocated


@pytest.mark.parametrize("times", [12, pytest.param(200, marks=pytest.mark.slow)])
def test_regenerating_does_not_take_more_and_more_memory(times):
    grown, size, allocated = regenerate_repeatedly(times)
    # A generation that was kept would show as its whole size, on the device as well: there are
    # the volume, the VDI that is shown and buffers of the frame
    assert allocated < 4 * size
    if times >= 200:
        assert grown < 0.25 * size
