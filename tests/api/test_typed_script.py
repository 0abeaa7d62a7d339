"""A user's script passes a strict check of types, which finds mistakes in it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import pyvista_vdi

SCRIPT = Path(__file__).with_name("typed_script.py")


def test_a_users_script_is_typed_strictly(tmp_path):
    pytest.importorskip("mypy")
    config = tmp_path / "mypy.ini"  # a user's, not this project's
    config.write_text("[mypy]\nstrict = true\n[mypy-pyvista.*]\nfollow_imports = skip\n")
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", config, SCRIPT],
        capture_output=True,
        text=True,
        cwd=Path(pyvista_vdi.__file__).parents[1],
        check=False,
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr
