"""The front of time and accuracy against VTK's mappers."""

from __future__ import annotations

import pytest
from measured import checked

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.front import (
    DISTANCES,
    FULL_STEP,
    STEPS,
    FrontPlan,
    Point,
    cost_alone,
    front_of,
    full_gain,
    gains,
    left_out,
    measure_front,
    points_of,
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


@pytest.mark.gl
def test_everybody_is_measured_and_resumed(tmp_path):
    plan = FrontPlan(("brain", "no_such"), ("soft",), ((0.0, 1.0), (30.0, 1.0)), (96, 54), 1)
    path, heard = tmp_path / "front.json", []
    found = measure_front(plan, path, progress=lambda share, *doing: heard.append(share))
    assert heard == sorted(heard)
    assert heard[-1] == 1
    assert list(left_out(found)) == ["no_such (DataNotFoundError: not in PYVISTA_VDI_DATA)"]
    rows = list(found.rows(volume="brain", look="soft"))
    assert [row["case"]["angle"] for row in rows] == [0.0, 30.0]
    for row in rows:
        ways = {(p.who, p.distance, p.step): p for p in points_of(row)}
        assert len(ways) == len(row["points"])
        for who in ("gpu", "fixed_point", "volume"):
            assert {(who, d, s) for d in DISTANCES for s in STEPS} <= ways.keys()
        assert ways["volume", 1.0, FULL_STEP].ssim == pytest.approx(1.0, abs=1e-5)
        # At V_O a VDI of the same steps is its volume; fewer rays lose, whoever casts them
        assert ways["vdi", 1.0, FULL_STEP].ssim > (0.999 if row is rows[0] else 0.9)
        for who in ("vdi", "volume", "gpu", "fixed_point"):
            step = FULL_STEP if who == "vdi" else 1.0
            assert ways[who, 1.0, step].ssim > ways[who, 2.0, step].ssim > ways[who, 4.0, step].ssim
        assert all(p.seconds > 0 for p in ways.values())
    lines = summary(found)
    for start in ("| 30 degrees ", "| all ", "| brain, soft "):
        assert [line for line in lines if line.startswith(start)]
    assert lines[-1].startswith("Measured from ")
    # What is there is not measured again, nor left out any more
    found.add({"volume": "brain"}, refused="DataNotFoundError: not in PYVISTA_VDI_DATA")
    again = measure_front(plan, path, resume=True)
    assert len(list(left_out(again))) == 1
    assert [row for row in again.rows() if "refused" not in row] == rows
    with pytest.raises(InvalidArgumentError, match="give the same options to --resume"):
        measure_front(FrontPlan(("brain",)), path, resume=True)
    assert checked(path).data == again.data


def test_a_short_run_has_24_cases():
    assert len(list(FrontPlan.quick().cases())) == 24
    with pytest.raises(InvalidArgumentError, match="repeats"):
        FrontPlan.quick(repeats=0)
