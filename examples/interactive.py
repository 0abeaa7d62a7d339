"""What one sees while a hand turns a VDI: previews, a full frame at rest, and a new VDI.

What one should see, with the status in the upper left corner: a brain turns, a little blurred when
the device has other things to do; once it is 30 degrees from the generating view another VDI is
made, and the old one is drawn until it is there; then the brain rests, sharp.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) the hand is simulated and an
animation (GIF) is written; else a window opens, and the hand is yours.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline.vtk import vtk_to_numpy, vtkUnsignedCharArray

#: Pictures per second of the animation, and of the simulated hand.
RATE = 12
#: Pictures in which the hand turns the view; it rests until the VDI is there, and a little longer.
TURNING, RESTING, LONGEST_REST = 30, 8, 100


def seen(plotter: pv.Plotter) -> Image.Image:
    """What the window shows now. A screenshot would be full, even of a preview."""
    window = plotter.render_window
    width, height = window.GetSize()
    pixels = vtkUnsignedCharArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 1, pixels, 0)
    return Image.fromarray(
        np.ascontiguousarray(vtk_to_numpy(pixels).reshape(height, width, 3)[::-1])
    )


def frame(plotter: pv.Plotter, update_rate: float) -> Image.Image:
    """Draw a frame as an interactor has it drawn, in time with the animation."""
    began = time.perf_counter()
    plotter.render_window.SetDesiredUpdateRate(update_rate)
    plotter.render()
    time.sleep(max(0.0, 1 / RATE - (time.perf_counter() - began)))
    return seen(plotter)


def record(plotter: pv.Plotter, actor: Any, target: str) -> None:
    """Turn the view, let it rest, and write what was seen."""
    actor.mapper.SetInteractiveOffScreen(True)  # somebody will watch
    plotter.show(auto_close=False)
    interactor = plotter.iren.interactor
    frames = [frame(plotter, interactor.GetStillUpdateRate())]
    for i in range(TURNING):
        # slowly, faster, slowly: 75 degrees in all
        plotter.camera.Azimuth(75 / TURNING * (1 - np.cos(2 * np.pi * (i + 0.5) / TURNING)))
        frames.append(frame(plotter, interactor.GetDesiredUpdateRate()))
    resting = 0
    while resting < RESTING and len(frames) < TURNING + LONGEST_REST:
        frames.append(frame(plotter, interactor.GetStillUpdateRate()))
        resting += actor.status.progress is None
    print(actor.status)
    reduced = [f.quantize(96, dither=Image.Dither.NONE) for f in frames]
    reduced[0].save(target, save_all=True, append_images=reduced[1:], duration=1000 // RATE, loop=0)
    print(f"written: {target}, {len(frames)} frames")


def main() -> None:
    """Open a window, or write an animation."""
    target = sys.argv[1] if len(sys.argv) > 1 else "interactive.gif"
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    plotter = pv.Plotter(off_screen=off_screen, window_size=(320, 240) if off_screen else None)
    plotter.set_background("midnightblue", top="black")
    actor = plotter.add_vdi(
        pvdi.examples.load_brain(),
        cmap="bone",
        opacity="sigmoid_8",
        show_scalar_bar=False,
        target_fps=60,
        regenerate=lambda status: status.angle > 30,
        draw="vdi",  # never the volume, so that one VDI is seen to follow the other
    )
    text = actor.show_status()
    text.SetMaximumFontSize(11)
    plotter.camera_position = "xz"
    plotter.camera.zoom(1.35)
    if off_screen:
        record(plotter, actor, target)
        plotter.close()
    else:
        plotter.show()


if __name__ == "__main__":
    main()
