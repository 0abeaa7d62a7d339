"""One dial: the shipped brain as fast as can be, in balance, and good.

What one should see: the same brain three times, turned by 30 degrees from where its VDI was made.
On the left, in the cheapest VDI, outlines are cut into coarse steps; in the middle there are finer
ones; on the right hardly any. In a corner of each stand the settings that the dial chose and what
it predicts of them.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) a picture is written; else a
window opens.
"""

from __future__ import annotations

import sys

import pyvista as pv

from pyvista_vdi import examples


def main() -> None:
    """Show it, or write a picture of it."""
    target = sys.argv[1] if len(sys.argv) > 1 else "dial.png"
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    plotter = pv.Plotter(off_screen=off_screen, window_size=(900, 360), shape=(1, 3), border=False)
    brain = examples.load_brain()
    for column, quality in enumerate(("fast", "balanced", "high")):
        plotter.subplot(0, column)
        plotter.set_background("black")
        # Off-screen a plotter draws a volume itself, by default: a VDI pays from some frames on
        actor = plotter.add_vdi(
            brain, cmap="bone", quality=quality, draw="vdi", show_scalar_bar=False
        )
        actor.show_status()
        plotter.camera.azimuth = 0
    plotter.show(auto_close=False, interactive=False)  # the VDIs are made in this view
    for column in range(3):
        plotter.subplot(0, column)
        plotter.camera.Azimuth(37)  # from obliquely above: by 30 degrees
    if not off_screen:
        plotter.show()
        return
    plotter.render()
    plotter.screenshot(target)
    print(f"{actor.status}\nwritten: {target}")
    plotter.close()


if __name__ == "__main__":
    main()
