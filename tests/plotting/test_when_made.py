"""A VDI is of the view, the light and the place that there are when it is made."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, WINDOW, shown, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import MissingDependencyError

pytestmark = pytest.mark.gl

OWN = pvdi.Camera((0, 6, 1), (0, 0, 0), (0, 0, 1))
DRAWS = ("auto", "vdi", "volume")
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


def test_without_pyvista_its_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyvista", None)
    with pytest.raises(MissingDependencyError, match=r"pyvista-vdi\[plot\]"):
        OWN.to_pyvista()


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


def test_what_no_renderer_shows_has_no_view():
    for deferred in ({}, {"classification": "deferred"}):
        plotter = new_plotter()
        actor = plotter.add_vdi(soft_ball(), **LOOKS, **deferred)
        plotter.close()
        assert actor.vdi is actor.deferred is None


@pytest.mark.parametrize("draw", DRAWS)
def test_after_a_change_all_is_of_what_is_shown(plotter, tmp_path, draw):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, draw=draw, **LOOKS)
    shown(plotter)
    assert actor.vdi.n_supersegments > 0
    volume["v"][:] = 0
    shown(plotter)
    assert actor.pick(WINDOW[0] // 2, WINDOW[1] // 2) is None
    plotter.iren.picker = "prop"
    assert not plotter.iren.picker.Pick(WINDOW[0] // 2, WINDOW[1] // 2, 0, plotter.renderer)
    assert actor.vdi.n_supersegments == 0


def test_volumes_that_overlap_are_drawn_as_in_auto():
    def show(draw):
        def add(plotter):
            for x in (0.0, 0.7):
                plotter.add_vdi(soft_ball(), draw=draw, user_matrix=moved(x), **LOOKS)
            shown(plotter)
            plotter.camera.Azimuth(80)

        return add

    np.testing.assert_array_equal(picture(show("volume"))[0], picture(show("auto"))[0])


# Light


def lit(plotter, color="white", **options):
    """Add a ball under a lamp that stands in the scene, and is narrow."""
    plotter.remove_all_lights()
    place = {"position": (0, 0, 6), "focal_point": (0, 0, 0), "light_type": "scene light"}
    plotter.add_light(pv.Light(positional=True, cone_angle=30, exponent=8, color=color, **place))
    return plotter.add_vdi(soft_ball(), shade=True, **LOOKS, **options)


@pytest.mark.parametrize("draw", DRAWS)
def test_what_is_moved_with_its_view_is_lit_where_it_is(draw):
    def go(plotter, actor, y):
        actor.position = (0, y, 0)
        plotter.camera_position = [(8, y, 0), (0, y, 0), (0, 0, 1)]

    plotter = new_plotter()
    actor = lit(plotter, draw=draw)
    go(plotter, actor, 0)
    before = shown(plotter)
    go(plotter, actor, 4)
    live, made = shown(plotter), actor.vdi
    plotter.close()
    other = new_plotter()
    alone = lit(other, draw=draw)
    go(other, alone, 4)
    np.testing.assert_array_equal(live, shown(other))
    assert np.abs(live - before).max() > 30
    assert made.color.mean() == pytest.approx(alone.vdi.color.mean(), rel=0.05)
    other.close()


def test_a_closed_plotter_has_lit_it_and_another_one_does(no_leaks):
    plotter = new_plotter()
    actor = lit(plotter, color="red")
    shown(plotter)
    plotter.close()
    red = actor.vdi.color
    assert red[:, 0].max() > 0.1 > red[:, 1].max()
    other = new_plotter(lighting="none")
    other.add_light(pv.Light(position=(0, 0, 6), light_type="scene light", color="lime"))
    other.background_color = "black"
    other.add_actor(actor)
    seen = shown(other)
    assert seen[..., 0].max() == 0 < seen[..., 1].max()
    assert actor.vdi.color[:, 0].max() < 0.1
    other.close()


# Values are made with the first picture


@pytest.mark.parametrize("how", ["default", "set later", "given", "placed"])
def test_values_are_of_the_first_picture(how):
    def show(plotter):
        given = {"camera": OWN} if how == "given" else {}
        matrix = moved(10) if how == "placed" else None
        kept = {"classification": "deferred", "user_matrix": matrix, **given}
        actor = plotter.add_vdi(soft_ball(), **LOOKS, **kept)
        if how == "set later":
            plotter.camera_position = [(9, 1, 1), (0, 0, 0), (0, 0, 1)]
        if how == "given":
            plotter.camera_position = [OWN.position, OWN.focal_point, OWN.view_up]
        return actor

    _, status = picture(show, window_size=(80, 120))
    assert (status.angle, status.coverage) == (pytest.approx(0, abs=1e-6), 1)


# What is held


@pytest.mark.parametrize("options", [{"draw": "vdi"}, {}, {"classification": "deferred"}])
def test_a_closed_plotter_that_is_kept_holds_nothing_on_the_device(default_runtime, options):
    gc.collect()
    before = default_runtime.allocated
    plotter = new_plotter()
    actor = plotter.add_vdi(soft_ball(), shade="classification" not in options, **LOOKS, **options)
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


@pytest.mark.extension("sets")
def test_another_blend_of_a_set_is_drawn(plotter):
    looks = {"cmap": "bone", "opacity_unit_distance": 0.2}
    eyes = [(0, -6, 1), (6, 0, 1)]
    views = [pvdi.Camera(eye, (0, 0, 0), (0, 0, 1)) for eye in eyes]
    vdis = pvdi.VDISet([pvdi.generate(soft_ball(), view, WINDOW, **looks) for view in views])
    plotter.add_vdi(vdis, show_scalar_bar=False, regenerate="never")
    plotter.camera_position = [(4.3, -4.2, 1), (0, 0, 0), (0, 0, 1)]
    before = shown(plotter)
    vdis.blend = 60
    assert np.abs(shown(plotter) - before).max() > 0
