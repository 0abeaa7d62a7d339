"""First lines of docstrings: sentences that a stranger understands at first reading.

D401 of ruff passes "Have a set have a VDI of a view". So first lines that begin with a verb which
says that somebody else does it are refused here.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pyvista_vdi

PACKAGE = Path(pyvista_vdi.__file__).parent

#: What no first line begins with, alone or in phrases such as "Let go of" and "Give up".
REFUSED = re.compile(r"(Have|Let|Say|Give)\b")


def _first_lines():
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            holders = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
            doc = ast.get_docstring(node) if isinstance(node, holders) else None
            if doc:
                where = f"{path.relative_to(PACKAGE)}:{getattr(node, 'lineno', 1)}"
                yield where, doc.partition("\n")[0]


def test_first_lines_are_sentences_in_the_imperative_or_indicative():
    refused = [f"{where}: {line}" for where, line in _first_lines() if REFUSED.match(line)]
    assert not refused, "\n".join(refused)
