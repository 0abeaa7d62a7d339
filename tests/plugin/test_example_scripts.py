"""The plugin's example scripts run on their own and write a picture with something in it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from skimage.io import imread

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = pytest.mark.gl


@pytest.mark.parametrize(
    "name", ["plotter.py", "pipeline.py", "overlap.py", "picking.py", "files.py", "occlusion.py"]
)
def test_example_writes_a_picture(name, tmp_path):
    target = tmp_path / "picture.png"
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), str(target)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "supersegments" in done.stdout
    assert "VDIWarning" not in done.stderr
    image = imread(target)[..., :3]
    assert image.shape == (480, 640, 3)
    assert np.ptp(image.reshape(-1, 3).astype(int), axis=0).max() > 100


def test_dial_example_writes_a_picture_of_three_qualities(tmp_path):
    target = tmp_path / "picture.png"
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "dial.py"), str(target)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "predicted SSIM 0.9" in done.stdout
    assert "VDIWarning" not in done.stderr
    image = imread(target)[100:, :, :3].astype(int)  # below the texts
    assert image.shape == (260, 900, 3)
    parts = np.split(image, 3, axis=1)
    assert all(np.ptp(part.reshape(-1, 3), axis=0).max() > 100 for part in parts)
    # The best is more like the second than like the cheapest
    good, balanced, fast = parts[2], parts[1], parts[0]
    assert 0 < np.abs(good - balanced).mean() < np.abs(good - fast).mean()


def test_interactive_example_writes_an_animation_with_a_new_vdi(tmp_path):
    target = tmp_path / "animation.gif"
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "interactive.py"), str(target)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    # One more where the device is fast enough to make another on the way
    shown = re.search(r"VDI no\. (\d+)", done.stdout)
    assert shown is not None, done.stdout
    assert int(shown[1]) >= 2
    assert "VDIWarning" not in done.stderr
    with Image.open(target) as animation:
        assert animation.size == (320, 240)
        assert animation.n_frames > 20
        first = np.asarray(animation.convert("RGB")).astype(int)
        animation.seek(animation.n_frames - 1)
        last = np.asarray(animation.convert("RGB")).astype(int)
    assert np.abs(last - first)[100:].mean() > 5, "nothing has turned"
