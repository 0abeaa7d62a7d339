"""The viewer's modules as one script: order, names, what is refused."""

import re
from importlib import resources

import pytest

from pyvista_vdi.extensions.web.bundle import OF_SERIES, OF_VALUES, SPAWN, bundled, viewer_script

MODULES = {
    "a.js": 'import { b, B } from "./b.js";\nimport { waysToSpawn } from "./spawn.js";\n'
    "/** What it is. */\nexport class A {\n  // twice\n  twice() { return 2 * b(B); }\n}\n",
    "b.js": "/**\n * Two lines.\n */\nexport const B = 2;\nexport function b(x) { return x; }\n",
    "spawn.js": "export const waysToSpawn = [() => new Worker(import.meta.url)];\n",
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


def test_comments_and_indentation_of_shaders_fall_away():
    glsl = "const A = `\n// one\n  uniform vec2 a; // two\n\n  url(http://c) // ${1}`;\n"
    assert bundled({"a.js": glsl}, ["a.js"]) == (
        "const A = `\n\nuniform vec2 a;\nurl(http://c) // ${1}`;;\n"
    )


def test_without_a_worker_there_is_none():
    assert "workerPart" not in bundled(MODULES, ["b.js"])


#: What a module says, and must say in the bundle. There are `b`, 1, of another module, and `say`.
PROGRAMS = [
    # What looks like a comment, an import or an end of a text
    ("say(`\n//cdn.example/x.js\n/** x */\n`);", "\n//cdn.example/x.js\n/** x */\n"),
    ("say(`a${`\n// ${b + `}//`}`}\n// d`);", "a\n// 1}//\n// d"),
    ('say(`\nimport { x } from "./x.js";`);', '\nimport { x } from "./x.js";'),
    ("const p = '/*', q = \"*/\"; // said\nsay(p + q);", "/**/"),
    ("say('a\\\n// b' + '\\'// c' + `\\`// \\${d`);", "a// b'// c`// ${d"),
    ("say('http://x'.replace(/[/'\"`]/g, '//'));", "http:////x"),
    ("if (b) /'/.test('');\nsay(/`/.source + /\\/*/.source);", "`\\/*"),
    # Divisions
    ("let x = 8, g = 2; say((x) / 2 / g + [x][0] / 4 / g /* ' */ + x++ / 2);", 7),
    ("const o = { return: 4, catch() { return 8; } }; say(o.return / 2 + o.catch() / 2);", 6),
    ("say(1. / 2 + (() => { return 4 })() / 2 / 1e0);", 2.5),
    # Ends of lines
    ("const f = () => 1 /*\n*/ const g = 2\nsay([f(), g])", [1, 2]),
    ("function f() { return /*\n*/ 1 }\nsay(typeof/**/f() + b +/**/+b)", "undefined11"),
    ("const c = b\nexport const d = b\nexport function e() {}\nsay(c + d)", 2),
    # Imports and exports
    ("import {\n  q, // one\n  r,\n} from './q.js'; say([q, r]);", [1, 2]),
    ('import { q } from "./q.js"; import { s } from "./q.js"; say(q + s);', 4),
    ("export async function* f() {}\nexport class D extends Array {}\nsay(new D().length);", 0),
    # Names that are not at top level
    ("const f = function B() {}, { x: { B: k } = { B: 4 } } = {};\n{ let B = k; say(B); }", 4),
    ("function f(B) { var B = 5; say(B); }\nf(); const g = () => { var B; }", 5),
    # Functions that wait
    ("class D { async m(a = 1) { if (a) { await a; } else await b } }\nsay(typeof D)", "function"),
    ("const f = async (x) => await x, g = async () => { await 1 }\nsay(typeof f(g))", "object"),
    ("const o = { async m() { for await (const x of [1]) await x } };\nsay(typeof o)", "object"),
]


@pytest.mark.parametrize(("text", "said"), PROGRAMS)
def test_the_script_does_what_the_modules_do(text, said, chromium):
    modules = {
        "a.js": f'import {{ b }} from "./b.js";\n{text}',
        "b.js": "export const b = 1;\nconst c1 = b",
        "q.js": "export const q = 1, [r, ...{ length: s }] = [2, 0, 0, 0]",
        "z.js": "[].push(1);\nexport const B = 0;",
    }
    script = bundled(modules, ["a.js", "z.js"])
    page = chromium.new_page()
    got = page.evaluate(
        f'() => {{ "use strict"; let said; const say = (x) => said = x;\n{script}return said; }}'
    )
    page.close()
    assert got == said


REFUSED = [
    # Names that another module has
    *(
        (f"{text}\n", "b.js and a.js both have B at top level")
        for text in (
            "export const B = 1;",
            "const r = 1, B = 2;",
            "export const { x: { B }, y } = { x: {} };",
            "const [, r = [1, 2], { u: B = 1 }] = [];",
            "const { r, ...B } = {};",
            "let r\nlet s, B",
            "const r = [1,\n2], s = { a: 1, b: 2 },\n  B = 1;",
            "export const r = () => 1\nvar B;",
            "if (b) { for (var i = 0, B = 1; i < 1; ++i); }",
            "for (var B of []) ;",
            "async function* B() {}",
            "const r = 1; class B {}",
        )
    ),
    # Forms
    *(
        (f"{text};\n", f"^a.js has .{re.escape(text)[:12]}.*, of a form that is not bundled")
        for text in (
            'import { a as b } from "./b.js"',
            'import * as all from "./b.js"',
            'import it from "./b.js"',
            'import "./b.js"',
            'import { x } from "https://cdn.example/x.js"',
            'import { x } from "./x.json" with { type: "json" }',
            "import { B } from './b.js'\nb()",
            "import.meta.url",
            "export default 3",
            "export { b }",
            'export * from "./b.js"',
            "await b()",
        )
    ),
    *(
        (text, "a form that is not bundled")
        for text in (
            'const lazy = () => import("./b.js");',
            "if (b) { await 1; }",
            "for await (const x of []) ;",
            "try { const f = async () => { await 1 }; say(`${await f()}`); } catch {}",
            "const f = async (x) => await x\nawait f();",
            "const f = async (x) => await x, y = await f();",
        )
    ),
    # The rest
    ('import { x } from "./missing.js";\n', "imports missing.js"),
    ('import { serve, C } from "./b.js";\n', "a.js imports serve, which b.js does not export"),
    ('import { A } from "./a.js";\n', "in a circle"),
    ("export let counted = 0;", "export let counted: a worker's change of it is lost"),
    ("const t = '</script>';\n", "end a <script>"),
    ("const r = {}\n/1/g;", "a.js has a / in .*division"),
    ("const t = `\n", "a.js has a ' in .*ends"),
]


@pytest.mark.parametrize(("text", "why"), REFUSED)
def test_modules_that_cannot_be_bundled_are_refused(text, why):
    modules = dict(MODULES)
    if "circle" in why or "worker" in why:
        modules["b.js"] = modules["b.js"] * ("worker" in why) + text
    else:
        modules["a.js"] = 'import { b } from "./b.js";\n' + text
    with pytest.raises(ValueError, match=why):
        bundled(modules, ["a.js"])


def test_every_module_of_the_viewer_is_in_the_package_and_can_be_bundled():
    folder = resources.files("pyvista_vdi.extensions.web") / "viewer"
    files = {p.name: p.read_text(encoding="utf-8") for p in folder.iterdir()}
    told = {"custom-elements.json", "package.json"}
    told |= {"element.d.ts", "remote.d.ts", "scene.d.ts"}
    sources = {name: text for name, text in files.items() if name.endswith(".js")}
    assert files.keys() - sources.keys() == told
    for name in sources.keys() - {SPAWN}:
        bundled(sources, [name])


def test_what_plays_series_and_edits_values_is_left_out_of_pages_without_them():
    without, whole = viewer_script(), viewer_script(series=True)
    assert "const unzstd = null;" in without
    assert "class ZstdFrame" in whole
    assert "class ZstdFrame" not in without
    assert "transferEditor = null" in without
    assert "transferEditor = null" not in viewer_script(values=True)
    folder = resources.files("pyvista_vdi.extensions.web") / "viewer"
    assert all((folder / name).is_file() for name in OF_SERIES + OF_VALUES)
