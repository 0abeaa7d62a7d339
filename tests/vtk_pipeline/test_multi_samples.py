"""Multisampling, which goes before rays do while a view moves, and is the user's at rest."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, soft_ball
from watched_windows import MOVING, frame, on_screen, turned, watched

import pyvista_vdi as pvdi
from pyvista_vdi.quality.rate import HEADROOM

pytestmark = pytest.mark.gl

SAMPLES = 4
#: Of the clock's time, so that all rays (12 ms) are kept without multisampling and not with it.
RATE = 30.0


@pytest.fixture
def taken(plotter, counted):
    """Samples of each frame so far; with them, it takes ``seconds`` more of the clock's time."""

    class Taken(list):
        seconds = 0.04

    taken = Taken()

    def begun(*_):
        taken.append(plotter.render_window.GetMultiSamples())
        counted.now += taken.seconds if taken[-1] else 0.0

    plotter.renderer.AddObserver("StartEvent", begun)
    plotter.enable_anti_aliasing("msaa", multi_samples=SAMPLES)
    # Its edge is beside the VDI
    plotter.add_mesh(pv.Sphere(radius=0.4, center=(0, 1.3, 0.9)), color="w")
    return taken


def moved(plotter, taken, frames=3, degrees=0.01):
    """Turn the view a little in a motion; the samples of its frames."""
    taken.clear()
    for _ in range(frames):
        turned(plotter, degrees, MOVING)
    return taken[-frames:]


def test_it_goes_before_rays_do_and_is_back_at_rest(plotter, taken):
    actor = watched(plotter, target_fps=RATE)
    full = turned(plotter, 1)
    assert moved(plotter, taken) == [SAMPLES, 0, 0], "a late frame tells the next"
    assert actor.status.share == 1.0
    preview = turned(plotter, -0.03, MOVING)
    assert np.abs(preview - full).max() > 8, "the mesh's edge is as smooth"
    assert plotter.render_window.GetMultiSamples() == SAMPLES, "between frames it is the user's"
    np.testing.assert_array_equal(frame(plotter), full)
    assert taken[-1] == SAMPLES
    assert moved(plotter, taken) == [0, 0, 0], "the motion before has told"
    assert actor.status.share == 1.0


def test_it_stays_where_frames_are_in_time(plotter, taken, counted):
    """And where one was held up by something else, or only rays make them late."""
    actor = watched(plotter, target_fps=15.0 / HEADROOM)
    turned(plotter, 1)
    assert moved(plotter, taken) == [SAMPLES] * 3
    assert actor.status.share == 1.0
    taken.seconds = 0.0
    frame(plotter)
    moved(plotter, taken, frames=1)
    taken.seconds = 0.2  # a frame that something held up
    moved(plotter, taken, frames=1)
    taken.seconds = 0.0
    assert moved(plotter, taken) == [SAMPLES] * 3
    counted.dear = 100.0
    turned(plotter, 1)
    assert moved(plotter, taken) == [SAMPLES] * 3
    assert actor.status.share < 1


@pytest.mark.parametrize(
    "shoot",
    [
        lambda plotter, _: plotter.screenshot(return_img=True),
        lambda plotter, _: plotter.screenshot(return_img=True, scale=2),
        lambda plotter, _: _quarter(plotter),
        lambda plotter, _: plotter.get_image_depth(),
        lambda plotter, path: _vector_graphics(plotter, path),
        lambda plotter, path: _movie_frame(plotter, path),
    ],
    ids=["screenshot", "tiles", "tile", "depth", "vector graphics", "movie"],
)
def test_pictures_in_a_motion_have_it(plotter, taken, shoot, tmp_path):
    watched(plotter, target_fps=RATE)
    turned(plotter, 1)
    moved(plotter, taken)
    frame(plotter)
    view, at_rest = plotter.camera_position, shoot(plotter, tmp_path)
    moved(plotter, taken, degrees=5)
    plotter.camera_position = view
    frame(plotter, MOVING)
    assert set(taken) == {0}
    in_motion = shoot(plotter, tmp_path)
    assert SAMPLES in taken
    np.testing.assert_array_equal(in_motion, at_rest)
    assert moved(plotter, taken) == [0, 0, 0], "the motion goes on"


def _quarter(plotter):
    window = plotter.render_window
    window.SetTileScale(2)
    window.SetTileViewport(0, 0, 0.5, 0.5)
    plotter.render()
    window.SetTileScale(1)
    window.SetTileViewport(0, 0, 1, 1)
    return on_screen(window)


def _vector_graphics(plotter, path):
    plotter.save_graphic(str(path / "scene.svg"))
    return (path / "scene.svg").read_text().partition("<defs>")[2]  # behind the date


def _movie_frame(plotter, path):
    pictures = []
    plotter.open_gif(str(path / "movie.gif"))
    plotter.mwriter.append_data = pictures.append
    plotter.write_frame()
    return pictures[0]


def test_whoever_sets_it_meanwhile_is_heeded(plotter, taken):
    watched(plotter, target_fps=RATE)
    turned(plotter, 1)
    window = plotter.render_window
    assert moved(plotter, taken) == [SAMPLES, 0, 0]
    plotter.enable_anti_aliasing("msaa", multi_samples=2)
    assert moved(plotter, taken) == [0, 0, 0]
    frame(plotter)
    assert window.GetMultiSamples() == taken[-1] == 2
    for turn_off in (plotter.disable_anti_aliasing, lambda: plotter.enable_anti_aliasing("ssaa")):
        turn_off()
        assert moved(plotter, taken) == [0, 0, 0]
        frame(plotter)
        assert window.GetMultiSamples() == taken[-1] == 0
        plotter.enable_anti_aliasing("msaa", multi_samples=SAMPLES)
    # Within a frame, too
    once = plotter.renderer.AddObserver("EndEvent", lambda *_: window.SetMultiSamples(2))
    assert moved(plotter, taken) == [0, 0, 0]
    plotter.renderer.RemoveObserver(once)
    frame(plotter)
    assert window.GetMultiSamples() == taken[-1] == 2


def test_a_frame_that_fails_gives_it_back(plotter, taken, monkeypatch):
    watched(plotter, target_fps=RATE)
    turned(plotter, 1)
    moved(plotter, taken)

    def fail(*_):
        raise RuntimeError("broken")

    monkeypatch.setattr("pyvista_vdi.vtk_pipeline.drawing.images.render_vdi", fail)
    with pytest.warns(UserWarning, match="broken"):
        assert moved(plotter, taken, frames=1) == [0]
    assert plotter.render_window.GetMultiSamples() == SAMPLES


def test_only_vdis_that_are_shown_let_it_go(plotter, taken):
    """All of them must: one that keeps it keeps it for the window."""
    first = watched(plotter, target_fps=RATE)
    second = plotter.add_vdi(
        soft_ball(8),
        target_fps=RATE,
        settings=pvdi.Settings(adjust_multi_samples=False),
        regenerate="never",
        draw="vdi",
        **LOOKS,
    )
    second.mapper.SetInteractiveOffScreen(True)
    second.scale, second.position = 0.3, (0, 0, 1.55)
    assert not second.mapper.GetAutoAdjustMultiSamples()
    turned(plotter, 1)
    assert moved(plotter, taken) == [SAMPLES] * 3
    second.mapper.SetAutoAdjustMultiSamples(True)
    assert moved(plotter, taken) == [0, 0, 0]
    second.mapper.SetTargetFrameRate(0)  # every frame is full
    assert moved(plotter, taken) == [SAMPLES] * 3
    second.visibility = False
    assert moved(plotter, taken) == [0, 0, 0]
    plotter.remove_actor(first)
    assert moved(plotter, taken) == [SAMPLES] * 3, "there is none"


def test_off_screen_it_stays(plotter, taken):
    actor = watched(plotter, target_fps=RATE)
    actor.mapper.SetInteractiveOffScreen(None)
    turned(plotter, 1)
    assert moved(plotter, taken) == [SAMPLES] * 3
