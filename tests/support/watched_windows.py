"""Plotters whose window counts as watched by somebody, and what holds up or hurries their work."""

from __future__ import annotations

import threading
import time

import pytest
import pyvista as pv
from plugin_scenes import CLASSIFICATION, LOOKS, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.quality import background
from pyvista_vdi.quality.rate import FrameRate
from pyvista_vdi.quality.view_error import ViewError
from pyvista_vdi.vtk_pipeline.drawing import driver
from pyvista_vdi.vtk_pipeline.vtk import vtk_to_numpy, vtkUnsignedCharArray

#: Odd, so that no smaller image divides it.
WINDOW = (121, 103)
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
    """Holds up what is generated in the background, until it is set; ``begun`` counts it."""
    gate = threading.Event()
    gate.begun = 0
    generate_vdi = background.generate_vdi

    def gated(request):
        gate.begun += 1
        while not gate.is_set():
            request.device.give_way()
            time.sleep(0.001)
        return generate_vdi(request)

    monkeypatch.setattr(background, "generate_vdi", gated)
    yield gate
    gate.set()


@pytest.fixture
def coarsest(monkeypatch):
    """Every preview is as coarse as it may be, whatever frames take."""
    monkeypatch.setattr(FrameRate, "chosen", lambda rate, full: 1)


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

        def estimate(self, *_, **__):
            answer.asked += 1
            return ViewError(answer.ssim, 1)

    monkeypatch.setattr(driver, "ViewErrorEstimator", Estimator)
    return answer


def watched(plotter, volume=None, **options):
    """Add a ball to a plotter whose window counts as watched, and show it."""
    options = {"regenerate": "never", "draw": "vdi", **LOOKS, **options}
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


def turned(plotter, degrees, rate=STILL):
    """Turn the view, and draw a frame; while a hand moves, it draws at the rate MOVING."""
    plotter.camera.Azimuth(degrees)
    return frame(plotter, rate)


def frames(plotter, count):
    """Draw frames of the same view."""
    for _ in range(count):
        frame(plotter)


def frames_until(plotter, happened):
    """Draw frames at rest until something is so; all pictures."""
    pictures = []
    end = time.monotonic() + LONG
    while not happened():
        assert time.monotonic() < end, "it has not happened"
        pictures.append(frame(plotter))
        time.sleep(0.005)
    return pictures


def threads(work="generation"):
    """Threads that do a kind of work behind the frames."""
    return [t for t in threading.enumerate() if t.name == f"pyvista-vdi {work}"]


def finish(work="generation"):
    """Wait for what is done behind the frames."""
    for thread in threads(work):
        thread.join(LONG)
        assert not thread.is_alive()


def picture_of(thing, plotter, **options):
    """What another plotter shows of a VDI or a volume, from this one's view, waiting for it."""
    other = pv.Plotter(window_size=plotter.window_size)
    other.add_vdi(thing, show_scalar_bar=False, regenerate="never", **options)
    other.camera = plotter.camera.copy()
    other.show(auto_close=False)
    picture = frame(other)
    other.close()
    return picture


def coarse(plotter, **options):
    """A ball with two supersegments per list: its VDIs of different views differ visibly."""
    actor = watched(plotter, max_supersegments=2, **options)
    plotter.render_window.SetDesiredUpdateRate(STILL)
    return actor


def small_vdi():
    camera = pvdi.Camera((5, 4, 3), (0, 0, 0), (0, 0, 1))
    return pvdi.generate(soft_ball(12), camera, (60, 50), **CLASSIFICATION)
