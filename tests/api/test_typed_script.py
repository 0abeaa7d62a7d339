"""A user's script passes a strict check of types, which finds mistakes in it."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

import pyvista_vdi

SCRIPT = Path(__file__).with_name("typed_script.py")


def test_a_users_script_is_typed_strictly(tmp_path):
    pytest.importorskip("mypy")
    config = tmp_path / "mypy.ini"  # a user's, not this project's
    config.write_text("[mypy]\nstrict = true\n[mypy-pyvista.*]\nfollow_imports = skip\n")
    place = Path(pyvista_vdi.__file__).parents[1]
    installed = place.samefile(sysconfig.get_path("purelib"))  # mypy refuses it as a source
    sources = {} if installed else {"MYPYPATH": str(place)}
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", config, SCRIPT],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | sources,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr
