"""The table of ``tools/mutants.py`` fits the sources: each of its patterns occurs once."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
TABLE = CHECKOUT / "tools" / "mutant_list.py"


def test_each_mutant_changes_one_place():
    if not TABLE.is_file():
        pytest.skip("tools/ is not beside the tests: an installed copy is tested")
    specification = importlib.util.spec_from_file_location("mutant_list", TABLE)
    module = sys.modules["mutant_list"] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    for mutant in module.MUTANTS:
        source = (CHECKOUT / mutant.file).read_text()
        assert mutant.changed(source) != source
    assert len({mutant.name for mutant in module.MUTANTS}) == len(module.MUTANTS) >= 90
