"""What can be told of Windows and macOS from here: imports, and versions kept together.

Needs a checkout: the folder that ``PYVISTA_VDI_CHECKOUT`` names, or the one these tests lie in.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pyvista_vdi

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])

#: Modules of Python that Windows has not.
POSIX = ("fcntl", "grp", "pwd", "resource", "termios")


def test_the_package_is_imported_where_posix_modules_are_absent():
    # psutil of Linux imports some of them itself
    code = f"import psutil, sys; sys.modules.update(dict.fromkeys({POSIX!r}))"
    modules = "pyvista_vdi.cli.parser, pyvista_vdi.model.vdi"
    subprocess.run([sys.executable, "-c", f"{code}; import {modules}"], check=True)


def test_one_version():
    if not (CHECKOUT / "CITATION.cff").is_file():
        pytest.skip("no checkout at hand: set PYVISTA_VDI_CHECKOUT to one")
    for name, pattern in (
        ("CITATION.cff", r"^version: (\S+)$"),
        ("tools/conda/recipe.yaml", r'^  version: "(\S+)"$'),
    ):
        text = (CHECKOUT / name).read_text(encoding="utf-8")
        assert re.findall(pattern, text, re.MULTILINE) == [pyvista_vdi.__version__], name


def test_the_conda_recipe_has_the_wheel_s_requirements():
    tomllib = pytest.importorskip("tomllib", reason="tomllib is Python 3.11's")
    recipe = CHECKOUT / "tools" / "conda" / "recipe.yaml"
    if not recipe.is_file():
        pytest.skip("no checkout at hand: set PYVISTA_VDI_CHECKOUT to one")
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = set(re.findall(r"^    - (\S+) >=(\S+)$", recipe.read_text("utf-8"), re.MULTILINE))
    needed = project["dependencies"] + project["optional-dependencies"]["plot"]
    conda_names = {"vtk": "vtk-base", "matplotlib": "matplotlib-base"}
    wanted = {tuple(re.split(">=", line)) for line in needed}
    assert {(conda_names.get(name, name), least) for name, least in wanted} <= listed
