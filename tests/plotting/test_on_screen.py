"""The same in a window on a virtual X screen: the platform's interactor, event loop and timers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import plugin_on_screen
import pytest
from virtual_screen import virtual_screen

pytestmark = [
    pytest.mark.gl,
    pytest.mark.skipif(
        not sys.platform.startswith("linux") or shutil.which("Xvfb") is None,
        reason="needs an X server without a screen: on Debian and Ubuntu the package 'xvfb'",
    ),
]


def test_on_screen():
    script = Path(plugin_on_screen.__file__)
    left_out = ("VTK_DEFAULT_OPENGL_WINDOW", "PYVISTA_OFF_SCREEN", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in left_out}
    with virtual_screen() as display:
        done = subprocess.run(
            [sys.executable, str(script)],
            env={**environment, "DISPLAY": display},
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
    assert done.stdout.strip() == "all well", done.stdout + done.stderr
    assert done.returncode == 0
    assert "WARN" not in done.stderr, done.stderr
