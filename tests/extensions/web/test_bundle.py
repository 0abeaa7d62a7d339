"""The viewer's modules as one script: order, and what is left out."""

import re

from pyvista_vdi.extensions.web.bundle import bundled

MODULES = {
    "a.js": 'import { b, B } from "./b.js";\nimport {\n  spawn,\n} from "./spawn.js";\n'
    "/** What it is. */\nexport class A {\n  // twice\n  twice() { return 2 * b(B); } // so\n}\n",
    "b.js": "/**\n * Two lines.\n */\nexport const B = 2;\nexport function b(x) { return x; }\n",
    "spawn.js": "export const spawn = () => new Worker(import.meta.url);\n",
    "worker.js": 'import { b } from "./b.js";\nexport function serve(scope) { b(scope); }\n',
}


def test_what_is_needed_comes_first_and_once():
    script = bundled(MODULES, ["a.js"])
    assert script.index("function b(") < script.index("function serve") < script.index("class A")
    assert script.count("function b(") == 1
    assert "const { B, b, serve } = workerPart();" in script
    assert not re.search(r"\b(import|export)\b|twice$|Two lines|What|so$", script, re.MULTILINE)
    assert "workerPart" not in bundled(MODULES, ["b.js"])
