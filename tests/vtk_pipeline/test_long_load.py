"""Frames upon frames (``tests/support/long_load.py``): nothing grows, pictures stay right."""

from __future__ import annotations

import sys
import warnings

import pytest
from long_load import BOUND, Load, Outcome, Sample

from pyvista_vdi.errors import VDIWarning

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def drawn(frames):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VDIWarning)  # views that no VDI serves
        return Load(frames).run()


@pytest.mark.slow
def test_a_hundred_and_twenty_frames(default_runtime):
    """Short: what is left on the device, files, and the error; memory says nothing so early."""
    outcome = drawn(120)
    assert outcome.checked == 20
    assert outcome.worst_error <= BOUND
    assert [sample.device for sample in outcome.between] == [0]
    early, late = outcome.grown("files")
    assert late <= early
    assert (outcome.resizes, outcome.edits) == (6, 2)
    assert outcome.generations >= 3


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_ten_thousand_frames(default_runtime):
    outcome = drawn(10_000)
    assert outcome.troubles() == []
    assert outcome.generations > 200


@pytest.mark.parametrize("name", ["resident", "device", "files", "threads"])
def test_growth_is_noticed(name):
    def run(step):
        samples = [
            Sample(
                **{"frame": f, "resident": 0, "device": 0, "files": 0, "threads": 0, name: f * step}
            )
            for f in range(1, 101)
        ]
        return Outcome(100, 0, 0, 0, 1, 1, 0.0, 1.0, samples, [Sample(1, 0, 0, 0, 0)])

    assert run(0).troubles() == []
    assert f"{name} grew" in run(2**20).troubles()[0]


def test_a_wrong_picture_and_what_stays_are_noticed():
    flat = [Sample(f, 0, 0, 0, 0) for f in range(1, 101)]
    wrong = Outcome(100, 0, 0, 0, 1, 1, 1e-3, 1.0, flat, [Sample(1, 0, 7, 0, 0)])
    assert len(wrong.troubles()) == 2
    assert Outcome(100, 0, 0, 0, 1, 1, float("nan"), 1.0, flat, [flat[0]]).troubles()
