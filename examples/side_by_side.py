"""A volume is turned in two windows, by `add_volume` and by `add_vdi`, each at its own pace.

What one should see: the same picture twice. The left one moves in steps, as each frame takes its
time; the right one follows the hand, a little blurred until the hand rests.

    python examples/side_by_side.py side_by_side.gif

The windows are filmed one after the other, so neither waits for the other. Only the time of
rendering counts. Without a screen both are off-screen, and every frame is full.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import pyvista as pv
from PIL import Image, ImageDraw

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline.vtk import vtk_to_numpy, vtkUnsignedCharArray

SIZE = (400, 300)
#: Degrees a second, seconds of turning and of rest, pictures of the film a second.
SPEED, TURNING, RESTING, RATE = 10.0, 4.0, 1.5, 8
LOOK = {"cmap": "bone", "opacity": "linear", "shade": True, "show_scalar_bar": False}


def seen(plotter: pv.Plotter) -> Image.Image:
    """Return what the window shows; a screenshot would be a full frame."""
    pixels = vtkUnsignedCharArray()
    plotter.render_window.GetPixelData(0, 0, SIZE[0] - 1, SIZE[1] - 1, 1, pixels, 0)
    values = vtk_to_numpy(pixels).reshape(SIZE[1], SIZE[0], 3)
    return Image.fromarray(np.ascontiguousarray(values[::-1]))


def filmed(add: str, volume: pv.ImageData) -> list[tuple[float, Image.Image]]:
    """Return the pictures of one window, each with the second at which it was there."""
    plotter = pv.Plotter(window_size=SIZE)
    plotter.background_color = "black"
    getattr(plotter, add)(volume, **LOOK)
    plotter.camera_position = [np.add(volume.center, (190, 260, 180)), volume.center, (0, 0, 1)]
    plotter.show(interactive_update=True, auto_close=False)
    window, interactor = plotter.render_window, plotter.iren.interactor
    plotter.render()  # kernels and shaders are compiled
    now, angle, moving, pictures = 0.0, 0.0, True, [(0.0, seen(plotter))]
    while moving:
        moving = now < TURNING
        window.SetDesiredUpdateRate(
            interactor.GetDesiredUpdateRate() if moving else interactor.GetStillUpdateRate()
        )
        wanted = SPEED * min(now, TURNING)
        plotter.camera.Azimuth(wanted - angle)
        angle, begun = wanted, time.perf_counter()
        plotter.render()
        now += time.perf_counter() - begun
        pictures.append((now, seen(plotter)))
    plotter.close()
    return pictures


def main() -> None:
    """Film both windows, and join them."""
    target = sys.argv[1] if len(sys.argv) > 1 else "side_by_side.gif"
    volume = pvdi.examples.load_brain()
    films = {add: filmed(add, volume) for add in ("add_volume", "add_vdi")}
    rates = {add: sum(at <= TURNING for at, _ in film) / TURNING for add, film in films.items()}
    ratio = rates["add_vdi"] / rates["add_volume"]
    length = max(film[-1][0] for film in films.values()) + RESTING
    frames = []
    for number in range(int(length * RATE)):
        frame = Image.new("RGB", (2 * SIZE[0], SIZE[1]))
        for place, (add, film) in enumerate(films.items()):
            shown = [picture for at, picture in film if at <= number / RATE]
            frame.paste(shown[-1], (place * SIZE[0], 0))
            said = f"{add}: {rates[add]:.1f} frames a second"
            said += f", {ratio:.1f} times as many" if place else ""
            ImageDraw.Draw(frame).text((place * SIZE[0] + 8, 8), said, "white", font_size=16)
        frames.append(frame.quantize(48, dither=Image.Dither.NONE))
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=1000 // RATE, loop=0)
    print(f"written: {target}, {len(frames)} pictures; {rates}")


if __name__ == "__main__":
    main()
