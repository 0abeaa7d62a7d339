"""The scripts of benchmarks/: each runs to its end over little."""

from __future__ import annotations

import ast
import importlib
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or BENCHMARKS.parent)
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)
sys.path.insert(0, str(BENCHMARKS))


#: The least that reaches each script's end.
RUNS = {
    "accuracy": "--volumes brain",
    "films": "--volumes brain --repeats 1",
    "baselines": "--size 64x36 --repeats 1",
    "files": "--volumes brain --repeats 1",
    "frames": "--volumes brain --repeats 1",
    "generation": "--volumes brain --repeats 1",
    "paper": "--volumes kingsnake_like@16 --sizes 64x36 --repeats 1",
    "scaling": "--volume brain --repeats 1",
    "trees": "--switch 'no prefetch' --volumes brain --repeats 1",
}


@pytest.mark.parametrize(
    "path", sorted(BENCHMARKS.rglob("*.py")), ids=lambda path: path.relative_to(BENCHMARKS).stem
)
def test_what_a_script_imports_of_the_package_is_there(path):
    """Scripts run in the nightly alone: a name that has moved is found here."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("pyvista_vdi"):
            module = importlib.import_module(node.module)
            for alias in node.names:
                if not hasattr(module, alias.name):  # a module in it
                    importlib.import_module(f"{node.module}.{alias.name}")


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize("name", RUNS)
def test_a_script_runs_to_its_end(name, tmp_path, default_runtime):
    size = "" if "--size" in RUNS[name] else "--size 48x27 "
    done = subprocess.run(
        [sys.executable, f"{name}.py", *shlex.split(f"{size}{RUNS[name]} --out {tmp_path}")],
        # It compares trees of sources, which lie beside what is tested
        cwd=CHECKOUT / "benchmarks" if name == "trees" else BENCHMARKS,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=800,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    found = json.loads((tmp_path / f"{name}_sample.json").read_text())
    assert found["extent"] == "sample"
    assert found["rows"]
    assert not [row for row in found["rows"] if "refused" in row]
    assert "Measured from" in (tmp_path / f"{name}_sample.md").read_text()


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize("question", ["calls", "plotter", "sharing"])
def test_what_is_asked_on_a_gpu_is_answered(question, default_runtime):
    command = [sys.executable, "on_gpu.py", question, "--size", "48x27", "--repeats", "1"]
    done = subprocess.run(command, cwd=BENCHMARKS, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") > 2
