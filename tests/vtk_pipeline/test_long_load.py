"""Frames upon frames (``tests/support/long_load.py``): nothing grows, pictures stay right."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys

import long_load
import pytest
from long_load import BOUND, Outcome, Sample

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def drawn(frames, folder):
    """Draw frames in a process of its own: nothing that other tests let go of is in its memory."""
    path = folder / "long_load.json"
    command = [sys.executable, long_load.__file__, "--frames", str(frames), "--json", str(path)]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}  # where the reference is
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=env)
    assert path.is_file(), done.stderr
    found = json.loads(path.read_text())
    samples = {name: [Sample(**each) for each in found[name]] for name in ("samples", "between")}
    return Outcome(**{**found, **samples})


@pytest.mark.slow
def test_a_hundred_and_twenty_frames(default_runtime, tmp_path):
    """Short: what is left on the device, files, and the error; memory says nothing so early."""
    outcome = drawn(120, tmp_path)
    assert outcome.checked == 20
    assert outcome.worst_error <= BOUND
    assert [sample.device for sample in outcome.between] == [0]
    early, late = outcome.grown("files")
    assert late <= early
    assert (outcome.resizes, outcome.edits) == (6, 2)
    assert outcome.generations >= 3


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_ten_thousand_frames(default_runtime, tmp_path):
    """Of 3,000 the allocator's own memory still grows by 30 MB."""
    outcome = drawn(10_000, tmp_path)
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
