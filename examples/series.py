"""A plume that rises in a wind: a series of VDIs, written step by step, opened, and played.

What one should see: a yellow and violet plume that rises step by step and bends to the right, while
the view turns around it.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) a movie of all steps is
written; else a window opens, in which the series plays, a slider seeks and the mouse turns.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import pyvista_vdi as pvdi

STEPS, POINTS, SIZE = 12, 48, (480, 360)


def density(step: int) -> pvdi.Volume:
    """Return a step of the plume, uint8 (z, y, x): it could come from a simulation's file."""
    z, y, x = np.mgrid[-1 : 1 : POINTS * 1j, -1 : 1 : POINTS * 1j, -1 : 1 : POINTS * 1j]
    time, height = step / STEPS, (z + 1) / 2
    along = x + 0.3 - 0.6 * height**2 * (0.4 + time)
    radius = 0.08 + 0.25 * height
    puffs = 1 + 0.5 * np.sin(9 * (height - 2 * time)) * np.cos(6 * y + 3 * along)
    values = np.exp(-(along**2 + y**2) / radius**2) * (1 - height**3) * puffs
    values *= height < 0.3 + time
    return pvdi.Volume(
        np.clip(200 * values, 0, 255).astype(np.uint8), (2 / (POINTS - 1),) * 3, (-1, -1, -1)
    )


def main() -> None:
    """Write the series, and show it, or write a movie."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "series.gif")
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    camera = pvdi.Camera((1.5, -5, 1), (0, 0, 0), (0, 0, 1))
    look = {"cmap": "inferno", "opacity": "linear", "clim": (0, 255)}
    folder = target.with_suffix(".vdis")
    with pvdi.SeriesWriter(folder, camera, SIZE, overwrite=True, **look) as out:
        for step in range(STEPS):
            out.append(density(step), 0.1 * step)
    on_disk = sum(file.stat().st_size for file in folder.iterdir())
    print(f"{folder.name}: {len(out)} steps, {on_disk / 2**20:.1f} MiB")
    series = pvdi.read(folder)  # by anybody: the volumes are not needed any more

    plotter = pv.Plotter(off_screen=off_screen, window_size=SIZE)
    actor = plotter.add_vdi(series, show_scalar_bar=False)
    plotter.camera_position = (camera.position, camera.focal_point, camera.view_up)
    if not off_screen:
        player, ends = actor.player, (series.times[0], series.times[-1])
        plotter.add_slider_widget(lambda time: setattr(player, "time", time), ends, title="time")
        player.play(rate=10)
        plotter.show()
        return
    plotter.open_gif(str(target), fps=10)
    for time in series.times:
        actor.player.time = time
        plotter.camera.Azimuth(1)
        plotter.write_frame()
    plotter.close()
    print(f"written: {target}")


if __name__ == "__main__":
    main()
