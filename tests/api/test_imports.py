"""The arrows of the house: who may import whom, read from the source and seen in a fresh process.

plotting -> vtk_pipeline -> engine -> opencl_runtime -> core, and paraview -> vtk_pipeline; vtk,
pyvista, paraview and pyopencl each have one place. The engine must run where neither VTK nor
PyVista is installed.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import pytest

import pyvista_vdi

PACKAGE = Path(pyvista_vdi.__file__).parent

#: The only layers that may import each of these. What renders through PyVista may speak to the
#: VTK objects behind it.
OWNERS = {
    "paraview": ("paraview",),
    "pyopencl": ("opencl_runtime",),
    "pyvista": ("plotting",),
    "vtk": ("vtk_pipeline", "plotting", "paraview"),
    "vtkmodules": ("vtk_pipeline", "plotting", "paraview"),
}

CORE = {
    "checks",
    "_version",
    "ambient_occlusion",
    "camera",
    "compositing",
    "cropping",
    "errors",
    "host_memory",
    "lighting",
    "numerics",
    "precision",
    "transfer_function",
    "vdi",
    "volume",
}

#: Imports from low layers upwards that run only when they are needed: ``VDI.save``, and sizes of
#: work-groups that are written into a file.
DEFERRED_UPWARDS = {("vdi", "io"), ("opencl_runtime", "io")}

#: Layers that nothing below them may need in order to be imported.
TOP_LAYERS = ("vtk_pipeline", "plotting", "paraview", "cli")

#: Slow to import, or optional: never loaded by ``import pyvista_vdi``.
HEAVY = (
    "matplotlib",
    "nrrd",
    "paraview",
    "pyopencl",
    "pyvista",
    "scipy",
    "skimage",
    "vtk",
    "vtkmodules",
)


def _modules():
    return sorted(path for path in PACKAGE.rglob("*.py") if "opencl" not in _part(path).parts[:-1])


def _part(path):
    return path.relative_to(PACKAGE)


def _top_level(path):
    """Return the layer a file belongs to: its folder, or its own name at the package's top."""
    part = _part(path)
    return part.parts[0] if len(part.parts) > 1 else part.stem


class Import(NamedTuple):
    """One import statement's target."""

    name: str
    line: int
    typing_only: bool
    deferred: bool  # runs when a function is called, not when the module is imported


def _imports(path):
    """Yield an `Import` for every name that a file imports."""
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    typing_only = _nodes_within(
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
    )
    deferred = _nodes_within(
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
    )
    package = ("pyvista_vdi", *_part(path).parts[:-1])
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, (base, node.module)))
            names = [f"{module}.{alias.name}" for alias in node.names]
        for name in names:
            yield Import(name, node.lineno, id(node) in typing_only, id(node) in deferred)


def _nodes_within(roots):
    return {id(inner) for root in roots for inner in ast.walk(root)}


def _own_layer(name):
    """Return the layer that a dotted name of this package belongs to, or None."""
    parts = name.split(".")
    if parts[0] != "pyvista_vdi" or len(parts) < 2:
        return None
    layer = parts[1]
    exists = (PACKAGE / layer).is_dir() or (PACKAGE / f"{layer}.py").is_file()
    return layer if exists else None


def _report(offences):
    return "\n".join(f"{_part(path)}:{item.line} imports {item.name}" for path, item in offences)


def _at_run_time(paths):
    """Yield (path, Import) of everything that is imported when the program runs."""
    for path in paths:
        for item in _imports(path):
            if not item.typing_only:
                yield path, item


def test_each_foreign_library_has_one_place():
    offences = []
    for path, item in _at_run_time(_modules()):
        owners = OWNERS.get(item.name.split(".")[0])
        if owners is not None and _top_level(path) not in owners:
            offences.append((path, item))
    assert not offences, _report(offences)


def test_lower_layers_do_not_import_upper_ones_when_loaded():
    offences = []
    for path, item in _at_run_time(_modules()):
        layer, target = _top_level(path), _own_layer(item.name)
        if layer == target:
            continue
        allowed = {
            "cli": ("vtk_pipeline", "plotting"),
            "paraview": ("vtk_pipeline",),
            "plotting": ("vtk_pipeline",),
        }.get(layer, ())
        if not item.deferred and target in TOP_LAYERS and target not in allowed:
            offences.append((path, item))
    assert not offences, _report(offences)


@pytest.mark.parametrize("layer", ["core", "reference", "opencl_runtime"])
def test_low_layers_import_only_the_core(layer):
    members = CORE if layer == "core" else {layer}
    files = [path for path in _modules() if _top_level(path) in members]
    assert files, f"there is no {layer}"
    offences = [
        (path, item)
        for path, item in _at_run_time(files)
        if (target := _own_layer(item.name)) is not None
        and target not in CORE | members
        and not (item.deferred and (_top_level(path), target) in DEFERRED_UPWARDS)
    ]
    assert not offences, _report(offences)


def _engine_modules():
    """Return the dotted names of every module that must import without VTK and PyVista."""
    names = []
    for path in _modules():
        if _top_level(path) in ("vtk_pipeline", "plotting", "paraview"):
            continue
        parts = ("pyvista_vdi", *_part(path).with_suffix("").parts)
        names.append(".".join(parts[:-1] if parts[-1] == "__init__" else parts))
    return sorted(set(names) - {"pyvista_vdi.__main__"})


def _run(code):
    """Run ``code`` in a fresh interpreter away from any checkout; return what it prints."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("COV_")}
    # with a relative or empty entry the interpreter would look in the current folder
    environment["PYTHONPATH"] = os.pathsep.join(
        str(Path(entry).resolve())
        for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep)
        if entry
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tempfile.gettempdir(),
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_engine_imports_without_vtk_and_pyvista():
    blocked = ("paraview", "pyvista", "vtk", "vtkmodules", "matplotlib")
    _run(
        "import sys, importlib\n"
        f"sys.modules.update(dict.fromkeys({blocked!r}))\n"
        f"for name in {_engine_modules()!r}:\n"
        "    importlib.import_module(name)\n"
    )


@pytest.fixture(scope="module")
def modules_after_import():
    """Return the modules that ``import pyvista_vdi`` loads beyond those that NumPy loads."""
    return _run(
        "import sys, numpy\n"
        "before = set(sys.modules)\n"
        "import pyvista_vdi\n"
        "print(*sorted(set(sys.modules) - before), sep='\\n')\n"
    ).split()


def test_importing_the_package_loads_nothing_heavy(modules_after_import):
    heavy = [name for name in modules_after_import if name.split(".")[0] in HEAVY]
    assert not heavy, heavy


def test_importing_the_package_loads_few_modules(modules_after_import):
    # Public names are loaded on first use. The package's own core and the standard library's
    # modules that it needs stay under this; a single heavy import (scikit-image: about 400
    # modules, PyVista: about 1000) is far beyond it.
    assert len(modules_after_import) < 60, modules_after_import


def test_importing_touches_no_environment_and_prints_nothing():
    output = _run(
        "import os\n"
        "before = dict(os.environ)\n"
        "import pyvista_vdi\n"
        "assert dict(os.environ) == before, set(os.environ.items()) ^ set(before.items())\n"
    )
    assert output == ""


def test_every_public_name_resolves():
    missing = [name for name in pyvista_vdi.__all__ if getattr(pyvista_vdi, name, None) is None]
    assert not missing, missing


def test_unknown_attribute_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = pyvista_vdi.no_such_name
