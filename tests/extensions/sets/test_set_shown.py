"""Sets of VDIs in scenes: the nearest VDI is drawn, blended with its neighbours."""

from __future__ import annotations

import threading
from itertools import pairwise

import numpy as np
import pytest
from plugin_scenes import CLASSIFICATION, soft_ball
from watched_windows import finish, frame, picture_of, turned

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.sets import shown as of_sets


@pytest.fixture(scope="module")
def once(default_runtime):
    return pvdi.generate_set(soft_ball(12), 12, (60, 50), max_supersegments=4, **CLASSIFICATION)


@pytest.fixture
def made(once):
    """The same set, which may be blended otherwise without the others' seeing it."""
    return pvdi.VDISet(list(once), window_size=once.window_size)


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


def test_a_set_makes_no_vdi_at_rest(plotter, made):
    actor, n = shown(plotter, made), len(made)
    for _ in range(3):
        frame(plotter)
        finish("set")
    assert (len(made), actor.status.stand_in) == (n, False)
    with pytest.raises(InvalidArgumentError, match="without a volume"):
        actor.regenerate()
