"""The component for trame apps: VDIs from Python, the camera both ways, in a real browser."""

import re
import subprocess
import sys

import numpy as np
import pytest
from browsers import picture
from plugin_scenes import soft_volume

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

trame_app = pytest.importorskip("trame.app")
layouts = pytest.importorskip("trame.ui.html")
VDIView = pytest.importorskip("pyvista_vdi.extensions.web.trame").VDIView

BALL = soft_volume()
SIZE = (240, 180)
CAMERA = filling_camera(BALL.bounds, SIZE)
LOOK = {"clim": (0, 255), "opacity": "linear"}


def test_the_component_s_state(default_runtime):
    vdi = pvdi.generate(BALL, CAMERA, (40, 30), cmap="bone", **LOOK)
    app = trame_app.get_server("state")
    with layouts.DivLayout(app):
        view = VDIView(vdi, background="white", camera=CAMERA)
    assert "<vdi-view " in view.html
    assert 'background="white"' in view.html
    assert view.camera == CAMERA
    names = dict(re.findall(r':(file|eye)="(\w+)"', view.html))
    assert app.state[names["file"]][:2] == b"PK"
    eye = app.state[names["eye"]]
    assert eye["view_angle"] == CAMERA.view_angle
    view.update(vdi)
    turned = re.search(r"""@turned="trigger\('([^']+)'""", view.html)[1]
    app.controller.trigger_fn(turned)({"camera": {**eye, "view_angle": 5}, "size": [30, 20]})
    assert view.camera.view_angle == 5
    assert view.size == (30, 20)


#: An app that shows another VDI from another side when somebody has turned the first.
APP = """
import sys
import pyvista_vdi as pvdi
from pyvista_vdi.extensions.web.trame import VDIView
from trame.app import get_server
from trame.ui.html import DivLayout

first, second = map(pvdi.read, sys.argv[1:])

def answer(view):
    if view.camera.view_angle == 11 and view.size == (240, 180):
        view.update(second)
        view.camera = first.camera.azimuth(30)

app = get_server()
with DivLayout(app):
    VDIView(first, style="width: 240px; height: 180px", on_camera=answer)
app.controller.on_server_ready.add(lambda **_: print("port", app.port, flush=True))
sys.argv[1:] = []
app.start(port=0, host="127.0.0.1", open_browser=False, show_connection_info=False)
"""


@pytest.mark.slow
def test_in_a_browser(open_page, default_runtime, tmp_path):
    vdis = [pvdi.generate(BALL, CAMERA, SIZE, cmap=c, **LOOK) for c in ("bone", "hot")]
    files = [str(vdi.save(tmp_path / f"{k}.vdi")) for k, vdi in enumerate(vdis)]
    command = [sys.executable, "-c", APP, *files]

    def ssim(vdi, camera):
        shown = picture(page, SIZE).astype(np.float32) / 255
        return pvdi.compare_images(shown, pvdi.render(vdi, camera, SIZE)).ssim

    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as app:
        try:
            port = next(line.split()[1] for line in app.stdout if line.startswith("port"))
            viewport = {"width": 320, "height": 280}
            page = open_page(url=f"http://127.0.0.1:{port}/", viewport=viewport, expected=".")
            page.page.wait_for_selector("vdi-viewer")
            page.evaluate("window.viewer = document.querySelector('vdi-viewer')")
            page.ready()
            assert ssim(vdis[0], CAMERA) > 0.99

            page.evaluate("viewer.camera = { ...viewer.camera, view_angle: 11 }")
            page.wait_for("viewer.camera.position[0] > 1")
            while ssim(vdis[1], CAMERA.azimuth(30)) < 0.99:
                page.page.wait_for_timeout(50)
            page.page.close()
        finally:
            app.kill()
