"""What is raycast where the volume is at hand: its VDI or itself, and with how many rays."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, add_judge, shown, soft_ball
from skimage.metrics import structural_similarity
from watched_windows import WINDOW

pytestmark = pytest.mark.gl

VIEW = ((5, 2, 3), (0, 0, 0), (0, 0, 1))


def alike(a, b):
    return structural_similarity(a, b, channel_axis=2, data_range=255)


def beside(plotter, add, **options):
    """Another plotter of the same view, to which something was added."""
    other = pv.Plotter(window_size=WINDOW, **options)
    actor = add(other)
    other.camera = plotter.camera.copy()
    return other, actor


def test_the_volume_is_drawn_as_by_vtk_and_no_vdi_is_made(plotter):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, draw="volume", interpolation="linear", **LOOKS)
    plotter.camera_position = VIEW
    seen = shown(plotter)
    assert actor.status.drawn == "volume"
    assert not actor.status.stand_in
    assert actor.mapper.GetVDI() is None
    judge, _ = beside(plotter, lambda other: add_judge(other, volume))
    assert alike(seen, shown(judge)) > 0.995
    judge.close()
    # Another view, and other voxels, at once
    plotter.camera.azimuth = 120
    turned = shown(plotter)
    assert np.abs(turned - seen).max() > 8
    volume["v"][:] = 0.5 * volume["v"]
    assert np.abs(shown(plotter) - turned).max() > 8
    assert actor.mapper.GetVDI() is None


def test_fewer_rays_as_by_vtks_mappers(plotter):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, **LOOKS)
    plotter.camera_position = VIEW
    full = shown(plotter)
    actor.mapper.SetImageSampleDistance(2)
    assert actor.mapper.GetImageSampleDistance() == 2
    few = shown(plotter)
    assert actor.status.share == pytest.approx(1 / 4, rel=0.02)
    judge, theirs = beside(plotter, lambda other: add_judge(other, volume))
    exact = shown(judge)
    theirs.mapper.SetImageSampleDistance(2)
    judged = alike(shown(judge), exact)
    judge.close()
    # As near its own full picture as VTK's is
    assert alike(few, full) > min(judged, 0.99) - 0.005
    assert np.abs(few - full).max() > 0
