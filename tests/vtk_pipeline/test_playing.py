"""Series of VDIs in scenes: each step's picture is that of its VDI, whatever the camera does."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, soft_ball, vdi_of_one_list
from watched_windows import LONG, MOVING, WINDOW, frame, picture_of, small_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError, UnsupportedError, VDIWarning
from pyvista_vdi.model.standard_cases import filling_camera

N = 4
SIZE = (60, 50)


def _volume(k):
    ball = soft_ball(12)
    ball["v"] = np.roll(ball["v"].reshape(12, 12, 12), k, axis=2).ravel()
    return ball


@pytest.fixture(scope="module")
def series(default_runtime):
    looks = {name: value for name, value in LOOKS.items() if name != "show_scalar_bar"}
    volumes = [_volume(k) for k in range(N)]
    camera = filling_camera((-1, 1, -1, 1, -1, 1), SIZE)
    return pvdi.generate_series(volumes, camera, SIZE, np.arange(N) / 4, **looks)


def _shown(plotter, series, **options):
    actor = plotter.add_vdi(series, show_scalar_bar=False, regenerate="never", **options)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    return actor


def test_each_step_is_drawn_as_its_vdi(plotter, series):
    actor = _shown(plotter, series)
    assert (actor.series, actor.time, actor.vdi) == (series, 0.0, series[0])
    pictures = []
    for k, now in enumerate(series.times):
        actor.time = now + 0.1
        assert (actor.step, actor.time) == (k, now)
        pictures.append(frame(plotter))
        np.testing.assert_array_equal(pictures[-1], picture_of(series[k], plotter))
    assert all(np.abs(b - a).max() > 8 for a, b in pairwise(pictures))
    actor.step = -2
    np.testing.assert_array_equal(frame(plotter), pictures[-2])
    assert f"time {series.times[-2]:g}" in str(actor.status)


def test_it_plays_while_the_camera_turns(plotter, series):
    actor = _shown(plotter, series)
    actor.play(rate=200)
    seen, end = set(), time.monotonic() + LONG
    while len(seen) < N:
        assert time.monotonic() < end, seen
        plotter.camera.Azimuth(3)
        picture = frame(plotter, MOVING)
        seen.add(actor.step)
    assert picture.shape == (*WINDOW[::-1], 3)
    assert actor.playing
    actor.pause()
    step = actor.step
    rest = frame(plotter)
    assert (actor.step, actor.playing) == (step, False)
    np.testing.assert_array_equal(rest, picture_of(series[step], plotter))


def test_a_series_from_a_file(plotter, series, tmp_path):
    series.save(tmp_path / "s.vdis")
    actor = _shown(plotter, pvdi.read(tmp_path / "s.vdis"))
    actor.step = 2
    np.testing.assert_array_equal(frame(plotter), picture_of(series[2], plotter))


def test_a_damaged_step_leaves_what_was_shown(plotter, series, tmp_path):
    path = series.save(tmp_path / "s.vdis")
    content = bytearray(path.read_bytes())
    places = [k for k in range(len(content)) if content[k : k + 4] == b"STEP"]
    content[places[2] + 60] ^= 255
    path.write_bytes(content)
    actor = _shown(plotter, pvdi.read(path))
    actor.step = 1
    before = frame(plotter)
    actor.step = 2
    with pytest.warns(VDIWarning, match="step 2"):
        np.testing.assert_array_equal(frame(plotter), before)
    actor.step = 3  # which is written by step 0
    np.testing.assert_array_equal(frame(plotter), picture_of(series[3], plotter))


def test_a_step_is_made_anew_for_another_view(plotter, series):
    actor = _shown(plotter, series)
    actor.step = 1
    plotter.camera.Azimuth(80)
    frame(plotter)
    assert actor.status.angle > 40
    vdi = actor.regenerate()
    assert vdi.window_size == WINDOW
    frame(plotter)
    assert actor.vdi is vdi
    assert actor.status.angle < 1e-6
    np.testing.assert_array_equal(frame(plotter), picture_of(vdi, plotter))
    actor.step = 2
    actor.step = 1
    frame(plotter)
    assert actor.vdi is series[1]


def test_another_series_keeps_the_time(plotter, series):
    actor = _shown(plotter, series)
    actor.time = 0.5
    actor.series = series[1:]
    assert (actor.time, actor.step) == (0.5, 1)
    actor.vdi = series[0]
    assert actor.series is None
    assert not actor.playing


def test_copies_play_by_themselves(plotter, series):
    actor = _shown(plotter, series)
    actor.step = 2
    other = actor.copy()
    assert other.step == 2
    other.step = 0
    assert actor.step == 2


def test_a_movie_has_every_step(plotter, series, tmp_path):
    imageio = pytest.importorskip("imageio")
    plotter.window_size = (240, 200)
    actor = _shown(plotter, series)
    plotter.open_gif(tmp_path / "m.gif")
    for now in series.times:
        actor.time = now
        plotter.write_frame()
    plotter.mwriter.close()
    frames = [np.asarray(each).astype(int) for each in imageio.mimread(tmp_path / "m.gif")]
    assert len(frames) == N
    for k, picture in enumerate(frames):
        other = picture_of(series[k], plotter)
        # 256 colours of a picture that has more
        assert np.abs(picture[..., :3] - other).mean() < 3


def test_a_slider_sets_the_time_and_follows_it(plotter, series):
    actor = _shown(plotter, series)
    slider = actor.add_time_slider(plotter, title="t / s")
    bar = slider.GetRepresentation()
    assert (bar.GetMinimumValue(), bar.GetMaximumValue(), bar.GetValue()) == (0.0, 0.75, 0.0)
    bar.SetValue(0.52)
    slider.InvokeEvent("InteractionEvent")
    assert actor.time == 0.5
    actor.play(rate=200)
    end = time.monotonic() + LONG
    while actor.step == 2:
        assert time.monotonic() < end
        frame(plotter)
    assert bar.GetValue() == actor.time


def test_vtk_alone_shows_a_series(series):
    mapper, actor = pvdi.VDIMapper(), pvdi.VDIActor()
    mapper.SetSeries(series)
    actor.SetMapper(mapper)
    assert mapper.GetSeries() is series
    plotter = pv.Plotter(window_size=WINDOW)
    plotter.renderer.AddVolume(actor)
    plotter.renderer.ResetCamera()
    plotter.show(auto_close=False)
    actor.time = 0.75
    np.testing.assert_array_equal(frame(plotter), picture_of(series[3], plotter))
    plotter.close()


def test_what_has_no_times_is_refused(plotter, series):
    actor = plotter.add_vdi(small_vdi())
    for use in (actor.play, actor.pause, lambda: actor.time, lambda: setattr(actor, "step", 0)):
        with pytest.raises(InvalidArgumentError, match="shows no series"):
            use()
    assert actor.series is None
    assert not actor.playing
    with pytest.raises(InvalidArgumentError, match="VDISeries"):
        actor.mapper.SetSeries([1, 2])
    with pytest.raises(UnsupportedError, match="cmap cannot be given with a VDI"):
        plotter.add_vdi(series, cmap="bone")
    with pytest.raises(InvalidVDIError):
        actor.mapper.SetVDI([series])
    files = pvdi.VDISeries.of([vdi_of_one_list()] * 2)
    one = plotter.add_vdi(files[:1], show_scalar_bar=False)
    with pytest.raises(InvalidArgumentError, match="one step"):
        one.add_time_slider(plotter)
    with pytest.raises(InvalidArgumentError, match="not at hand"):
        one.regenerate()


def test_closing_while_it_plays_leaves_nothing(no_leaks, series):
    plotter = pv.Plotter(window_size=WINDOW)
    actor = _shown(plotter, series)
    actor.add_time_slider(plotter)
    actor.play()
    frame(plotter)
    player = actor._player()
    plotter.close()
    assert not player.playing
    assert not player._worker.running
    del plotter, actor
