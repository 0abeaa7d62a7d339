"""The front of time and accuracy against VTK's mappers."""

from __future__ import annotations

import json

import pytest

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.front import (
    DISTANCES,
    FULL_STEP,
    STEPS,
    FrontFile,
    Plan,
    Point,
    cost_alone,
    front_of,
    full_gain,
    gains,
    measure_front,
    summary,
)


def point(who, seconds, ssim):
    return Point(who, 1.0, 1.0, seconds, ssim)


@pytest.mark.fast
def test_a_front_has_what_nothing_is_as_fast_and_as_near_as():
    points = [point("gpu", s, q) for s, q in ((3, 0.9), (1, 0.8), (2, 0.7), (2, 0.95), (1, 0.5))]
    assert [(p.seconds, p.ssim) for p in front_of(points)] == [(1, 0.8), (2, 0.95)]


@pytest.mark.fast
def test_gains_are_at_equal_ssim():
    theirs = [point("gpu", 8.0, 1.0), point("fixed_point", 4.0, 0.95), point("gpu", 5.0, 0.94)]
    ours = [point("volume", 2.0, 1.0), point("vdi", 1.0, 0.949), point("vdi", 0.1, 0.9)]
    # The slack lets .949 stand for .95, and nothing stand for 1 but 1
    assert gains([*theirs, *ours]) == [4.0 / 1.0, 8.0 / 2.0]
    # That of the faster mapper, though the other's is nearer
    assert full_gain([*theirs, *ours]) == 4.0 / 1.0
    # Nobody of theirs is faster than 4 s; a VDI that comes nearer than all is not compared
    assert cost_alone([*theirs, *ours]) == [0.1 / 4.0, 1.0 / 4.0]
    assert cost_alone([*theirs[1:], point("vdi", 1.0, 0.96)]) == []


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    path = tmp_path_factory.mktemp("front") / "front.json"
    views = ((0.0, 1.0), (30.0, 1.0))
    return path, Plan(("brain", "no_such"), ("soft",), views, (96, 54), 1)


@pytest.mark.gl
def test_everybody_is_measured_and_resumed(measured):
    path, plan = measured
    seen = []
    found = measure_front(plan, path, progress=lambda share, *doing: seen.append((share, *doing)))
    assert list(found.data["left_out"]) == ["no_such"]
    assert [(name, angle, zoom) for name, angle, zoom, _ in found.views()] == [
        ("brain, soft", 0.0, 1.0),
        ("brain, soft", 30.0, 1.0),
    ]
    for _, angle, _, points in found.views():
        ways = {(p.who, p.distance, p.step): p for p in points}
        assert len(ways) == len(points)
        for who in ("gpu", "fixed_point", "volume"):
            assert {(who, d, s) for d in DISTANCES for s in STEPS} <= ways.keys()
        assert ways["volume", 1.0, FULL_STEP].ssim == pytest.approx(1.0, abs=1e-6)
        # At V_O a VDI of the same steps is its volume; fewer rays lose, whoever casts them
        assert ways["vdi", 1.0, FULL_STEP].ssim > (0.999 if angle == 0 else 0.9)
        for who in ("vdi", "volume", "gpu", "fixed_point"):
            step = FULL_STEP if who == "vdi" else 1.0
            assert ways[who, 1.0, step].ssim > ways[who, 2.0, step].ssim > ways[who, 4.0, step].ssim
        assert all(p.seconds > 0 for p in points)
    assert json.loads(path.read_text())["format"] == "pyvista-vdi front"
    assert [share for share, *_ in seen] == sorted(share for share, *_ in seen)
    lines = summary(found)
    assert any(line.startswith("| 30 degrees ") for line in lines)
    assert [line for line in lines if line.startswith("| all ")]
    assert [line for line in lines if line.startswith("| brain, soft ")]
    assert lines[-1].startswith("Measured from ")
    assert seen[-1][0] == 1
    # What is there is not measured again, nor left out any more
    before = path.read_text()
    found.data["left_out"]["brain"] = "not there then"
    found.save()
    again = measure_front(plan, path, resume=True)
    assert list(again.data["left_out"]) == ["no_such"]
    assert again.data["cases"] == json.loads(before)["cases"]
    with pytest.raises(InvalidArgumentError, match="give the same options to --resume"):
        measure_front(Plan(("brain",)), path, resume=True)
    assert FrontFile.read(path).data == again.data


def test_a_short_run_has_24_cases():
    plan = Plan.quick()
    assert len(plan.volumes) * len(plan.looks) * len(plan.views) == 24
    with pytest.raises(InvalidArgumentError, match="repeats"):
        Plan.quick(repeats=0)
