"""Series of VDIs in scenes: each step's picture is that of its VDI, whatever the camera does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import CLASSIFICATION, soft_ball
from watched_windows import WINDOW, frame, picture_of, threads

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.model.standard_cases import filling_camera

N = 4
SIZE = (60, 50)


@pytest.fixture(scope="module")
def series(default_runtime):
    def volume(k):
        ball = soft_ball(12)
        ball["v"] = np.roll(ball["v"].reshape(12, 12, 12), k, axis=2).ravel()
        return ball

    camera, times = filling_camera((-1, 1, -1, 1, -1, 1), SIZE), np.arange(N) / 4
    return pvdi.generate_series(
        [volume(k) for k in range(N)], camera, SIZE, times, **CLASSIFICATION
    )


def shown(plotter, series, **options):
    actor = plotter.add_vdi(series, show_scalar_bar=False, regenerate="never", **options)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    return actor


def test_each_step_is_drawn_as_its_vdi(plotter, series):
    actor = shown(plotter, series)
    assert (actor.player.collection, actor.player.time, actor.vdi) == (series, 0.0, series[0])
    pictures = []
    for k, now in enumerate(series.times):
        actor.player.time = now + 0.1
        assert (actor.player.step, actor.player.time) == (k, now)
        pictures.append(frame(plotter))
        np.testing.assert_array_equal(pictures[-1], picture_of(series[k], plotter))
    assert all(np.abs(b - a).max() > 8 for a, b in pairwise(pictures))
    actor.player.step = -2
    np.testing.assert_array_equal(frame(plotter), pictures[-2])
    assert f"time {series.times[-2]:g}" in str(actor.status)


def test_a_damaged_step_of_a_file_leaves_what_was_shown(plotter, series, tmp_path):
    path = tmp_path / "s.vdis"
    with pvdi.SeriesWriter(path) as out:
        for step in series:
            out.append(step)
    (path / "000002.vdi").write_bytes(b"damaged")
    actor = shown(plotter, pvdi.read(path))
    actor.player.step = 1
    before = frame(plotter)
    np.testing.assert_array_equal(before, picture_of(series[1], plotter))
    actor.player.step = 2
    with pytest.warns(VDIWarning, match=r"000002\.vdi"):
        np.testing.assert_array_equal(frame(plotter), before)
    actor.player.step = 3
    np.testing.assert_array_equal(frame(plotter), picture_of(series[3], plotter))


def test_closing_while_it_plays_leaves_nothing(no_leaks, series):
    plotter = pv.Plotter(window_size=WINDOW)
    actor = shown(plotter, series)
    actor.player.play()
    frame(plotter)
    plotter.close()
    assert not actor.player.playing
    assert not threads("series")
    del plotter, actor


LOOK = {"cmap": "bone", "opacity": [0, 0.2, 0.9], "clim": (20, 220)}


@pytest.fixture(scope="module")
def saved(default_runtime, tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "run.vdis"
    camera = filling_camera((-1, 1, -1, 1, -1, 1), SIZE)
    with pvdi.SeriesWriter(path, camera, SIZE, classification="deferred") as out:
        for k in range(4):
            ball = soft_ball(12)
            ball["v"] = np.roll(ball["v"].reshape(12, 12, 12), k, axis=2).ravel()
            out.append(ball, k / 4)
    return path


def test_steps_are_drawn_in_the_look_that_is_given_and_in_what_it_becomes(plotter, saved):
    actor = plotter.add_vdi(str(saved), show_scalar_bar=False, regenerate="never", **LOOK)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    series = pvdi.read(saved)
    for step in (0, 2):
        actor.player.step = step
        picture = frame(plotter)
        of_one = picture_of(series[step].classified(**LOOK), plotter)
        assert np.abs(picture - of_one).max() <= 1
    values = actor.mapper.driver.input.deferred
    assert values.equals(series[2])
    actor.prop.GetScalarOpacity().AddPoint(60, 1.0)
    changed = frame(plotter)
    now = values.classified(volume_property=actor.prop)
    assert np.abs(changed - picture_of(now, plotter)).max() <= 1
    assert np.abs(changed - picture).max() > 8
    assert actor.pick(60, 50).value > 0
