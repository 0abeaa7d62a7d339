"""VDIs in a real JupyterLab in a real browser: turned there, read in the kernel, and saved."""

import base64
import importlib.util
import io
import json
import os
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from browsers import HELPERS, array_of
from PIL import Image
from plugin_scenes import soft_volume

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.web.shown import camera_of, viewer_camera

MISSING = [
    name
    for name in ("jupyterlab", "ipykernel", "anywidget", "pyvista")
    if importlib.util.find_spec(name) is None
]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.gl,
    pytest.mark.skipif(
        bool(MISSING),
        reason=f"needs {', '.join(MISSING)}: pip install 'pyvista-vdi[browser,notebook,plot]'",
    ),
]

#: Seconds after which something that should have happened has not.
LONG = 300
SIZE = (192, 108)

CELLS = (
    """
import json
import numpy as np
import pyvista as pv
import pyvista_vdi as pvdi
from pyvista_vdi.extensions.web.shown import viewer_camera
from pyvista_vdi.extensions.web import VDIWidget
vdi = pvdi.read("ball.vdi")
widget = VDIWidget(vdi, background="white")
widget
""",
    "print(json.dumps(widget.camera))",
    "widget.camera = vdi.camera.azimuth(60)",
    "vdi",
    """
volume = pv.Wavelet(extent=(-12, 12) * 3)
plotter = pv.Plotter(window_size=(192, 108))
actor = plotter.add_vdi(volume, cmap="viridis", show_scalar_bar=False, regenerate_below=1.0)
plotter.show(jupyter_backend="vdi")
""",
    "print(json.dumps(viewer_camera(plotter.camera)))",
    "plotter.view_xz()",
    "print(json.dumps(viewer_camera(actor.vdi.camera)))",
)
TURNED, SHOWN, PLOTTED = 0, 3, 4  # cells with viewers
READ, READ_PLOTTER, READ_VDI = 1, 5, 7  # that print a camera
SET, SET_PLOTTER = 2, 6  # that set one


@pytest.fixture(scope="module")
def vdi():
    camera = pvdi.Camera((3, 2, 5), (0, 0, 0), (0, 1, 0))
    return pvdi.generate(soft_volume(), camera, SIZE, cmap="viridis", opacity=[0, 0.1, 0.4, 0.9])


@pytest.fixture
def lab(vdi, tmp_path, monkeypatch):
    """Start a JupyterLab in a folder with a notebook; give the folder and the notebook's URL."""
    folder = tmp_path / "books"
    folder.mkdir()
    vdi.save(folder / "ball.vdi")
    cell = {"cell_type": "code", "metadata": {}, "outputs": [], "execution_count": None}
    cells = [{**cell, "id": f"cell{k}", "source": text.strip()} for k, text in enumerate(CELLS)]
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    book = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    (folder / "book.ipynb").write_text(json.dumps(book))
    settings = tmp_path / "settings"
    settings.mkdir()
    overrides = {
        "@jupyterlab/apputils-extension:notification": {"fetchNews": "false"},
        "@jupyter-widgets/jupyterlab-manager:plugin": {"saveState": True},
    }
    (settings / "overrides.json").write_text(json.dumps(overrides))
    own = {f"JUPYTER_{kind}_DIR": str(tmp_path / kind) for kind in ("CONFIG", "DATA", "RUNTIME")}
    environment = {**os.environ, **own, "IPYTHONDIR": str(tmp_path / "ipython")}
    options = {
        "ServerApp.root_dir": folder,
        "ServerApp.ip": "127.0.0.1",
        "ServerApp.port": 0,
        "IdentityProvider.token": "known",
        "LabApp.app_settings_dir": settings,
        "LabApp.expose_app_in_browser": True,
        "LabApp.news_url": "",
        "LabApp.check_for_updates_class": "jupyterlab.NeverCheckForUpdate",
    }
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root"]
    command += [f"--{name}={value}" for name, value in options.items()]
    with (tmp_path / "log").open("w") as log:
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        yield folder, f"{address_of(process, tmp_path)}doc/tree/book.ipynb?token=known"
    finally:
        process.terminate()
        process.wait(LONG)


def address_of(process, folder):
    """Return a server's URL as soon as it answers: it writes it to a file of its own."""
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        assert process.poll() is None, (folder / "log").read_text()
        for file in (folder / "RUNTIME").glob(f"jpserver-{process.pid}.json"):
            try:
                url = json.loads(file.read_text())["url"]
                with urllib.request.urlopen(f"{url}api?token=known", timeout=LONG):
                    return url
            except (ValueError, urllib.error.URLError):
                pass
        time.sleep(0.2)
    raise AssertionError((folder / "log").read_text())


class Notebook:
    """A notebook in a browser's page."""

    def __init__(self, page, url):
        self.page = page
        self.hosts, self.complaints = set(), []
        page.set_default_timeout(LONG * 1000)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self.hear)
        page.on("request", lambda request: self.hosts.add(request.url.partition("?")[0]))
        page.goto(url)
        page.wait_for_selector("text=/Python 3.*Idle/")

    def hear(self, message):
        if message.type == "error" or "GL_INVALID" in message.text:
            self.complaints.append(f"{message.text} ({message.location['url']})")

    def run(self, k):
        """Run a cell; return what it printed."""
        self.page.evaluate(
            """async (k) => {
              jupyterapp.shell.currentWidget.content.activeCellIndex = k;
              await jupyterapp.commands.execute("notebook:run-cell");
            }""",
            k,
        )
        return "".join(self.cell(k).locator(".jp-OutputArea-output pre").all_inner_texts())

    def cell(self, k):
        return self.page.locator(".jp-Notebook .jp-CodeCell").nth(k)

    def viewer(self, k):
        """Return a cell's viewer once all of its VDI is drawn."""
        viewer = self.cell(k).locator("vdi-viewer")
        viewer.scroll_into_view_if_needed()
        viewer.evaluate("(viewer) => viewer.ready.then(() => null)")
        return viewer

    def camera(self, k):
        return self.viewer(k).evaluate("(viewer) => viewer.camera")

    def drag(self, k):
        """Turn a viewer by hand, and wait until it has turned."""
        before, box = self.camera(k), self.viewer(k).bounding_box()
        x, y = box["x"] + box["width"] / 3, box["y"] + box["height"] / 2
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + 40, y + 12, steps=3)
        self.page.mouse.up()
        until(lambda: self.camera(k) != before)

    def picture(self, k):
        """Return what a viewer shows, premultiplied RGBA from 0 to 1."""
        text = self.viewer(k).evaluate(
            """async (viewer, [width, height]) =>
              textOf((await viewer.screenshot({ width, height })).data)""",
            SIZE,
        )
        return array_of(text, np.uint8).reshape(*SIZE[::-1], 4) / 255


def until(condition):
    end = time.monotonic() + LONG
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.1)


def assert_alike(picture, expected):
    """Hold the viewer's picture to the bound of issue 17."""
    assert np.mean(np.abs(picture - expected).max(axis=2) <= 2 / 255) >= 0.999


def test_in_jupyterlab(chromium, lab, vdi):
    context = chromium.new_context(viewport={"width": 900, "height": 1400})
    context.add_init_script(HELPERS)
    notebook = Notebook(context.new_page(), lab[1])
    notebook.run(TURNED)
    assert notebook.camera(TURNED) == viewer_camera(vdi.camera)
    sent = vdi.with_precision("8-byte")
    assert_alike(notebook.picture(TURNED), pvdi.render(sent, vdi.camera))

    # Turned by hand, read in the kernel, which may be told while a cell runs, or before
    notebook.drag(TURNED)
    turned = notebook.camera(TURNED)
    until(lambda: json.loads(notebook.run(READ)) == turned)
    assert_alike(notebook.picture(TURNED), pvdi.render(sent, camera_of(turned)))

    # Set in the kernel, seen in the browser
    notebook.run(SET)
    until(lambda: notebook.camera(TURNED) == viewer_camera(vdi.camera.azimuth(60)))

    notebook.run(SHOWN)
    assert_alike(notebook.picture(SHOWN), pvdi.render(sent, vdi.camera))

    # A plotter's
    notebook.run(PLOTTED)
    first = json.loads(notebook.run(READ_PLOTTER))
    assert notebook.camera(PLOTTED) == first
    assert notebook.picture(PLOTTED)[..., 3].max() > 0.5
    notebook.drag(PLOTTED)
    turned = notebook.camera(PLOTTED)
    until(lambda: json.loads(notebook.run(READ_PLOTTER)) == turned)

    # The view rests there: the kernel makes a VDI of it, and the browser is given that
    def has_a_vdi_of_it():
        made = json.loads(notebook.run(READ_VDI))
        return np.allclose(made["position"], turned["position"], rtol=1e-9)

    until(has_a_vdi_of_it)
    assert notebook.camera(PLOTTED) == turned
    notebook.run(SET_PLOTTER)
    until(lambda: notebook.camera(PLOTTED) == json.loads(notebook.run(READ_PLOTTER)) != turned)

    # Saved: the pictures are there for who does not run it
    notebook.page.evaluate("jupyterapp.commands.execute('docmanager:save')")
    path = lab[0] / "book.ipynb"
    until(lambda: len(pictures_in(path)) == 3)
    pictures = pictures_in(path)
    expected = pvdi.io.to_bytes(pvdi.render(vdi, vdi.camera))
    np.testing.assert_array_equal(pictures[SHOWN], expected)
    assert pictures[TURNED].shape == pictures[PLOTTED].shape == (*SIZE[::-1], 3)

    # The viewer as well, where the state of widgets is saved: another kernel knows nothing of it
    notebook.page.evaluate("jupyterapp.shell.currentWidget.sessionContext.shutdown()")
    notebook.page.close()
    again = Notebook(context.new_page(), lab[1])
    assert again.camera(TURNED) == viewer_camera(vdi.camera.azimuth(60))
    assert_alike(again.picture(TURNED), pvdi.render(sent, vdi.camera.azimuth(60)))
    again.drag(SHOWN)

    # Nobody complained, but JupyterLab of servers for languages that there are not
    complaints = notebook.complaints + again.complaints
    assert not [each for each in complaints if "/lsp/status" not in each]

    # Nothing came from elsewhere
    server = lab[1].partition("/doc")[0]
    foreign = [url for url in notebook.hosts if not url.startswith((server, "blob:", "data:"))]
    assert not foreign
    context.close()


ARROWS = ("ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown")
TAKEN = (*ARROWS, *(f"Shift+{key}" for key in ARROWS), "+", "=", "-", "r", "ArrowLeft", "Shift+R")


def test_keys_in_jupyterlab(chromium, lab):
    """In JupyterLab R makes a cell raw, and its output is gone; A and B insert cells, and so on."""
    context = chromium.new_context(viewport={"width": 900, "height": 1400})
    notebook = Notebook(context.new_page(), lab[1])
    page = notebook.page

    def state():
        """Return the cells' types, which is active and selected, how often it ran, and the mode."""
        return page.evaluate(
            """() => {
              const { content } = jupyterapp.shell.currentWidget;
              return { types: content.widgets.map(({ model }) => model.type), mode: content.mode,
                active: content.activeCellIndex, ran: content.activeCell.model.executionCount,
                selected: content.selectedCells.length };
            }"""
        )

    # What the viewer takes it takes alone
    notebook.run(TURNED)
    for key in TAKEN:
        notebook.viewer(TURNED).click()
        before, camera = state(), notebook.camera(TURNED)
        page.keyboard.press(key)
        assert state() == before, key
        until(lambda camera=camera: notebook.camera(TURNED) != camera)
    assert before["active"] == TURNED
    assert before["mode"] == "command"
    assert before["types"] == ["code"] * len(CELLS)

    # What it does not take does what it does without it, and nothing to the view
    def press(key, **changes):
        notebook.viewer(TURNED + added).click()
        before, camera = state(), notebook.camera(TURNED + added)
        page.keyboard.press(key)
        until(lambda: state() == {**before, **changes})
        return camera

    added = 0
    camera = press("j", active=TURNED + 1, ran=None)
    press("Escape")
    types = ["code"] * (len(CELLS) + 1)
    press("b", types=types, active=TURNED + 1, ran=None)
    assert page.evaluate("jupyterapp.shell.currentWidget.context.model.dirty")
    notebook.viewer(TURNED).click()
    page.keyboard.press("Control+s")
    until(lambda: not page.evaluate("jupyterapp.shell.currentWidget.context.model.dirty"))
    assert notebook.camera(TURNED) == camera
    press("a", types=[*types, "code"], active=TURNED, ran=None)
    added = 1
    press("Shift+Enter", active=TURNED + 2, ran=None)
    notebook.run(READ + added)  # the kernel has run the other as well
    press("m", types=["code", "markdown", *types[1:]], ran=None)
    context.close()


def pictures_in(path):
    """Return the pictures that a notebook's file holds, by cell."""
    found = {}
    for k, cell in enumerate(json.loads(path.read_text())["cells"]):
        for output in cell["outputs"]:
            if "image/png" in output.get("data", {}):
                png = base64.b64decode(output["data"]["image/png"])
                found[k] = np.asarray(Image.open(io.BytesIO(png)))
    return found


def test_nbconvert_s_page_of_an_executed_notebook_shows_the_picture_offline(
    chromium, vdi, tmp_path
):
    pytest.importorskip("nbconvert")
    vdi.save(tmp_path / "ball.vdi")
    nbformat = pytest.importorskip("nbformat")
    code = 'import pyvista_vdi as pvdi\npvdi.read("ball.vdi")'
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    nbformat.write(book, tmp_path / "book.ipynb")
    command = ["nbconvert", "--execute", "--to", "html", "book.ipynb"]
    subprocess.run([sys.executable, "-m", *command], cwd=tmp_path, check=True, timeout=LONG)
    context = chromium.new_context(offline=True)
    page = context.new_page()
    page.goto((tmp_path / "book.html").as_uri(), wait_until="domcontentloaded")
    [seen] = [image for image in page.locator("img").all() if image.is_visible()]
    assert seen.evaluate("(it) => it.decode().then(() => it.naturalWidth)") == SIZE[0]
    context.close()
