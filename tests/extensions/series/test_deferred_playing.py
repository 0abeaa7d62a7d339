"""A series that keeps values in a plotter: what the property says is in the next frame."""

from __future__ import annotations

import numpy as np
import pytest
from plugin_scenes import soft_ball
from watched_windows import frame, picture_of, threads

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVDIError, UnsupportedError
from pyvista_vdi.model.standard_cases import filling_camera

pv = pytest.importorskip("pyvista")

SIZE, LOOK = (60, 50), {"cmap": "bone", "opacity": [0, 0.2, 0.9], "clim": (20, 220)}


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
        actor.step = step
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
    other = actor.copy()  # of the same step, with a look of its own
    other.prop = pv.VolumeProperty(lookup_table=pv.LookupTable("Reds", scalar_range=(0, 255)))
    assert other.step == 2
    assert not other.mapper.GetVDI().equals(now)
    assert actor.mapper.GetVDI().equals(now)
    actor.play(1000)
    for _ in range(4):
        frame(plotter)
    assert actor.pick(60, 50).value > 0
    actor.pause()
    plotter.remove_actor(actor)
    assert not threads("series")


def test_what_has_no_look_yet_is_refused(plotter, saved):
    with pytest.raises(UnsupportedError, match="max_supersegments"):
        plotter.add_vdi(str(saved), max_supersegments=4)
    actor = pvdi.VDIActor()
    actor.SetMapper(pvdi.VDIMapper())
    actor.GetMapper().SetVDI(pvdi.read(saved))
    with pytest.raises(InvalidVDIError, match="no colours yet"):
        actor.GetMapper().GetVDI()
