"""The forms in which volumes are shown without ``add_volume(grid)``; help; exports."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import (
    LOOKS,
    shown,
    soft_ball,
)
from pyvista.plotting.plotter import _ALL_PLOTTERS

from pyvista_vdi.errors import UnsupportedError

pytestmark = pytest.mark.gl

WINDOW = (60, 50)
#: That the VDI is missing where a scene is written for another renderer.


def two_balls():
    left, right = soft_ball(8), soft_ball(8)
    right.origin = (2.5, -1, -1)
    return pv.MultiBlock([left, None, right])


@pytest.mark.parametrize("multi_colors", [False, True])
def test_blocks_are_those_that_are_added_one_by_one(plotter, multi_colors):
    blocks = two_balls()
    looks = {**LOOKS, "clim": (0.0, 200.0)}
    actors = plotter.add_vdi(blocks, multi_colors=multi_colors, name="balls", **looks)
    assert [type(each).__name__ for each in actors] == ["PlotterVDIActor"] * 2
    names = [name for name in plotter.renderer.actors if name.startswith("balls")]
    judge = pv.Plotter(window_size=WINDOW, off_screen=True)
    for block, cmap in zip((blocks[0], blocks[2]), ("Reds", "Greens"), strict=True):
        judge.add_vdi(block, **{**looks, "cmap": cmap if multi_colors else looks["cmap"]})
    picture = shown(plotter)
    assert np.abs(picture - shown(judge)).max() == 0
    assert (np.abs(picture - 255).max(axis=2) > 60).any()
    vtks = judge.add_volume(blocks, multi_colors=multi_colors, name="balls")
    assert len(vtks) == 2
    assert names == [name for name in judge.renderer.actors if name.startswith("balls")]


def test_blocks_within_blocks_and_none(plotter):
    actors = plotter.add_vdi(pv.MultiBlock([two_balls(), soft_ball(8)]), **LOOKS)
    assert [isinstance(each, list) for each in actors] == [True, False]
    assert plotter.add_vdi(pv.MultiBlock()) == []
    before = len(plotter.renderer.actors)
    with pytest.raises(UnsupportedError, match="voxelise a surface"):
        plotter.add_vdi(pv.MultiBlock([soft_ball(8), pv.MultiBlock([pv.Sphere()])]))
    assert len(plotter.renderer.actors) == before, "nothing, or all"


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_rectilinear_grid_of_equidistant_points_is_the_uniform_grid(plotter, dtype):
    ball = soft_ball(12)
    axis = np.linspace(-1, 1, 12, dtype=dtype)
    grid = pv.RectilinearGrid(axis, axis, axis)
    grid["v"] = ball["v"].copy()
    actor = plotter.add_vdi(grid, **LOOKS)
    first = shown(plotter)
    plotter.remove_actor(actor)
    plotter.add_vdi(ball, **LOOKS)
    # Bounds differ by rounding
    assert np.abs(shown(plotter) - first).max() <= 1
    assert np.ptp(first) > 40
    axis[3] += 0.001
    with pytest.raises(UnsupportedError, match=r"not a uniform grid.*resample"):
        plotter.add_vdi(pv.RectilinearGrid(axis, axis, axis))


def test_plot_of_a_grid_is_what_a_plotter_shows(plotter):
    volume = soft_ball(8)
    arguments = {
        "off_screen": True,
        "window_size": WINDOW,
        "return_img": True,
        "cpos": "xy",
        "zoom": 1.3,
        "parallel_projection": True,
        "background": "tan",
        "show_axes": False,
        **LOOKS,
    }
    picture = volume.vdi.plot(**arguments)
    plotter.set_background("tan")
    plotter.add_vdi(volume, **LOOKS)
    plotter.camera_position = "xy"
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.3)
    np.testing.assert_array_equal(picture, shown(plotter))
    vtks = volume.plot(volume=True, **arguments)
    # The ball has 8 voxels along an edge; half-voxel steps of both begin elsewhere
    assert np.abs(picture.astype(int) - vtks).mean() < 4


def test_a_plot_that_is_refused_leaves_no_plotter():
    before = dict(_ALL_PLOTTERS)
    with pytest.raises(TypeError, match="'opcity': did you mean 'opacity'"):
        soft_ball(8).vdi.plot(off_screen=True, opcity=1)
    assert before == _ALL_PLOTTERS
