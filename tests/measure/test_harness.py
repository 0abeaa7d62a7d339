"""The harness: files of results, and a run that goes on."""

from __future__ import annotations

import json
import math
from statistics import NormalDist

import numpy as np
import pytest

from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.measure.clock import rank_sum_chance
from pyvista_vdi.measure.harness import Case, Latest, run
from pyvista_vdi.measure.results import Results
from pyvista_vdi.model.camera import Camera

CASES = [
    Case(volume, look, (96, 64), angle, options=(("max_supersegments", 8),))
    for volume, looks in (("small", ("a",)), ("large", ("a", "b", "c", "d")))
    for look in looks
    for angle in (0.0, 5.0, 30.0)
]


@pytest.fixture
def begun(default_runtime, tmp_path):
    def begin(**changes):
        arguments = {"plan": {"repeats": 3}, "path": tmp_path / "a.json", "rooms": ["raycasting"]}
        return Results.begun("test", **{**arguments, **changes})

    return begin


@pytest.mark.fast
def test_a_case_is_its_row_and_its_view():
    case = Case("brain", None, (96, 64), 30.0, 2.0, (("max_supersegments", 8),), what="view")
    assert case.name == "brain, 96x64, max_supersegments 8, 30 degrees, zoomed by 2, view"
    assert case.to_dict() == {
        "what": "view",
        "volume": "brain",
        "window_size": (96, 64),
        "max_supersegments": 8,
        "angle": 30.0,
        "zoom": 2.0,
    }
    v_o = Camera((0, -9, 0), (0, 0, 0), (0, 0, 1), view_angle=30)
    assert case.camera(v_o) == v_o.azimuth(30).replace(view_angle=15)


def test_a_run_measures_what_is_missing_and_says_why_something_is(begun):
    asked, heard = [], []

    def measure(case):
        asked.append(case)
        if case.look == "d":
            raise DeviceMemoryError("9 GiB")
        return {"seconds": 0.123456789, "psnr": math.inf, "bytes": 123456789, "clock": [1e-7 / 3]}

    run(CASES[:4], measure, begun(), lambda *said: heard.append(said))
    assert [said for _, *said in heard] == [*([case.name] for case in CASES[:4]), []]
    assert [share for share, *_ in heard] == [0, 0.25, 0.5, 0.75, 1]
    results = begun(resume=True)
    run(CASES, measure, results)
    assert asked == CASES  # none twice
    found = json.loads(results.path.read_text())
    assert [row["case"] for row in found["rows"]] == json.loads(
        json.dumps([case.to_dict() for case in CASES])
    )
    assert found["rows"][0] == {
        "case": found["rows"][0]["case"],
        "seconds": 0.12346,
        "psnr": None,
        "bytes": 123456789,
        "clock": [3.3333e-08],
    }
    assert [row["refused"] for row in results.rows(look="d")] == ["DeviceMemoryError: 9 GiB"] * 3
    assert len(list(results.rows(look="a", angle=5.0))) == 2
    assert len(results.path.read_text().splitlines()) < 15 + len(CASES)  # a row a line
    assert Results.read(results.path, "test").data == found


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plan": {"repeats": 4}}, "holds results for repeats = 3, not 4: give the same options"),
        ({"extent": "sample"}, "holds results for extent = whole, not sample"),
        ({"system": {"device": "another"}}, "was measured on device another, and this is"),
        ({"system": {"driver": "another"}}, "was measured on driver another, and this is"),
        ({"sources": {"raycasting": "0"}}, "was measured by other code in raycasting"),
    ],
)
def test_other_results_are_not_gone_on_with(changes, message, begun):
    results = begun()
    results.data["system"] |= changes.pop("system", {})
    results.data["measured"]["sources"] |= changes.pop("sources", {})
    results.save()
    with pytest.raises(InvalidArgumentError, match=message):
        begun(**changes, resume=True)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be read: No such file"),
        ("{", "is no JSON .*: name a file that pyvista-vdi test has written"),
        ("[]", "holds no results"),
        ('{"format": "pyvista-vdi benchmark", "version": 1}', "is of version 1"),
        ('{"format": "pyvista-vdi results", "version": 9}', "is of version 9"),
        ('{"format": "pyvista-vdi results", "version": 2, "kind": "test"}', "lacks plan, system"),
    ],
)
def test_what_holds_no_results_is_refused(tmp_path, content, message):
    if content is not None:
        (tmp_path / "a.json").write_text(content)
    with pytest.raises(InvalidArgumentError, match=message):
        Results.read(tmp_path / "a.json", "test")


def test_results_of_another_kind_are_refused(begun):
    begun().save()
    with pytest.raises(InvalidArgumentError, match="holds results of test: name a file that pyv"):
        Results.read(begun().path, "benchmark")
    with pytest.raises(InvalidArgumentError, match="have no file"):
        _ = begun(path=None).path


@pytest.mark.fast
def test_the_latest_is_kept_and_the_former_closed():
    made, closed = [], []

    class Held:
        def __init__(self, name):
            made.append(name)
            if name == "too large":
                raise DeviceMemoryError(name)
            self.close = lambda: closed.append(name)

    with Latest(Held) as latest:
        assert latest("a") is latest("a")
        latest("b")
        assert closed == ["a"]
        for _ in range(2):
            with pytest.raises(DeviceMemoryError):
                latest("too large")
        latest("b")
    assert made == ["a", "b", "too large", "b"]
    assert closed == ["a", "b", "b"]


@pytest.mark.fast
def test_the_chance_of_a_separation():
    # All of n samples below all of m: 2 of the orders of n and m
    assert rank_sum_chance((1, 2, 3, 4, 5), (6, 7, 8, 9, 10)) == pytest.approx(2 / 252)
    assert rank_sum_chance((3,), (1, 2, 4)) == 1
    few = [-1.0, -2.0, -3.0]
    assert rank_sum_chance(tuple(few), tuple(range(1000))) == pytest.approx(2 / math.comb(1003, 3))
    # As many as may be asked for: 1 + 2 + ... + 929 wins of 10^6, by the normal distribution
    far = (5e5 - 929 * 930 / 2 - 0.5) / math.sqrt(1e6 * 2001 / 12)
    chance = rank_sum_chance(tuple(range(1000)), tuple(np.arange(1000) + 70.5))
    assert chance == pytest.approx(2 * NormalDist().cdf(-far))
