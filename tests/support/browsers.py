"""A real browser: Chromium, driven by Playwright, with WebGL 2 by SwiftShader.

``PYVISTA_VDI_CHROMIUM`` names an executable where it is not in the path, or not the first there;
``PYVISTA_VDI_REQUIRE_BROWSER=1`` makes a missing one a failure, as in CI. Playwright keeps an event
loop running in its thread, so a file of tests has a browser of its own, which ends with it.
"""

from __future__ import annotations

import base64
import os
import re
import shutil
from importlib import resources

import numpy as np
import pytest

#: Names of Chromium in distributions.
NAMES = ("chromium", "chromium-browser", "google-chrome")

#: The same without windows, Debian's: tests with it take two thirds of the time.
WITHOUT_WINDOWS = "chromium-headless-shell"

#: Software WebGL; a container's root has no sandbox.
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")

#: Where pages are, and the viewer's modules beside them; nothing leaves the machine.
SITE = "http://vdi.test/"

#: Milliseconds after which something that should have happened has not.
LONG = 120_000

PAGE = """<!doctype html><meta charset="utf-8"><style>body {{ margin: 0 }}</style>
<vdi-viewer {attributes} style="width: {width}px; height: {height}px; aspect-ratio: auto">
</vdi-viewer>
<script type="module">
import "./element.js";
{script}
const viewer = window.viewer = document.querySelector("vdi-viewer");
window.heard = [];
for (const name of ["camerachange", "framedrawn", "vditime", "error"]) {{
  viewer.addEventListener(name, (event) => heard.push([name, event.detail]));
}}
window.bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
window.textOf = (bytes) => {{
  let text = "";
  for (let k = 0; k < bytes.length; k += 8192) {{
    text += String.fromCharCode(...bytes.subarray(k, k + 8192));
  }}
  return btoa(text);
}};
window.begun = true;
</script>"""


def missing(reason):
    if os.environ.get("PYVISTA_VDI_REQUIRE_BROWSER") == "1":
        pytest.fail(f"PYVISTA_VDI_REQUIRE_BROWSER=1, but {reason}")
    pytest.skip(reason)


@pytest.fixture(scope="module")
def chromium():
    """A browser, Playwright's."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("playwright is not installed: pip install playwright")
    named = os.environ.get("PYVISTA_VDI_CHROMIUM")
    names = (named,) if named else (WITHOUT_WINDOWS, *NAMES)
    executable = next(filter(None, map(shutil.which, names)), None)
    if executable is None:
        missing(f"none of {', '.join(names)} is in the path: install the package 'chromium'")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(FLAGS))
        yield browser
        browser.close()


class Page:
    """A page with a viewer; ``page`` is Playwright's.

    ``asked`` has the names of the files that were asked for, and the range of each or None. Parts
    are given of those whose names are in ``in_parts``.
    """

    def __init__(self, page, files, expected, in_parts=()):
        self.page = page
        self.complaints = []
        self.expected = expected
        self.asked = []
        self.in_parts = in_parts
        page.set_default_timeout(LONG)
        page.on("pageerror", lambda error: self._complain(str(error)))
        page.on("console", self._hear)
        page.route(SITE + "**", lambda route: self._answer(route, files))

    def _hear(self, message):
        # Calls that WebGL refuses are warnings to Chromium
        if message.type == "error" or "GL_INVALID" in message.text:
            self._complain(message.text)

    def _complain(self, text):
        if not (self.expected and re.search(self.expected, text)):
            self.complaints.append(text)

    def _answer(self, route, files):
        name = route.request.url.removeprefix(SITE).partition("?")[0]
        content = files.get(name)
        part = re.fullmatch(r"bytes=(\d+)-(\d+)", route.request.headers.get("range", ""))
        self.asked.append((name, part and tuple(map(int, part.groups()))))
        if part and name in self.in_parts:
            begin, last = self.asked[-1][1]
            sent = content[begin : last + 1]
            where = f"bytes {begin}-{begin + len(sent) - 1}/{len(content)}"
            route.fulfill(status=206, body=sent, headers={"Content-Range": where})
            return
        module = resources.files("pyvista_vdi.web") / "viewer" / name
        if content is None and name.endswith(".js") and module.is_file():
            content = module.read_text(encoding="utf-8")
        if content is None:
            route.fulfill(status=404, body="")
            return
        kinds = {"html": "text/html", "js": "text/javascript"}
        kind = kinds.get(name.rpartition(".")[2], "application/octet-stream")
        route.fulfill(body=content, content_type=kind)

    def evaluate(self, script, argument=None):
        return self.page.evaluate(script, argument)

    def wait_for(self, condition):
        """Wait until a JavaScript expression is true."""
        self.page.wait_for_function(condition)

    def load(self, data):
        """Show the bytes of a .vdi file; return when all of it is drawn."""
        text = base64.b64encode(data).decode()
        self.page.evaluate("(text) => viewer.load(bytesOf(text)).then(() => true)", text)

    def screenshot(self, camera, size):
        """The viewer's picture from a Camera, premultiplied, uint8 (H, W, 4), top row first."""
        keys = ["position", "focal_point", "view_up", "window_center"]
        keys.append("parallel_scale" if camera.parallel_projection else "view_angle")
        state = camera.to_dict()
        shot = self.page.evaluate(
            """async ([camera, width, height]) => {
              viewer.camera = camera;
              const shot = await viewer.screenshot({ width, height });
              return [shot.width, shot.height, textOf(shot.data)];
            }""",
            [{key: state[key] for key in keys}, *size],
        )
        assert shot[:2] == list(size)
        picture = np.frombuffer(base64.b64decode(shot[2]), np.uint8)
        return picture.reshape(size[1], size[0], 4)


@pytest.fixture
def open_page(chromium):
    """Open a page with a viewer of ``size`` CSS pixels, or one of ``files`` by its ``name``.

    ``before`` runs before anything else. Of files named in ``in_parts`` the server gives parts.
    What the page complains of fails the test, but for what ``expected`` (a pattern) is found in.
    """
    contexts, pages = [], []

    def open_page(
        size=(320, 180),
        *,
        attributes="",
        script="",
        before="",
        files=None,
        name=None,
        expected=None,
        in_parts=(),
        **options,
    ):
        files = dict(files or {})
        if name is None:
            name = "page.html"
            files[name] = PAGE.format(
                attributes=attributes, script=script, width=size[0], height=size[1]
            )
        context = chromium.new_context(**options)
        context.add_init_script(before)
        contexts.append(context)
        page = Page(context.new_page(), files, expected, in_parts)
        pages.append(page)
        page.page.goto(SITE + name)
        if name == "page.html":
            page.wait_for("window.begun")
        return page

    yield open_page
    for context in contexts:
        context.close()
    complaints = [text for page in pages for text in page.complaints]
    assert not complaints
