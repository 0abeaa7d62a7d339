"""What was added stays as it was added, by the same rules as with ``add_volume``."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import shown

import pyvista_vdi as pvdi
from pyvista_vdi import errors

pytestmark = pytest.mark.gl

N = 8
WINDOW = (48, 40)
LOOKS = {"clim": (0, N - 1), "cmap": "gray", "show_scalar_bar": False}
#: A change that is seen moves pixels by more than 60 of 255, another by none.
SEEN = 30


def ramp():
    """A grid whose values rise along z, with others along x, and those of cells."""
    grid = pv.ImageData(dimensions=(N, N, N))
    grid["x"] = np.float32(grid.points[:, 0])
    grid["s"] = np.float32(grid.points[:, 2])
    grid.cell_data["c"] = np.float32(grid.cell_centers().points[:, 2])
    grid.set_active_scalars("s")
    return grid


@pytest.fixture
def plotter():
    plotter = pv.Plotter(window_size=WINDOW, off_screen=True)
    plotter.camera_position = "xz"
    yield plotter
    plotter.close()


def test_a_replaced_property_takes_effect(plotter):
    table = pv.LookupTable("hot", scalar_range=(0, N - 1))
    table.apply_opacity("linear_r")
    prop = pv.VolumeProperty(lookup_table=table, opacity_unit_distance=3.0)
    actor = plotter.add_vdi(ramp(), **LOOKS)
    before = shown(plotter)
    actor.prop = prop
    assert actor.prop is prop
    after = shown(plotter)
    assert np.abs(after - before).max() > SEEN
    plotter.remove_actor(actor)
    other = plotter.add_vdi(ramp(), cmap=table, opacity_unit_distance=3.0, show_scalar_bar=False)
    np.testing.assert_array_equal(after, shown(plotter))
    plotter.remove_actor(other)
    plotter.add_actor(actor, reset_camera=False)
    prop.opacity_unit_distance = 60.0  # it is followed
    assert np.abs(shown(plotter) - after).max() > SEEN
    refused = prop.copy()
    refused.SetTransferFunctionModeTo2D()
    with pytest.raises(errors.UnsupportedError, match="2D transfer function"):
        actor.prop = refused
    assert actor.prop is prop


def test_another_vdi_takes_the_place_of_the_first(plotter):
    actor = plotter.add_vdi(ramp(), **LOOKS)
    before = shown(plotter)
    other = pvdi.generate(ramp(), plotter.camera, WINDOW, clim=(0, N - 1), cmap="hot")
    actor.vdi = other
    assert actor.vdi is other
    assert np.abs(shown(plotter) - before).max() > SEEN
    with pytest.raises(errors.InvalidArgumentError, match="without a volume.*add the volume"):
        actor.regenerate()
    for name, value in (("vdi", other), ("opacity_multiplier", 2)):
        with pytest.raises(errors.InvalidArgumentError, match="this actor has no mapper"):
            setattr(pvdi.VDIActor(), name, value)
    with pytest.raises(errors.InvalidVDIError, match="got ImageData"):
        actor.vdi = ramp()
    assert actor.vdi is other
