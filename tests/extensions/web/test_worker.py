"""The worker that decodes: started where modules are files, and where none may be."""

import shutil
from contextlib import ExitStack
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from threading import Thread

import pytest
from browsers import LONG

SIZE = (64, 36)

PAGE = """<!doctype html><meta charset="utf-8"><title>VDIs</title>
<script type="module" src="viewer/element.js"></script>
<vdi-viewer src="ball.vdi"></vdi-viewer><vdi-viewer src="ball.vdi"></vdi-viewer>"""


@pytest.fixture
def folder(data, tmp_path):
    """A folder with a VDI and the viewer's modules."""
    (tmp_path / "ball.vdi").write_bytes(data)
    (tmp_path / "index.html").write_text(PAGE)
    with resources.as_file(resources.files("pyvista_vdi.extensions.web") / "viewer") as viewer:
        shutil.copytree(viewer, tmp_path / "viewer")
    return tmp_path


@pytest.fixture
def serve():
    """Serve a folder at an origin of its own, with headers; return its URL."""
    with ExitStack() as stack:

        def serve(folder, headers=()):
            class Handler(SimpleHTTPRequestHandler):
                def end_headers(self):
                    for header in headers:
                        self.send_header(*header)
                    super().end_headers()

                def log_message(self, *_):
                    pass

            Handler.extensions_map = {".js": "text/javascript", ".html": "text/html", "": "a/b"}
            server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(folder)))
            stack.enter_context(server)
            Thread(target=server.serve_forever, daemon=True).start()
            stack.callback(server.shutdown)
            return f"http://127.0.0.1:{server.server_address[1]}/"

        yield serve


def workers_and_warnings(chromium, url):
    """Return how many workers a page of two viewers has, and what it warns of."""
    page = chromium.new_page(viewport={"width": 64, "height": 72})
    page.set_default_timeout(LONG)
    warnings = []
    page.on("console", lambda said: warnings.append(said.text) if said.type == "warning" else None)
    page.goto(url)
    page.evaluate(
        """async () => {
          await customElements.whenDefined("vdi-viewer");
          const viewers = [...document.querySelectorAll("vdi-viewer")];
          await Promise.all(viewers.map((viewer) => viewer.ready));
        }"""
    )
    workers = len(page.workers)
    page.close()
    return workers, [text for text in warnings if "vdi-viewer" in text]


def test_modules_start_it_and_where_none_may_be_that_is_said_once(folder, serve, chromium):
    for policy, starts in (("default-src 'self'", True), ("worker-src 'none'", False)):
        url = serve(folder, [("Content-Security-Policy", policy)])
        workers, warnings = workers_and_warnings(chromium, url)
        assert bool(workers) == starts, policy
        assert len(warnings) == (not starts)
        assert all("decodes on the page's own thread" in text for text in warnings)
        assert all("worker-src" in text and "worker.js" in text for text in warnings)
