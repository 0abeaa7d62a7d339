"""Frames upon frames (``tests/support/long_load.py``): nothing grows, pictures stay right."""

from __future__ import annotations

import math
import sys

import pytest
from long_load import BOUND, Load, Outcome, Sample

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
    # Views that no VDI serves
    pytest.mark.filterwarnings("ignore::pyvista_vdi.errors.VDIWarning"),
]


@pytest.mark.slow
def test_a_hundred_and_twenty_frames(default_runtime):
    """Short: what is left on the device, files, and the error; memory says nothing so early."""
    outcome = Load(120).run()
    assert outcome.checked == 20
    assert outcome.worst_error <= BOUND
    assert [sample.device <= 0 for sample in outcome.between] == [True]
    early, late = outcome.grown("files")
    assert late <= early
    assert (outcome.resizes, outcome.edits) == (6, 2)
    assert outcome.generations >= 3


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_ten_thousand_frames(default_runtime):
    """Of 3,000 the allocator's own memory still grows by 30 MB."""
    outcome = Load(10_000).run()
    assert outcome.troubles() == []
    assert outcome.generations > 200


@pytest.mark.parametrize("name", ["resident", "device", "files", "threads", "error", "nan", "left"])
def test_what_grows_or_is_wrong_is_noticed(name):
    def troubles(step, error=0.0, left=0):
        held = {"resident": 0, "device": 0, "files": 0, "threads": 0}
        samples = [Sample(frame=f, **{**held, name: f * step}) for f in range(1, 101)]
        between = [Sample(**{**held, "device": left}, frame=1)]
        return Outcome(100, 0, 0, 0, 1, 1, error, 1.0, samples, between).troubles()

    wrong = {"error": (1e-3, 0), "nan": (math.nan, 0), "left": (0.0, 7)}
    if name in wrong:
        name, (error, left) = "device", wrong[name]
        assert len(troubles(0, error, left)) == 1
    else:
        assert troubles(0) == []
        assert f"{name} grew" in troubles(2**20)[0]
