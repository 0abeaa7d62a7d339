"""A VDI is of the view, the light and the place that there are when it is made."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, WINDOW, shown, soft_ball

import pyvista_vdi as pvdi

pytestmark = pytest.mark.gl

OWN = pvdi.Camera((0, 6, 1), (0, 0, 0), (0, 0, 1))
#: Rounding of 8-bit colours, of two pictures of the same view by kernels that march differently.
ALIKE = 3


def new_plotter(**options):
    return pv.Plotter(off_screen=True, **{"window_size": WINDOW, **options})


def moved(x=0.0, turned=0.0):
    return pv.Transform().rotate_z(turned).translate(x, 0, 0).matrix


def picture(show, **options):
    """The picture of a plotter to which something was added, and the status of its actor."""
    plotter = new_plotter(**options)
    actor = show(plotter)
    seen, status = shown(plotter), getattr(actor, "status", None)
    plotter.close()
    return seen, status


# A stored VDI opens from its own view


@pytest.mark.parametrize("kind", ["VDI", "deferred", "series", "set"])
def test_it_opens_from_its_own_view(kind):
    given = {"classification": "deferred"} if kind == "deferred" else {"cmap": "bone"}
    vdi = pvdi.generate(soft_ball(), OWN, WINDOW, **given)
    thing = vdi
    if kind == "series":
        thing = pvdi.VDISeries([vdi])
    if kind == "set":
        thing = pvdi.VDISet([vdi, vdi], [OWN.azimuth(90), OWN], camera=OWN)
    _, status = picture(lambda plotter: plotter.add_vdi(thing))
    assert (status.angle, status.coverage) == (pytest.approx(0, abs=1e-6), 1)


@pytest.mark.parametrize(("scale", "parallel"), [(1, False), (3, True)])  # 3: no eye moves so
def test_what_a_plotter_saved_opens_as_it_was_seen(tmp_path, scale, parallel):
    def show(plotter):
        if parallel:
            plotter.enable_parallel_projection()
        plotter.set_scale(zscale=scale)
        actor = plotter.add_vdi(soft_ball(), user_matrix=moved(10, 40), **LOOKS)
        actor.vdi.save(tmp_path / "x.vdi")
        return actor

    seen, _ = picture(show)
    again, _ = picture(lambda plotter: plotter.add_vdi(tmp_path / "x.vdi", show_scalar_bar=False))
    assert np.abs(again - seen).max() <= ALIKE
    vdi = pvdi.read(tmp_path / "x.vdi")
    assert vdi.picture_size == WINDOW != vdi.window_size
    assert pvdi.render(vdi, OWN).shape == (*WINDOW[::-1], 4)


def test_a_camera_that_was_set_stays_and_to_pyvista_goes_back(plotter):
    plotter.camera_position = [(9, 1, 1), (0, 0, 0), (0, 0, 1)]
    tilted = OWN.replace(parallel_projection=True, window_center=(0.1, 0.2))
    vdi = pvdi.generate(soft_ball(), tilted, WINDOW, cmap="bone")
    actor = plotter.add_vdi(vdi, show_scalar_bar=False)
    assert plotter.camera.position == (9, 1, 1)
    with pytest.warns(pvdi.VDIWarning, match=r"camera = vdi\.camera\.to_pyvista\(\)"):
        shown(plotter)
    plotter.camera = actor.vdi.camera.to_pyvista()
    assert pvdi.Camera.from_any(plotter.camera) == tilted
    assert plotter.camera.parallel_projection
    expected = np.clip(pvdi.render(vdi, tilted)[..., :3], 0, 1)
    plotter.background_color = "black"
    assert np.abs(shown(plotter) / 255 - expected).max() <= 1 / 255


# actor.vdi, whenever it is asked for


def test_before_the_first_picture_it_is_of_the_view_that_this_has():
    plotter = new_plotter(shape=(1, 2))
    plotter.subplot(0, 1)
    actor = plotter.add_vdi(soft_ball(), **LOOKS)
    first = actor.vdi
    assert actor.vdi is first
    plotter.add_mesh(pv.Box((-3, 3) * 3).extract_all_edges())
    made = actor.vdi
    assert made is not first
    shown(plotter)
    assert actor.vdi is made
    camera = plotter.renderers[1].camera
    np.testing.assert_allclose(made.camera.position, camera.position)
    assert made.picture_size == plotter.renderers[1].GetSize()
    plotter.close()


# What is held


@pytest.mark.parametrize("options", [{"draw": "vdi"}, {}, {"classification": "deferred"}])
def test_a_closed_plotter_that_is_kept_holds_nothing_on_the_device(default_runtime, options):
    gc.collect()
    before = default_runtime.allocated
    plotter = new_plotter()
    actor = plotter.add_vdi(soft_ball(), **LOOKS, **options)
    first = shown(plotter)
    if options:  # else the volume has drawn the picture, and no VDI was made
        pvdi.render(actor.vdi, plotter.camera)
    plotter.close()
    gc.collect()
    assert default_runtime.allocated <= before
    other = new_plotter()
    other.add_actor(actor)
    assert np.abs(shown(other) - first).max() <= ALIKE
    other.close()
