"""The verb ``paraview``: where the plugin is, and what ParaView's Python must see."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest
from command_line import run

from pyvista_vdi.extensions.paraview import cli as verb
from pyvista_vdi.extensions.paraview.parts.client import require_one_process


@pytest.fixture
def plain_installation(tmp_path, monkeypatch):
    """An environment that holds the package and no VTK, in a folder that a shell must quote."""
    package = tmp_path / "a folder" / "pyvista_vdi"
    for room in ("opencl", "extensions/paraview"):
        (package / room).mkdir(parents=True)
    (package / "opencl" / "__init__.py").touch()
    copied = shutil.copy(verb.__file__, package / "extensions" / "paraview")
    specification = importlib.util.spec_from_file_location(verb.__name__, copied)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    monkeypatch.setitem(sys.modules, verb.__name__, module)
    monkeypatch.setattr(module.sysconfig, "get_path", lambda name: str(package.parent))
    return package


def test_paraview_prints_what_a_shell_evaluates(plain_installation, capsys):
    out = run(capsys, "paraview", "--environment")
    shown = subprocess.run(
        ["sh", "-c", f'{out}echo "$PYTHONPATH"; echo "$PV_PLUGIN_PATH"'],
        env={"PYTHONPATH": "/before"},
        capture_output=True,
        text=True,
        check=True,
    )
    site = plain_installation.parent
    assert shown.stdout.splitlines() == [
        f"{site}:/before",
        f"{site}/pyvista_vdi/extensions/paraview/plugin",
    ]


def test_a_server_of_several_ranks_is_refused_when_the_plugin_is_loaded():
    with pytest.raises(ImportError, match=r"has 4 ranks, .* without mpirun, or .*InSitu"):
        require_one_process(SimpleNamespace(GetNumberOfProcesses=lambda: 4))
    require_one_process(SimpleNamespace(GetNumberOfProcesses=lambda: 1))
    require_one_process(None)
