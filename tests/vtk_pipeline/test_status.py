"""What a person is told of a VDI on the screen, what may be set, and how far views are apart."""

from __future__ import annotations

import numpy as np
import pytest
from plugin_scenes import LOOKS, soft_ball
from settings import with_settings
from skimage.io import imread
from watched_windows import MOVING, STILL, frame, small_vdi, turned, watched

import pyvista_vdi as pvdi
from pyvista_vdi.cli import main
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.vtk_pipeline.filters.view import View

pytestmark = pytest.mark.gl


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("target_fps", -1, "target_fps must be a number of frames per second, .*got -1"),
        ("target_fps", "fast", "target_fps .*got 'fast'"),
        ("target_fps", np.inf, "target_fps .*got inf"),
        ("target_fps", True, "target_fps .*got True"),
        ("regenerate", "always", "regenerate must be 'auto', 'never' or a callable.*'always'"),
        ("regenerate", None, "regenerate must be .*got None"),
        ("regenerate_below", 1.5, "regenerate_below must be an SSIM .*got 1.5"),
        ("regenerate_below", "x", "regenerate_below must be an SSIM .*got 'x'"),
        ("SetInteractiveUpdateRate", -1, "interactive update rate .*got -1"),
        ("SetTargetFrameRate", np.nan, "target frame rate .*got nan"),
        ("SetRegenerate", "often", "regenerate must be"),
    ],
)
def test_nonsense_is_refused_by_name(plotter, name, value, message):
    mapper = pvdi.VDIMapper()
    give = getattr(
        mapper, name, lambda value: plotter.add_vdi(soft_ball(8), **with_settings(**{name: value}))
    )
    with pytest.raises(InvalidArgumentError, match=message):
        give(value)
    assert not plotter.actors
    assert mapper.GetRegenerate() == "auto"


def test_status_from_before_the_first_frame_on(plotter, gate, coarsest):
    actor = plotter.add_vdi(soft_ball(), regenerate="never", **LOOKS)
    assert str(actor.status) == "no VDI drawn yet"
    assert (actor.status.vdi, actor.status.fps, actor.status.share) == (None, None, 0.0)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    assert (actor.status.mode, actor.status.generation, actor.status.vdi) == ("full", 0, None)
    vdi = actor.vdi  # made now, and not when it comes from behind the frames
    frame(plotter)
    status = actor.status
    assert (status.mode, status.generation, status.vdi) == ("full", 1, vdi)
    assert (status.coverage, status.magnification) == (1.0, pytest.approx(1.0))
    assert status.fps > 0
    actor.mapper.SetDraw("vdi")  # else its own frames, which keep the rate, show changes
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    text = str(actor.status)
    assert text.startswith("preview, the volume itself: ")
    assert actor.status.stand_in
    assert not status.stand_in
    assert "0° from the generating view, VDI no. 1, making the next: 0%" in text
    with pytest.raises(AttributeError):
        status.mode = "preview"


def test_corner_text_is_of_the_frame_before(plotter, coarsest):
    plotter.window_size = (241, 203)
    actor = watched(plotter)
    annotation = actor.show_status()
    before = turned(plotter, 20, MOVING)[:60, :120]
    after = frame(plotter, STILL)[:60, :120]
    assert annotation.GetText(2).startswith("preview: 6%")
    assert np.abs(before - after).max() > 100
    frame(plotter)
    assert "20° from" in annotation.GetText(2)
    other = actor.show_status(corner="lower right")
    plotter.render()
    assert other.GetText(1).startswith("full")
    with pytest.raises(InvalidArgumentError, match="corner must be .*got 'middle'"):
        actor.show_status(corner="middle")
    lone = pvdi.VDIActor()
    lone.SetMapper(pvdi.VDIMapper())
    with pytest.raises(InvalidArgumentError, match="nothing shows this actor yet"):
        lone.show_status()


def test_command_line_passes_its_options_on(tmp_path, capsys):
    small_vdi().save(tmp_path / "ball.vdi")
    file, picture = str(tmp_path / "ball.vdi"), tmp_path / "ball.png"
    options = ["--target-fps", "0", "--regenerate", "never"]
    assert main(["view", file, "--screenshot", str(picture), *options]) == 0
    plain = imread(picture).astype(int)
    assert main(["view", file, "--screenshot", str(picture), *options, "--status"]) == 0
    assert np.abs(imread(picture) - plain).max() > 100, "there is no text"
    assert main(["view", file, "--target-fps", "-3"]) == 2
    assert "frames per second, 0 or above; got '-3'" in capsys.readouterr().err
    assert main(["view", file, "--regenerate", "often"]) == 2


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
