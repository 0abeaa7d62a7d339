"""The viewer's modules as one script, for pages that nothing may be loaded beside.

The modules in ``viewer/`` run as they are, without a build step. Browsers load no module that lies
beside a page on disk, however, so a page that stands alone holds them as one script, in which what
a module needs comes before it. A module is joined if it is written by these rules:

- ``import { a, b } from "./x.js";`` is the only form of an import, and begins a line;
- ``export`` begins a line, before ``function``, ``async function``, ``class``, ``const`` or
  ``let``; a ``const`` or ``let`` that is exported declares one name;
- no two modules have a name at top level in common, and none waits there by ``await``;
- ``/**`` and, to the end of a line, `` // `` are comments, and indents nothing, in shaders too.

What runs in a worker, ``worker.js`` and what it imports, stands in a function of its own: its text
is the worker's program, and where no worker may be started the page calls it itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources

#: The module that is the worker's program, and the one that starts it where modules are files.
WORKER = "worker.js"
SPAWN = "spawn.js"

#: What takes the place of SPAWN.
_SPAWN_BUNDLED = """\
export const spawn = () => {
  const text = `"use strict";(${workerPart})();`;
  const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
  try {
    return new Worker(url);
  } finally {
    URL.revokeObjectURL(url);
  }
};
"""

_IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w.]+)";\n', re.MULTILINE)
_EXPORT = re.compile(
    r"^export (?=(?:async function|function|class|const|let)\*? (\w+))", re.MULTILINE
)
_COMMENT = re.compile(
    r"^[ \t]*/\*\*.*?\*/[ \t]*\n|^[ \t]*(?://[^\n]*)?\n|(?<=[;,{})\]])[ \t]+// [^\n`]*|^[ \t]+",
    re.MULTILINE | re.DOTALL,
)


@cache
def viewer_script(*more: str, module: bool = False) -> str:
    """Return the viewer as one script, UTF-8 text that may stand in a ``<script>``.

    ``more``: modules beside the element, "scene.js" (meshes and texts beside VDIs) or "remote.js"
    (VDIs from ``pyvista-vdi serve``). ``module``: the text of an ES module, for what is written
    behind it; by default it is a function that is called, and shows but its element.
    """
    folder = resources.files("pyvista_vdi.extensions.web") / "viewer"
    sources = {e.name: e.read_text("utf-8") for e in folder.iterdir() if e.name.endswith(".js")}
    script = bundled(sources, ["element.js", *more])
    return script if module else f'(() => {{\n"use strict";\n{script}}})();\n'


def bundled(sources: Mapping[str, str], entries: Iterable[str]) -> str:
    """Return modules, and what they import, as one script without comments.

    Raises ValueError if one has an import or export that is not written as the head of this file
    asks.
    """
    sources = {**sources, SPAWN: _SPAWN_BUNDLED}
    wanted, in_worker = _in_order(entries, sources), _in_order([WORKER], sources)
    script = ""
    if SPAWN in wanted:
        wanted = [name for name in wanted if name not in in_worker]
        shared = ", ".join(each for name in in_worker for each in _EXPORT.findall(sources[name]))
        body = "".join(_joined(name, sources[name]) for name in in_worker)
        script = (
            f"const workerPart = () => {{\n{body}return {{ {shared} }};\n}};\n"
            f"const {{ {shared} }} = workerPart();\n"
        )
    script += "".join(_joined(name, sources[name]) for name in wanted)
    if re.search(r"</script|<!--", script, re.IGNORECASE):
        raise ValueError("a module holds what would end a <script> or begin a comment of HTML")
    return script


def _in_order(entries: Iterable[str], sources: Mapping[str, str]) -> list[str]:
    """Return the names of modules and of what they need, which comes first."""
    order: list[str] = []

    def visit(name: str) -> None:
        if name not in order:
            for needed in _IMPORT.findall(sources[name]):
                visit(needed)
            order.append(name)

    for entry in entries:
        visit(entry)
    return order


def _joined(name: str, text: str) -> str:
    """Return a module's text without imports, ``export``, comments, indents and empty lines."""
    text = _EXPORT.sub("", _IMPORT.sub("", _COMMENT.sub("", text)))
    if other := re.search(r"^(?:import|export)\b.*|\bimport\b *[.(].*", text, re.MULTILINE):
        raise ValueError(f"{name} has {other[0]!r}, of a form that is not bundled")
    return text
