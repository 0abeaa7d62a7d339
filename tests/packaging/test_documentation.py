"""The pages of ``docs/``: their diagrams, the tables that they include, and the names on them.

Needs a checkout: the folder that ``PYVISTA_VDI_CHECKOUT`` names, or the one these tests lie in.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import os
import re
from pathlib import Path
from types import ModuleType

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


def _script(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_diagrams_are_those_that_the_script_draws():
    for name, text in _script("diagrams").draw().items():
        drawn = DOCS / "images" / name
        assert drawn.read_bytes() == text.encode(), f"{name}: run python docs/diagrams.py"


def test_terms_are_typeset_and_names_are_not():
    pytest.importorskip("sphinx")
    text = "V_O's lists have N_S; a.V_O, V_Old, t_near_far and t_near() are names"
    parts = _script("terms").typeset(text)
    assert [part.astext() for part in parts if part.tagname == "inline"] == ["VO", "NS"]
    assert "".join(part.astext() for part in parts).endswith("are names")


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


def _rows():
    """Yield the cells of each row of the tables on the page *Where is what*."""
    for line in (DOCS / "where_is_what.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("|") and not line.startswith("|---"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            assert len(cells) == 5, line
            if cells[1] != "Python":
                yield cells


def _named(cell):
    return re.findall(r"`([^`]+)`", cell)


def _is_importable(name):
    """Return whether a dotted name, relative to the package, is a module or in one."""
    found = importlib.import_module("pyvista_vdi")
    for part in name.split("."):
        if isinstance(found, ModuleType) and hasattr(found, "__path__"):
            with contextlib.suppress(ModuleNotFoundError):
                importlib.import_module(f"{found.__name__}.{part}")
        found = getattr(found, part, None)
        if found is None:
            return False
    return True


def _anchors(page):
    """Return the anchors of a page: those of its headings, and those that it names."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    slugs = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return slugs | set(re.findall(r"^\(([a-z0-9-]+)\)=$", text, re.MULTILINE))


def test_where_is_what_names_python_that_exists():
    pytest.importorskip("pyvista")
    missing = [name for row in _rows() for name in _named(row[1]) if not _is_importable(name)]
    assert not missing, f"docs/where_is_what.md: {missing}"


def test_where_is_what_names_kernels_tests_and_pages_that_exist():
    missing = []
    # A definition, or a macro that makes one, begins its line or names itself in one
    kernel, test = r"^(?!\s|//)[^;\n]*\b{}\s*[(,]", r"^(?:async )?def {}\("
    for _step, _python, kernels, tests, page in _rows():
        for folder, cell, pattern in (("opencl", kernels, kernel), ("tests", tests, test)):
            for name in _named(cell):
                file, _, function = name.partition("::")
                path = CHECKOUT / folder / file
                defined = pattern.format(function) if function or folder == "opencl" else ""
                if not path.is_file() or not re.search(
                    defined, path.read_text(encoding="utf-8"), re.MULTILINE
                ):
                    missing.append(name)
        target = re.search(r"\]\(([^)#]+)#?([^)]*)\)", page)
        assert target, page
        file, anchor = target.groups()
        if not (DOCS / file).is_file() or (anchor and anchor not in _anchors(DOCS / file)):
            missing.append(f"{file}#{anchor}")
    assert not missing, f"docs/where_is_what.md: {missing}"


def test_pages_name_files_that_exist():
    missing = set()
    for page in _pages():
        if page.name == "changelog.md":
            continue
        text = page.read_text(encoding="utf-8")
        roots = r"(?:pyvista_vdi|opencl|tests|benchmarks|examples|docs|tools)"
        for name in re.findall(rf"(?<![\w/.-])({roots}/[\w/.-]+\.(?:py|cl|md|json|sh))\b", text):
            if not (CHECKOUT / name).is_file():
                missing.add(f"{page.name}: {name}")
    assert not missing, sorted(missing)
