"""Each extension can be deleted: the core's tests pass without it, and those that need it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest

import pyvista_vdi
from pyvista_vdi import registry

TESTS = Path(__file__).parents[1]
#: Tests of the core: those that name what extensions add, and those run without any extension.
NAMING, OTHERS = "api cli", "io model generation raycasting"


def gone_with(name):
    """Return an extension, and those that are left out without it."""
    return [name, *(n for n, each in registry.extensions().items() if name in each.requires)]


@pytest.fixture
def without(tmp_path):
    """What makes a copy of package and tests without an extension."""

    def copy(*names):
        ignored = shutil.ignore_patterns("__pycache__", "opencl")
        package = Path(pyvista_vdi.__file__).parent
        shutil.copytree(package, tmp_path / "pyvista_vdi", ignore=ignored)
        kernels = Path(str(resources.files("pyvista_vdi.opencl")))
        shutil.copytree(kernels, tmp_path / "pyvista_vdi" / "opencl")
        shutil.copytree(TESTS, tmp_path / "tests", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(TESTS.parent / "pyproject.toml", tmp_path)
        for name in names:
            shutil.rmtree(tmp_path / "pyvista_vdi" / "extensions" / name)
        for each in {each for name in names for each in gone_with(name)}:
            shutil.rmtree(tmp_path / "tests" / "extensions" / each)
        return tmp_path

    return copy


@pytest.mark.slow
@pytest.mark.parametrize("name", [*registry.extensions(), "all of them"])
def test_the_cores_tests_pass_without(name, without):
    every = name == "all of them"
    place = without(*registry.extensions()) if every else without(name)
    folders = f"{NAMING} {OTHERS}" if every else NAMING
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "-m", "fast", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, *(f"tests/{folder}" for folder in folders.split())],
        cwd=place,
        # The copy without the extension is no installed one
        env={
            **{k: v for k, v in os.environ.items() if k != "PYVISTA_VDI_REQUIRE_INSTALLED"},
            "PYTHONPATH": str(place),
            "PYVISTA_VDI_CHECKOUT": str(TESTS.parent),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
