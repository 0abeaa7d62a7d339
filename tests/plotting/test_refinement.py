"""Stores in a plotter: which level is shown, and when a finer one is read."""

from __future__ import annotations

import threading

import numpy as np
import pytest
import pyvista as pv

import pyvista_vdi as pvdi
from pyvista_vdi.plotting import refinement

zarr = pytest.importorskip("zarr", minversion="3")
pytestmark = pytest.mark.usefixtures("default_runtime")

N = 64
LOOK = {"clim": (0, 255), "show_scalar_bar": False}


@pytest.fixture
def store(tmp_path):
    """A ball of three levels, each with half the points of the one before."""
    path = tmp_path / "a.ome.zarr"
    group = zarr.open_group(str(path), mode="w", zarr_format=2)
    z, y, x = np.mgrid[:N, :N, :N] / (N - 1) - 0.5
    fine = np.where(z**2 + y**2 + x**2 < 0.2, 200, 20).astype(np.uint8)
    datasets = []
    for level, step in enumerate((1, 2, 4)):
        group.create_array(str(level), data=fine[::step, ::step, ::step], chunks=(16, 16, 16))
        scale = [{"type": "scale", "scale": [float(step)] * 3}]
        datasets.append({"path": str(level), "coordinateTransformations": scale})
    axes = [{"name": a, "type": "space"} for a in "zyx"]
    group.attrs["multiscales"] = [{"version": "0.4", "datasets": datasets, "axes": axes}]
    return path


@pytest.fixture
def plotter():
    plotter = pv.Plotter(off_screen=True, window_size=(40, 30))
    look_from(plotter, 2000)
    yield plotter
    plotter.close()


def look_from(plotter, distance):
    centre = (N - 1) / 2
    at = (centre, centre, centre)
    plotter.camera_position = [(centre, centre, centre + distance), at, (0, 1, 0)]


def picture(plotter):
    plotter.show(auto_close=False)
    plotter.render()
    return plotter.screenshot(return_img=True)


def points(actor):
    return actor.mapper.GetSource().GetVolume().dimensions[0]


@pytest.mark.parametrize("draw", ["auto", "volume", "vdi"])
def test_a_nearer_view_is_drawn_of_a_finer_level(store, plotter, draw, caplog):
    caplog.set_level("INFO", "pyvista_vdi")
    actor = plotter.add_vdi(pvdi.read_volume(store), draw=draw, **LOOK)
    assert (actor.level, points(actor)) == (2, N // 4)
    assert "level 2 of 3" in caplog.text
    picture(plotter)
    look_from(plotter, 120)
    near = picture(plotter)
    assert actor.level < 2
    assert points(actor) == N >> actor.level
    assert actor.status.level == (actor.level, 3)
    assert f"level {actor.level} of 3" in str(actor.status)
    other = pv.Plotter(off_screen=True, window_size=(40, 30))
    look_from(other, 120)
    again = other.add_vdi(pvdi.read_volume(store), draw=draw, **LOOK)
    assert again.level == actor.level
    straight = picture(other)
    other.close()
    if draw != "vdi":  # whose VDI is of the first view
        assert np.array_equal(near, straight)
    level = actor.level
    look_from(plotter, 2000)
    picture(plotter)
    assert actor.level == level  # it is there already


def test_a_level_that_is_asked_for_stays(store, plotter):
    actor = plotter.add_vdi(pvdi.read_volume(store, level=1), **LOOK)
    look_from(plotter, 60)
    picture(plotter)
    assert (actor.level, points(actor)) == (1, N // 2)


def test_levels_have_the_finest_ones_opacity(store, plotter):
    finest = pvdi.read_volume(store)
    actor = plotter.add_vdi(finest, **LOOK)
    assert actor.prop.GetScalarOpacityUnitDistance() == pytest.approx(finest.default_unit_distance)


def test_a_level_that_cannot_be_read_leaves_the_picture_and_is_said_once(store, plotter):
    actor = plotter.add_vdi(pvdi.read_volume(store), **LOOK)
    picture(plotter)
    for chunk in (store / "0").rglob("*"):
        if chunk.is_file() and not chunk.name.startswith("."):
            chunk.write_bytes(b"damaged")
    look_from(plotter, 40)
    with pytest.warns(pvdi.VDIWarning, match="level 0 of .* cannot be read, and level") as said:
        picture(plotter)
    picture(plotter)  # warnings are errors in these tests
    assert len(said) == 1
    assert actor.level == 1  # finer than what was shown


def test_what_memory_cannot_hold_is_not_read(store, plotter, monkeypatch):
    actor = plotter.add_vdi(pvdi.read_volume(store), **LOOK)

    def refuse(nbytes, what, remedy, free):
        raise pvdi.DeviceMemoryError(f"{what} needs {nbytes} bytes: {remedy}")

    monkeypatch.setattr(refinement, "require_host_memory", refuse)
    look_from(plotter, 40)
    with pytest.warns(pvdi.VDIWarning, match="level 0 of .* bytes"):
        picture(plotter)
    assert actor.level == 2


def test_a_removed_actor_reads_nothing_and_other_data_stay(store, plotter, monkeypatch):
    actor = plotter.add_vdi(pvdi.read_volume(store), **LOOK)
    removed = plotter.add_vdi(pvdi.read_volume(store), **LOOK)
    plotter.remove_actor(removed)
    actor.mapper.dataset = pv.ImageData(dimensions=(5, 5, 5))
    actor.mapper.dataset["values"] = np.arange(125.0)
    monkeypatch.setattr(refinement, "load", lambda _: pytest.fail("a level was read"))
    look_from(plotter, 60)
    picture(plotter)
    assert removed._refinement._observer == 0
    assert actor.level is None


def test_an_actor_whose_mapper_is_taken_away_reads_nothing(store, plotter, monkeypatch):
    actor = plotter.add_vdi(pvdi.read_volume(store), **LOOK)
    found = actor._refinement
    monkeypatch.setattr(refinement, "load", lambda _: pytest.fail("a level was read"))
    actor.SetMapper(None)
    found._before_frame()  # VTK would print what it raises, and go on
    assert found._observer == 0


def test_in_a_window_a_thread_reads_and_frames_go_on(store, plotter, monkeypatch):
    actor = plotter.add_vdi(pvdi.read_volume(store), **LOOK)
    picture(plotter)
    go_on, found = threading.Event(), actor._refinement
    load = refinement.load

    def slow(volume):
        assert threading.current_thread() is not threading.main_thread()
        assert go_on.wait(60)
        return load(volume)

    monkeypatch.setattr(refinement, "load", slow)
    monkeypatch.setattr(refinement, "_watched", lambda _: True)
    look_from(plotter, 120)
    picture(plotter)
    assert actor.level == 2
    go_on.set()
    found._worker.join()
    picture(plotter)
    assert actor.level < 2


def test_the_end_of_a_plotter_ends_the_reading(store):
    plotter = pv.Plotter(off_screen=True, window_size=(40, 30))
    actor = plotter.add_vdi(pvdi.read_volume(store), **LOOK)
    found = actor._refinement
    plotter.close()
    assert found._observer == 0
    with pytest.raises(RuntimeError, match="closed"):
        found._worker.put(None)


@pytest.mark.extension("series")
def test_the_dial_and_series_take_the_level_that_the_view_requires(store):
    far = pvdi.Camera(position=(31.5, 31.5, 900), focal_point=(31.5, 31.5, 31.5), view_up=(0, 1, 0))
    size, look = (40, 30), {"clim": (0, 255)}
    chosen = pvdi.read_volume(store).in_view(far, window_size=size)
    assert chosen.level == 2
    dialled = pvdi.generate(pvdi.read_volume(store), far, size, quality="fast", **look)
    assert dialled.metadata["dial"]["chosen"]
    assert dialled.bounds == chosen.bounds
    series = pvdi.generate_series([pvdi.read_volume(store)], far, size, **look)
    assert series[0].bounds == chosen.bounds
    asked = pvdi.generate_series([pvdi.read_volume(store, level=0)], far, size, **look)
    assert asked[0].bounds == pvdi.read_volume(store).bounds != chosen.bounds


@pytest.mark.extension("sets")
def test_a_set_takes_the_finest_level_that_a_view_requires(store):
    at = {"focal_point": (31.5, 31.5, 31.5), "view_up": (0, 1, 0)}
    near, far = (pvdi.Camera(position=(31.5, 31.5, 31.5 + d), **at) for d in (300, 900))
    volume = pvdi.read_volume(store)
    wanted = volume.in_view(far, near, window_size=(40, 30))
    assert wanted.level == 1
    made = pvdi.generate_set(
        volume, [far, near], (40, 30), lists=0.2, max_supersegments=4, clim=(0, 255)
    )
    assert made[0].bounds == wanted.bounds
