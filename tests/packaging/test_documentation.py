"""The pages of ``docs/``: the names on them.

Needs a checkout: the folder that ``PYVISTA_VDI_CHECKOUT`` names, or the one these tests lie in.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
from pathlib import Path
from types import ModuleType

import pytest

from pyvista_vdi import cli

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])
DOCS = CHECKOUT / "docs"

pytestmark = pytest.mark.skipif(
    not (DOCS / "conf.py").is_file(),
    reason="no documentation at hand: set PYVISTA_VDI_CHECKOUT to a checkout",
)


def _pages():
    pages = [page for page in DOCS.rglob("*.md") if "_build" not in page.parts]
    assert pages
    return sorted(pages)


def _rows():
    """Yield the cells of each row of the tables on the page *Where is what*."""
    for line in (DOCS / "dev" / "where_is_what.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("|") and not line.startswith("|---"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            assert len(cells) == 5, line
            if cells[1] != "Python":
                yield cells


def _named(cell):
    return re.findall(r"`([^`]+)`", cell)


def _is_importable(name):
    """Return whether a dotted name, relative to the package or to `tests`, is in it."""
    found = importlib.import_module("pyvista_vdi")
    if name.startswith("reference."):  # beside these tests
        found, name = importlib.import_module("reference"), name.partition(".")[2]
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
    assert not missing, f"docs/dev/where_is_what.md: {missing}"


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
        led = DOCS / "dev" / file
        if not led.is_file() or (anchor and anchor not in _anchors(led)):
            missing.append(f"{file}#{anchor}")
    assert not missing, f"docs/dev/where_is_what.md: {missing}"


@pytest.fixture(scope="module")
def verbs():
    """The verbs of the command line and the options of each, as their help says them."""

    def said(*arguments):
        with contextlib.redirect_stdout(io.StringIO()) as out:
            cli.main([*arguments, "--help"])
        return out.getvalue()

    names = re.findall(r"^    (\w+)(?: +\S.*)?$", said(), re.MULTILINE)
    assert "generate" in names
    return {name: set(re.findall(r"(?<![\w-])--[a-z][\w-]*", said(name))) for name in names}


def test_commands_on_pages_are_those_of_the_command_line(verbs):
    mistakes, seen = [], set()
    for page in [*_pages(), CHECKOUT / "README.md"]:
        if page.name == "changelog.md":
            continue
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        # In blocks a command ends with its line, in sentences with its mark
        for command in re.findall(r"(?<![\w/.-])pyvista-vdi ([a-z]+\b[^`\n|#]*)", text):
            verb, *words = command.split()
            options = [word.split("=")[0].strip("(),.;:") for word in words if word[:2] == "--"]
            if verb in verbs:
                seen.add(verb)
                mistakes += [
                    f"{page.name}: {verb} {o}" for o in options if o not in verbs[verb] | {"--help"}
                ]
            elif options:
                mistakes.append(f"{page.name}: there is no verb {verb}")
    assert not mistakes
    assert seen == set(verbs)


def test_pages_for_users_say_the_field_s_words():
    lines = (DOCS / "dev" / "phrases.txt").read_text(encoding="utf-8").splitlines()
    phrases = "|".join(re.escape(line) for line in lines if not line.startswith("#"))
    said = []
    for page in [*DOCS.glob("*.md"), CHECKOUT / "README.md"]:
        # What is code, a link's place or a term that is explained stays
        text = re.sub(
            r"```.*?```|`[^`]*`|\]\([^)]*\)|^\|.*, V_[ON] \|",
            "",
            page.read_text("utf-8"),
            flags=re.S | re.M,
        )
        said += [f"{page.name}: {each}" for each in re.findall(rf"\b(?:{phrases})\b", text)]
    assert not said
