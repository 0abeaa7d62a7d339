"""A report is held against the right bounds, and a missed one is seen."""

from __future__ import annotations

import math

import pytest

from pyvista_vdi.measure.compare import (
    AngleResult,
    Check,
    Report,
    Timing,
    judge_times,
    judge_vdi,
    judge_vtk,
)
from pyvista_vdi.model.metrics import Comparison
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS


def found(ssim=1.0, psnr=60.0, worst=0.0, brightness=1.0):
    return Comparison(ssim, psnr, worst, (0, 0), brightness)


def report(*angles, edge=256, generation=None, full_raycast=None):
    timings = [t if t is None else Timing(t, t) for t in (generation, full_raycast)]
    return Report({"dimensions": [edge] * 3}, {}, {}, *timings, list(angles))


def view(angle, near=found(), *, ours=None, theirs=None, **seconds):  # noqa: B008 - is frozen
    times = {name: Timing(t, t) for name, t in seconds.items()}
    return AngleResult(float(angle), near, ours, theirs, times)


def missed(checks):
    return [check.name for check in checks if not check.passed]


@pytest.mark.parametrize(
    ("volume", "look", "angle", "bound"),
    [
        ("brain", "soft", 5, 0.985),
        ("brain", "steep", 30, 0.97),
        ("heptane", "nearly-opaque", 5, 0.975),
        ("heptane", "nearly-opaque", 30, 0.95),
        ("berea", "soft", 5, 0.94),
        ("berea", "nearly-opaque", 30, 0.85),
    ],
)
def test_ssim_from_a_new_view(volume, look, angle, bound):
    name = f"SSIM at {angle} degrees"
    assert missed(judge_vdi(report(view(angle, found(bound))), volume, look)) == []
    below = report(view(angle, found(bound - 1e-6)))
    assert missed(judge_vdi(below, volume, look)) == [name]


@pytest.mark.parametrize(
    ("result", "names"),
    [
        (view(5, found(brightness=0.9799)), ["brightness error at 5 degrees"]),
        (view(5, found(brightness=1.0201)), ["brightness error at 5 degrees"]),
        (view(0, found(0.998, worst=2.1)), ["SSIM at V_O", "worst pixel at V_O"]),
        (view(0, found(0.9991, worst=2)), []),
        (view(60, found(0.1)), []),  # other angles have no bound
    ],
)
def test_what_a_vdi_misses(result, names):
    assert missed(judge_vdi(report(result), "brain", "soft")) == names


@pytest.mark.parametrize(
    ("ours", "theirs", "look", "names"),
    [
        # Soft is held against VTK itself, the others against what VTK's two mappers differ by:
        # 1.5 times the root mean square is 3.52 dB less
        (found(0.989, 37.9), found(0.5, 10), "soft", ["SSIM", "PSNR"]),
        (found(0.986, 36.5), found(0.99, 40), "steep", []),
        (found(0.984, 36.4), found(0.99, 40), "steep", ["1 - SSIM", "RMS"]),
    ],
)
def test_how_far_from_vtk(ours, theirs, look, names):
    checks = judge_vtk(report(view(0, ours=ours, theirs=theirs)), look)
    assert missed(checks) == [f"{name} to VTK at 0 degrees" for name in names]


def test_a_figure_that_is_no_number_misses():
    assert not Check("SSIM", math.nan, ">=", 0.9).passed
    assert "MISSED" in str(Check("SSIM", math.nan, ">=", 0.9))
    assert str(Check("SSIM", 0.99, ">=", 0.9)) == "SSIM: 0.99 >= 0.9 reached"


@pytest.mark.parametrize(
    ("volume", "edge", "names"),
    [
        ("heptane", 256, ["generation / raycast", "frame / VTK at 5 degrees"]),
        ("brain", 255, ["generation / raycast"]),  # a smaller volume
        ("berea", 400, ["generation / raycast"]),  # a binary solid
    ],
)
def test_times(volume, edge, names):
    timed = view(5, vdi=0.8, gpu=1, fixed_point=2)
    checks = judge_times(report(timed, edge=edge, generation=3.1, full_raycast=2), volume)
    assert [check.name for check in checks] == missed(checks) == names
    assert judge_times(report(view(5)), volume) == []


def test_every_standard_transfer_function_has_bounds():
    for look in TRANSFER_FUNCTIONS:
        assert len(judge_vdi(report(view(0), view(5), view(30)), "brain", look)) == 6
