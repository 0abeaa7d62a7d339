"""``add_vdi`` in a real plotter: arguments, updates, files, bars, removal and leaks."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, WINDOW, shown, soft_ball
from watched_windows import small_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIWarning
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
    (bar,) = plotter.scalar_bars.values()
    colors = [bar.GetLookupTable().GetTableValue(k)[:3] for k in (0, 128, 255)]
    stored = np.array(vdi.metadata["transfer_function"]["colors"])
    np.testing.assert_allclose(colors, stored[[0, 128, 255]], atol=0.51 / 255)


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


def exercise():
    plotter = pv.Plotter(window_size=WINDOW)
    actor = plotter.add_vdi(soft_ball(), **{**LOOKS, "show_scalar_bar": True})
    plotter.add_mesh(pv.Sphere(radius=0.5, center=(0.4, 0.2, 0.5)))
    plotter.add_volume_clip_plane(actor)
    shown(plotter)
    actor.prop.interpolation_type = "linear"
    plotter.render()
    return plotter, actor


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
