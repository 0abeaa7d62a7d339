"""The component for trame apps: VDIs from Python, the camera both ways, in a real browser."""

from __future__ import annotations

import base64
import subprocess
import sys

import numpy as np
import pytest
from browsers import LONG
from web_client import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

trame_app = pytest.importorskip("trame.app")
layouts = pytest.importorskip("trame.ui.html")
VDIView = pytest.importorskip("pyvista_vdi.web.trame").VDIView

BALL = soft_ball()
SIZE = (240, 180)
CAMERA = filling_camera(BALL.bounds, SIZE)
LOOK = {"clim": (0, 255), "opacity": "linear"}


def _view(name, vdi, **options):
    app = trame_app.get_server(name)
    with layouts.DivLayout(app):
        view = VDIView(vdi, style="width: 240px; height: 180px", **options)
    return app, view


def test_the_component_s_state(default_runtime):
    vdi = pvdi.generate(BALL, CAMERA, (40, 30), cmap="bone", **LOOK)
    app, view = _view("state", vdi, background="white", camera=CAMERA)
    assert "<vdi-view " in view.html
    assert 'background="white"' in view.html
    assert view.camera == CAMERA
    file, eye = (app.state[f"{view._file_key[:-5]}_{name}"] for name in ("file", "camera"))
    assert file[:2] == b"PK"
    assert eye["view_angle"] == CAMERA.view_angle
    view.update(vdi)
    view._turned({"camera": {**eye, "view_angle": 5}, "size": [30, 20]})
    assert view.camera.view_angle == 5
    assert view.size == (30, 20)


#: An app that shows another VDI from another side when somebody has turned the first.
APP = """
import sys
import pyvista_vdi as pvdi
from pyvista_vdi.web.trame import VDIView
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
def test_in_a_browser(chromium, default_runtime, tmp_path):
    vdis = [pvdi.generate(BALL, CAMERA, SIZE, cmap=c, **LOOK) for c in ("bone", "hot")]
    files = [str(vdi.save(tmp_path / f"{k}.vdi")) for k, vdi in enumerate(vdis)]
    command = [sys.executable, "-c", APP, *files]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as app:
        try:
            port = next(line.split()[1] for line in app.stdout if line.startswith("port"))
            page = chromium.new_page(viewport={"width": 320, "height": 280})
            page.set_default_timeout(LONG)
            page.goto(f"http://127.0.0.1:{port}/")
            page.wait_for_selector("vdi-viewer")
            page.evaluate("window.viewer = document.querySelector('vdi-viewer')")
            page.evaluate("viewer.ready.then(() => 1)")
            assert _ssim(page, vdis[0], CAMERA) > 0.99

            page.evaluate("viewer.camera = { ...viewer.camera, view_angle: 11 }")
            page.wait_for_function("viewer.camera.position[0] > 1")
            while _ssim(page, vdis[1], CAMERA.azimuth(30)) < 0.99:
                page.wait_for_timeout(50)
            page.close()
        finally:
            app.kill()


def _ssim(page, vdi, camera):
    text = page.evaluate(
        """async ([width, height]) => {
          const shot = await viewer.screenshot({ width, height });
          let text = "";
          for (const value of shot.data) text += String.fromCharCode(value);
          return btoa(text);
        }""",
        SIZE,
    )
    picture = np.frombuffer(base64.b64decode(text), np.uint8).reshape(SIZE[1], SIZE[0], 4)
    shown = picture.astype(np.float32) / 255
    return pvdi.compare_images(shown, pvdi.render(vdi, camera, SIZE)).ssim
