"""What users see of the package, as text: two versions that agree in it look the same from outside.

``python tools/surface.py --out old.json`` writes it, ``--compare old.json new.json`` prints what
differs. It holds signatures and properties of all public names, of what the package adds to PyVista
and to the command line (``--help``), the text of every error and warning in the source, and what
ParaView's plugin declares.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import ast
import contextlib
import difflib
import inspect
import io
import json
import os
import re
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import pyvista as pv

import pyvista_vdi as pvdi
from pyvista_vdi import cli

PACKAGE = Path(pvdi.__file__).parent


def signatures(name: str, thing: Any) -> Iterator[str]:
    """Yield a line for a function, or for a class and each of its own public members."""
    if not inspect.isclass(thing):
        yield f"{name}{inspect.signature(thing)}" if callable(thing) else f"{name}: {thing!r}"
        return
    yield f"{name}({', '.join(base.__name__ for base in thing.__mro__[1:-1])})"
    own = {key for base in thing.__mro__ if _is_ours(base) for key in vars(base)}
    for key in sorted(own | {"__init__"}):
        member = inspect.getattr_static(thing, key)
        if isinstance(member, property):
            yield f"{name}.{key}: property{', can be set' if member.fset else ''}"
        elif not key.startswith("_") or key == "__init__":
            found = getattr(thing, key)
            try:
                yield f"{name}.{key}{inspect.signature(found)}"
            except (TypeError, ValueError):
                yield f"{name}.{key}"


def _is_ours(base: type) -> bool:
    return base.__module__.startswith("pyvista_vdi")


def public() -> Iterator[str]:
    """Yield the lines of all public names, and of what PyVista finds by entry points."""
    for name in sorted(pvdi.__all__):
        if not inspect.ismodule(getattr(pvdi, name)):
            yield from signatures(name, getattr(pvdi, name))
    for name, thing in sorted(vars(pvdi.examples).items()):
        if inspect.isfunction(thing) and not name.startswith("_"):
            yield from signatures(f"examples.{name}", thing)
    points = {(each.group, each.name) for each in distribution("pyvista-vdi").entry_points}
    yield from sorted(map(": ".join, points))
    for name in ("add_vdi", "add_vdi_clip_plane", "add_transfer_function_editor", "vdi"):
        found = getattr(pv.Plotter, name)
        yield f"Plotter.{name}{inspect.signature(vars(found).get('__call__', found))}"
    yield from signatures("ImageData.vdi", pv.ImageData.vdi)


def helps() -> Iterator[str]:
    """Yield the help of each verb, a line at a time."""
    os.environ["COLUMNS"] = "100"
    overview = _help()
    yield from overview.splitlines()
    for verb in re.findall(r"^    ?([a-z]+) ", overview, re.MULTILINE):
        yield from (f"{verb}: {line}" for line in _help(verb).splitlines())


def _help(*verb: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
        cli.main([*verb, "--help"])
    return said.getvalue()


def messages() -> Iterator[str]:
    """Yield the text of every error and warning, what is filled in as {}."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = node.func if isinstance(node, ast.Call) else None
            name = getattr(called, "attr", getattr(called, "id", ""))
            if re.search(r"(Error|Warning|warn|refuse\w*|Cancelled)$", name):
                for argument in node.args:
                    text = _text(argument)
                    if len(text) > 12:
                        yield text


def _text(node: ast.AST) -> str:
    """Return the text of a string's expression."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else "{}"
    if isinstance(node, ast.JoinedStr):
        return "".join(map(_text, node.values))
    if isinstance(node, ast.BinOp):
        return _text(node.left) + _text(node.right)
    return "{}"


def plugin() -> Iterator[str]:
    """Yield what ParaView's plugin declares: its decorators, and the XML in its strings."""
    for path in sorted((PACKAGE / "extensions" / "paraview").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            for decorator in getattr(node, "decorator_list", ()):
                yield f"{node.name}: {ast.unparse(decorator)}"
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "<" in node.value:
                yield from node.value.splitlines()


def surface() -> dict[str, list[str]]:
    """Return the lines of each kind; those whose order means nothing are sorted."""
    return {
        "public": list(public()),
        "help": list(helps()),
        "messages": sorted(messages()),
        "plugin": list(plugin()),
    }


def main() -> int:
    """Write the lines, or compare two files of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="file to write")
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("OLD", "NEW"))
    options = parser.parse_args()
    if options.compare:
        old, new = (json.loads(path.read_text(encoding="utf-8")) for path in options.compare)
        differ = [
            f"{kind}: {line}"
            for kind in sorted(old | new)
            for line in difflib.unified_diff(old.get(kind, []), new.get(kind, []), lineterm="", n=0)
            if not line.startswith(("---", "+++", "@@"))
        ]
        print(*differ, sep="\n")
        print(f"{len(differ)} lines differ")
        return bool(differ)
    found = surface()
    (options.out or Path("/dev/stdout")).write_text(json.dumps(found, indent=1), encoding="utf-8")
    print({kind: len(lines) for kind, lines in found.items()}, Counter(found["messages"]).total())
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
