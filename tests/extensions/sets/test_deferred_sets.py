"""Sets of deferred VDIs: what is seen is that of the nearest, in a look that is chosen later."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from command_line import complaint, run
from plugin_scenes import soft_ball
from watched_windows import frame, picture_of

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.model.standard_cases import filling_camera

pv = pytest.importorskip("pyvista")

SIZE, LOOK = (60, 50), {"cmap": "bone", "opacity": [0, 0.2, 0.9], "clim": (20, 220)}
CAMERA = filling_camera((-1, 1, -1, 1, -1, 1), SIZE)


@pytest.fixture(scope="module")
def views(default_runtime):
    return [
        pvdi.generate(
            soft_ball(12),
            CAMERA.azimuth(angle),
            SIZE,
            classification="deferred",
            value_range=(1, 250),
            precision="8-byte",
        )
        for angle in (0, 30)
    ]


@pytest.fixture(scope="module")
def saved(views, tmp_path_factory):
    return pvdi.VDISet(views).save(tmp_path_factory.mktemp("set") / "ball.vdiset")


@pytest.mark.filterwarnings("ignore:the transfer function shows values outside")
def test_what_is_read_and_rendered_is_that_of_each_view(views, saved, tmp_path, capsys):
    found = pvdi.read(saved)
    assert all(one.equals(other) for one, other in zip(found, views, strict=True))
    assert found.value_range == (1, 250)
    assert "1 to 250" in repr(found)
    baked = pvdi.VDISet([view.classified(**LOOK) for view in views])
    view = CAMERA.azimuth(12)
    expected = pvdi.render(baked, view)
    assert np.array_equal(pvdi.render(found.classified(**LOOK), view), expected)
    pickled = pickle.loads(pickle.dumps(found.classified(**LOOK)))
    assert np.array_equal(pvdi.render(pickled, view), expected)
    assert np.array_equal(pvdi.render(found, view, **LOOK), expected)
    picked = [pvdi.pick(each, view, (30, 25), **LOOK) for each in (found, views[0])]
    assert picked[0] == picked[1]
    for refused in (lambda: pvdi.render(found, view), lambda: found.save(tmp_path / "a.html")):
        with pytest.raises(InvalidVDIError, match="no colours yet"):
            refused()
    with pytest.raises(InvalidVDIError, match="number 1 has colours"):
        pvdi.VDISet([views[0], baked[1]])
    with pytest.raises(TypeError, match="generate_set.*generate_series"):
        pvdi.generate_set(soft_ball(12), window_size=SIZE, classification="deferred")
    picture = tmp_path / "a.png"
    assert "no colours yet: give --cmap" in complaint(capsys, "render", saved, "-o", picture)
    run(capsys, "render", saved, "-o", picture, "--cmap", "bone")


def test_its_property_is_followed_in_a_plotter(plotter, saved):
    actor = plotter.add_vdi(str(saved), show_scalar_bar=False, **LOOK)
    plotter.show(auto_close=False)
    pictures = []
    for _ in range(2):
        values = [view.classified(volume_property=actor.prop) for view in pvdi.read(saved)]
        pictures.append(frame(plotter))
        assert np.abs(pictures[-1] - picture_of(pvdi.VDISet(values), plotter)).max() <= 1
        actor.prop.GetScalarOpacity().AddPoint(60, 1.0)
    assert np.abs(pictures[1] - pictures[0]).max() > 8
