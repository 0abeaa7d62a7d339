"""VDIs in notebooks: the widget, what IPython shows, PyVista's backend, and the view in a page."""

import asyncio
import base64
import importlib.metadata
import io
import json
import subprocess
import sys
import types
import warnings
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from browsers import in_base64, picture
from PIL import Image
from plugin_scenes import soft_volume

import pyvista_vdi as pvdi
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.extensions.web.notebook import mime_bundle, show_plotter
from pyvista_vdi.extensions.web.shown import camera_of, viewer_camera

anywidget = pytest.importorskip("anywidget", reason="needs the extra notebook")

from pyvista_vdi.extensions.web import VDIWidget  # noqa: E402

WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"
SIZE = (96, 64)
BALL = soft_volume()
EYE = ((3, 2, 5), (0, 0, 0), (0, 1, 0))
LOOK = {"cmap": "viridis", "opacity": [0, 0.1, 0.4, 0.9]}


@pytest.fixture(scope="module")
def vdi():
    return pvdi.generate(BALL, pvdi.Camera(*EYE), SIZE, **LOOK)


@pytest.fixture
def widget(vdi):
    widget = VDIWidget(vdi)
    yield widget
    widget.close()


def binaries(widget):
    """The bytes that a browser is sent, by the names of the traits: of the VDI, then of a scene."""
    state = {
        k: bytes(v) for k, v in widget.get_state().items() if isinstance(v, bytes | memoryview)
    }
    return dict(sorted(state.items(), key=lambda item: item[1][:2] != b"PK"))


def file_of(widget):
    return next(iter(binaries(widget).values()))


def scene_of(widget):
    return list(binaries(widget).values())[1]


def sent(widget, folder):
    """What a browser is sent."""
    path = folder / "sent.vdi"
    path.write_bytes(file_of(widget))
    return pvdi.read(path)


def png(data):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data["image/png"]))))


LENSES = [
    {"view_angle": 40.0},
    {"parallel_projection": True, "parallel_scale": 2.5},
    {"view_angle": 25.0, "window_center": (0.25, -0.5)},
    {"view_angle": 50.0, "use_horizontal_view_angle": True},
]


@pytest.mark.parametrize("lens", LENSES)
def test_a_viewer_s_camera_is_the_same_view(lens):
    camera = pvdi.Camera((3, 2, 5), (0.5, 0, 0), (0, 1, 0), **lens)
    state = viewer_camera(camera, SIZE)
    again = camera_of(state)
    np.testing.assert_allclose(again.view_matrix, camera.view_matrix, rtol=1e-14)
    np.testing.assert_allclose(
        again.viewport_matrix(SIZE), camera.viewport_matrix(SIZE), rtol=1e-14
    )


def test_a_widget_takes_cameras_backgrounds_planes_and_other_vdis(widget, vdi, tmp_path):
    assert sent(widget, tmp_path).equals(vdi.with_precision("8-byte"))
    told = []
    widget.observe(lambda change: told.append(change.new), "camera")
    widget.camera = vdi.camera.azimuth(30)
    assert told == [viewer_camera(vdi.camera.azimuth(30))]
    camera = pv.Camera()
    camera.position, camera.parallel_projection, camera.parallel_scale = (1, 2, 30), True, 4
    widget.camera = camera
    assert (widget.camera["parallel_scale"], widget.camera["position"]) == (4, [1, 2, 30])
    for color, kept in (("white", "#ffffff"), ("#204060", "#204060"), ((1, 0.2, 0), "#ff3300")):
        widget.background = color
        assert widget.background == kept
    other = pvdi.generate(BALL, vdi.camera.azimuth(40), SIZE, cmap="bone")
    widget.vdi = other
    assert widget.vdi is other
    assert sent(widget, tmp_path).equals(other.with_precision("8-byte"))
    assert widget.camera["parallel_scale"] == 4
    same = {**widget.camera, "position": widget.camera["focal_point"]}
    for name, wrong, error in (
        *(("camera", camera, pvdi.InvalidCameraError) for camera in (same, "xy")),
        *(("background", color, ValueError) for color in ("no colour", (1, 2, 3), 7)),
        ("clipping_planes", [[0, 0, 0, 1, 0, 0]] * 25, pvdi.InvalidArgumentError),
        ("vdi", "brain.vdi", pvdi.InvalidVDIError),
    ):
        with pytest.raises(error):
            setattr(widget, name, wrong)


def test_a_vdi_and_a_widget_show_themselves_with_a_small_picture(widget, vdi, monkeypatch):
    data, _ = vdi._repr_mimebundle_()
    assert data["text/plain"] == repr(vdi)
    assert data[WIDGET_VIEW]["model_id"]
    np.testing.assert_array_equal(png(data), pvdi.io.to_bytes(pvdi.render(vdi, vdi.camera)))
    lists = pvdi.VDI(vdi.camera, (1600, 8), np.zeros(12801, int), [], [], [], [], vdi.bounds)
    assert png(lists._repr_mimebundle_()[0]).shape == (4, 800, 4)
    widget.camera, widget.background = vdi.camera.azimuth(90), "white"
    image = pvdi.render(vdi, vdi.camera.azimuth(90))
    over = image[..., :3] + (1 - image[..., 3:])
    # One step for rounding, another for the rounding of sums in float32
    assert np.abs(png(widget._repr_mimebundle_()[0]) / 255 - over).max() <= 1 / 255

    # In a kernel the picture is an output of its own, which nbconvert shows beside a view
    ipython, said = pytest.importorskip("IPython"), []
    publish = types.SimpleNamespace(publish=said.append)
    shell = types.SimpleNamespace(kernel=None, display_pub=publish)
    monkeypatch.setattr(ipython, "get_ipython", lambda: shell)
    data, _ = vdi._repr_mimebundle_()
    assert WIDGET_VIEW in data
    assert "image/png" not in data
    assert said[0]["text/html"].startswith('<img data-vdi="')
    monkeypatch.setattr(ipython, "get_ipython", object)  # a terminal
    assert mime_bundle(vdi) == {}


@pytest.fixture
def without_anywidget(monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    for name in ("widget", "plotter_widget"):
        monkeypatch.delitem(sys.modules, f"pyvista_vdi.extensions.web.{name}", raising=False)


@pytest.fixture(scope="module")
def series(vdi):
    dense = pvdi.generate(BALL, vdi.camera, SIZE, cmap="bone", opacity=[0, 0.5, 1])
    return pvdi.VDISeries([vdi.with_precision("8-byte"), dense], [0.0, 1.5])


# -- plotters --------------------------------------------------------------------------------------


@pytest.fixture
def plotter():
    plotter = pv.Plotter(off_screen=True, window_size=SIZE, notebook=True)
    yield plotter
    plotter.close()


def add_ball(plotter, **how):
    image = pv.ImageData(dimensions=BALL.array.shape[::-1], spacing=BALL.spacing)
    image["density"] = BALL.array.ravel()
    return plotter.add_vdi(image, cmap="bone", show_scalar_bar=False, **how)


def show(plotter):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return plotter.show(jupyter_backend="vdi", return_viewer=True)


@pytest.mark.gl
def test_a_plotter_and_its_viewer_have_one_camera(plotter, tmp_path):
    (entry,) = importlib.metadata.entry_points(group="pyvista.jupyter_backends", name="vdi")
    assert entry.load() is show_plotter
    actor = add_ball(plotter)
    plotter.set_background("navy")
    widget = show(plotter)
    assert widget.vdi is actor.vdi
    assert widget.background == "#000080"
    assert widget.camera == viewer_camera(plotter.camera)
    np.testing.assert_array_equal(png(widget._repr_mimebundle_()[0]), plotter.screenshot())

    # What the browser turns; its message sets the trait
    turned = viewer_camera(pvdi.Camera((9, 1, 1), (1, 1, 1), (0, 1, 0), view_angle=20))
    widget.set_state({"camera": turned})
    assert viewer_camera(plotter.camera) == turned
    parallel = {**turned, "parallel_scale": 3.0}
    del parallel["view_angle"]
    widget.set_state({"camera": parallel})
    assert plotter.camera.parallel_projection
    assert plotter.camera.parallel_scale == 3

    # What the plotter draws
    plotter.disable_parallel_projection()
    plotter.view_xy()
    assert widget.camera == viewer_camera(plotter.camera)
    plotter.set_background("white")
    vdi = actor.regenerate()
    plotter.render()
    assert widget.background == "#ffffff"
    assert widget.vdi is vdi
    assert sent(widget, tmp_path).equals(vdi.with_precision("8-byte"))
    plotter.screenshot(scale=2)  # in tiles, each of which has a camera of its own
    assert widget.camera == viewer_camera(plotter.camera)
    plotter.close()
    widget.camera = turned  # the browser still has the VDI


@pytest.mark.gl
def test_a_view_that_rests_gets_a_vdi_of_its_own(plotter):
    """In the loop that cells run in."""

    async def in_a_kernel():
        actor = add_ball(plotter)
        widget = show(plotter)
        first, file = widget.vdi, file_of(widget)
        turned = viewer_camera(pvdi.Camera.from_any(plotter.camera).azimuth(70))
        widget.set_state({"camera": turned})
        while widget.vdi is first:
            await asyncio.sleep(0.02)
        assert widget.vdi is actor.vdi
        assert file_of(widget) != file
        assert widget.camera == turned  # to the last bit: nobody has touched it
        generating = viewer_camera(widget.vdi.camera)
        np.testing.assert_allclose(generating["position"], turned["position"], rtol=1e-12)

    asyncio.run(asyncio.wait_for(in_a_kernel(), 300))


@pytest.mark.gl
def test_other_scenes_are_shown_as_ever(plotter, monkeypatch, request):
    """Those without VDIs, subplots, and where there is no anywidget."""
    monkeypatch.setattr(pv, "registered_jupyter_backends", tuple)
    plotter.add_mesh(pv.Sphere())
    assert isinstance(show(plotter), Image.Image)
    subplots = pv.Plotter(shape=(1, 2), off_screen=True, window_size=SIZE, notebook=True)
    add_ball(subplots)
    with pytest.warns(UserWarning, match="not subplots"):
        assert isinstance(show_plotter(subplots), Image.Image)
    with pytest.raises(pvdi.InvalidArgumentError, match="one renderer, and this plotter has 2"):
        subplots.vdi.export_html(None)
    subplots.close()
    add_ball(plotter)
    request.getfixturevalue("without_anywidget")
    with pytest.warns(UserWarning, match=r"pyvista-vdi\[notebook\]"):
        assert isinstance(show_plotter(plotter), Image.Image)


@pytest.mark.gl
def test_the_example_s_cells_run():
    """With a smaller volume and pictures."""
    example = Path(__file__).parents[3] / "examples" / "notebook.ipynb"
    names = {}
    cells = json.loads(example.read_text(encoding="utf-8"))["cells"]
    for cell in [each for each in cells if each["cell_type"] == "code"]:
        assert not cell["outputs"]
        exec(
            "".join(cell["source"]).replace("= 96", "= 24").replace("(640, 360)", "(96, 54)"), names
        )
    assert names["widget"].camera == viewer_camera(names["vdi"].camera.azimuth(40))
    names["plotter"].close()


# -- in a page -------------------------------------------------------------------------------------

#: A page with a model as anywidget hands it in, and two views of it, as of two outputs.
PAGE = """<!doctype html><meta charset="utf-8"><div id="one" style="width: 192px"></div>
<div id="two" style="width: 192px"></div><img data-vdi="KEY"><script type="module">
import widget from "./widget.js";
const heard = {}, values = STATE;
for (const name of BINARIES) {
  values[name] = new DataView(await (await fetch(name)).arrayBuffer());
}
window.sent = [];
window.model = {
  get: (name) => values[name],
  set(name, value) { values[name] = value; for (const told of heard[name] ?? []) told(); },
  on(event, told) { (heard[event.replace("change:", "")] ??= new Set()).add(told); },
  off(event, told) { heard[event.replace("change:", "")].delete(told); },
  save_changes() { sent.push(values.camera); },
  listeners: () => Object.values(heard).reduce((sum, each) => sum + each.size, 0),
};
window.leave = ["one", "two"].map((id) =>
  widget.render({ model, el: document.getElementById(id) }));
window.viewers = [...document.querySelectorAll(":is(#one, #two) > *")];
await Promise.all(viewers.map((viewer) => viewer.ready));
window.begun = true;
</script>"""


@pytest.fixture
def open_widget(open_page):
    """Open a page with two views of a widget."""

    def open_widget(widget):
        state, files = widget.get_state(), binaries(widget)
        module = state.pop("_esm")
        text = json.dumps({name: state[name] for name in state.keys() - files.keys()})
        html = PAGE.replace("STATE", text).replace("BINARIES", json.dumps([*files]))
        files |= {"widget.html": html.replace("KEY", state["_key"]), "widget.js": module}
        page = open_page(name="widget.html", files=files)
        page.wait_for("window.begun")
        return page

    return open_widget


def assert_shows(page, size, viewer, expected):
    apart = np.abs(picture(page, size, viewer) / 255 - expected).max(axis=2)
    assert np.mean(apart <= 2 / 255) >= 0.999  # where a ray runs along a border, one list is met


def test_a_widget_of_values_edits_their_transfer_function(vdi, open_widget):
    kept = pvdi.generate(BALL, pvdi.Camera(*EYE), SIZE, classification="deferred")
    widget = VDIWidget(kept, **LOOK)
    with pytest.raises(UnsupportedError, match="leave out cmap, opacity"):
        VDIWidget(vdi, **LOOK)
    page = open_widget(widget)
    packed = pvdi.render(kept.with_precision("8-byte"), kept.camera, **LOOK)
    assert_shows(page, SIZE, "viewers[0]", packed)
    assert page.page.get_by_label("Window").count()
    with pytest.raises(pvdi.InvalidVDIError, match=r"this series keeps.*series\.classified"):
        VDIWidget(pvdi.VDISeries([kept]), **LOOK)
    widget.close()


def test_the_view_draws_and_shares_its_camera(open_widget, widget, vdi):
    widget.background, widget.clipping_planes = "white", [[0.1, 0, 0, -1, 0.2, 0]]
    page = open_widget(widget)
    assert page.evaluate("document.querySelector('img')") is None  # the still picture has gone
    assert page.evaluate("sent") == []  # nobody has turned it

    # By the kernel: both views follow, and tell it nothing that it knows
    turned = viewer_camera(vdi.camera.azimuth(25))
    page.evaluate("(camera) => model.set('camera', camera)", turned)
    assert page.evaluate("viewers.map((viewer) => viewer.camera)") == [turned, turned]
    packed, planes = vdi.with_precision("8-byte"), widget.clipping_planes
    expected = pvdi.render(packed, vdi.camera.azimuth(25), clipping_planes=planes)
    assert_shows(page, SIZE, "viewers[1]", expected)

    # By hand: the kernel and the other view are told, not more often than frames are drawn
    box = page.evaluate("(({ x, y }) => [x, y])(viewers[0].getBoundingClientRect())")
    mouse = page.page.mouse
    mouse.move(box[0] + 40, box[1] + 30)
    mouse.down()
    mouse.move(box[0] + 60, box[1] + 35, steps=4)
    mouse.up()
    page.wait_for("JSON.stringify(sent.at(-1)) === JSON.stringify(viewers[0].camera)")
    first, second = page.evaluate("viewers.map((viewer) => viewer.camera)")
    assert first == second != turned
    assert page.evaluate("sent.length") <= 5

    page.evaluate("model.set('background', null)")
    assert page.evaluate("viewers[0].background") == "transparent"
    page.evaluate("leave.forEach((go) => go())")
    left = "[model.listeners(), document.querySelectorAll(':is(#one, #two) > *').length]"
    assert page.evaluate(left) == [0, 0]


@pytest.mark.gl
def test_the_view_shows_a_plotter_s_scene_and_another_in_its_place(open_widget, plotter):
    add_ball(plotter, regenerate="never")
    center = np.add(plotter.center, (0, 0, 0.9))
    ball = plotter.add_mesh(pv.Sphere(radius=0.2, center=center), color="red", lighting=False)
    plotter.view_xy()
    plotter.set_background("k")
    widget = show(plotter)
    page = open_widget(widget)

    def red(pixels):
        return (pixels[..., 0].astype(int) - pixels[..., 1] > 200).sum()

    expected = red(plotter.screenshot())
    assert red(picture(page, SIZE, "viewers[0]")) == pytest.approx(expected, rel=0.1)  # silhouettes
    ball.visibility = False
    plotter.render()
    page.evaluate(
        """([name, text]) => {
          model.set(name, new DataView(bytesOf(text).buffer));
          return viewers[0].scene.whole.then(() => true);
        }""",
        [list(binaries(widget))[1], in_base64(scene_of(widget))],
    )
    assert red(picture(page, SIZE, "viewers[0]")) == 0


def test_a_series_in_a_notebook_has_one_time(open_widget, series):
    widget = VDIWidget(series)
    widget.time = 1.4
    page = open_widget(widget)
    page.wait_for("viewers.every(({ time }) => time === 1.5) && model.get('time') === 1.5")
    expected = pvdi.render(series[1].with_precision("8-byte"), series.camera)
    assert_shows(page, SIZE, "viewers[0]", expected)
    page.evaluate("viewers[0].time = 0")
    page.wait_for("model.get('time') === 0 && viewers[1].time === 0")


@pytest.mark.slow
def test_nbconvert_s_page_of_an_executed_notebook_shows_the_picture_offline(
    chromium, vdi, tmp_path
):
    for needed in ("nbconvert", "ipykernel"):
        pytest.importorskip(needed)
    nbformat = pytest.importorskip("nbformat")
    vdi.save(tmp_path / "ball.vdi")
    code = 'import pyvista_vdi as pvdi\npvdi.read("ball.vdi")'
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    nbformat.write(book, tmp_path / "book.ipynb")
    command = ["nbconvert", "--execute", "--to", "html", "book.ipynb"]
    subprocess.run([sys.executable, "-m", *command], cwd=tmp_path, check=True, timeout=300)
    context = chromium.new_context(offline=True)
    page = context.new_page()
    page.goto((tmp_path / "book.html").as_uri(), wait_until="domcontentloaded")
    [seen] = [image for image in page.locator("img").all() if image.is_visible()]
    assert seen.evaluate("(it) => it.decode().then(() => it.naturalWidth)") == SIZE[0]
    context.close()
