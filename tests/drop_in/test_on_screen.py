"""The quick cases in windows on a virtual screen, as scripts without ``off_screen`` open them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from virtual_screen import virtual_screen

pytestmark = [
    pytest.mark.gl,
    pytest.mark.slow,
    pytest.mark.skipif(
        not sys.platform.startswith("linux") or shutil.which("Xvfb") is None,
        reason="needs an X server without a screen: on Debian and Ubuntu the package 'xvfb'",
    ),
]


def test_windows_on_a_screen(default_runtime):
    left_out = ("VTK_DEFAULT_OPENGL_WINDOW", "PYVISTA_OFF_SCREEN", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in left_out}
    with virtual_screen() as display:
        done = subprocess.run(
            [sys.executable, str(Path(__file__).with_name("on_screen.py"))],
            env={**environment, "DISPLAY": display},
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert len(said) == 1, done.stdout
    assert int(said[0].split()[0]) >= 30
