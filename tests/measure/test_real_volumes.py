"""Real volumes in the standard cases: the project's accuracy bounds.

The whole table (every volume, 1280 x 720) is slow and for the nightly run; the shipped volumes are
checked small on every run.
"""

from __future__ import annotations

import os
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from real_data import require_data

from pyvista_vdi import examples
from pyvista_vdi.measure.compare import Settings, judge_vdi, judge_vtk, measure
from pyvista_vdi.measure.compare.bounds import (
    BRIGHTNESS_TOLERANCE,
    CONVERGED_STEPS,
    PSNR_TO_VTK,
    SSIM_TO_VTK,
)
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS

SMALL = (320, 180)

#: SSIM at 5 and 30 degrees from V_O at 320 x 180, measured with Intel's OpenCL. The bounds of the
#: standard table do not apply: a list is four times as wide as at 1280 x 720, about two voxels, so
#: it averages what a new view tells apart, and SSIM's window of 11 pixels sees more detail.
MEASURED = {
    ("brain", "soft", "nearest"): (0.9724, 0.9748),
    ("brain", "steep", "nearest"): (0.9647, 0.9621),
    ("brain", "nearly-opaque", "nearest"): (0.9790, 0.9808),
    ("rayleigh_taylor", "soft", "nearest"): (0.9885, 0.9876),
    ("rayleigh_taylor", "steep", "nearest"): (0.9821, 0.9809),
    ("rayleigh_taylor", "nearly-opaque", "nearest"): (0.9808, 0.9775),
    ("brain", "soft", "linear"): (0.9746, 0.9721),
    ("brain", "steep", "linear"): (0.9785, 0.9727),
    ("brain", "nearly-opaque", "linear"): (0.9844, 0.9836),
    ("rayleigh_taylor", "soft", "linear"): (0.9919, 0.9904),
    ("rayleigh_taylor", "steep", "linear"): (0.9894, 0.9870),
    ("rayleigh_taylor", "nearly-opaque", "linear"): (0.9878, 0.9844),
}

#: Other forms of the merge criterion that were tried moved SSIM by up to 0.001. A list that forgets
#: what V_O cannot see (``view_cone=0``) loses 0.027: rayleigh_taylor, nearly opaque, 30 degrees.
SSIM_MARGIN = 0.003

#: Worst pixel from V_O, in 1/255. Merging is exact there but for rounding: float32 composites some
#: hundreds of samples, 6e-8 each, in another order. Measured: up to 0.002.
ROUNDING = 0.05


def looks(transfer_function, interpolation):
    return {**TRANSFER_FUNCTIONS[transfer_function], "interpolation": interpolation}


@pytest.mark.every(3)
@pytest.mark.parametrize(("name", "transfer_function", "interpolation"), list(MEASURED))
def test_shipped_volumes_small(name, transfer_function, interpolation, default_runtime):
    pytest.importorskip("pyvista")
    volume = examples.load_data(name, as_volume=True)
    settings = Settings(looks(transfer_function, interpolation), SMALL, repeats=0, vtk=False)
    report, vdi, _ = measure(volume, settings)
    at_generating_view, *turned = (result.vdi_to_raycaster for result in report.angles)
    assert at_generating_view.worst_pixel <= ROUNDING
    for found, ssim in zip(turned, MEASURED[name, transfer_function, interpolation], strict=True):
        assert found.ssim >= ssim - SSIM_MARGIN
        assert found.mean_brightness_ratio == pytest.approx(1, abs=BRIGHTNESS_TOLERANCE)
    assert np.diff(vdi.offsets).max() <= 20


@pytest.mark.gl
@pytest.mark.parametrize(
    ("name", "interpolation"),
    [
        ("brain", "linear"),
        ("rayleigh_taylor", "nearest"),
        pytest.param("brain", "nearest", marks=pytest.mark.slow),
        pytest.param("rayleigh_taylor", "linear", marks=pytest.mark.slow),
    ],
)
def test_shipped_volumes_against_vtk(name, interpolation, default_runtime):
    """The soft transfer function's bounds; measured small: SSIM .9949, PSNR 40.0 dB at least."""
    pytest.importorskip("pyvista")
    volume = examples.load_data(name, as_volume=True)
    report, _, _ = measure(volume, Settings(looks("soft", interpolation), SMALL, repeats=0))
    for result in report.angles:
        assert result.raycaster_to_gpu.ssim >= SSIM_TO_VTK, result.angle
        assert result.raycaster_to_gpu.psnr >= PSNR_TO_VTK, result.angle


#: Bounds that are known to be missed, and why (docs/accuracy.md): vessels and noise thinner than a
#: list is wide. A list's medium fills its width, so thin opaque features come out too wide.
TOO_THIN = {
    ("aneurism", "steep", "nearest"),  # SSIM .9833 at 5 degrees
    ("brain_half_mm", "soft", "nearest"),  # SSIM .9828 at 5 degrees
    ("aneurism", "steep", "linear"),  # 2.8 % too bright at 30 degrees
    ("aneurism", "nearly-opaque", "linear"),  # 3.5 % too bright at 30 degrees
}


def standard_cases():
    """Every volume with every transfer function at the nearest point, and with one trilinear.

    VTK takes minutes for trilinear ones; `test_shipped_volumes_small` has all of them on two
    volumes. Also the known misses, and one look alone of the largest volume.
    """
    for name, look, interpolation in product(
        examples.WHOLE, TRANSFER_FUNCTIONS, ("nearest", "linear")
    ):
        known = (name, look, interpolation) in TOO_THIN
        if known or look == "soft" or (interpolation == "nearest" and name != "allen_mouse_brain"):
            thin = pytest.mark.xfail(reason="features thinner than a list")
            yield pytest.param(name, look, interpolation, marks=thin if known else ())


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.real_data
@pytest.mark.parametrize(("name", "transfer_function", "interpolation"), [*standard_cases()])
def test_standard_table(name, transfer_function, interpolation, default_runtime):
    pytest.importorskip("pyvista")
    volume = require_data(name)
    settings = Settings(looks(transfer_function, interpolation), repeats=0)
    report, _, _ = measure(volume, settings)
    checks = judge_vdi(report, name, transfer_function)
    assert len(checks) == 6  # 2 at each view
    to_vtk = judge_vtk(report, transfer_function)
    assert len(to_vtk) == 6
    if not all(check.passed for check in to_vtk):
        finer = min(volume.spacing) / CONVERGED_STEPS
        report, _, _ = measure(volume, replace(settings, sample_distance=finer))
        to_vtk = judge_vtk(report, transfer_function)
    missed = [str(check) for check in (*checks, *to_vtk) if not check.passed]
    assert not missed, os.linesep.join(missed)
