"""A plotter with a window on a real (or virtual) screen, turned by a hand that is simulated.

Run as a script, with DISPLAY set: the platform's own window and interactor, its event loop, its
timers. It prints what failed and ends with status 1, or prints "all well".
"""

from __future__ import annotations

import sys
import time
import traceback
import warnings

import pyvista as pv
from plugin_scenes import LOOKS, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline.vtk import VTK_INT, calldata_type

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


def wait(plotter, happened):
    """Let events and timers be processed, without drawing anything, until something is so."""
    end = time.monotonic() + LONG
    while not happened():
        assert time.monotonic() < end, "it has not happened"
        plotter.render_window.GetInteractor().ProcessEvents()
        time.sleep(0.005)


def new_vdi_appears_by_itself():
    """At rest a VDI is made behind the frames, and shown without a frame being asked for."""
    plotter, actor = scene(regenerate="auto", settings=pvdi.Settings(regenerate_below=0.9999))
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
    wait(plotter, lambda: not actor.mapper.driver.goes_on)
    plotter.close()


def show_blocks_and_the_new_vdi_comes():
    """The same in the blocking event loop of show(); other timers do not hear of ours."""
    plotter, actor = scene(settings=pvdi.Settings(regenerate_below=0.9999))
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


CASES = (
    new_vdi_appears_by_itself,
    show_blocks_and_the_new_vdi_comes,
)


def main():
    """Run all cases."""
    warnings.simplefilter("error")
    # Matplotlib 3.8, the oldest allowed, uses what newer versions of pyparsing deprecate
    warnings.filterwarnings("default", category=DeprecationWarning, module="matplotlib")
    failed = 0
    for case in CASES:
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
