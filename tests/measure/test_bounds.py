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

PERFECT = Comparison(1.0, math.inf, 0.0, (0, 0), 1.0)


def found(ssim=1.0, psnr=60.0, worst=0.0, brightness=1.0):
    return Comparison(ssim, psnr, worst, (0, 0), brightness)


def report(*angles, dimensions=(256, 256, 256), generation=None, full_raycast=None):
    timings = [t if t is None else Timing(t, t) for t in (generation, full_raycast)]
    return Report({"dimensions": list(dimensions)}, {}, {}, *timings, list(angles))


def view(angle, vdi=PERFECT, ours=None, theirs=None):
    return AngleResult(angle, vdi, ours, theirs, {})


def view_with_times(**seconds):
    times = {name: Timing(t, t) for name, t in seconds.items()}
    return AngleResult(5.0, PERFECT, None, None, times)


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


@pytest.mark.parametrize("brightness", [0.9799, 1.0201])
def test_brightness(brightness):
    checks = judge_vdi(report(view(5, found(brightness=brightness))), "brain", "soft")
    assert missed(checks) == ["brightness error at 5 degrees"]


def test_the_generating_view_has_its_own_bounds():
    checks = judge_vdi(report(view(0, found(0.998, worst=2.1))), "brain", "soft")
    assert missed(checks) == ["SSIM at V_O", "worst pixel at V_O"]
    assert missed(judge_vdi(report(view(0, found(0.9991, worst=2))), "brain", "soft")) == []


def test_other_angles_have_no_bound():
    assert judge_vdi(report(view(60, found(0.1))), "brain", "soft") == []


def test_soft_is_held_against_vtk_itself():
    far = view(0, ours=found(0.989, 37.9), theirs=found(0.5, 10))
    checks = judge_vtk(report(far), "soft")
    assert missed(checks) == ["SSIM to VTK at 0 degrees", "PSNR to VTK at 0 degrees"]


def test_the_others_are_held_against_what_vtk_differs():
    # 1.5 times the root mean square is 3.52 dB less
    near = view(0, ours=found(0.986, 36.5), theirs=found(0.99, 40))
    assert missed(judge_vtk(report(near), "steep")) == []
    far = view(0, ours=found(0.984, 36.4), theirs=found(0.99, 40))
    checks = judge_vtk(report(far), "steep")
    assert missed(checks) == ["1 - SSIM to VTK at 0 degrees", "RMS to VTK at 0 degrees"]


def test_a_figure_that_is_no_number_misses():
    assert not Check("SSIM", math.nan, ">=", 0.9).passed
    assert "MISSED" in str(Check("SSIM", math.nan, ">=", 0.9))
    assert str(Check("SSIM", 0.99, ">=", 0.9)) == "SSIM: 0.99 >= 0.9 reached"


def test_times():
    timed = view_with_times(vdi=0.8, gpu=1, fixed_point=2)
    checks = judge_times(report(timed, generation=3.1, full_raycast=2), "heptane")
    assert missed(checks) == ["generation / raycast", "frame / VTK at 5 degrees"]


@pytest.mark.parametrize(
    ("volume", "dimensions"), [("brain", (181, 217, 181)), ("berea", (400, 400, 400))]
)
def test_small_and_binary_volumes_have_no_frame_bound(volume, dimensions):
    timed = view_with_times(vdi=9, gpu=1)
    checks = judge_times(report(timed, dimensions=dimensions, generation=1, full_raycast=1), volume)
    assert [check.name for check in checks] == ["generation / raycast"]


def test_without_timings_there_is_nothing_to_judge():
    assert judge_times(report(view(5)), "heptane") == []


def test_every_standard_transfer_function_has_bounds():
    for look in TRANSFER_FUNCTIONS:
        assert len(judge_vdi(report(view(0), view(5), view(30)), "brain", look)) == 6
