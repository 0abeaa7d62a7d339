"""Volumes far from the origin: the picture is the one at the origin as long as float64 allows."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import shown

pytestmark = pytest.mark.gl

WINDOW = (120, 90)
EYE = np.array([1.5, -2.25, 1.25])
LOOKS = {"clim": (0, 255), "opacity": [0.2, 0.7], "show_scalar_bar": False}
#: Where, in extents of the volume: from there float32 does not tell its ends apart.
FAR = [2**12, 2**24, 2**37]


def block(at):
    """Dense up to its edges, and not symmetrical; float64 holds all its places at any of FAR."""
    x = np.linspace(-1, 1, 17)
    r = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    image = pv.ImageData(dimensions=(17, 17, 17), spacing=(1 / 16,) * 3, origin=at - 0.5)
    image["v"] = (255 * (1 - r / 2) * (0.8 + 0.2 * x)).clip(0).ravel()
    return image


def look(plotter, at, eye=EYE):
    plotter.camera.position, plotter.camera.focal_point = at + eye, at + 0.0
    plotter.camera.up = (0, 0, 1)
    plotter.renderer.reset_camera_clipping_range()


def plain(plotter, at):
    actor = plotter.add_vdi(block(at), **LOOKS)
    look(plotter, at)
    return actor


def parallel(plotter, at):
    plain(plotter, at)
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 0.8


def from_aside(plotter, at):
    plotter.add_vdi(block(at), regenerate="never", draw="vdi", **LOOKS)
    look(plotter, at)
    plotter.show(auto_close=False)
    look(plotter, at, EYE + np.array([0.5, 0.25, 0]))


def from_inside(plotter, at):
    plotter.add_vdi(block(at), draw="volume", **LOOKS)
    look(plotter, at, EYE / 32)


def with_a_mesh(plotter, at):
    plain(plotter, at)
    ball = pv.Sphere(radius=0.375)  # in float32, as PyVista makes it, it would be at one point
    plotter.add_mesh(ball, color="w").position = at + 0.25
    look(plotter, at)


def moved_there(plotter, at):
    plotter.add_vdi(block(0.0 * at), **LOOKS).position = at
    look(plotter, at)


def overlapping(plotter, at):
    plotter.add_vdi(block(at), **LOOKS)
    plotter.add_vdi(block(at + 0.25), cmap="hot", **LOOKS)
    look(plotter, at)


def picture(scene, at):
    plotter = pv.Plotter(off_screen=True, window_size=WINDOW)
    plotter.render_window.SetMultiSamples(0)  # they smooth the edges of a box that VTK can place
    scene(plotter, at)
    image = shown(plotter)
    plotter.close()
    return image


@pytest.mark.parametrize(
    "scene",
    [
        *(plain, parallel, from_aside, from_inside, with_a_mesh, moved_there),
        overlapping,
    ],
)
def test_the_picture_is_that_at_the_origin(scene):
    near = picture(scene, np.zeros(3))
    assert np.ptp(near, axis=(0, 1)).max() > 15
    for distance in FAR:
        far = picture(scene, np.array([0.5, -0.75, 0.25]) * distance)
        off = np.abs(far - near)
        # Seen: 2 and .002; and at the largest, where float64 has 4096 places from voxel to voxel
        # and rays meet a voxel's border that much further on, 9 and .016
        most, mean = (20, 0.04) if distance == FAR[-1] else (4, 0.01)
        assert off.max() <= most, distance
        assert off.mean() < mean, distance
