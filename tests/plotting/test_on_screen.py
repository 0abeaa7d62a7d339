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


@pytest.fixture(scope="module")
def display():
    """The name of a virtual X display."""
    with virtual_screen() as name:
        yield name


@pytest.mark.every(6)
@pytest.mark.parametrize("case", [case.__name__ for case in plugin_on_screen.CASES])
def test_on_screen(display, case):
    if case == plugin_on_screen.a_finer_level_comes_by_itself.__name__:
        pytest.importorskip("zarr", minversion="3")
    script = Path(plugin_on_screen.__file__)
    left_out = ("VTK_DEFAULT_OPENGL_WINDOW", "PYVISTA_OFF_SCREEN", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in left_out}
    done = subprocess.run(
        [sys.executable, str(script), case],
        env={**environment, "DISPLAY": display},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.stdout.strip() == "all well", done.stdout + done.stderr
    assert done.returncode == 0
    assert "WARN" not in done.stderr, done.stderr
