"""The table of ``tools/mutants.py`` fits the kernels: each of its patterns occurs once."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
SCRIPT = CHECKOUT / "tools" / "mutants.py"


@pytest.fixture(scope="module")
def mutants():
    if not SCRIPT.is_file():  # an installed copy is tested, away from its checkout
        pytest.skip("tools/ is not beside the tests")
    specification = importlib.util.spec_from_file_location("mutants", SCRIPT)
    module = sys.modules["mutants"] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module.MUTANTS


def test_each_mutant_changes_one_place(mutants):
    for mutant in mutants:
        kernel = (CHECKOUT / "opencl" / mutant.file).read_text()
        assert mutant.changed(kernel) != kernel


def test_names_differ(mutants):
    assert len({mutant.name for mutant in mutants}) == len(mutants) >= 30
