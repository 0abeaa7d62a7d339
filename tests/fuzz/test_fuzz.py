"""Fuzzing within bounds: every input that is kept, and some hundreds of new ones for each target.

``run.py`` fuzzes for as long as one likes, guided by coverage.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from fuzz.targets import TARGETS
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import pyvista_vdi

CORPUS = Path(__file__).parent / "corpus"

#: Inputs of each target, where they are not 50: together some ten seconds on two cores; nightly
#: runs run.py.
EXAMPLES = {
    "archive_heads": 40,
    "command_line": 30,
    "served_messages": 200,
    "validator": 250,
}


@pytest.fixture
def target(request):
    if request.param == "command_line":
        request.getfixturevalue("default_runtime")
        pytest.importorskip("pyvista")
    return TARGETS[request.param]


@pytest.mark.parametrize("target", TARGETS, indirect=True)
def test_inputs_that_were_kept(target):
    """Seeds that reach far into the code, and every input that once broke a promise."""
    for path in sorted((CORPUS / target.__name__).glob("*")):
        target(path.read_bytes())


@pytest.mark.parametrize("target", TARGETS, indirect=True)
def test_new_inputs(target):
    @settings(
        max_examples=EXAMPLES.get(target.__name__, 50),
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(data=st.binary(max_size=500))
    @example(data=b"")
    def fuzz(data):
        target(data)

    fuzz()


# -- nothing is executed --------------------------------------------------------------------------

#: Modules that make objects or code of data, or start programs, and functions that do.
MODULES = {
    *("pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "yaml", "runpy", "code"),
    "subprocess",
}
FUNCTIONS = {"eval", "exec", "compile", "__import__"}
METHODS = {"loads", "system", "popen", "Popen", "memmap"}


def test_nothing_in_the_package_makes_code_or_objects_of_data():
    """No pickle, no eval: data stay data. ``json.loads`` makes numbers, text, lists and dicts."""
    package = Path(pyvista_vdi.__file__).parent
    sources = sorted(package.rglob("*.py"))
    assert len(sources) > 50
    for path in sources:
        # ParaView's own Python is asked for its devices, by a text that is part of the package, and
        # git for the commit of a checkout
        starters = (
            ("paraview", "cli.py"),
            ("measure", "clock.py"),
        )
        allowed = {"subprocess"} if path.parts[-2:] in starters else set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            used = {name.split(".")[0] for name in names} & (MODULES - allowed)
            assert not used, f"{path}:{node.lineno} imports {used}"
            if not isinstance(node, ast.Call):
                continue
            where, function = f"{path}:{node.lineno}", node.func
            assert not any(k.arg == "allow_pickle" for k in node.keywords), where
            if isinstance(function, ast.Name):
                assert function.id not in FUNCTIONS, where
            elif isinstance(function, ast.Attribute):
                owner = function.value.id if isinstance(function.value, ast.Name) else ""
                if function.attr in METHODS:  # JSON's loads makes no objects
                    assert owner in ("json", "platform"), f"{where}: {owner}.{function.attr}"
                assert (owner, function.attr) != ("np", "load"), where  # which may read pickles
