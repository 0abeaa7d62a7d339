"""The viewer's modules as one script, for pages that nothing may be loaded beside.

The modules in ``viewer/`` run as they are, without a build step. Browsers load no module that lies
beside a page on disk, however, so a page that stands alone holds them as one script: imports and
exports fall away, and what a module needs comes before it. That asks three things of every module:

- ``import { a, b } from "./x.js";`` is the only form of an import, in one statement;
- ``export`` stands at the begin of a line, before ``function``, ``async function``, ``class``,
  ``const`` or ``let``;
- no two modules have a name at top level in common.

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

#: What reads and plays series, and zstd, which pages without a series do not have.
OF_SERIES = (
    *("differences.js", "frames.js", "player.js", "series.js", "steps.js", "surround.js"),
    "zstd.js",
)

#: What takes the place of SPAWN. The text ends with a call of what stands in it.
_SPAWN_BUNDLED = """\
function spawnWorker() {
  const text = `"use strict";(${workerPart})().serve(self);`;
  const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
  try {
    return new Worker(url);
  } finally {
    URL.revokeObjectURL(url);
  }
}
"""

_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w.]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:(?:async )?function\*?|class|const|let) (\w+))", re.MULTILINE)
_TOP_LEVEL = re.compile(
    r"^(?:(?:async )?function\*?|class|const|let) (\w+)(?=\s*(?:[=(;{]|extends))", re.MULTILINE
)
_COMMENT = re.compile(r"^[ \t]*(?://[^\n]*|/\*\*.*?\*/[ \t]*)\n", re.MULTILINE | re.DOTALL)


@cache
def viewer_script(
    *, scene: bool = False, remote: bool = False, series: bool = False, module: bool = False
) -> str:
    """Return the viewer as one script.

    Parameters
    ----------
    scene : bool
        Whether it draws meshes, lines and text beside VDIs.
    remote : bool
        Whether it can be fed by ``pyvista-vdi serve``.
    series : bool
        Whether it plays series, and reads what zstd has compressed. Otherwise the names that
        these modules export are null.
    module : bool
        Whether names stay in sight of what is written behind the script: for an ES module. By
        default the script is a function that is called, and shows nothing but its element.

    Returns
    -------
    str
        ASCII or UTF-8 text that may stand in a ``<script>``.
    """
    folder = resources.files("pyvista_vdi.web") / "viewer"
    sources = {
        entry.name: entry.read_text(encoding="utf-8")
        for entry in folder.iterdir()
        if entry.name.endswith(".js")
    }
    if not series:
        sources |= {name: _absent(sources[name]) for name in OF_SERIES if name in sources}
    entries = ["element.js", *["scene.js"] * scene, *["remote.js"] * remote]
    script = bundled(sources, entries)
    return script if module else f'(() => {{\n"use strict";\n{script}}})();\n'


def bundled(sources: Mapping[str, str], entries: Iterable[str]) -> str:
    """Return modules as one script.

    Parameters
    ----------
    sources : mapping of str to str
        Texts of modules by their files' names.
    entries : iterable of str
        Those that are wanted; they bring what they import.

    Returns
    -------
    str
        The script, without comments that have lines of their own.

    Raises
    ------
    ValueError
        If a module is not written as the head of this file asks.
    """
    bare, names, needs = {}, {}, {}
    for name, text in sources.items():
        needs[name] = [module for _, module in _IMPORT.findall(text)]
        names[name] = _EXPORT.findall(text)
        bare[name] = _COMMENT.sub("", _EXPORT.sub("", _IMPORT.sub("", text)))
        if re.search(r"^(import|export)\b", bare[name], re.MULTILINE):
            raise ValueError(f"{name} has an import or an export of a form that is not bundled")
    wanted = _in_order(entries, needs)
    in_worker = _in_order([WORKER], needs) if SPAWN in wanted else []
    page = [name for name in wanted if name not in in_worker and name != SPAWN]
    _check_unique({name: bare[name] for name in (*in_worker, *page)})
    parts = [bare[name] for name in page]
    if in_worker:
        shared = ", ".join(name for module in in_worker for name in names[module])
        body = "".join(bare[name] for name in in_worker)
        parts.insert(
            0,
            f"const workerPart = () => {{\n{body}return {{ {shared} }};\n}};\n"
            f"const {{ {shared} }} = workerPart();\n{_SPAWN_BUNDLED}",
        )
    script = "".join(parts)
    if re.search(r"</script|<!--", script, re.IGNORECASE):
        raise ValueError("a module holds what would end a <script> or begin a comment of HTML")
    return script


def _absent(text: str) -> str:
    """Return a module in which all that another one exports is null."""
    return "".join(f"export const {name} = null;\n" for name in _EXPORT.findall(text))


def _in_order(entries: Iterable[str], needs: Mapping[str, list[str]]) -> list[str]:
    """Return modules and what they need, which comes first."""
    order: list[str] = []

    def visit(name: str, above: tuple[str, ...]) -> None:
        if name in above:
            raise ValueError(f"modules import each other in a circle: {' -> '.join(above)}")
        if name not in needs:
            raise ValueError(
                f"{above[-1] if above else 'the bundle'} imports {name}, which is none"
            )
        if name not in order:
            for needed in needs[name]:
                visit(needed, (*above, name))
            order.append(name)

    for entry in entries:
        visit(entry, ())
    return order


def _check_unique(texts: Mapping[str, str]) -> None:
    home: dict[str, str] = {}
    for module, text in texts.items():
        for name in _TOP_LEVEL.findall(text):
            if name in home:
                raise ValueError(f"{home[name]} and {module} both have {name} at top level")
            home[name] = module
