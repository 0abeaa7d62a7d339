"""A VDI as a file: made where the volume is, opened where it is not.

What one should see: a yellow-green knot over white, from 20 degrees beside the view that it was
made for. Nothing of the volume is needed for it but one file of a few megabytes.

The picture is written to the file that the argument names (files.png without one); with --show a
window opens instead.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv

import pyvista_vdi as pvdi
from pyvista_vdi.io import read_info


def knot(n: int = 96) -> pv.ImageData:
    """Density around a trefoil knot."""
    t = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    curve = np.stack(
        [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1
    )
    volume = pv.ImageData(dimensions=(n, n, n), spacing=(8 / (n - 1),) * 3, origin=(-4, -4, -4))
    nearest = np.full(volume.n_points, np.inf, np.float32)
    points = volume.points.astype(np.float32)
    for place in curve.astype(np.float32):
        np.minimum(nearest, ((points - place) ** 2).sum(axis=1), out=nearest)
    volume["density"] = (255 * np.exp(-nearest / 0.2)).astype(np.uint8)
    return volume


def made_where_the_volume_is(folder: Path) -> Path:
    """Generate a VDI of the volume and write it."""
    volume = knot()
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (0, -13, 4), (0, 0, 0), (0, 0, 1)
    opacity = [0, 0.02, 0.1, 0.4, 0.8]
    vdi = volume.vdi.generate(camera, (320, 240), cmap="viridis", opacity=opacity)
    print(f"volume: {volume.n_points / 2**20:.1f} MiB; {vdi}")
    return vdi.save(folder / "knot.vdi")


def opened_where_it_is_not(file: Path, target: str, show: bool) -> None:
    """Say what the file holds, and show it from a new view."""
    info = read_info(file)  # reads no array
    print(
        f"{file.name}: {info.file_bytes / 2**20:.1f} MiB, {info.window_size[0]} x "
        f"{info.window_size[1]} lists, {info.n_supersegments} supersegments"
    )
    vdi = pvdi.read(file)
    vdi.save(file.with_suffix(".exr"))  # for compositing programs
    assert pvdi.read(file.with_suffix(".exr")).bounds == vdi.bounds  # depths are rounded
    plotter = pv.Plotter(off_screen=not show, window_size=(640, 480))
    plotter.background_color = "white"
    plotter.add_vdi(pv.read(file), regenerate="never")  # the volume is elsewhere
    plotter.camera.position = vdi.camera.position
    plotter.camera.focal_point = vdi.camera.focal_point
    plotter.camera.up = vdi.camera.view_up
    plotter.camera.azimuth = 20
    if show:
        plotter.show()
        return
    plotter.screenshot(target)
    print(f"written: {target}")
    plotter.close()


def main() -> None:
    """Write the file, and open it."""
    names = [a for a in sys.argv[1:] if not a.startswith("--")]
    with tempfile.TemporaryDirectory() as folder:
        file = made_where_the_volume_is(Path(folder))
        opened_where_it_is_not(file, names[0] if names else "files.png", "--show" in sys.argv)


if __name__ == "__main__":
    main()
