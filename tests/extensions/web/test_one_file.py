"""One file with viewer and VDI: from disk, offline, in a real browser."""

import base64
import io
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from browsers import LONG
from PIL import Image, JpegImagePlugin

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.page import page as page_of

SIZE = (160, 90)
VIEWPORT = {"width": 320, "height": 180}


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
def open_file(open_page, tmp_path):
    """Write a page and open it."""

    def open_file(content, name="a.html", **how):
        (tmp_path / name).write_bytes(content)
        return open_page(url=(tmp_path / name).as_uri(), viewport=VIEWPORT, **how)

    return open_file


def assert_as_rendered(page, vdi, *cameras):
    for camera in cameras:
        got = page.screenshot(camera, SIZE).astype(int)
        off = np.abs(got - np.rint(pvdi.render(vdi, camera, SIZE) * 255)).max(axis=2)
        # The bound; where a ray runs along a border, one list or the other is met
        assert (off <= 2).mean() >= 0.999
        assert off.max() <= 24


def test_the_picture_is_python_s(vdi, open_file, tmp_path):
    name = "a page & <more>.html"
    page = open_file(vdi.save(tmp_path / name).read_bytes(), name)
    page.ready()
    assert page.page.title() == "a page & <more>"
    turned = vdi.camera.azimuth(25), vdi.camera.azimuth(180)
    assert_as_rendered(page, pvdi.read(tmp_path / name), vdi.camera, *turned)
    assert page.evaluate("[viewer.clientWidth, viewer.clientHeight]") == [320, 180]
    status = page.evaluate("viewer.status")
    assert (status["state"], status["supersegments"]) == ("full", vdi.n_supersegments)


@pytest.mark.slow
def test_where_workers_are_forbidden_the_page_decodes(vdi, open_file):
    content = page_of(vdi)
    assert content.count(b" data: blob:") == 1
    content = content.replace(b" data: blob:", b" data:")
    page = open_file(content, expected="Content Security Policy")
    page.ready()
    assert_as_rendered(page, vdi.with_precision("8-byte"), vdi.camera)


def test_the_coarse_level_is_drawn_while_the_page_is_still_read(vdi, chromium):
    """The page comes from a server that stops within the rest until the first picture is there."""
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

    with ThreadingHTTPServer(("127.0.0.1", 0), Slow) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        context = chromium.new_context(viewport=VIEWPORT)
        try:
            page = context.new_page()
            page.set_default_timeout(LONG)
            page.goto(f"http://127.0.0.1:{server.server_port}/", wait_until="commit")
            viewer = "document.querySelector('vdi-viewer')"
            page.wait_for_function(f"{viewer}?.status?.level === 'coarse'")
            assert page.evaluate("document.readyState") == "loading"
            goes_on.set()
            assert page.evaluate(f"{viewer}.ready.then((it) => it.status.level)") == "full"
        finally:
            goes_on.set()
            context.close()
            server.shutdown()
            thread.join()


def test_without_scripts_there_is_the_still_picture_within_the_page(vdi, open_file):
    page = open_file(page_of(vdi), java_script_enabled=False).page
    image = page.locator("vdi-viewer > img")
    assert image.is_visible()
    assert (image.bounding_box()["width"], image.bounding_box()["height"]) == SIZE
    assert "Scripts are turned off" in page.locator("noscript").inner_text()
    for viewport in ({"width": 60, "height": 200}, {"width": 300, "height": 50}):
        page.set_viewport_size(viewport)
        box = image.bounding_box()
        assert box["x"] + box["width"] <= viewport["width"]
        assert box["y"] + box["height"] <= viewport["height"]
        assert box["width"] / box["height"] == pytest.approx(SIZE[0] / SIZE[1], abs=0.02)


def test_the_still_picture_is_python_s(vdi):
    text = re.search(rb'src="data:image/jpeg;base64,([^"]+)"', page_of(vdi))[1]
    still, same = Image.open(io.BytesIO(base64.b64decode(text))), io.BytesIO()
    expected = np.rint(pvdi.render(vdi, vdi.camera)[..., :3] * 255).astype(np.uint8)  # over black
    coded = {"qtables": still.quantization, "subsampling": JpegImagePlugin.get_sampling(still)}
    Image.fromarray(expected).save(same, "jpeg", **coded)
    off = np.abs(np.asarray(still, float) - np.asarray(Image.open(same), float))
    # 0 is seen; a value that is rounded the other way may change a block of JPEG
    assert off.mean() < 0.01


def test_damaged_data_are_a_sentence(vdi, open_file, tmp_path):
    content = bytearray(page_of(vdi))
    at = content.rindex(b"<script") + 4000
    content[at] = ord("A") if content[at] != ord("A") else ord("B")
    page = open_file(content, expected="damaged")
    page.wait_for("viewer.status.state === 'error'")
    assert "damaged" in page.evaluate("viewer.status.message")
    with pytest.raises(pvdi.errors.VDIFileError, match="damaged"):
        pvdi.read(tmp_path / "a.html")


def test_a_background_that_is_no_colour_is_refused(vdi, tmp_path):
    with pytest.raises(InvalidArgumentError, match=r"three numbers from 0 to 1; got 'black'"):
        vdi.save(tmp_path / "a.html", background="black")
    assert not list(tmp_path.iterdir())


def test_the_page_is_small_and_text(vdi):
    """The viewer's budget is 150 kB; what else is not data, the still picture, is eight at most."""
    assert len(viewer_script()) < 150_000
    content = page_of(vdi)
    parts = content.split(b'application/vdi+base64">')[1:]
    data = sum(part.index(b"<") for part in parts)
    assert len(content) - data < 158_000
    content.decode()
