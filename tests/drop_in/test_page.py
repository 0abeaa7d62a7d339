"""``docs/drop_in.md`` is what the cases make of it; the quick ones, on a virtual screen as well."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from drop_in.make_page import kinds, page
from drop_in.stage import PAGE, least_ssims
from virtual_screen import virtual_screen


@pytest.mark.skipif(not PAGE.is_file(), reason="needs the pages of a checkout")
def test_the_page_is_up_to_date_and_has_enough_cases():
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(least_ssims()), "run python tests/drop_in/make_page.py"
    cases = [case for kind in kinds().values() for case in kind.cases]
    assert len(cases) >= 300
    assert sum(case.quick for case in cases) >= 30
    assert not [case.name for case in cases if case.quick and case.defect]


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.skipif(
    not sys.platform.startswith("linux") or shutil.which("Xvfb") is None,
    reason="needs an X server without a screen: on Debian and Ubuntu the package 'xvfb'",
)
def test_windows_on_a_screen(default_runtime):
    """As scripts without ``off_screen`` open them."""
    left_out = ("VTK_DEFAULT_OPENGL_WINDOW", "PYVISTA_OFF_SCREEN", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in left_out}
    with virtual_screen() as display:
        said = subprocess.check_output(
            [sys.executable, str(Path(__file__).with_name("make_page.py")), "on-screen"],
            env={**environment, "DISPLAY": display},
            text=True,
            timeout=600,
        )
    found = json.loads(said)
    assert not found["wrong"]
    assert found["cases"] >= 30
