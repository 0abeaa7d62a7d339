"""One file with viewer and VDI: from disk, offline, in a real browser."""

from __future__ import annotations

import json

import numpy as np
import pytest
from browsers import LONG, Page

import pyvista_vdi as pvdi
from pyvista_vdi.web.page import page as page_of

SIZE = (160, 90)


@pytest.fixture(scope="module")
def vdi():
    """A smooth body of 48 x 40 x 32 voxels."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in (32, 40, 48)), indexing="ij")
    volume = pvdi.Volume((np.cos(5 * x * y) * np.exp(-2 * (x * x + y * y + z * z))).astype("f4"))
    ramp = np.linspace(0, 1, 64)
    looks = pvdi.TransferFunction(np.stack([ramp, ramp**2, 1 - ramp], 1), 0.2 * ramp, (-0.2, 0.9))
    camera = pvdi.Camera((24, -90, 50), (24, 20, 16), (0, 0, 1))
    return pvdi.generate(volume, camera, SIZE, transfer_function=looks)


@pytest.fixture
def from_disk(chromium):
    """Open a file, and hold that nothing but it is asked for."""
    opened = []

    def from_disk(path, expected=None, **options):
        context = chromium.new_context(viewport={"width": 320, "height": 180}, **options)
        page = Page(context.new_page(), {}, expected)
        asked = []
        page.page.on("request", lambda request: asked.append(request.url))
        opened.append((context, page, path, asked))
        page.page.goto(path.as_uri())
        if options.get("java_script_enabled", True):
            page.page.evaluate(
                """() => {
                  window.viewer = document.querySelector("vdi-viewer");
                  window.textOf = (bytes) => btoa(String.fromCharCode(...bytes));
                }"""
            )
        return page

    yield from_disk
    for context, page, path, asked in opened:
        context.close()
        assert not page.complaints
        foreign = [url for url in asked if not url.startswith((path.as_uri(), "blob:", "data:"))]
        assert not foreign


def pictures_agree(page, vdi, cameras):
    for camera in cameras:
        got = page.screenshot(camera, SIZE).astype(int)
        want = np.rint(pvdi.render(vdi, camera, SIZE) * 255)
        off = np.abs(got - want).max(axis=2)
        # The bound; where a ray runs along a border, one list or the other is met
        assert (off <= 2).mean() >= 0.999
        assert off.max() <= 24


def test_the_picture_is_python_s(vdi, from_disk, tmp_path):
    path = vdi.save(tmp_path / "a page & <more>.html")
    page = from_disk(path)
    page.evaluate("viewer.ready.then(() => true)")
    assert page.page.title() == "a page & <more>"
    packed = pvdi.read(path)
    pictures_agree(page, packed, [vdi.camera, vdi.camera.azimuth(25), vdi.camera.azimuth(180)])
    assert page.evaluate("[viewer.clientWidth, viewer.clientHeight]") == [320, 180]
    status = page.evaluate("viewer.status")
    assert (status["state"], status["supersegments"]) == ("full", vdi.n_supersegments)


@pytest.mark.slow
def test_where_workers_are_forbidden_the_page_decodes(vdi, from_disk, tmp_path):
    path = tmp_path / "a.html"
    content = page_of(vdi)
    assert content.count(b" data: blob:") == 1
    path.write_bytes(content.replace(b" data: blob:", b" data:"))
    page = from_disk(path, "Content Security Policy")
    page.evaluate("viewer.ready.then(() => true)")
    pictures_agree(page, vdi.with_precision("8-byte"), [vdi.camera])


def test_the_coarse_level_is_drawn_while_the_page_is_still_read(vdi, chromium, tmp_path):
    """The page comes from a server that stops within the rest until the first picture is there."""
    import threading
    from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

    content, goes_on = page_of(vdi), threading.Event()
    cut = content.rindex(b"<script") + 1000

    class Slow(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(content[:cut])
            goes_on.wait(LONG / 1000)
            self.wfile.write(content[cut:])

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Slow)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    context = chromium.new_context(viewport={"width": 160, "height": 90})
    try:
        page = context.new_page()
        page.set_default_timeout(LONG)
        page.goto(f"http://127.0.0.1:{server.server_port}/", wait_until="commit")
        page.wait_for_function("document.querySelector('vdi-viewer')?.status?.level === 'coarse'")
        assert page.evaluate("document.readyState") == "loading"
        goes_on.set()
        level = "document.querySelector('vdi-viewer').ready.then((viewer) => viewer.status.level)"
        assert page.evaluate(level) == "full"
    finally:
        goes_on.set()
        context.close()
        server.shutdown()
        thread.join()
        server.server_close()


def test_without_scripts_there_is_the_still_picture(vdi, from_disk, tmp_path):
    page = from_disk(vdi.save(tmp_path / "a.html"), java_script_enabled=False)
    image = page.page.locator("vdi-viewer > img")
    assert image.is_visible()
    assert (image.bounding_box()["width"], image.bounding_box()["height"]) == SIZE
    assert "Scripts are turned off" in page.page.locator("noscript").inner_text()


def test_without_webgl_2_there_are_a_sentence_and_the_still_picture(vdi, from_disk, tmp_path):
    path = tmp_path / "a.html"
    hide = b"<script>HTMLCanvasElement.prototype.getContext = () => null;</script></head>"
    path.write_bytes(page_of(vdi).replace(b"</head>", hide))
    page = from_disk(path, "WebGL 2")
    page.wait_for("viewer.status.state === 'error'")
    assert "WebGL 2" in page.evaluate("viewer.status.message")
    still = """(({ hidden, naturalWidth, clientWidth }) => [hidden, naturalWidth, clientWidth])(
        viewer.shadowRoot.querySelector("img"))"""
    assert page.evaluate(still) == [False, SIZE[0], 320]


def test_the_still_picture_is_python_s(vdi):
    from pyvista_vdi.web.page import _from_generating_view

    # Sums of optical depths against products of float32 transmittances
    np.testing.assert_allclose(_from_generating_view(vdi), pvdi.render(vdi, vdi.camera), atol=1e-5)


def test_damaged_data_are_a_sentence(vdi, from_disk, tmp_path):
    content = bytearray(page_of(vdi))
    at = content.rindex(b"<script") + 4000
    content[at] = ord("A") if content[at] != ord("A") else ord("B")
    path = tmp_path / "a.html"
    path.write_bytes(content)
    page = from_disk(path, "damaged")
    page.wait_for("viewer.status.state === 'error'")
    assert "damaged" in page.evaluate("viewer.status.message")
    with pytest.raises(pvdi.errors.VDIFileError, match="damaged"):
        pvdi.read(path)


def test_the_page_is_small(vdi):
    """The viewer's budget is 100 kB; what else is not data, the still picture, is a few."""
    content = page_of(vdi)
    data = sum(len(part) for part in content.split(b'application/vdi+base64">')[1:])
    assert len(content) - data < 100_000
    assert json.dumps(content.decode()).isascii()
