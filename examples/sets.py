"""A knot of fog seen from all sides: a set of VDIs, saved, opened without the volume, and turned.

What one should see: a bright knot that makes one turn, with nothing that jumps when another VDI
becomes the nearest.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) a movie of the turn is
written; else a window opens, in which the mouse turns.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import pyvista_vdi as pvdi

POINTS, SIZE, FRAMES = 44, (200, 150), 24


def knot() -> pvdi.Volume:
    """Return fog around a trefoil knot, uint8 (z, y, x)."""
    t = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    curve = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)])
    axis = np.linspace(-1, 1, POINTS)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    nearest = np.full(x.shape, np.inf)
    for a, b, c in (curve * 0.28).T:
        np.minimum(nearest, (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2, out=nearest)
    return pvdi.Volume(
        (255 * np.exp(-nearest / 0.012)).astype(np.uint8), (2 / (POINTS - 1),) * 3, (-1, -1, -1)
    )


def main() -> None:
    """Make the set and its file, and show it, or write a movie."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "sets.gif")
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    made = pvdi.generate_set(knot(), 32, SIZE, max_supersegments=6, cmap="inferno")
    file = made.save(target.with_suffix(".vdiset"))
    print(f"{file.name}: {len(made)} VDIs, {file.stat().st_size / 2**20:.1f} MiB")

    vdis = pvdi.read(file)  # by anybody: the volume is not needed any more
    plotter = pv.Plotter(off_screen=off_screen, window_size=SIZE)
    plotter.add_vdi(vdis, show_scalar_bar=False)
    view = vdis.camera
    plotter.camera_position = (view.position, view.focal_point, view.view_up)
    if not off_screen:
        plotter.show()
        return
    plotter.open_gif(str(target), fps=12)
    for _ in range(FRAMES):
        plotter.camera.Azimuth(360 / FRAMES)
        plotter.write_frame()
    plotter.close()
    print(f"written: {target}")


if __name__ == "__main__":
    main()
