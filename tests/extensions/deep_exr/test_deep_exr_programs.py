"""Deep images and OpenEXR's own programs: what they make of ours, and what is read of theirs."""

from __future__ import annotations

import ctypes.util
import shutil
import subprocess
import warnings

import numpy as np
import pytest

OpenEXR = pytest.importorskip("OpenEXR")

from deep_programs import COMMANDS, RECORDED, SIZE, VIEW, make, pair  # noqa: E402

import pyvista_vdi as pvdi  # noqa: E402
from pyvista_vdi.errors import VDIFileError, VDIWarning  # noqa: E402

A, B = pair()

#: Half the spacing of float32 at 1: what one rounding costs, relative to the value.
ROUNDING = 2.0**-24


def depths(vdi):
    """Absolute view depths of fronts and backs."""
    return np.stack([vdi.front, vdi.back]).astype(float) + vdi.depth_origin


def recorded(name, **options):
    """Read a recorded file; its attribute is an older one."""
    with pytest.warns(VDIWarning, match="is of version 2 of .* as any program's"):
        return pvdi.read(RECORDED / f"oiiotool_{name}.exr", **options)


def check_shows_both(vdi, angle):
    """Hold a picture of a merged VDI against that of its two in one scene.

    A is rounded to float32 when it is written and again when a sample is split. At tau = 12 that
    moves tau by 2**-24 exp(12) = .0097 each time; over a part x of its length that is
    .0097 x exp(-12 x) of the opacity, at most .0097 / 12 e = 3e-4. Elsewhere it is far less.
    """
    truth = pvdi.render([A, B], VIEW.azimuth(angle), (80, 60))
    assert np.abs(pvdi.render(vdi, VIEW.azimuth(angle), (80, 60)) - truth).max() < 6e-4
    assert truth.max() > 0.3  # something is there


@pytest.mark.parametrize(
    ("name", "lost"), [("tiled", ROUNDING), ("run_lengths", ROUNDING), ("half", 2.0**-11)]
)
def test_recorded_files_are_read(name, lost):
    vdi = recorded(name)
    assert np.array_equal(vdi.counts, A.counts)
    assert np.allclose(depths(vdi), depths(A), rtol=2 * lost)
    assert np.allclose(vdi.color, A.color, atol=4 * lost)
    alphas = [-np.expm1(-each.optical_depth.astype(float)) for each in (vdi, A)]
    assert np.allclose(*alphas, rtol=2 * lost)
    assert np.allclose(vdi.camera.axes, VIEW.axes, atol=1e-6)
    assert vdi.metadata == {"read_from": f"oiiotool_{name}.exr"}


def test_a_recorded_file_of_two_shows_both(default_runtime):
    vdi = recorded("merged")
    for angle in (0, 90):
        check_shows_both(vdi, angle)
    flat = OpenEXR.File(str(RECORDED / "oiiotool_merged_flat.exr")).channels()["RGBA"].pixels
    assert np.abs(pvdi.render(vdi, VIEW, SIZE) - flat).max() < 1e-5


@pytest.mark.filterwarnings("ignore:.*is of version 2:pyvista_vdi.errors.VDIWarning")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no_back", "60 samples without a thickness"),
        ("renamed", r"has the channels left\.A, .* needs Z, ZBack, A, R, G and B"),
        ("flat", "has 0 deep images .* write a flat image, which says nothing about depth, as a"),
        ("parts", "has 2 deep images .* take one of several out by oiiotool"),
    ],
)
def test_what_is_refused_says_why(name, message):
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(RECORDED / f"oiiotool_{name}.exr")
    assert recorded("no_back", thickness=0.1).n_supersegments == A.n_supersegments


@pytest.mark.parametrize("name", COMMANDS)
def test_what_oiiotool_makes(name, tmp_path, default_runtime):
    program = shutil.which("oiiotool") or pytest.skip("oiiotool is not installed")
    made = make(name, tmp_path, program)
    if name in ("cut", "resized", "moved", "flat"):
        with pytest.raises(VDIFileError, match="was cut, resized or moved after|a flat image"):
            pvdi.read(made)
        return
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        vdi = pvdi.read(made)
    changed = name in ("merged", "half", "cropped")
    assert ["was changed after" in str(each.message) for each in given] == [True] * changed
    if name == "merged":
        check_shows_both(vdi, 20)
    elif name == "cropped":
        expected = np.zeros_like(A.counts)
        expected[0:4, 1:4] = A.counts[0:4, 1:4]  # 4 rows from the top's third one on
        assert np.array_equal(vdi.counts, expected)
    else:
        assert np.allclose(depths(vdi), depths(A), rtol=2.0**-10 if name == "half" else ROUNDING)
        assert (vdi.camera, vdi.bounds == A.bounds) == (VIEW, name != "half")


def test_openexrs_own_checks_accept_our_files(tmp_path):
    """``exrinfo``; and what ``exrcheck`` does, from OpenEXR's library."""
    path = A.save(tmp_path / "a.exr")
    program, name = shutil.which("exrinfo"), ctypes.util.find_library("OpenEXRUtil-3_1")
    if program is None and name is None:
        pytest.skip("neither exrinfo nor libOpenEXRUtil-3_1 is installed")
    if program is not None:
        command = [program, "-v", "-s", str(path)]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        # Debian's 3.1.5 returns a number at random for any file, and says ERROR where there is one
        assert "ERROR" not in result.stderr
        assert "compression 'zips'" in result.stdout
        assert "worldToNDC: m44f" in result.stdout
    if name is not None:
        check = ctypes.CDLL(name)._ZN7Imf_3_116checkOpenEXRFileEPKcbbb
        check.restype = ctypes.c_bool  # true where something is wrong
        for core in (False, True):
            assert not check(str(path).encode(), False, False, core)
