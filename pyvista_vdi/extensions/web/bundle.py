"""The viewer's modules as one script, for pages that nothing may be loaded beside.

The modules in ``viewer/`` run as they are, without a build step. Browsers load no module that lies
beside a page on disk, however, so a page that stands alone holds them as one script: imports and
exports fall away, and what a module needs comes before it. What is written otherwise is refused:

- ``import { a, b } from "./x.js";`` is the only form of an import; it ends with its semicolon;
- ``export`` stands before ``function``, ``async function``, ``class``, ``const`` or ``let``;
- no two modules have a name at top level in common, and none waits there by ``await``;
- templates at top level are shaders and style sheets: their comments (`` // ``) and indentation
  fall away, too.

What runs in a worker, ``worker.js`` and what it imports, stands in a function of its own: its text
is the worker's program, and where no worker may be started the page calls it itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources
from typing import NamedTuple

from pyvista_vdi.extensions.web.javascript import DOTS, declared, tokens_of

#: The module that is the worker's program, and the one that starts it where modules are files.
WORKER = "worker.js"
SPAWN = "spawn.js"

#: What reads and plays series, and zstd, which pages without a series do not have.
OF_SERIES = ("player.js", "series.js", "surround.js", "zstd.js")

#: What edits the transfer function of values, which pages of colours do not have.
OF_VALUES = ("editor.js",)

#: What takes the place of SPAWN.
_SPAWN_BUNDLED = """\
export const waysToSpawn = [() => {
  const text = `"use strict";(${workerPart})();`;
  const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
  try {
    return new Worker(url);
  } finally {
    URL.revokeObjectURL(url);
  }
}];
"""

_IMPORT = re.compile(r'import \{ ((?:[\w$]+ , )*[\w$]+ (?:, )?)\} from (["\'])\./([\w.]+)\2 ;')

#: What falls away in a template: comments, indentation, lines without anything.
_IN_TEMPLATES = re.compile(r"(?:[ \t]+|(?<=\n))//[ \t][^\n`]*(?=[\n`])|(?<=\n)[ \t\n]+")

_DECLARE = ("async", "class", "const", "function", "let", "var")


class _Module(NamedTuple):
    text: str  # without imports, exports and comments
    needs: dict[str, list[str]]  # names that are imported, by module
    names: list[str]  # at top level
    exports: dict[str, str]  # names, and what declares them: "const", "function", ...


@cache
def viewer_script(
    *,
    scene: bool = False,
    remote: bool = False,
    series: bool = False,
    values: bool = False,
    module: bool = False,
) -> str:
    """Return the viewer as one script, ASCII or UTF-8 text that may stand in a ``<script>``.

    ``scene``: it draws meshes, lines and text beside VDIs. ``remote``: it can be fed by
    ``pyvista-vdi serve``. ``series``: it plays series, and reads what zstd has compressed;
    ``values``: it edits transfer functions; otherwise the names that these modules export are
    null. ``module``: names stay in sight of what is written behind the script, for an ES module;
    by default it is a function that is called, and shows nothing but its element.
    """
    folder = resources.files("pyvista_vdi.extensions.web") / "viewer"
    sources = {
        entry.name: entry.read_text(encoding="utf-8")
        for entry in folder.iterdir()
        if entry.name.endswith(".js")
    }
    for name in (*(() if series else OF_SERIES), *(() if values else OF_VALUES)):
        exports = _module(name, sources[name]).exports
        sources[name] = "".join(f"export const {each} = null;\n" for each in exports)
    entries = ["element.js", *["scene.js"] * scene, *["remote.js"] * remote]
    script = bundled(sources, entries)
    return script if module else f'(() => {{\n"use strict";\n{script}}})();\n'


def bundled(sources: Mapping[str, str], entries: Iterable[str]) -> str:
    """Return modules, and what they import, as one script without comments and indentation.

    Raises ValueError if one is not written as the head of this file asks.
    """
    if SPAWN in sources:
        sources = {**sources, SPAWN: _SPAWN_BUNDLED}
    wanted = _in_order(entries, sources)
    in_worker = _in_order([WORKER], sources) if SPAWN in wanted else {}
    modules = in_worker | wanted
    home = {"workerPart": "the bundle"} if in_worker else {}
    for name, module in modules.items():
        for each in module.names:
            if home.setdefault(each, name) != name:
                raise ValueError(f"{home[each]} and {name} both have {each} at top level")
        for needed, names in module.needs.items():
            if absent := [each for each in names if each not in modules[needed].exports]:
                raise ValueError(f"{name} imports {absent[0]}, which {needed} does not export")
        for each, how in module.exports.items():
            if name in in_worker and how in ("let", "var"):
                raise ValueError(f"{name} has export {how} {each}: a worker's change of it is lost")
    script = "".join(module.text for name, module in wanted.items() if name not in in_worker)
    if in_worker:
        shared = ", ".join(each for module in in_worker.values() for each in module.exports)
        body = "".join(module.text for module in in_worker.values())
        script = (
            f"const workerPart = () => {{\n{body}return {{ {shared} }};\n}};\n"
            f"const {{ {shared} }} = workerPart();\n{script}"
        )
    if re.search(r"</script|<!--", script, re.IGNORECASE):
        raise ValueError("a module holds what would end a <script> or begin a comment of HTML")
    return script


def _in_order(entries: Iterable[str], sources: Mapping[str, str]) -> dict[str, _Module]:
    """Return modules and what they need, which comes first."""
    order: dict[str, _Module] = {}

    def visit(name: str, above: tuple[str, ...]) -> None:
        if name in above:
            raise ValueError(f"modules import each other in a circle: {' -> '.join(above)}")
        if name not in sources:
            raise ValueError(
                f"{above[-1] if above else 'the bundle'} imports {name}, which is none"
            )
        if name not in order:
            module = _module(name, sources[name])
            for needed in module.needs:
                visit(needed, (*above, name))
            order[name] = module

    for entry in entries:
        visit(entry, ())
    return order


@cache
def _module(name: str, text: str) -> _Module:
    """Return a module as the bundle needs it."""
    tokens = tokens_of(name, text)
    texts = [token.text for token in tokens]
    parts, gap, behind = [], "", 1
    needs: dict[str, list[str]] = {}
    names: list[str] = []
    exports: dict[str, str] = {}
    for k, token in enumerate(tokens):
        if k < behind:
            continue
        word = token.text if token.kind == "word" and texts[k - 1] not in DOTS else ""
        end = texts.index(";", k) + 1 if word == "import" else k
        found = _IMPORT.fullmatch(" ".join(texts[k:end])) if token.depth == 0 else None
        if (
            (word == "import" and not found)
            or (word == "export" and texts[k + 1] not in _DECLARE)
            or (word == "await" and not token.inside)
        ):
            form = "".join(part.gap + part.text for part in tokens[k : k + 6]).partition(";")[0]
            raise ValueError(f"{name} has {form.strip()!r}, of a form that is not bundled")
        if found:
            needs.setdefault(found[3], []).extend(re.findall(r"[\w$]+", found[1]))
            behind = end
        if found or word == "export":
            gap = gap or token.gap  # now of what follows, which may begin a statement by it
            continue
        lasting = token.kind == "template" and token.depth == 0
        shown = _IN_TEMPLATES.sub("", token.text) if lasting else token.text
        parts.append((gap or token.gap) + shown)
        gap = ""
        first = k - (texts[k - 1] == "async")
        exported = texts[first - 1] == "export"
        top = token.depth == 0 and (exported or tokens[first].begins)
        if word in _DECLARE[1:] and (top or (word == "var" and not token.inside)):
            bound = list(declared(tokens[k:]))
            names += bound
            exports |= dict.fromkeys(bound if exported else [], word)
    return _Module("".join(parts).strip() + "\n", needs, names, exports)
