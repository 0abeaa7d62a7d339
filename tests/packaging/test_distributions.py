"""What the wheel, the sdist and an editable install hold, against the repository's own files.

Needs a checkout: the folder that ``PYVISTA_VDI_CHECKOUT`` names, or the one these tests lie in.
The builds run on a copy of the checkout's files, so that nothing is written into it.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import pyvista_vdi

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """Return (copy of the checkout's files, their names): what git tracks or would track."""
    if not (CHECKOUT / ".git").exists():
        pytest.skip("no checkout at hand: set PYVISTA_VDI_CHECKOUT to one")
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=CHECKOUT,
        capture_output=True,
        check=True,
    )
    names = {name for name in os.fsdecode(listing.stdout).split("\0") if name}
    names = {name for name in names if (CHECKOUT / name).is_file()}
    copy = tmp_path_factory.mktemp("source")
    for name in names:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(CHECKOUT / name, copy / name)
    return copy, names


def _build(source, kind, target):
    """Build one distribution with the installed setuptools; return its path."""
    code = f"from setuptools import build_meta; print(build_meta.build_{kind}({str(target)!r}))"
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=source, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return target / result.stdout.split()[-1]


@pytest.fixture(scope="module")
def wheel(source, tmp_path_factory):
    """Return what the wheel holds, {name: bytes}."""
    path = _build(source[0], "wheel", tmp_path_factory.mktemp("wheel"))
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_wheel_holds_the_package_and_nothing_else(source, wheel):
    expected = {name for name in source[1] if name.startswith("pyvista_vdi/")}
    expected |= {f"pyvista_vdi/{name}" for name in source[1] if name.startswith("opencl/")}
    assert {name for name in wheel if ".dist-info/" not in name} == expected


def test_wheel_metadata_and_entry_points(wheel):
    metadata, entry_points = (
        next(text.decode() for name, text in wheel.items() if name.endswith(f".dist-info/{part}"))
        for part in ("METADATA", "entry_points.txt")
    )
    assert f"\nVersion: {pyvista_vdi.__version__}\n" in metadata
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in wheel)
    required = {
        re.match(r"[\w.-]+", line.partition(": ")[2])[0].lower()
        for line in metadata.splitlines()
        if line.startswith("Requires-Dist: ") and "extra ==" not in line
    }
    assert {"numpy", "pyopencl", "scikit-image"} <= required
    # the engine runs on machines without these
    assert required.isdisjoint({"vtk", "pyvista", "matplotlib", "pydicom", "intel-opencl-rt"})
    assert "pyvista-vdi = pyvista_vdi.cli:main" in entry_points
    assert "\nadd_vdi = pyvista_vdi.plotting.component\n" in entry_points


def test_sdist_holds_the_repository(source, tmp_path):
    archive = _build(source[0], "sdist", tmp_path)
    with tarfile.open(archive) as tar:
        found = {name.partition("/")[2] for name in tar.getnames() if tar.getmember(name).isfile()}
    found = {name for name in found if ".egg-info/" not in name}
    assert found - {"PKG-INFO", "setup.cfg"} == source[1] - {".gitattributes"}


def test_editable_install_finds_the_kernels(source, tmp_path):
    """The package resources of `opencl/`, which stands outside the package, resolve as well."""
    copy, names = source
    wheel = _build(copy, "editable", tmp_path)
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    kernels = sorted(n for n in names if n.startswith("opencl/") and n.endswith(".cl"))
    assert kernels
    # An editable install of the same version has a finder of the same name: it is forgotten first.
    # The new one goes before all others, so that it is asked although a copy may be installed.
    code = f"""
import importlib.resources, site, sys
for name in [name for name in sys.modules if name.startswith("__editable__")]:
    del sys.modules[name]
known = list(sys.meta_path)
sys.path.insert(0, {str(site)!r})
site.addsitedir({str(site)!r})
sys.meta_path.sort(key=lambda finder: finder in known)
import pyvista_vdi
folder = importlib.resources.files("pyvista_vdi.opencl")
for name in {kernels!r}:
    kernel = folder.joinpath(*name.split("/")[1:])
    assert kernel.is_file(), kernel
    assert str(kernel).startswith({str(copy)!r}), kernel
assert pyvista_vdi.__file__.startswith({str(copy)!r}), pyvista_vdi.__file__
"""
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
