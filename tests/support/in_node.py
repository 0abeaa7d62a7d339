"""The viewer's modules in Node, for what of them needs no browser."""

from __future__ import annotations

import json
import shutil
import subprocess
from importlib import resources

import pytest
from browsers import HELPERS

PROGRAM = """
globalThis.window = globalThis;
%s
const from = (name) => import(`%s/${name}`);
let text = "";
for await (const part of process.stdin) text += part;
process.stdout.write(JSON.stringify(await (%s)(...JSON.parse(text))) ?? "null");
"""


def in_node(script, *given):
    """What a JavaScript function makes of values; ``await from("decode.js")`` is a module."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node in the path, 20 or newer")
    viewer = (resources.files("pyvista_vdi.extensions.web") / "viewer").as_uri()
    program = PROGRAM % (HELPERS, viewer, script)
    done = subprocess.run(
        [node, "--input-type=module", "--eval", program],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
