"""``pvdi.Plotter``: PyVista's plotter, of which tools that read code know ``add_vdi``."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import pyvista_vdi as pvdi


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mypy") is None, reason="needs mypy")
def test_a_type_checker_sees_its_arguments(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import pyvista_vdi as pvdi\n"
        "plotter = pvdi.Plotter()\n"
        "plotter.add_vdi(None, cmap='bone', max_supersegments=5)\n"
        "plotter.add_vdi(None, max_supersegments='five')\n"
    )
    package = Path(pvdi.__file__).parents[1]
    # mypy finds no editable installation by itself, and refuses the folder of others
    where = {} if package.name == "site-packages" else {"MYPYPATH": str(package)}
    options = ["--config-file=", "--ignore-missing-imports", "--follow-imports=silent"]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, f"--cache-dir={tmp_path}", str(script)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, **where},
    )
    lines = done.stdout.splitlines()
    assert len(lines) == 2, done.stdout + done.stderr
    assert "script.py:4" in lines[0]
    assert 'argument "max_supersegments"' in lines[0].lower()
