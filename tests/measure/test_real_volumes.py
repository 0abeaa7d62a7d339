"""Real volumes in the standard cases: the project's accuracy bounds.

A sample of the table (every volume, 1280 x 720) is slow and for the nightly run; the shipped
volumes are checked small on every run.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from real_data import TEST_WHOLE, require_data

from pyvista_vdi import examples
from pyvista_vdi.measure.compare import measure
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS

SMALL = (320, 180)

#: The project's bounds of the standard cases at 1280 x 720 with 20 supersegments. From V_O, against
#: our raycaster at the same step: SSIM at least, worst pixel at most, in 1/255.
AT_V_O = 0.999, 2.0
#: SSIM at 5 and 30 degrees, by transfer function; and of a volume of two values that is solid
#: everywhere, with all: its rays cross more faces than a list has supersegments.
FROM_NEW_VIEWS = {"soft": (0.985, 0.97), "steep": (0.985, 0.97), "nearly-opaque": (0.975, 0.95)}
BINARY_SOLID = {"berea": (0.94, 0.85)}
#: How far mean brightness from a new view may be from the raycaster's, as a share of it.
BRIGHTNESS_TOLERANCE = 0.02

#: Our raycaster against VTK's GPU mapper with the soft transfer function; PSNR in dB.
SSIM_TO_VTK, PSNR_TO_VTK = 0.99, 38.0
#: With the others it may be so many times as far as VTK's own two mappers are from each other, in
#: 1 - SSIM and in the root of the mean square.
FACTOR_OF_VTK = 1.5
#: Steps to a voxel at which two raycasters with samples at different places agree, where half a
#: voxel is not enough: `aneurism` comes to 36.5 dB of VTK's at 2, to 41.6 at 4 and to 47.3 at 8,
#: and each is as far from itself at half the steps.
CONVERGED_STEPS = 8

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


@pytest.mark.parametrize(
    ("name", "transfer_function", "interpolation"),
    [
        pytest.param(*case, marks=[pytest.mark.slow] * (k % 3 > 0))
        for k, case in enumerate(MEASURED)
    ],
)
def test_shipped_volumes_small(name, transfer_function, interpolation, default_runtime):
    pytest.importorskip("pyvista")
    volume = examples.load_data(name, as_volume=True)
    look = looks(transfer_function, interpolation)
    report, vdi, _ = measure(volume, look, SMALL, repeats=0, vtk=False)
    at_generating_view, *turned = (view["near"]["vdi_to_raycaster"] for view in report["views"])
    assert at_generating_view["worst_pixel"] <= ROUNDING
    for found, ssim in zip(turned, MEASURED[name, transfer_function, interpolation], strict=True):
        assert found["ssim"] >= ssim - SSIM_MARGIN
        assert found["brightness"] == pytest.approx(1, abs=BRIGHTNESS_TOLERANCE)
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
    report, _, _ = measure(volume, looks("soft", interpolation), SMALL, repeats=0)
    for view in report["views"]:
        assert view["near"]["raycaster_to_gpu"]["ssim"] >= SSIM_TO_VTK, view["angle"]
        assert view["near"]["raycaster_to_gpu"]["psnr"] >= PSNR_TO_VTK, view["angle"]


#: Bounds that are known to be missed, and why (docs/accuracy.md): vessels and noise thinner than a
#: list is wide. A list's medium fills its width, so thin opaque features come out too wide.
TOO_THIN = {
    ("aneurism", "steep", "nearest"),  # SSIM .9833 at 5 degrees
    ("brain_half_mm", "soft", "nearest"),  # SSIM .9828 at 5 degrees
    ("aneurism", "steep", "linear"),  # 2.8 % too bright at 30 degrees
    ("aneurism", "nearly-opaque", "linear"),  # 3.5 % too bright at 30 degrees
}


def missed_by_the_vdi(report, name, transfer_function):
    """Return what is beyond its bound, of V_O, 5 and 30 degrees."""
    at_v_o, *turned = (view["near"]["vdi_to_raycaster"] for view in report["views"])
    if not (at_v_o["ssim"] >= AT_V_O[0] and at_v_o["worst_pixel"] <= AT_V_O[1]):
        yield at_v_o
    bounds = BINARY_SOLID.get(name, FROM_NEW_VIEWS[transfer_function])
    for found, ssim in zip(turned, bounds, strict=True):
        if not (found["ssim"] >= ssim and abs(found["brightness"] - 1) <= BRIGHTNESS_TOLERANCE):
            yield found


def missed_against_vtk(report, transfer_function):
    """Return the comparisons with VTK's GPU mapper that are beyond their bounds."""
    for view in report["views"]:
        ours, theirs = (view["near"][f"{name}_to_gpu"] for name in ("raycaster", "fixed_point"))
        ssim, psnr = SSIM_TO_VTK, PSNR_TO_VTK
        if transfer_function != "soft":
            ssim = 1 - FACTOR_OF_VTK * (1 - theirs["ssim"])
            psnr = theirs["psnr"] - 20 * np.log10(FACTOR_OF_VTK)
        if not (ours["ssim"] >= ssim and ours["psnr"] >= psnr):
            yield ours


def standard_cases():
    """Every volume with every transfer function at the nearest point, and with one trilinear.

    VTK takes minutes for trilinear ones; `test_shipped_volumes_small` has all of them on two
    volumes. Also the known misses, and one look alone of the largest volume. Every fifth of them
    and the known misses, unless the variable PYVISTA_VDI_TEST_WHOLE asks for all: an hour.
    """
    every = [
        case
        for case in product(examples.WHOLE, TRANSFER_FUNCTIONS, ("nearest", "linear"))
        if case in TOO_THIN
        or case[1] == "soft"
        or (case[2] == "nearest" and case[0] != "allen_mouse_brain")
    ]
    for number, case in enumerate(every):
        if case in TOO_THIN:
            yield pytest.param(
                *case, marks=pytest.mark.xfail(reason="features thinner than a list")
            )
        elif TEST_WHOLE or number % 5 == 0:
            yield case


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.real_data
@pytest.mark.parametrize(("name", "transfer_function", "interpolation"), [*standard_cases()])
def test_standard_table(name, transfer_function, interpolation, default_runtime):
    pytest.importorskip("pyvista")
    volume = require_data(name)
    look = looks(transfer_function, interpolation)
    report, _, _ = measure(volume, look, repeats=0)
    assert [view["angle"] for view in report["views"]] == [0, 5, 30]
    missed = list(missed_by_the_vdi(report, name, transfer_function))
    if list(missed_against_vtk(report, transfer_function)):
        finer = min(volume.spacing) / CONVERGED_STEPS
        report, _, _ = measure(volume, look, repeats=0, sample_distance=finer)
        missed += missed_against_vtk(report, transfer_function)
    assert not missed
