"""The page of a server in a real browser: it draws what it has, and is sent what its view needs."""

import re
import urllib.request

import numpy as np
import pytest
from browsers import picture
from plugin_scenes import soft_volume

import pyvista_vdi as pvdi
from pyvista_vdi.extensions import web
from pyvista_vdi.extensions.web.shown import camera_of


def checkered(ball):
    """A ball whose every other voxel is thin: seen from near, it needs more lists."""
    values = ball.array.copy()
    values[np.indices(values.shape).sum(axis=0) % 2 == 1] //= 8
    return pvdi.Volume(values, ball.spacing, ball.origin)


BALL = checkered(soft_volume(16))
LOOK = {"clim": (0, 255), "opacity": "linear", "cmap": "bone"}
SIZE = (240, 180)
#: The viewer is not as high as the pictures that are compared, so that pixels and lists do not
#: coincide: .94 to .97 where a full VDI is shown, below .9 by that of the view before.
ENOUGH = 0.92


@pytest.fixture(scope="module")
def server(default_runtime):
    with web.serve([BALL, BALL], port=0, wait=False, **LOOK) as serving:
        yield serving


@pytest.fixture
def page(server, open_page):
    viewport = {"width": SIZE[0], "height": SIZE[1] + 20}
    return open_page(url=server.url, viewport=viewport)


def ssim_of(page):
    shown = picture(page, SIZE).astype(np.float32) / 255
    camera = camera_of(page.evaluate("viewer.camera"))
    truth = pvdi.render_volume(BALL, camera, SIZE, **LOOK)
    return pvdi.compare_images(shown, truth).ssim


def wait(page, condition):
    # Playwright's own wait evaluates text in the page, which its policy forbids
    while not page.evaluate(condition):
        page.page.wait_for_timeout(20)


def test_the_page_is_the_viewer_and_leaks_nothing(server):
    with urllib.request.urlopen(server.url) as response:
        text, headers = response.read().decode(), response.headers
    assert "<vdi-viewer" in text
    assert server.token not in text
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]+)"', text)[1]
    nonce = re.search(r"script-src 'nonce-([\w-]+)' blob:;", policy)[1]
    assert policy.startswith("default-src 'none';")
    assert re.findall(r"<script[^>]*>", text) == [f'<script type="module" nonce="{nonce}">']


def test_a_page_is_sent_what_its_view_needs(page):
    wait(page, "remote.received === 1")
    page.evaluate("viewer.camera = { ...viewer.camera, view_angle: 4 }")
    wait(page, "remote.received === 2")
    assert ssim_of(page) > ENOUGH
    page.page.get_by_label("Time step").fill("1")
    wait(page, "remote.received === 3")


def test_a_page_says_that_its_server_is_gone_comes_back_and_ends_with_its_token(
    default_runtime, open_page
):
    def serve(token, port=0):
        return web.serve([BALL], port=port, token=token, wait=False, **LOOK)

    line = "document.querySelector('#status').textContent"
    serving = serve("a")
    viewport = {"width": SIZE[0], "height": SIZE[1] + 20}
    refusals = "ERR_CONNECTION|WebSocket|403"
    page = open_page(url=serving.url, viewport=viewport, expected=refusals)
    wait(page, "remote.received === 1")
    serving.close()
    wait(page, f"{line}.includes('no connection to the server; trying again in')")
    serving = serve("a", serving.port)
    wait(page, f"remote.received === 2 && !{line}.includes('trying')")
    serving.close()
    with serve("b", serving.port):
        wait(page, f"{line}.includes('no longer valid')")
        assert "trying" not in page.evaluate(line)
