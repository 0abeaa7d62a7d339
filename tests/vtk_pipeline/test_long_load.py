"""Frames upon frames (``tests/support/long_load.py``): nothing grows, pictures stay right."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import long_load
import pytest
from long_load import Outcome, Sample

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
@pytest.mark.timeout(3600)
def test_ten_thousand_frames(default_runtime, tmp_path):
    """Of 3,000 the allocator's own memory still grows by 30 MB."""
    outcome = drawn(10_000, tmp_path)
    assert outcome.troubles() == []
    assert outcome.generations > 200
