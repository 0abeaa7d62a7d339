"""A VDI in a PyVista plotter, with opaque geometry inside it.

What one should see: a soft ball over white, green in its middle, blue and then faintly violet
around. A light grey sphere sticks out of its right side and fades into the ball to the left.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) a picture is written; else a
window opens, in which the ball turns without being generated anew.
"""

from __future__ import annotations

import sys

import numpy as np
import pyvista as pv


def soft_ball(n: int = 96) -> pv.ImageData:
    """Density that falls from 255 at the centre to 0 at radius 1, with ripples."""
    x = np.linspace(-1, 1, n)
    radius = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    density = 255 * np.clip(1 - radius, 0, 1) * (0.8 + 0.2 * np.cos(20 * radius))
    volume = pv.ImageData(dimensions=(n, n, n), spacing=(2 / (n - 1),) * 3, origin=(-1, -1, -1))
    volume["density"] = density.astype(np.float32).ravel()
    return volume


def main() -> None:
    """Show it, or write a picture of it."""
    target = sys.argv[1] if len(sys.argv) > 1 else "plotter.png"
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    plotter = pv.Plotter(off_screen=off_screen, window_size=(640, 480))
    actor = plotter.add_vdi(soft_ball(), cmap="viridis", opacity=[0, 0.02, 0.1, 0.4, 0.8])
    plotter.add_mesh(pv.Sphere(radius=0.35, center=(-0.5, 0.35, -0.1)), color="white")
    if not off_screen:
        plotter.show()
        return
    plotter.screenshot(target)
    print(f"{actor.vdi}\nwritten: {target}")
    plotter.close()


if __name__ == "__main__":
    main()
