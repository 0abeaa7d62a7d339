"""The worker that decodes: started where modules are files, of here or elsewhere, or bundled."""

import shutil
import subprocess
from contextlib import ExitStack
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from threading import Thread

import pytest
from browsers import LONG
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (64, 36)

PAGE = """<!doctype html><meta charset="utf-8"><title>VDIs</title>
<script type="module" src="{script}"></script>
<vdi-viewer src="ball.vdi"></vdi-viewer><vdi-viewer src="ball.vdi"></vdi-viewer>"""

#: Commands that make ``out/main.js`` of ``main.js``, and what else it takes.
BUNDLERS = {
    "esbuild": "main.js viewer/worker.js --bundle --format=esm --outdir=out --entry-names=[name]",
    "vite": "build --logLevel=error --base=./ --outDir=out",
    "rollup": "main.js viewer/worker.js --dir out --silent",
}


@pytest.fixture(scope="module")
def ball(default_runtime, tmp_path_factory):
    """A file with a VDI."""
    volume = soft_ball()
    vdi = pvdi.generate(volume, filling_camera(volume.bounds, SIZE), SIZE, cmap="viridis")
    path = tmp_path_factory.mktemp("ball") / "ball.vdi"
    return vdi.save(path, precision="8-byte", compression="deflate")


@pytest.fixture
def folder(ball, tmp_path):
    """A folder with a VDI and the viewer's modules."""
    shutil.copy(ball, tmp_path)
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
    page = chromium.new_page()
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


def assert_a_worker_starts(chromium, url):
    workers, warnings = workers_and_warnings(chromium, url)
    assert workers
    assert not warnings


POLICIES = ["default-src 'self'", "", "worker-src 'self'"]


@pytest.mark.every(9)
@pytest.mark.parametrize("policy", POLICIES)
def test_modules_of_the_pages_own_origin_start_it(policy, folder, serve, chromium):
    (folder / "index.html").write_text(PAGE.format(script="viewer/element.js"))
    url = serve(folder, [("Content-Security-Policy", policy)] if policy else [])
    assert_a_worker_starts(chromium, url)


def test_modules_of_another_origin_start_it(folder, serve, chromium):
    elsewhere = serve(folder, [("Access-Control-Allow-Origin", "*")])
    (folder / "index.html").write_text(PAGE.format(script=f"{elsewhere}viewer/element.js"))
    assert_a_worker_starts(chromium, serve(folder))


@pytest.mark.every(9)
@pytest.mark.parametrize("policy", ["worker-src 'none'", "script-src 'self'; worker-src x.test"])
def test_where_no_worker_may_be_started_that_is_said_once(policy, folder, serve, chromium):
    (folder / "index.html").write_text(PAGE.format(script="viewer/element.js"))
    url = serve(folder, [("Content-Security-Policy", policy)])
    workers, (warning,) = workers_and_warnings(chromium, url)
    assert not workers
    assert "decodes on the page's own thread" in warning
    assert "worker-src" in warning


@pytest.mark.parametrize("bundler", BUNDLERS)
def test_bundlers_take_it_with_them(bundler, folder, serve, chromium):
    command = shutil.which(bundler)
    if command is None:
        pytest.skip(f"needs {bundler} in the path: npm install --global {bundler}")
    (folder / "main.js").write_text('import "./viewer/element.js";\n')
    (folder / "index.html").write_text(PAGE.format(script="./main.js"))
    subprocess.run([command, *BUNDLERS[bundler].split()], cwd=folder, check=True, timeout=LONG)
    out = folder / "out"
    shutil.copy(folder / "ball.vdi", out)
    if bundler != "vite":
        shutil.copy(folder / "index.html", out)
    assert_a_worker_starts(chromium, serve(out))


def test_a_bundle_without_it_says_so(folder, serve, chromium):
    """What esbuild makes where the worker is not named as well: its file is not there."""
    command = shutil.which("esbuild")
    if command is None:
        pytest.skip("needs esbuild in the path: npm install --global esbuild")
    bundle = ["viewer/element.js", "--bundle", "--format=esm", "--outfile=out/main.js"]
    subprocess.run([command, *bundle], cwd=folder, check=True, timeout=LONG)
    shutil.copy(folder / "ball.vdi", folder / "out")
    (folder / "out" / "index.html").write_text(PAGE.format(script="./main.js"))
    workers, (warning,) = workers_and_warnings(chromium, serve(folder / "out"))
    assert not workers
    assert "worker.js" in warning
