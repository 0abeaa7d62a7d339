"""A plotter with a window on a real (or virtual) screen, turned by a hand that is simulated.

Run as a script, with DISPLAY set: the platform's own window and interactor, its event loop, its
timers. It prints what failed and ends with status 1, or prints "all well".
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
import traceback
import warnings
from itertools import pairwise

import numpy as np
import pyvista as pv
from PIL import ImageGrab
from plugin_scenes import LOOKS, soft_ball
from skimage.io import imread

import pyvista_vdi as pvdi
from pyvista_vdi.quality.rate import FrameRate
from pyvista_vdi.vtk_pipeline.vtk import VTK_INT, calldata_type, vtk_to_numpy, vtkUnsignedCharArray

LONG = 250.0


class Hand:
    """Mouse events at an interactor, as a window system sends them."""

    def __init__(self, plotter):
        self.interactor = plotter.render_window.GetInteractor()

    def send(self, event, x, y):
        """Invoke an event at a place."""
        self.interactor.SetEventInformation(x, y, 0, 0, "\0", 0, None)
        self.interactor.InvokeEvent(event)

    def press(self, x, y):
        """Press the left button."""
        self.send("MouseMoveEvent", x, y)
        self.send("LeftButtonPressEvent", x, y)

    def move(self, x, y):
        """Move the mouse."""
        self.send("MouseMoveEvent", x, y)

    def release(self, x, y):
        """Let go of the button."""
        self.send("LeftButtonReleaseEvent", x, y)


def scene(**options):
    """A plotter with a ball of two supersegments per list."""
    plotter = pv.Plotter(off_screen=False, window_size=(241, 203))
    actor = plotter.add_vdi(soft_ball(), max_supersegments=2, **{"draw": "vdi", **LOOKS, **options})
    plotter.camera_position = ((6, 0, 0), (0, 0, 0), (0, 0, 1))
    return plotter, actor


def vdi_from(volume):
    """A small VDI of a ball."""
    camera = pvdi.Camera((5, 4, 3), (0, 0, 0), (0, 0, 1))
    looks = {name: value for name, value in LOOKS.items() if name != "show_scalar_bar"}
    return pvdi.generate(volume, camera, (60, 50), **looks)


def wait(plotter, happened):
    """Let events and timers be processed, without drawing anything, until something is so."""
    end = time.monotonic() + LONG
    while not happened():
        assert time.monotonic() < end, "it has not happened"
        plotter.render_window.GetInteractor().ProcessEvents()
        time.sleep(0.005)


def pixels(plotter):
    """What the window shows; nothing is drawn for it."""
    width, height = plotter.render_window.GetSize()
    values = vtkUnsignedCharArray()
    plotter.render_window.GetPixelData(0, 0, width - 1, height - 1, 1, values, 0)
    return vtk_to_numpy(values).astype(int)


def previews_and_screenshots():
    """A drag draws previews, its end a full frame, and a screenshot in its middle is full."""
    plotter, actor = scene(regenerate="never")
    plotter.show(interactive_update=True, auto_close=False)
    assert plotter.render_window.GetShowWindow()
    hand = Hand(plotter)
    hand.press(100, 100)
    for x in (105, 110, 115):
        hand.move(x, 100)
        assert actor.status.mode == "preview", actor.status
    before = plotter.camera.position
    shot = np.asarray(plotter.screenshot(return_img=True)).astype(int)
    assert actor.status.mode == "full", actor.status
    hand.move(120, 100)
    assert actor.status.mode == "preview", actor.status
    hand.move(115, 100)
    hand.release(115, 100)
    assert actor.status.mode == "full", actor.status
    np.testing.assert_allclose(plotter.camera.position, before, atol=1e-6)
    rest = np.asarray(plotter.screenshot(return_img=True)).astype(int)
    assert np.abs(rest - shot).max() <= 1, "the screenshot was of a preview"
    plotter.close()


def multisampling_goes_while_late_and_is_back_at_rest():
    """A drag whose frames are late with it goes without; its end, and a screenshot, have it."""
    plotter, _ = scene(regenerate="never")
    window = plotter.render_window
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    plotter.add_mesh(pv.Sphere(radius=0.4, center=(0, 1.3, 0.9)), color="w", reset_camera=False)
    plotter.show(interactive_update=True, auto_close=False)
    samples = []

    def begun(*_):
        samples.append(window.GetMultiSamples())
        time.sleep(0.1 if samples[-1] else 0.0)

    plotter.renderer.AddObserver("StartEvent", begun)
    plotter.camera.Azimuth(1)
    plotter.render()
    full, view = pixels(plotter), plotter.camera_position
    hand = Hand(plotter)
    for at_first in (4, 0):
        hand.press(100, 100)
        samples.clear()
        for x in (105, 110, 115):
            hand.move(x, 100)
        assert samples == [at_first, 0, 0], samples
        assert window.GetMultiSamples() == 4
        plotter.screenshot(return_img=True)
        assert 4 in samples
        plotter.camera_position = view
        hand.release(115, 100)
        assert samples[-1] == 4
        np.testing.assert_array_equal(pixels(plotter), full)
    hand.press(100, 100)
    hand.move(105, 100)
    plotter.close()


def new_vdi_appears_by_itself():
    """At rest a VDI is made behind the frames, and shown without a frame being asked for."""
    plotter, actor = scene(regenerate="auto", settings=pvdi.Settings(regenerate_below=0.9999))
    actor.show_status()
    plotter.show(interactive_update=True, auto_close=False)
    old = actor.vdi
    hand = Hand(plotter)
    hand.press(100, 100)
    for x in (105, 110, 115):
        hand.move(x, 100)
    hand.release(115, 100)
    turned = plotter.camera.position
    wait(plotter, lambda: actor.status.generation == 2)
    assert actor.vdi is not old
    assert actor.status.angle < 1e-6
    assert plotter.camera.position == turned
    wait(plotter, lambda: not actor.mapper.driver.following)
    plotter.close()


def held_still_nothing_turns_and_moving_shows_the_new_vdi():
    """No timer of ours turns the view while a button is held; the next motion shows the new VDI."""
    plotter, actor = scene(regenerate=lambda status: status.angle > 5)
    plotter.show(interactive_update=True, auto_close=False)
    hand = Hand(plotter)
    plotter.camera.Azimuth(10)
    plotter.render()
    assert actor.mapper.driver.following
    hand.press(100, 100)
    assert not actor.mapper.driver.following
    hand.move(95, 100)  # away from the VDI's view
    held = plotter.camera.position
    wait(plotter, lambda: actor.status.progress is None)
    assert plotter.camera.position == held
    assert actor.status.generation == 1
    hand.move(94, 100)
    assert actor.status.generation == 2
    hand.release(94, 100)
    wait(plotter, lambda: not actor.mapper.driver.following)
    plotter.close()


def show_blocks_and_the_new_vdi_comes():
    """The same in the blocking event loop of show(); other timers do not hear of ours."""
    plotter, actor = scene(regenerate=lambda status: status.angle > 5)
    seen, others = [], []
    interactor = plotter.render_window.GetInteractor()

    @calldata_type(VTK_INT)
    def on_timer(_caller, _event, timer):
        if timer != mine:
            others.append(timer)
        seen.append(actor.status.generation)
        if len(seen) == 5:
            plotter.camera.Azimuth(30)
            plotter.render()
        if seen[-1] == 2 or len(seen) > 2000:
            interactor.TerminateApp()

    interactor.AddObserver("TimerEvent", on_timer)
    mine = plotter.iren.create_timer(20)
    plotter.show()
    assert seen[-1] == 2, seen[-1]
    assert not others


def closing_in_the_middle():
    """Closing while a VDI is made leaves neither thread nor crash."""
    plotter, actor = scene(
        settings=pvdi.Settings(sample_distance=0.002), regenerate=lambda status: status.angle > 5
    )
    plotter.show(interactive_update=True, auto_close=False)
    plotter.camera.Azimuth(30)
    plotter.render()
    assert actor.status.progress is not None
    plotter.close()
    left = [t for t in threading.enumerate() if t.name.startswith("pyvista-vdi")]
    assert not left, left


def every_change_is_shown():
    """Changes that come faster than VDIs: each is seen, written and shot as it was set."""
    plotter = pv.Plotter(off_screen=False, window_size=(241, 203))
    volume = soft_ball()
    values = volume["v"].copy()
    actor = plotter.add_vdi(volume, settings=pvdi.Settings(sample_distance=0.002), **LOOKS)
    plotter.show(interactive_update=True, auto_close=False)
    shown = []
    for step in range(20):
        volume["v"][:] = values * (0.4 if step % 2 else 0.6 + 0.02 * step)
        plotter.update()
        shown.append(pixels(plotter))
    assert all(np.abs(b - a).max() > 4 for a, b in pairwise(shown)), "a change was not shown"
    frames = []
    volume["v"][:] = values
    for cmap in ("inferno", "bone", "viridis"):
        actor.mapper.lookup_table.cmap = cmap
        plotter.update()
        shot = np.asarray(plotter.screenshot(return_img=True)).astype(int)
        assert actor.status.mode == "full", actor.status
        frames.append(shot)
    assert all(np.abs(b - a).max() > 40 for a, b in pairwise(frames))
    # Where a pixel lies across the border of a step, VDI and volume may differ by more
    wait(plotter, lambda: actor.status.progress is None and not actor.status.stand_in)
    rest = np.asarray(plotter.screenshot(return_img=True)).astype(int)
    assert np.abs(rest - frames[-1]).max() <= 2, np.abs(rest - frames[-1]).max()
    plotter.close()


def a_movie_has_every_step():
    """Ten steps, written one after the other, are ten pictures."""
    volume = soft_ball()
    values = volume["v"].copy()
    with tempfile.TemporaryDirectory() as folder:
        name = f"{folder}/steps.gif"
        plotter = pv.Plotter(off_screen=False, window_size=(241, 203))
        plotter.add_vdi(volume, settings=pvdi.Settings(sample_distance=0.002), **LOOKS)
        plotter.show(interactive_update=True, auto_close=False)
        plotter.open_gif(name)
        for step in range(10):
            volume["v"][:] = values * (1 - 0.08 * step)
            plotter.write_frame()
        plotter.close()
        pictures = np.array(imread(name)).astype(int)
    assert len(pictures) == 10
    assert all(np.abs(b - a).max() > 4 for a, b in pairwise(pictures))


def a_series_plays_by_itself_and_goes_on_after_a_turn():
    """Steps follow each other without a frame being asked for, before and after a hand turns."""
    vdis = [vdi_from(soft_ball(12 + k)) for k in range(3)]
    plotter = pv.Plotter(off_screen=False, window_size=(241, 203))
    actor = plotter.add_vdi(pvdi.VDISeries(vdis), show_scalar_bar=False, regenerate="never")
    actor.play(rate=30)
    plotter.show(interactive_update=True, auto_close=False)
    seen = {}
    wait(plotter, lambda: seen.setdefault(actor.step) or len(seen) == 3)
    hand = Hand(plotter)
    hand.press(100, 100)
    assert not actor.mapper.driver.following
    for x in (105, 110, 115):
        hand.move(x, 100)
    hand.release(115, 100)
    seen.clear()
    wait(plotter, lambda: seen.setdefault(actor.step) or len(seen) == 3)
    actor.pause()
    wait(plotter, lambda: not actor.mapper.driver.following)
    plotter.close()


def the_screen_shows_every_pixel_and_depth_is_read():
    """The X server has what VTK drew, which is what it draws with nothing left out."""
    plotter, actor = scene(regenerate="never")
    plotter.add_mesh(pv.Sphere(radius=0.4, center=(0, 1.3, 0.9)), color="w", reset_camera=False)
    plotter.show(interactive_update=True, auto_close=False)
    window = plotter.render_window
    left, top = window.GetPosition()
    width, height = window.GetSize()
    hand = Hand(plotter)
    hand.press(100, 100)
    actor.mapper.driver.release()
    window.Render()
    assert window.GetFrameBlitMode() == window.BlitToHardware
    for mode in ("preview", "full"):
        assert actor.status.mode == mode, actor.status
        drawn = pixels(plotter).reshape(height, width, 3)[::-1]
        window.WaitForCompletion()
        on_screen = np.asarray(ImageGrab.grab(xdisplay=os.environ["DISPLAY"])).astype(int)
        on_screen = on_screen[top : top + height, left : left + width, :3]
        np.testing.assert_array_equal(on_screen, drawn)
        assert np.ptp(drawn) > 100
        depth = plotter.get_image_depth(fill_value=np.nan)
        assert np.isfinite(depth).any()
        assert np.isnan(depth).any()
        hand.release(100, 100)
    plotter.close()


CASES = (
    the_screen_shows_every_pixel_and_depth_is_read,
    a_series_plays_by_itself_and_goes_on_after_a_turn,
    every_change_is_shown,
    a_movie_has_every_step,
    previews_and_screenshots,
    multisampling_goes_while_late_and_is_back_at_rest,
    new_vdi_appears_by_itself,
    held_still_nothing_turns_and_moving_shows_the_new_vdi,
    show_blocks_and_the_new_vdi_comes,
    closing_in_the_middle,
)


def main():
    """Run all cases, or those that are named."""
    warnings.simplefilter("error")
    # Matplotlib 3.8, the oldest allowed, uses what newer versions of pyparsing deprecate
    warnings.filterwarnings("default", category=DeprecationWarning, module="matplotlib")
    # Every preview as coarse as it may be, whatever frames take
    FrameRate.chosen = lambda rate, full: 1
    failed = 0
    for case in CASES:
        if len(sys.argv) > 1 and case.__name__ not in sys.argv[1:]:
            continue
        try:
            case()
        except Exception as error:
            failed += 1
            place = traceback.extract_tb(error.__traceback__)[-1]
            print(
                f"{case.__name__}, line {place.lineno}, {place.line}: "
                f"{type(error).__name__}: {error}",
                flush=True,
            )
    print("all well" if not failed else f"{failed} failed", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
