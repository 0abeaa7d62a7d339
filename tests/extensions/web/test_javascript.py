"""The viewer's pure functions, its types and its package, by Node where that is installed."""

import os
import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path

import pytest

from pyvista_vdi import __version__

HERE = Path(__file__).parent / "javascript"
VIEWER = resources.files("pyvista_vdi.extensions.web") / "viewer"


def test_units():
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node in the path, 20 or newer")
    done = subprocess.run(
        [node, "--test"],
        cwd=HERE,
        env={**os.environ, "PYVISTA_VDI_VIEWER": str(VIEWER)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_package_has_the_version_of_this_one():
    text = (VIEWER / "package.json").read_text(encoding="utf-8")
    version = re.search(r'"version": "([^"]+)"', text)[1]
    assert __version__.startswith(version)
