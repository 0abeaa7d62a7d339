"""The forms in which volumes are shown without ``add_volume(grid)``."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, shown, soft_ball
from pyvista.plotting.plotter import _ALL_PLOTTERS

from pyvista_vdi.errors import UnsupportedError

pytestmark = pytest.mark.gl

WINDOW = (60, 50)


def two_balls():
    left, right = soft_ball(8), soft_ball(8)
    right.origin = (2.5, -1, -1)
    return pv.MultiBlock([left, None, right])


def test_blocks_within_blocks_and_none(plotter):
    actors = plotter.add_vdi(pv.MultiBlock([two_balls(), soft_ball(8)]), **LOOKS)
    assert [isinstance(each, list) for each in actors] == [True, False]
    assert plotter.add_vdi(pv.MultiBlock()) == []
    before = len(plotter.renderer.actors)
    with pytest.raises(UnsupportedError, match="voxelise a surface"):
        plotter.add_vdi(pv.MultiBlock([soft_ball(8), pv.MultiBlock([pv.Sphere()])]))
    assert len(plotter.renderer.actors) == before, "nothing, or all"


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
