"""``add_vdi`` in a real plotter: arguments, updates, files, bars, removal and leaks."""

from __future__ import annotations

import gc
import signal
import sys

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, WINDOW, shown, soft_ball
from watched_windows import small_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import Cancelled, InvalidVolumeError, VDIWarning
from pyvista_vdi.plotting.progress import DelayedBar, progress_callback
from pyvista_vdi.vtk_pipeline.drawing import images
from pyvista_vdi.vtk_pipeline.filters import source as source_module
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_to_image
from pyvista_vdi.vtk_pipeline.vtk import vtkOpenGLGPUVolumeRayCastMapper, vtkWeakReference

pytestmark = pytest.mark.gl


@pytest.fixture
def calls(monkeypatch):
    """Count generations and raycasts."""
    counted = {"generate": 0, "render": 0}

    def count(name, module, function):
        before = getattr(module, function)

        def call(*arguments, **keywords):
            counted[name] += 1
            return before(*arguments, **keywords)

        monkeypatch.setattr(module, function, call)

    count("generate", source_module, "generate_vdi")
    count("render", images, "render_vdi")
    return counted


def view(x, y, z):
    """A view of the origin from there, as a plotter takes it."""
    return ((x, y, z), (0, 0, 0), (0, 0, 1))


ARGUMENTS = {
    "defaults": {},
    "names": {"cmap": "inferno", "opacity": "sigmoid_5", "clim": (20, 200)},
    "one number": {"clim": 100, "opacity": 0.3, "n_colors": 7},
    "array of n_colors": {"opacity": np.arange(16) * 9, "n_colors": 16},
    "short array": {"opacity": [0, 0, 0.02, 0.9, 1.0]},
    "list of colours": {"cmap": ["red", "lime", "blue"], "flip_scalars": True},
    "logarithm": {"log_scale": True, "cmap": "bone"},
    "categories": {"categories": 5},
    "aliases": {"rng": (10, 90), "colormap": "plasma", "backface_culling": True},
    "unit distance": {"opacity_unit_distance": 0.77, "opacity": "linear_r"},
    "values per point": {"scalars": np.linspace(-3, 3, 12**3)},
    "name": {"scalars": "w"},
    "cell data": {"scalars": "c"},
    "lookup table": {"cmap": pv.LookupTable(cmap="cividis", scalar_range=(1, 222))},
}


@pytest.mark.parametrize("arguments", ARGUMENTS.values(), ids=ARGUMENTS.keys())
def test_arguments_mean_what_they_mean_in_add_volume(plotter, arguments):
    volume = soft_ball(12)
    volume["w"] = np.cos(volume["v"])
    volume.cell_data["c"] = np.arange(volume.n_cells, dtype=float)
    volume.set_active_scalars("v")
    # In a plotter of its own: scalar bars of one title widen the ranges of all
    judge = pv.Plotter(window_size=WINDOW)
    theirs = judge.add_volume(volume, mapper="gpu", **arguments)
    ours = plotter.add_vdi(volume, **arguments)
    table = pvdi.vtk_pipeline.transfer_function_from_property(theirs.prop)
    assert pvdi.vtk_pipeline.transfer_function_from_property(ours.prop) == table
    source = ours.mapper.GetSource()
    np.testing.assert_allclose(
        source.GetVolume().array.ravel(), theirs.mapper.dataset.active_scalars, rtol=1e-6
    )
    assert ours.bounds == pytest.approx(theirs.bounds)
    assert ours.mapper.scalar_range == pytest.approx(theirs.mapper.scalar_range)
    assert list(plotter.scalar_bars.keys()) == list(judge.scalar_bars.keys())
    assert len(plotter.scalar_bars) == 1


def masked(shape, dtype):
    """Values of which some, far beyond the others, are masked."""
    values = np.linspace(0, 200, np.prod(shape)).astype(dtype).reshape(shape)
    values[:3] = 30000
    return np.ma.masked_greater(values, 1000)


@pytest.mark.parametrize("dtype", [np.float32, np.int16])
@pytest.mark.parametrize("given", ["scalars", "cells", "dataset", "bare"])
def test_masked_arrays_are_taken_as_by_add_volume(plotter, given, dtype):
    """Of scalars= the others give the range; elsewhere PyVista takes no notice of a mask."""
    grid, arguments = pv.ImageData(dimensions=(9, 8, 7)), {}
    if given == "scalars":
        arguments["scalars"] = masked(grid.n_points, dtype)
    elif given == "cells":
        arguments["scalars"] = masked(grid.n_cells, dtype)
    elif given == "dataset":
        grid["v"] = masked(grid.n_points, dtype)
    else:
        grid = masked((9, 8, 7), dtype)
    judge = pv.Plotter(off_screen=True)
    theirs = judge.add_volume(grid, **arguments).mapper
    source = plotter.add_vdi(grid, **arguments).mapper
    assert source.scalar_range == pytest.approx(theirs.scalar_range)
    assert source.scalar_range[1] == (200 if "scalars" in arguments else 30000)
    np.testing.assert_allclose(source.GetSource().GetVolume().scalars.max(), 30000)
    judge.close()


def test_scalars_that_are_all_masked_are_refused_and_the_engine_ranges_the_others():
    grid = pv.ImageData(dimensions=(9, 8, 7))
    values = masked(grid.n_points, np.float32)
    camera, window = pvdi.Camera((30, 9, 9), (4, 4, 3), (0, 0, 1)), (24, 18)
    pictures = [
        pvdi.render_volume(grid, camera, window, scalars=scalars, clim=clim)
        for scalars, clim in ((values, None), (values.data, (values.min(), values.max())))
    ]
    np.testing.assert_array_equal(*pictures)
    with pytest.raises(InvalidVolumeError, match="every one of the scalars is masked"):
        pv.Plotter(off_screen=True).add_vdi(grid, scalars=np.ma.masked_all(grid.n_points))


def test_numpy_volume_with_resolution_and_engine_volume(plotter):
    array = np.random.default_rng(1).random((5, 6, 7))
    theirs = plotter.add_volume(array, resolution=(1, 2, 3), mapper="gpu")
    ours = plotter.add_vdi(array, resolution=(1, 2, 3))
    assert ours.bounds == pytest.approx(theirs.bounds)
    values = ours.mapper.GetSource().GetVolume().array
    np.testing.assert_array_equal(values, array.transpose(2, 1, 0))
    volume = pvdi.Volume(array, (1, 2, 3), (4, 5, 6))
    assert plotter.add_vdi(volume).bounds == pytest.approx(volume.bounds)


def test_user_matrix_name_pickable_and_culling(plotter):
    matrix = pv.Transform().translate(1, 2, 3).matrix
    first = plotter.add_vdi(soft_ball(8), name="ball", pickable=False, user_matrix=matrix)
    assert not first.GetPickable()
    assert first.bounds[::2] == pytest.approx((0, 1, 2))
    second = plotter.add_vdi(soft_ball(8), name="ball", culling="front")
    assert plotter.actors["ball"] is second
    assert first not in plotter.renderer.actors.values()


def test_the_view_is_that_of_the_first_frame_and_kept_while_nothing_changes(plotter, calls):
    actor = plotter.add_vdi(
        soft_ball(), settings=pvdi.Settings(coverage="view"), draw="vdi", **LOOKS
    )
    plotter.camera_position = view(9, 1, 1)
    shown(plotter)
    made = actor.vdi
    assert made.camera.position == (9, 1, 1)
    assert made.window_size == WINDOW
    for _ in range(3):
        plotter.render()
    assert calls == {"generate": 1, "render": 1}
    plotter.camera.Azimuth(20)
    plotter.render()
    assert calls == {"generate": 1, "render": 2}
    assert actor.vdi is made
    plotter.camera_position = view(0, 9, 1)
    vdi = actor.regenerate()
    assert vdi.camera.position == (0, 9, 1)
    assert actor.vdi is vdi
    again = actor.regenerate(pvdi.Camera((3, 3, 3), (0, 0, 0), (0, 0, 1)), window_size=(40, 30))
    assert again.window_size == (40, 30)
    assert calls["generate"] == 3


def test_moving_opaque_geometry_is_seen_without_moving_the_camera(plotter, calls):
    plotter.add_vdi(soft_ball(), draw="vdi", **LOOKS)
    sphere = plotter.add_mesh(pv.Sphere(radius=0.4), color="w", reset_camera=False)
    first = shown(plotter)
    for _ in range(3):  # images are freed and made anew: none may be taken for another
        sphere.position = (0.6, 0, 0)
        moved = shown(plotter)
        assert np.abs(moved - first).max() > 40
        sphere.position = (0, 0, 0)
        np.testing.assert_array_equal(shown(plotter), first)
    assert calls["generate"] == 1


def test_given_camera_and_the_scale_of_the_renderer(plotter):
    plotter.set_scale(zscale=2.0)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = view(0, 7, 0)
    actor = plotter.add_vdi(
        soft_ball(), camera=camera, settings=pvdi.Settings(coverage="view"), **LOOKS
    )
    shown(plotter)
    assert actor.vdi.camera.position == (0, 7, 0)
    np.testing.assert_array_equal(actor.vdi.camera.model_transform, np.diag([1, 1, 2, 1]))
    assert actor.bounds == pytest.approx((-1, 1, -1, 1, -2, 2))


def test_covered_bounds_show_no_cut_edge_when_panned(plotter):
    actor = plotter.add_vdi(soft_ball(), **LOOKS)
    plotter.camera_position = ((6, 0, 0), (0, 1.2, 0), (0, 0, 1))  # half of it outside
    plotter.render()
    shown(plotter)
    plotter.camera_position = view(9, 0, 0)
    ours = shown(plotter)
    judge = plotter.add_volume(soft_ball(), mapper="gpu", **LOOKS)
    judge.mapper.SetSampleDistance(0.02)
    actor.visibility = False
    difference = np.abs(ours - shown(plotter)).max(axis=-1)
    # a cut edge would leave half of the ball away: differences of 100 and more
    assert np.percentile(difference, 99.5) < 12


def test_changed_property_and_data_generate_anew(plotter, calls):
    volume = soft_ball()
    actor = plotter.add_vdi(volume, draw="vdi", **LOOKS)
    before = shown(plotter)
    actor.mapper.lookup_table.cmap = "inferno"
    after = shown(plotter)
    assert calls["generate"] == 2
    assert np.abs(after - before).max() > 40
    volume["v"][:] = 0
    plotter.render()
    assert calls["generate"] == 3
    assert actor.vdi.n_supersegments == 0 or actor.vdi.optical_depth.max() < 1e-3
    actor.prop.interpolation_type = "linear"
    plotter.render()
    assert calls["generate"] == 4
    volume.Modified()  # nothing that matters
    plotter.render()
    assert calls["generate"] == 4


def test_what_has_changed_is_made_anew_from_the_frame_s_view(plotter, calls):
    """Off-screen as on it; a view that somebody chose, and ``regenerate="never"``, keep theirs."""
    volume = soft_ball()
    actor = plotter.add_vdi(volume, settings=pvdi.Settings(coverage="view"), draw="vdi", **LOOKS)
    shown(plotter)
    plotter.camera_position = view(0, 9, 1)
    plotter.render()
    assert calls["generate"] == 1
    volume["v"][:] = volume["v"] / 2
    plotter.render()
    assert calls["generate"] == 2
    assert actor.vdi.camera.position == (0, 9, 1)

    plotter.camera_position = view(8, 0, 1)
    actor.mapper.SetRegenerate("never")
    actor.mapper.lookup_table.cmap = "inferno"
    plotter.render()
    assert actor.vdi.camera.position == (0, 9, 1)
    actor.mapper.SetRegenerate("auto")
    actor.regenerate(pvdi.Camera((3, 3, 3), (0, 0, 0), (0, 0, 1)))
    actor.mapper.lookup_table.cmap = "gray"
    plotter.render()
    assert actor.vdi.camera.position == (3, 3, 3)
    assert calls["generate"] == 5


def test_settings_reach_the_generator(plotter):
    settings = {
        "criterion": "homogeneity",
        "sample_distance": 0.1,
        "tolerance": 0.01,
        "view_cone": 30.0,
    }
    actor = plotter.add_vdi(
        soft_ball(), max_supersegments=3, ambient_occlusion=0.4, settings=pvdi.Settings(**settings)
    )
    shown(plotter)
    made_by = actor.vdi.metadata
    assert actor.vdi.counts.max() <= 3
    assert {name: made_by[name] for name in settings} == settings
    assert made_by["ambient_occlusion"]["radius"] == 0.4
    assert made_by["scalars"] == "v"


def test_vdi_image_and_file_show_the_same(plotter, tmp_path):
    vdi = small_vdi()
    vdi.save(tmp_path / "ball.vdi")
    images = []
    for thing in (vdi, vdi_to_image(vdi), pv.read(tmp_path / "ball.vdi")):
        actor = plotter.add_vdi(thing, name="it")
        plotter.camera_position = view(5, 4, 3)
        assert actor.vdi.equals(vdi)
        images.append(shown(plotter))
    assert np.ptp(images[0].reshape(-1, 3), axis=0).max() > 60
    for image in images[1:]:
        np.testing.assert_array_equal(image, images[0])


def test_accessor_and_the_bar_that_a_vdi_brings(plotter):
    plotter.camera_position = view(5, 4, 3)
    vdi = soft_ball(12).vdi.generate(plotter.camera, (60, 50), cmap="inferno", clim=(5, 99))
    assert vdi.window_size == (60, 50)
    assert vdi.camera.position == (5, 4, 3)
    assert vdi.n_supersegments > 0
    actor = plotter.add_vdi(vdi)
    assert actor.mapper.scalar_range == (5, 99)
    assert list(plotter.scalar_bars.keys()) == ["v"]
    assert plotter.add_vdi(vdi, show_scalar_bar=False) is not actor


def test_visibility_removal_and_scalar_bar(plotter):
    actor = plotter.add_vdi(soft_ball(), **{**LOOKS, "show_scalar_bar": None})
    assert list(plotter.scalar_bars.keys()) == ["v"]
    plotter.remove_scalar_bar("v")
    seen = shown(plotter)
    actor.visibility = False
    hidden = shown(plotter)
    assert np.abs(seen - hidden).max() > 40
    actor.visibility = True
    np.testing.assert_array_equal(shown(plotter), seen)
    plotter.remove_actor(actor)
    np.testing.assert_array_equal(shown(plotter), hidden)


@pytest.mark.parametrize("deep", [True, False])
def test_copies_of_what_the_plotter_holds_alone(plotter, deep):
    """PyVista's mappers lose their lookup table with the last reference from Python."""
    plotter.add_vdi(soft_ball(), name="ball", **LOOKS)
    before = shown(plotter)
    plotter.add_mesh(pv.Sphere(radius=0.1), name="mesh")
    plotter.remove_actor("mesh")
    gc.collect()
    twin = plotter.actors["ball"].copy(deep=deep)
    plotter.remove_actor("ball")
    plotter.add_actor(twin, reset_camera=False)
    np.testing.assert_array_equal(shown(plotter), before)
    # Without the volume, the property is VTK's own
    alone = plotter.add_vdi(twin.vdi, show_scalar_bar=False)
    plotter.remove_actor(twin)
    before = shown(plotter)
    twin = alone.copy(deep=deep)
    plotter.remove_actor(alone)
    plotter.add_actor(twin, reset_camera=False)
    np.testing.assert_array_equal(shown(plotter), before)


def test_problem_in_a_frame_is_said_once_and_the_last_image_stays(plotter):
    actor = plotter.add_vdi(soft_ball(), **LOOKS)
    before = shown(plotter)
    actor.prop.SetTransferFunctionModeTo2D()
    with pytest.warns(VDIWarning, match="cannot be drawn: UnsupportedError: .*2D transfer") as said:
        shown(plotter)  # three frames
    assert len(said) == 1
    np.testing.assert_array_equal(shown(plotter), before)
    actor.prop.SetTransferFunctionModeTo1D()
    np.testing.assert_array_equal(shown(plotter), before)


def test_progress_reaches_a_callable_that_can_stop_the_work(plotter):
    fractions = []

    def stop(fraction):
        fractions.append(fraction)
        return False

    actor = plotter.add_vdi(soft_ball(), progress_bar=stop, draw="vdi", **LOOKS)
    with pytest.warns(VDIWarning, match="cannot be drawn: Cancelled") as said:
        shown(plotter)  # three frames
    assert len(said) == 1
    assert len(fractions) > 1  # each frame tries again
    with pytest.raises(Cancelled):
        _ = actor.vdi
    actor.mapper.GetSource().SetProgressCallback(fractions.append)
    assert actor.regenerate().n_supersegments > 0
    assert fractions[-1] == 1.0


@pytest.mark.skipif(sys.platform == "win32", reason="raises SIGINT in its own process")
def test_interrupt_leaves_a_usable_plotter(plotter):
    def interrupt(fraction):
        signal.raise_signal(signal.SIGINT)

    actor = plotter.add_vdi(soft_ball(), progress_bar=interrupt, draw="vdi", **LOOKS)
    with pytest.warns(VDIWarning, match="interrupted.*actor.regenerate"):
        shown(plotter)
    with pytest.raises(KeyboardInterrupt):
        actor.regenerate()
    actor.mapper.GetSource().SetProgressCallback(None)
    assert actor.regenerate().n_supersegments > 0


def test_bar_appears_only_after_a_second(capsys):
    bar = DelayedBar(always=True)
    for fraction in (0.1, 0.6, 0.2, 1.0):  # 0.2: other work began
        bar(fraction)
    assert capsys.readouterr().err == ""
    assert progress_callback(False) is None
    assert progress_callback(print) is print


def exercise():
    plotter = pv.Plotter(window_size=WINDOW)
    actor = plotter.add_vdi(soft_ball(), **{**LOOKS, "show_scalar_bar": True})
    plotter.add_mesh(pv.Sphere(radius=0.5, center=(0.4, 0.2, 0.5)))
    plotter.add_volume_clip_plane(actor)
    shown(plotter)
    actor.prop.interpolation_type = "linear"
    plotter.render()
    return plotter, actor


def test_an_actor_that_was_removed_is_let_go_of(plotter):
    """At once, and not when the next is drawn."""
    actor, mapper = plotter.add_vdi(soft_ball(8), **LOOKS), vtkWeakReference()
    mapper.Set(actor.mapper)
    shown(plotter)
    plotter.remove_actor(actor)
    actor = plotter.volume = plotter.mapper = None  # PyVista keeps the last of each
    gc.collect()
    assert mapper.Get() is None


@pytest.mark.parametrize("end", ["close", "deep_clean"])
def test_nothing_is_left(no_leaks, end):
    plotter, actor = exercise()
    assert isinstance(actor.mapper, vtkOpenGLGPUVolumeRayCastMapper)
    alive = {}
    for thing in (
        plotter.render_window,
        plotter.renderer,
        actor,
        actor.mapper,
        actor.mapper.GetSource(),
        actor.mapper.driver.box.image,
        actor.prop,
    ):
        alive[type(thing).__name__] = weak = vtkWeakReference()
        weak.Set(thing)
    del thing
    plotter.close()
    if end == "deep_clean":
        plotter.deep_clean()
    del plotter, actor
    gc.collect()
    # beyond Python's view: VTK's own counts
    assert [name for name, weak in alive.items() if weak.Get() is not None] == []
