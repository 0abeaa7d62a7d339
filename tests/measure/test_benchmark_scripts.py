"""Every script in benchmarks/ runs to its end, over little: what they find is not judged here."""

from __future__ import annotations

import ast
import importlib
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from browsers import NAMES, missing
from watched_windows import small_vdi

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)

SIZE = "--size 48x27"
SMALL = f"{SIZE} --out {{here}}"
ON_BRAIN = f"{SMALL} --volumes brain"
#: The least that reaches each script's end; {here} is the run's own folder, {rates} the device's.
RUNS = {
    "files": f"{ON_BRAIN} --repeats 1",
    "generation": f"{ON_BRAIN} --repeats 1",
    "large": f"{ON_BRAIN} --parts accuracy",
    "machine": "--quick --out {rates}",
    "memory": f"{SIZE} --volumes brain",
    "model": f"{ON_BRAIN} --repeats 1 --machine {{rates}}",
    "packed": f"{ON_BRAIN} --frame 48x27 --repeats 1",
    "page": f"{ON_BRAIN} --repeats 1",
    "playing": f"{SMALL} --series plume --seconds 1",
    "trees": "--other .. --vdis {here}/ball.vdi --repeats 1",
    "scaling": f"{SMALL} --volume brain --repeats 1 --quick",
    "series": f"{SMALL} --series plume",
    "series_data": "plume --out {here}",
    "sets": f"{ON_BRAIN} --directions 2 --target-ssim .8",
    "web": f"{ON_BRAIN} --seconds 6",
}


def test_every_script_is_run():
    scripts = {
        path.stem
        for path in BENCHMARKS.glob("*.py")
        if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
    }
    assert scripts == set(RUNS)
    about = (BENCHMARKS / "README.md").read_text(encoding="utf-8")
    assert [name for name in scripts if f"`{name}.py`" not in about] == []


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("*.py")), ids=lambda path: path.stem)
def test_what_a_script_imports_of_the_package_is_there(path):
    """Scripts run in the nightly alone: a name that has moved is found here."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("pyvista_vdi"):
            module = importlib.import_module(node.module)
            for alias in node.names:
                if not hasattr(module, alias.name):  # a module in it
                    importlib.import_module(f"{node.module}.{alias.name}")


@pytest.fixture(scope="module")
def rates(tmp_path_factory):
    """A folder of what the device can do, from which ``model`` reckons."""
    folder = tmp_path_factory.mktemp("rates")
    run("machine", RUNS["machine"].format(rates=folder))
    return folder


def run(name, arguments):
    done = subprocess.run(
        [sys.executable, f"{name}.py", *shlex.split(arguments)],
        cwd=BENCHMARKS,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=800,
        check=False,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize("name", RUNS)
def test_a_script_runs_to_its_end(name, request, tmp_path, default_runtime):
    if name in ("page", "web") and not any(map(shutil.which, NAMES)):
        missing("no Chromium is in the path: install the system's package 'chromium'")
    if name == "trees":
        small_vdi().save(tmp_path / "ball.vdi")
    folders = {"here": tmp_path}
    if "{rates}" in RUNS[name]:
        folders["rates"] = request.getfixturevalue("rates")
    run(name, RUNS[name].format(**folders))
