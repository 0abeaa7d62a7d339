"""The viewer's modules as one script: order, names, what is refused."""

import re
from importlib import resources

import pytest

from pyvista_vdi.web.bundle import OF_SERIES, SPAWN, bundled, viewer_script

MODULES = {
    "a.js": 'import { b, B } from "./b.js";\nimport { spawnWorker } from "./spawn.js";\n'
    "/** What it is. */\nexport class A {\n  // twice\n  twice() { return 2 * b(B); }\n}\n",
    "b.js": "/**\n * Two lines.\n */\nexport const B = 2;\nexport function b(x) { return x; }\n",
    "spawn.js": "export function spawnWorker() { return new Worker(import.meta.url); }\n",
    "worker.js": 'import { b } from "./b.js";\nexport function serve(scope) { b(scope); }\n',
}


def test_what_is_needed_comes_first_and_once():
    script = bundled(MODULES, ["a.js"])
    assert script.index("function b(") < script.index("function serve") < script.index("class A")
    assert script.count("function b(") == 1
    assert "const { B, b, serve } = workerPart();" in script
    assert not re.search(r"\b(import|export)\b|twice$|Two lines", script, re.MULTILINE)


def test_constants_of_shaders_are_no_names():
    glsl = "export const %s = `\nconst float x = 1.0;\n`;\n"
    assert bundled({"a.js": glsl % "A", "b.js": glsl % "B"}, ["a.js", "b.js"])


def test_without_a_worker_there_is_none():
    assert "workerPart" not in bundled(MODULES, ["b.js"])


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("export const B = 1;\n", "both have B at top level"),
        ('import { a as b } from "./b.js"\n', "a form that is not bundled"),
        ("export default 3;\n", "a form that is not bundled"),
        ('import { x } from "./missing.js";\n', "imports missing.js"),
        ('import { A } from "./a.js";\n', "in a circle"),
        ("const t = '</script>';\n", "end a <script>"),
    ],
)
def test_modules_that_cannot_be_bundled_are_refused(text, why):
    modules = dict(MODULES)
    modules["a.js" if "circle" not in why else "b.js"] = text
    if "both" in why:
        modules["a.js"] = 'import { b } from "./b.js";\n' + text
    with pytest.raises(ValueError, match=why):
        bundled(modules, ["a.js"])


def test_every_module_of_the_viewer_is_in_the_package_and_can_be_bundled():
    folder = resources.files("pyvista_vdi.web") / "viewer"
    sources = {p.name: p.read_text(encoding="utf-8") for p in folder.iterdir()}
    assert all(name.endswith(".js") for name in sources), sorted(sources)
    for name in sources.keys() - {SPAWN}:
        bundled(sources, [name])


def test_what_plays_series_is_left_out_of_pages_without_one():
    without, whole = viewer_script(), viewer_script(series=True)
    assert "const unzstd = null;" in without
    assert "class ZstdFrame" in whole
    assert "class ZstdFrame" not in without
    folder = resources.files("pyvista_vdi.web") / "viewer"
    assert all((folder / name).is_file() for name in OF_SERIES)
