"""Ambient occlusion: the shipped brain without and with it.

What one should see: the same brain twice, seen from behind and above. On the left it is pale and
flat: the colour map is all there is. On the right the furrows are dark, the deeper the darker, and
the folds between them stand out as rounded ridges, although there is no lamp.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) a picture is written; else a
window opens.
"""

from __future__ import annotations

import sys

import pyvista as pv

from pyvista_vdi import AmbientOcclusion, examples


def main() -> None:
    """Show it, or write a picture of it."""
    target = sys.argv[1] if len(sys.argv) > 1 else "occlusion.png"
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    plotter = pv.Plotter(off_screen=off_screen, window_size=(640, 480), shape=(1, 2), border=False)
    brain = examples.load_brain()
    for column, occlusion in enumerate((None, AmbientOcclusion(strength=0.15))):
        plotter.subplot(0, column)
        plotter.set_background("black")
        actor = plotter.add_vdi(
            brain,
            cmap="bone",
            opacity=[0, 0, 0, 0.6, 1, 1],
            interpolation="linear",
            ambient_occlusion=occlusion,
            show_scalar_bar=False,
        )
    plotter.link_views()
    plotter.camera_position = [(90.0, -330.0, 260.0), (90.0, 108.0, 88.0), (0.0, 0.0, 1.0)]
    if not off_screen:
        plotter.show()
        return
    plotter.screenshot(target)
    print(f"{actor.vdi}\nwritten: {target}")
    plotter.close()


if __name__ == "__main__":
    main()
