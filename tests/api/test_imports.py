"""The arrows of the house: who may import whom, read from the source and seen in a fresh process.

Every import counts: those of a module's head, those that a function makes when it is called, and
those for the checker of types. There are no exemptions. What a lower room needs of an upper one,
and the core of extensions, is found by ``pyvista_vdi/registry.py``.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import NamedTuple

import pytest
from fresh_python import run_python

import pyvista_vdi

PACKAGE = Path(pyvista_vdi.__file__).parent

#: The only rooms that may import each of these. VTK's names come from ``vtk_pipeline.vtk``.
OWNERS = {
    "aiohttp": ("extensions.web",),
    "anywidget": ("extensions.web",),
    "cvista": (),
    "distributed": ("extensions.large",),
    "h5py": ("io",),
    "mpi4py": ("extensions.large",),
    "paraview": ("extensions.paraview",),
    "pyopencl": ("device",),
    "pyvista": ("plotting", "examples", "extensions.web", "measure", "cli"),
    "traitlets": ("extensions.web",),
    "vtk": (),
    "vtkmodules": ("vtk_pipeline", "extensions.paraview"),
    "zarr": ("io", "model"),
}

#: Rooms and loose modules from the lowest to the highest; what stands in one line may not import
#: each other. Extensions are above the core, which imports none, and of each other they import what
#: their records require.
LEVELS = (
    ("errors", "_version"),
    ("registry",),
    ("model",),
    ("device", "io"),
    ("volume",),
    ("generation", "raycasting"),
    ("quality",),
    ("api",),
    ("vtk_pipeline",),
    ("plotting",),
    ("examples",),
    ("measure",),
    ("cli",),
    ("__init__",),
    ("__main__",),
    ("extensions",),
    ("extensions.deep_exr", "extensions.large"),
    ("extensions.series",),
    ("extensions.sets", "extensions.insitu", "extensions.paraview"),
    ("extensions.web",),
)

#: Slow to import, or optional: never loaded by ``import pyvista_vdi``.
HEAVY = """
SimpleITK aiohttp anywidget cvista dask distributed h5py matplotlib nrrd paraview pydicom pyopencl
pyvista scipy skimage tifffile traitlets trame vtk vtkmodules zarr
"""


def _modules():
    return sorted(path for path in PACKAGE.rglob("*.py") if "opencl" not in _part(path).parts[:-1])


def _part(path):
    return path.relative_to(PACKAGE)


def _name(path):
    """Return a file's dotted name without the package's."""
    parts = _part(path).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


def _room(name):
    """Return the room of a module: an extension, or the first part of its name."""
    parts = name.split(".")
    return ".".join(parts[: 2 if parts[0] == "extensions" else 1])


class Import(NamedTuple):
    name: str
    line: int


def _imports(path):
    """Yield an `Import` for every name that a file imports, wherever it does."""
    package = ("pyvista_vdi", *_part(path).parts[:-1])
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), filename=str(path))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, (base, node.module)))
            names = [f"{module}.{alias.name}" for alias in node.names]
        for name in names:
            yield Import(name, node.lineno)


@pytest.fixture(scope="module")
def arrows():
    """Return {module: {module that it imports: line}}, both by their dotted names."""
    names = {_name(path): path for path in _modules()}
    found = {}
    for name, path in names.items():
        own = found.setdefault(name, {})
        for item in _imports(path):
            target = item.name.removeprefix("pyvista_vdi").removeprefix(".")
            if item.name.partition(".")[0] != "pyvista_vdi":
                continue
            while target and target not in names:  # a name in a module
                target = target.rpartition(".")[0]
            if (target or "__init__") != name:
                own.setdefault(target or "__init__", item.line)
    return found


def _floor(levels, name):
    floors = [i for i, level in enumerate(levels) if name in level]
    assert len(floors) == 1, f"{name} has no place in the levels of this test"
    return floors[0]


def test_each_foreign_library_has_one_place():
    offences = []
    for path in _modules():
        room = _room(_name(path))
        for item in _imports(path):
            if room not in OWNERS.get(item.name.partition(".")[0], (room,)):
                offences.append(f"{_part(path)}:{item.line} imports {item.name}")
    assert not offences, "\n".join(offences)


def test_arrows_point_down(arrows):
    offences = []
    for name, targets in arrows.items():
        room = _room(name)
        for target, line in targets.items():
            to = _room(target)
            if to != room and _floor(LEVELS, to) >= _floor(LEVELS, room):
                offences.append(f"{name}:{line} imports {target}")
    assert not offences, "\n".join(offences)


def _engine_modules():
    """Return the dotted names of the modules below the VTK pipeline, and of the command line."""
    floor = _floor(LEVELS, "vtk_pipeline")
    rooms = {name for level in LEVELS[:floor] for name in level} | {"cli"}
    return sorted(f"pyvista_vdi.{name}" for name in map(_name, _modules()) if _room(name) in rooms)


def _run(code):
    """Run ``code`` in a fresh interpreter; return what it prints."""
    done = run_python(code)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_engine_imports_without_vtk_and_pyvista():
    blocked = ("cvista", "paraview", "pyvista", "vtk", "vtkmodules", "matplotlib")
    _run(
        "import sys, importlib\n"
        f"sys.modules.update(dict.fromkeys({blocked!r}))\n"
        f"for name in {_engine_modules()!r}:\n"
        "    importlib.import_module(name)\n"
    )


def test_importing_the_package_loads_little_and_touches_no_environment():
    """Beyond what NumPy loads; public names are loaded on first use."""
    loaded = _run(
        "import os, sys, numpy\n"
        "before, environment = set(sys.modules), dict(os.environ)\n"
        "import pyvista_vdi\n"
        "assert dict(os.environ) == environment\n"
        "print(*sorted(set(sys.modules) - before), sep='\\n')\n"
    ).split()
    assert all(re.fullmatch(r"[\w.]+", name) for name in loaded)  # nothing else is printed
    assert not [name for name in loaded if name.split(".")[0] in HEAVY.split()]
    # The package's own core and the standard library's modules that it needs stay under this; a
    # single heavy import (scikit-image: about 400 modules, PyVista: about 1000) is far beyond it
    assert len(loaded) < 60, loaded


def test_every_public_name_resolves():
    missing = [name for name in pyvista_vdi.__all__ if getattr(pyvista_vdi, name, None) is None]
    assert not missing, missing
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = pyvista_vdi.no_such_name
