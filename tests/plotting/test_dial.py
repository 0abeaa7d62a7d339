"""One dial in a plotter and in a pipeline: what is asked reaches the VDI; the status says it."""

from __future__ import annotations

import pytest
from plugin_scenes import LOOKS, soft_ball
from vtk_sources import SIZE, ready_source, some_property

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.options import QualityTarget
from pyvista_vdi.quality.plan import REGENERATE_BELOW

pytestmark = pytest.mark.gl

WINDOW = (60, 48)


def shown(plotter, **arguments):
    actor = plotter.add_vdi(soft_ball(12), draw="vdi", **LOOKS, **arguments)
    plotter.show(auto_close=False)
    return actor


def test_the_status_says_what_was_chosen_and_is_predicted(plotter):
    actor = shown(plotter, quality="balanced")
    status, dial = actor.status, actor.vdi.metadata["dial"]
    assert dial["asked"] == {"quality": "balanced"}
    assert dial["predicted"]["ssim"] >= 0.96
    width, height = actor.vdi.window_size
    assert f"chosen {width} x {height} lists of up to" in str(status)
    assert actor.vdi.precision == "8-byte"
    before = actor.vdi
    actor.regenerate(pvdi.Camera((3, -4, 1), (0, 0, 0), (0, 0, 1)))
    assert actor.vdi is not before
    assert actor.vdi.metadata["dial"]["asked"] == {"quality": "balanced"}


@pytest.mark.parametrize(
    ("arguments", "bound"),
    [
        ({}, None),
        ({"quality": "high"}, REGENERATE_BELOW),  # .98 less .02 is above it
        ({"quality": "fast"}, 0.91),
        ({"target_ssim": 0.5, "settings": pvdi.Settings(regenerate_below=0.3)}, 0.3),
        ({"max_bytes": 1e9}, None),
    ],
)
def test_views_regenerate_below_what_was_asked_for(plotter, arguments, bound):
    actor = plotter.add_vdi(soft_ball(12), render=False, **arguments)
    assert actor.mapper.GetRegenerateBelow() == pytest.approx(bound)


def test_a_source_makes_what_generate_makes():
    source = ready_source()
    source.SetDial("high", max_bytes=10**6)
    assert source.GetDial() == QualityTarget("high", max_bytes=10**6)
    looks = {"volume_property": some_property()}
    expected = pvdi.generate(
        soft_ball(12), source.GetCamera(), SIZE, quality="high", max_bytes=10**6, **looks
    )
    assert source.GetVDI().equals(expected)
    assert source.GetVDI().metadata["dial"]["chosen"] == expected.metadata["dial"]["chosen"]
    source.SetDial()
    assert source.GetDial() is None
    source.SetPrecision("8-byte")
    assert source.GetPrecision() == source.GetVDI().precision == "8-byte"
    assert source.GetVDI().window_size == SIZE
    source.SetMaxSupersegments(5)
    source.SetDial("fast")
    refused = {"max_supersegments=5": source.GetVDI, "got 3": lambda: source.SetOptions(3)}
    for message, call in refused.items():
        with pytest.raises(InvalidArgumentError, match=message):
            call()
