"""Two volumes that overlap: VTK's picture depends on the order of adding, a VDI's does not.

What one should see: a red and a blue-green ball, the red one before the other and half inside it.
Above, VTK's volumes, added in either order: in one of the pictures the blue-green ball covers the
red one, which it is behind. Below, VDIs, added in either order: twice the same picture.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) a picture is written; else a
window opens.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pyvista as pv

#: Colour map and centre of the two.
BALLS = (("viridis", (0.0, 0.0, 0.0)), ("hot", (0.9, 0.4, 0.2)))


def soft_ball(n: int = 48) -> pv.ImageData:
    """Density that falls from 255 at the centre to 0 at radius 1."""
    x = np.linspace(-1, 1, n)
    radius = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    volume = pv.ImageData(dimensions=(n, n, n), spacing=(2 / (n - 1),) * 3, origin=(-1, -1, -1))
    volume["density"] = (255 * np.clip(1 - radius, 0, 1)).astype(np.float32).ravel()
    return volume


def main() -> None:
    """Show it, or write a picture of it."""
    target = sys.argv[1] if len(sys.argv) > 1 else "overlap.png"
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    plotter = pv.Plotter(off_screen=off_screen, window_size=(640, 480), shape=(2, 2), border=False)
    actor: Any = None
    for row, kind in enumerate(("add_volume", "add_vdi")):
        for column, order in enumerate((BALLS, BALLS[::-1])):
            plotter.subplot(row, column)
            for cmap, place in order:
                matrix = pv.Transform().translate(*place).matrix
                actor = getattr(plotter, kind)(
                    soft_ball(),
                    cmap=cmap,
                    opacity="linear",
                    opacity_unit_distance=0.2,
                    show_scalar_bar=False,
                    user_matrix=matrix,
                )
            which = ("blue-green first", "red first")[column]
            plotter.add_text(f"{kind}, {which}", font_size=8)
            plotter.camera_position = ((4, 3, 2), (0.4, 0.2, 0.1), (0, 0, 1))
    if not off_screen:
        plotter.show()
        return
    plotter.screenshot(target)
    print(f"{actor.vdi}\nwritten: {target}")
    plotter.close()


if __name__ == "__main__":
    main()
