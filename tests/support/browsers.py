"""A real browser: Chromium, driven by Playwright, with WebGL 2 by SwiftShader.

``PYVISTA_VDI_CHROMIUM`` names an executable where it is not in the path, or not the first there;
``PYVISTA_VDI_REQUIRE_BROWSER=1`` makes a missing one a failure, as in CI. Playwright keeps an event
loop running in its thread, so a file of tests has a browser of its own, which ends with it.
"""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.io.vdi_file.writer import write_to

#: Names of Chromium in distributions.
NAMES = ("chromium", "chromium-browser", "google-chrome")

#: The same without windows, Debian's: tests with it take two thirds of the time.
WITHOUT_WINDOWS = "chromium-headless-shell"

#: Software WebGL; a container's root has no sandbox; what scrolls is where it is to be at once.
FLAGS = (
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--no-sandbox", "--disable-smooth-scrolling"),
)

#: Where pages are, and the viewer's modules beside them; nothing leaves the machine.
SITE = "http://vdi.test/"

#: The window of a page that has all of it, unless a test says another: pixels take time.
SMALL = {"width": 320, "height": 200}

#: Milliseconds after which something that should have happened has not.
LONG = 120_000

#: In every page.
HELPERS = """
window.bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
window.textOf = (bytes) => {
  let text = "";
  for (let k = 0; k < bytes.length; k += 8192) {
    text += String.fromCharCode(...bytes.subarray(k, k + 8192));
  }
  return btoa(text);
};
// What a decoder returns: its arrays as base64, or its sentence
window.told = async (decoding) => {
  try {
    const raw = ({ buffer, byteOffset, byteLength }) =>
      textOf(new Uint8Array(buffer, byteOffset, byteLength));
    return Object.fromEntries(Object.entries(await decoding).map(
      ([name, value]) => [name, ArrayBuffer.isView(value) ? raw(value) : value]));
  } catch (error) {
    return `${error.name}: ${error.message}`;
  }
};
"""

#: Counts a page's objects of WebGL.
COUNTING = """
window.alive = {};
const of = WebGL2RenderingContext.prototype;
for (const kind of ["Texture", "Framebuffer", "Renderbuffer", "Buffer", "VertexArray", "Program",
  "Shader"]) {
  const [make, free] = [of["create" + kind], of["delete" + kind]];
  alive[kind] = 0;
  of["create" + kind] = function (...rest) { ++alive[kind]; return make.apply(this, rest); };
  of["delete" + kind] = function (what) { alive[kind] -= !!what; return free.call(this, what); };
}
"""

#: Counts the contexts of WebGL that a page makes, and keeps them.
CONTEXTS = """
window.contexts = [];
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  const made = getContext.call(this, kind, ...rest);
  if (kind === "webgl2" && !contexts.includes(made)) contexts.push(made);
  return made;
};
"""

PAGE = """<!doctype html><meta charset="utf-8"><style>body {{ margin: 0 }}</style>
<body></body><script type="module">
import "./element.js";
{script}
window.show = (markup) => {{
  document.body.innerHTML = markup;
  window.viewer = document.querySelector("vdi-viewer");
  window.errors = [];
  viewer?.addEventListener("error", ({{ detail }}) => errors.push(detail.message));
}};
</script>"""

VIEWER = """<vdi-viewer {attributes}
  style="width: {width}px; height: {height}px; aspect-ratio: auto"></vdi-viewer>"""


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
        browser = playwright.chromium.launch(executable_path=executable, args=[*FLAGS])
        yield browser
        browser.close()


def in_base64(data):
    return base64.b64encode(data).decode()


def file_of(vdi, compression="deflate"):
    """The bytes of a VDI's file."""
    stream = io.BytesIO()
    write_to(stream, vdi, compression, 1)
    return stream.getvalue()


def array_of(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def assert_decoded(got, vdi):
    """Hold what a decoder has ``told`` to the VDI that Python has."""
    assert isinstance(got, dict), got
    assert tuple(got["windowSize"]) == vdi.window_size
    assert got["camera"] == json.loads(json.dumps(vdi.camera.to_dict()))
    assert (got["depthOrigin"], tuple(got["bounds"])) == (vdi.depth_origin, vdi.bounds)
    wanted = {"offsets": vdi.offsets.astype("<u4")}
    if vdi.precision == "8-byte":
        packing = vdi.packing
        assert (got["precision"], got["depthStep"]) == ("8-byte", packing.step)
        wanted |= {"words": packing.words, "origin": packing.origins, "stride": packing.strides}
    else:
        assert got["precision"] == "exact"
        wanted |= {name: getattr(vdi, name) for name in ("front", "back", "color")}
        wanted["opticalDepth"] = vdi.optical_depth
    for name, array in wanted.items():
        found = array_of(got[name], array.dtype)
        np.testing.assert_array_equal(found, array.reshape(-1), err_msg=name)


def picture(page, size, viewer="viewer"):
    """What a viewer of a page (or frame) shows: premultiplied RGBA, uint8, top row first."""
    *shape, text = page.evaluate(
        f"""async ([width, height]) => {{
          const shot = await {viewer}.screenshot({{ width, height }});
          return [shot.height, shot.width, textOf(shot.data)];
        }}""",
        list(size),
    )
    assert shape == [size[1], size[0]]
    return array_of(text, np.uint8).reshape(*shape, 4)


def assert_axe_finds_nothing(page):
    """Hold a page to axe-core's rules of accessibility.

    ``PYVISTA_VDI_AXE`` names its axe.min.js: ``npm install axe-core``.
    """
    axe = os.environ.get("PYVISTA_VDI_AXE")
    if axe is None:
        pytest.skip("PYVISTA_VDI_AXE names no axe.min.js: npm install axe-core")
    page.evaluate(Path(axe).read_text(encoding="utf-8"))
    found = page.evaluate("axe.run(document)")
    assert [each["id"] for each in found["violations"]] == []
    assert len(found["passes"]) > 10


class Page:
    """A page with a viewer; ``page`` is Playwright's, and ``urls`` has what was asked for."""

    def __init__(self, context):
        self.page = context.new_page()
        self.begin_anew()
        self.page.set_default_timeout(LONG)
        self.page.on("pageerror", lambda error: self.complain(str(error)))
        self.page.on("console", self.hear)
        self.page.on("request", lambda request: self.urls.append(request.url))
        self.page.route(SITE + "**", self.answer)

    def begin_anew(self, files=None, expected=None):
        self.files, self.expected = dict(files or {}), expected
        self.urls, self.complaints = [], []

    def hear(self, message):
        # Calls that WebGL refuses are warnings to Chromium
        if message.type == "error" or "GL_INVALID" in message.text:
            self.complain(message.text)

    def complain(self, text):
        if not (self.expected and re.search(self.expected, text)):
            self.complaints.append(text)

    def answer(self, route):
        name = route.request.url.removeprefix(SITE).partition("?")[0]
        content = self.files.get(name)
        module = resources.files("pyvista_vdi.extensions.web") / "viewer" / name
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

    def assert_shows(self, vdi, size, *views):
        """Hold the viewer's pictures from views, or from the VDI's own, to those of ``render``."""
        for view in views or [vdi.camera]:
            expected = pvdi.render(vdi, view, size) * 255.0
            # A picture has 8 bits, and float32 of two devices composites; test_raycast has the rest
            assert np.abs(self.screenshot(view, size) - expected).max() <= 1.0

    def ready(self):
        """Wait until all of what is to be shown is drawn."""
        self.page.evaluate("viewer.ready.then(() => true)")

    def load(self, data):
        """Show the bytes of a .vdi file; return when all of it is drawn."""
        self.page.evaluate("(text) => viewer.load(bytesOf(text)).then(() => true)", in_base64(data))

    def screenshot(self, camera, size):
        """The viewer's picture from a Camera, premultiplied, uint8 (H, W, 4), top row first."""
        keys = ["position", "focal_point", "view_up", "window_center"]
        keys.append("parallel_scale" if camera.parallel_projection else "view_angle")
        state = camera.to_dict()
        self.page.evaluate(
            "(camera) => { viewer.camera = camera; }", {key: state[key] for key in keys}
        )
        return picture(self.page, size)


def show_scene(page, scene):
    """Show a scene of web/scene.py, and its VDI, in a page's viewer."""
    page.evaluate(
        """async ([scene, data]) => {
          const { Scene } = await import("./scene.js");
          viewer.scene = new Scene(bytesOf(scene));
          await viewer.load(bytesOf(data));
        }""",
        [in_base64(part) for part in (scene.data, file_of(scene.shown))],
    )


@pytest.fixture(scope="module")
def shared_pages(chromium):
    """Pages that the tests of a file share, by their scripts."""
    return {}


@pytest.fixture
def open_page(chromium, shared_pages):
    """Open a page with a viewer of ``size`` CSS pixels, the one of ``files`` that has ``name``, or
    a ``url`` of the disk or of a server, which must ask for nothing from elsewhere.

    ``before`` runs before anything else, ``script`` before there is a viewer. What the page
    complains of fails the test, but for what ``expected`` (a pattern) is found in. Without
    ``options`` of Playwright's context a page of the same scripts is shared by the tests of a file,
    each of which has a viewer of its own.
    """
    contexts, pages, used = [], [], []

    def new(before, options):
        context = chromium.new_context(**options)
        context.add_init_script(HELPERS + before)
        return Page(context)

    def open_page(
        size=(320, 180),
        *,
        attributes="",
        script="",
        before="",
        files=None,
        name=None,
        url=None,
        expected=None,
        **options,
    ):
        shared = not (options or name or url)
        if name or url:
            options = {"viewport": SMALL} | options
        page = shared_pages.get((script, before)) if shared else None
        fresh = page is None
        if fresh:
            page = new(before, options)
            if shared:
                shared_pages[script, before] = page
            else:
                contexts.append(page.page.context)
        if shared:
            used.append(page)
        page.begin_anew(files, expected)
        pages.append((page, url))
        if url is None and name is None:
            if fresh:
                page.files["page.html"] = PAGE.format(script=script)
                page.page.goto(SITE + "page.html")
                page.wait_for("!!window.show")
            markup = VIEWER.format(attributes=attributes, width=size[0], height=size[1])
            page.evaluate("(markup) => show(markup)", markup)
        else:
            page.page.goto(url or SITE + name)
            if options.get("java_script_enabled", True):
                page.evaluate("window.viewer = document.querySelector('vdi-viewer')")
        return page

    yield open_page
    for page in used:
        page.evaluate("show('')")
    for context in contexts:
        context.close()
    for page, url in pages:
        assert not page.complaints, page.complaints
        ours = url and (re.split("[?#]", url)[0], "blob:", "data:")
        assert not url or not [each for each in page.urls if not each.startswith(ours)]
