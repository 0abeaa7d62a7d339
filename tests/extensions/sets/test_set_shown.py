"""Sets of VDIs in scenes: the nearest VDI is drawn, blended with its neighbours, and more made."""

from __future__ import annotations

import threading
from itertools import pairwise

import numpy as np
import pytest
from plugin_scenes import CLASSIFICATION, soft_ball
from watched_windows import MOVING, finish, frame, frames_until, picture_of, threads, turned

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.extensions.sets import generate
from pyvista_vdi.extensions.sets import shown as of_sets

GROWTH = "set's growth"


@pytest.fixture(scope="module")
def once(default_runtime):
    with pytest.MonkeyPatch.context() as fewer:
        fewer.setattr(generate, "DIRECTIONS", 12)
        options = {"target_ssim": 0.8, "lists": 1, "max_supersegments": 4, **CLASSIFICATION}
        return pvdi.generate_set(soft_ball(12), "sphere", (60, 50), **options)


@pytest.fixture
def made(once):
    """The same set, which may grow, and be blended otherwise, without the others' seeing it."""
    again = pvdi.VDISet.of(list(once), window_size=once.window_size)
    again._maker = once._maker
    return again


@pytest.fixture
def decoded(monkeypatch):
    """Which VDIs are taken out of sets, and in which thread."""
    taken, get = [], pvdi.VDISet.__getitem__

    def noting(vdi_set, index):
        if isinstance(index, int):
            taken.append((index, threading.current_thread() is threading.main_thread()))
        return get(vdi_set, index)

    monkeypatch.setattr(pvdi.VDISet, "__getitem__", noting)
    return taken


def shown(plotter, vdi_set, **options):
    actor = plotter.add_vdi(vdi_set, show_scalar_bar=False, **options)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    return actor


def test_each_view_is_drawn_by_the_vdi_nearest_to_it(plotter, made):
    made.blend = 0
    actor = shown(plotter, made, regenerate="never")
    seen = set()
    for _ in range(8):
        picture = turned(plotter, 41)
        nearest = made.nearest(plotter.camera)
        seen.add(nearest)
        assert actor.vdi is made[nearest]
        np.testing.assert_array_equal(picture, picture_of(made[nearest], plotter))
    assert len(seen) > 3
    assert actor.vdi_set is made
    x, y = (edge // 2 for edge in plotter.window_size)
    hit, alone = (
        actor.pick(x, y),
        pvdi.pick(made[nearest], plotter.camera, (x, y), plotter.window_size),
    )
    assert (hit.list, hit.supersegment) == (alone.list, alone.supersegment)
    # The frame's view comes of VTK's matrices
    np.testing.assert_allclose(hit.position, alone.position, rtol=1e-9)


def test_between_two_a_blend_is_drawn(plotter, made):
    made.blend = 60
    plotter.window_size = (241, 203)  # with fewer pixels blends differ by fewer steps
    shown(plotter, made, regenerate="never")
    picture = turned(plotter, 17)
    weights = made.weights(plotter.camera)
    assert len(weights) > 1
    mean = sum(w * picture_of(made[i], plotter).astype(float) for i, w in weights)
    # Each picture, and their blend, is rounded by a step of 1/255 at most
    assert np.abs(picture - mean).max() <= 2
    alone = picture_of(made[weights[0][0]], plotter).astype(float)
    assert np.abs(alone - mean).max() > 8


def test_a_set_from_a_file_is_decoded_ahead(plotter, made, decoded, tmp_path):
    read = pvdi.read(made.save(tmp_path / "a.vdiset"))
    decoded.clear()
    actor = shown(plotter, read, regenerate="never")
    finish("set")
    wanted = min(8, len(read))
    nearest = np.argsort(read.distances(plotter.camera), kind="stable")[:wanted].tolist()
    assert set(nearest) <= {i for i, _ in decoded}
    decoded.clear()
    turned(plotter, 5)
    finish("set")
    assert not any(in_frame for _, in_frame in decoded), "a frame has waited"
    actor.mapper.driver.release()
    decoded.clear()
    frame(plotter)  # begins anew
    finish("set")
    assert decoded


def test_with_little_memory_what_is_drawn_stays(plotter, made, decoded, monkeypatch):
    monkeypatch.setattr(of_sets, "MEMORY", 1.0)
    shown(plotter, made, regenerate="never")
    drawn = []
    for _ in range(5):
        turned(plotter, 50)
        finish("set")
        drawn.append({i for i, _ in made.weights(plotter.camera)})
        decoded.clear()
        turned(plotter, 1e-6)
        assert not drawn[-1] & {i for i, in_frame in decoded if in_frame}
    assert any(later - before for before, later in pairwise(drawn))
    decoded.clear()
    turned(plotter, -200)
    gone = {i for i, _ in made.weights(plotter.camera)} - drawn[-1]
    # All but one that was decoded ahead
    assert len(gone - {i for i, _ in decoded}) <= 1


class Hungry:
    """What finds every view lacking."""

    def __init__(self, maker):
        self._maker = maker

    def lacking(self, vdi_set, camera):
        return self._maker(camera)


def test_it_grows_where_the_picture_misses_the_target(plotter, made, once):
    actor = shown(plotter, made)
    plotter.camera.position = np.asarray(plotter.camera.focal_point) + 0.4 * np.subtract(
        plotter.camera.position, plotter.camera.focal_point
    )
    frame(plotter, MOVING)
    finish(GROWTH)
    made._maker, n = Hungry(once._maker), len(made)
    frame(plotter, MOVING)
    assert (threads(GROWTH), len(made)) == ([], n)  # while a hand moves
    frames_until(plotter, lambda: len(made) > n)
    assert made.nearest(plotter.camera) == n
    frame(plotter)
    assert actor.vdi is made[n]
    assert len(once) <= n


def test_off_screen_it_grows_in_the_picture_that_misses_the_target(plotter, made, once):
    made._maker, n = Hungry(once._maker), len(made)
    plotter.add_vdi(made, show_scalar_bar=False)
    plotter.show(auto_close=False)
    assert (len(made), threads(GROWTH)) == (n + 1, [])
    assert made.nearest(plotter.camera) == n
    plotter.render()
    assert len(made) == n + 1  # once for a view


def test_it_does_not_grow_where_the_target_is_reached_or_nothing_is_to_be_made(plotter, made, once):
    view, n = made.cameras[0], len(made)
    assert made.lacking(view) is None or made._maker.maker.ssim([(made[0], 1.0)], view) < 0.8
    made._maker = Hungry(once._maker)
    shown(plotter, made, regenerate="never")
    for _ in range(3):
        frame(plotter)
        finish(GROWTH)
    assert len(made) == n


def test_regenerate_adds_the_view_that_is_shown(plotter, made):
    actor = shown(plotter, made, regenerate="never")
    plotter.camera.Elevation(33)
    vdi = actor.regenerate()
    assert made[-1] is vdi
    frame(plotter)
    assert actor.vdi is vdi
    actor.vdi_set = pvdi.VDISet.of(list(made))
    frame(plotter)
    with pytest.raises(InvalidArgumentError, match="not at hand"):
        actor.regenerate()


def test_what_only_a_volume_can_honour_is_refused(plotter, made):
    with pytest.raises(UnsupportedError, match="cmap"):
        plotter.add_vdi(made, cmap="bone")
    actor = shown(plotter, made)
    with pytest.raises(InvalidArgumentError, match="SetVDISet"):
        actor.mapper.SetVDISet([made[0]])
    assert actor.mapper.GetSeries() is None
