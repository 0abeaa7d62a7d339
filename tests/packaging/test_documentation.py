"""The pages of ``docs/``: their diagrams, and the tables that they include.

Needs a checkout: the folder that ``PYVISTA_VDI_CHECKOUT`` names, or the one these tests lie in.
"""

from __future__ import annotations

import importlib.util
import os
import re
from pathlib import Path

import pytest

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])
DOCS = CHECKOUT / "docs"

pytestmark = pytest.mark.skipif(
    not (DOCS / "conf.py").is_file(),
    reason="no documentation at hand: set PYVISTA_VDI_CHECKOUT to a checkout",
)

INCLUDE = re.compile(r"```\{include\} (\S+)\n((?::\S+: .*\n)*)```")


def _pages():
    pages = [page for page in DOCS.rglob("*.md") if "_build" not in page.parts]
    assert pages
    return sorted(pages)


def test_diagrams_are_those_that_the_script_draws():
    spec = importlib.util.spec_from_file_location("diagrams", DOCS / "diagrams.py")
    diagrams = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(diagrams)
    for name, text in diagrams.draw().items():
        drawn = DOCS / "images" / name
        assert drawn.read_bytes() == text.encode(), f"{name}: run python docs/diagrams.py"


def test_included_tables_bring_no_headings():
    """A title within an included file would be a page of its own in the site's menu."""
    included = 0
    for page in _pages():
        for name, options in INCLUDE.findall(page.read_text(encoding="utf-8")):
            if name.endswith("CHANGELOG.md"):  # the whole page
                continue
            text = (page.parent / name).read_text(encoding="utf-8")
            where = dict(re.findall(r':(start-after|end-before): "(.*)"', options))
            if "start-after" in where:
                _before, found, text = text.partition(where["start-after"])
                assert found, f"{page.name}: {name} has no {where['start-after']!r} in it"
            if "end-before" in where:
                text, found, _after = text.partition(where["end-before"])
                assert found, f"{page.name}: {name} has no {where['end-before']!r} in it"
            assert not re.search(r"^#", text, re.MULTILINE), f"{page.name}: headings of {name}"
            included += 1
    assert included > 5
