"""Choose a volume's opacities and colours over its picture, by the mouse.

What one should see: a brain, and in the upper right corner its values' histogram, with the opacity
curve over it. Double-click it; then drag its points, click to add one, press Delete to delete one.
A double-click beside it gives the mouse back to the camera.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) the same is done by program,
and a picture is written: white matter, bright, within a translucent brain.
"""

from __future__ import annotations

import sys

import pyvista as pv

import pyvista_vdi as pvdi


def main() -> None:
    """Show it, or write a picture of it."""
    target = sys.argv[1] if len(sys.argv) > 1 else "transfer_function.png"
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    plotter = pv.Plotter(off_screen=off_screen, window_size=(640, 480))
    volume = pvdi.examples.load_brain()
    brain = plotter.add_vdi(volume, cmap="bone", opacity="sigmoid_10", show_scalar_bar=False)
    editor = plotter.vdi.add_transfer_function_editor(brain)
    plotter.camera_position = [(-90, 550, 340), (70, 108, 105), (0, 0, 1)]
    if not off_screen:
        plotter.show()
        return
    editor.points = [(60, 0.0), (80, 0.04), (100, 0.03), (118, 0.9)]
    editor.apply_cmap("inferno")
    plotter.show(auto_close=False)
    plotter.screenshot(target)
    print(f"{brain.vdi}\nwritten: {target}")
    plotter.close()


if __name__ == "__main__":
    main()
