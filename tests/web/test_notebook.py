"""VDIs in notebooks: the widget, what IPython shows, PyVista's backend, and the view in a page.

One widget, in all the places where it shows itself: hence more than 500 lines.
"""

from __future__ import annotations

import asyncio
import base64
import importlib.metadata
import io
import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi.web.camera import camera_of, viewer_camera
from pyvista_vdi.web.notebook import mime_bundle, show_plotter

anywidget = pytest.importorskip("anywidget", reason="needs the extra notebook")

from pyvista_vdi.web import VDIWidget  # noqa: E402

WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"
SIZE = (96, 64)


def soft_ball(n=24):
    x = np.linspace(-1, 1, n)
    radius = np.sqrt(x[:, None, None] ** 2 + x[:, None] ** 2 + x**2)
    density = 255 * np.clip(1 - radius, 0, 1)
    return pvdi.Volume(density.astype(np.float32), (2 / (n - 1),) * 3, (-1, -1, -1))


@pytest.fixture(scope="module")
def vdi():
    camera = pvdi.Camera((3, 2, 5), (0, 0, 0), (0, 1, 0))
    return pvdi.generate(soft_ball(), camera, SIZE, cmap="viridis", opacity=[0, 0.1, 0.4, 0.9])


@pytest.fixture
def widget(vdi):
    widget = VDIWidget(vdi)
    yield widget
    widget.close()


# -- cameras ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "lens",
    [
        {"view_angle": 40.0},
        {"parallel_projection": True, "parallel_scale": 2.5},
        {"view_angle": 25.0, "window_center": (0.25, -0.5)},
    ],
)
def test_a_viewer_s_camera_is_the_same_view(lens):
    camera = pvdi.Camera((3, 2, 5), (0.5, 0, 0), (0, 1, 0), **lens)
    state = viewer_camera(camera, SIZE)
    assert ("parallel_scale" in state) == ("parallel_projection" in lens)
    again = camera_of(state)
    np.testing.assert_array_equal(again.view_matrix, camera.view_matrix)
    np.testing.assert_array_equal(again.viewport_matrix(SIZE), camera.viewport_matrix(SIZE))
    assert viewer_camera(state, SIZE) == state


def test_a_horizontal_angle_becomes_the_vertical_one():
    camera = pvdi.Camera(
        (3, 2, 5), (0, 0, 0), (0, 1, 0), view_angle=50, use_horizontal_view_angle=True
    )
    again = camera_of(viewer_camera(camera, SIZE))
    np.testing.assert_allclose(again.half_extent(SIZE), camera.half_extent(SIZE), rtol=1e-14)


def test_other_entries_are_refused():
    state = viewer_camera(pvdi.Camera((3, 2, 5), (0, 0, 0), (0, 1, 0)))
    with pytest.raises(pvdi.InvalidCameraError, match="zoom"):
        camera_of({**state, "zoom": 2})
    with pytest.raises(pvdi.InvalidCameraError, match="lacks"):
        camera_of({"position": [1, 2, 3]})


# -- the widget ------------------------------------------------------------------------------------


def test_the_widget_holds_a_file_of_the_vdi(widget, vdi, tmp_path):
    (tmp_path / "sent.vdi").write_bytes(widget._file)
    assert pvdi.read(tmp_path / "sent.vdi").equals(vdi.with_precision("8-byte"))
    exact = VDIWidget(vdi, precision="exact")
    (tmp_path / "sent.vdi").write_bytes(exact._file)
    assert pvdi.read(tmp_path / "sent.vdi").equals(vdi)


def test_any_camera_can_be_set_and_none_that_shows_nothing(widget, vdi):
    assert widget.camera == viewer_camera(vdi.camera)
    told = []
    widget.observe(lambda change: told.append(change.new), "camera")
    widget.camera = vdi.camera.azimuth(30)
    assert told == [viewer_camera(vdi.camera.azimuth(30))]
    with pytest.raises(pvdi.InvalidCameraError):
        widget.camera = {**widget.camera, "position": widget.camera["focal_point"]}
    with pytest.raises(pvdi.InvalidCameraError):
        widget.camera = "xy"
    assert len(told) == 1
    pv = pytest.importorskip("pyvista")
    camera = pv.Camera()
    camera.position, camera.parallel_projection, camera.parallel_scale = (1, 2, 30), True, 4
    widget.camera = camera
    assert widget.camera["parallel_scale"] == 4
    assert widget.camera["position"] == [1, 2, 30]


def test_backgrounds(widget):
    assert widget.background is None
    for color, kept in (("white", "#ffffff"), ("#204060", "#204060"), ((1, 0.2, 0), "#ff3300")):
        widget.background = color
        assert widget.background == kept
    for wrong in ("no colour", (1, 2, 3), (0.5, 0.5), 7):
        with pytest.raises(pvdi.InvalidArgumentError, match="a background is"):
            widget.background = wrong
    widget.background = None


def test_another_vdi_takes_its_place(widget, vdi):
    before, camera = widget._file, widget.camera
    other = pvdi.generate(soft_ball(), vdi.camera.azimuth(40), SIZE, cmap="bone")
    widget.vdi = other
    assert widget.vdi is other
    assert widget._file != before
    assert widget.camera == camera
    with pytest.raises(pvdi.InvalidVDIError):
        widget.vdi = "brain.vdi"


def test_a_screenshot_is_the_picture_of_the_view(widget, vdi, tmp_path):
    widget.camera = vdi.camera.azimuth(20)
    image = pvdi.render(vdi, vdi.camera.azimuth(20))
    pixels = widget.screenshot(tmp_path / "turned.png")
    assert pixels.shape == (*SIZE[::-1], 4)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "turned.png")), pixels)
    widget.background = "white"
    over = image[..., :3] + (1 - image[..., 3:])
    # One step for rounding, another for the rounding of sums in float32
    assert np.abs(widget.screenshot() / 255 - over).max() <= 1 / 255
    assert widget.screenshot(window_size=(30, 20)).shape == (20, 30, 3)


# -- what IPython shows ----------------------------------------------------------------------------


def png(data):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data["image/png"]))))


def test_a_vdi_shows_itself(vdi):
    data, _ = vdi._repr_mimebundle_()
    assert data["text/plain"] == repr(vdi)
    assert data[WIDGET_VIEW]["model_id"]
    np.testing.assert_array_equal(png(data), pvdi.io.to_bytes(pvdi.render(vdi, vdi.camera)))


def test_a_picture_that_is_kept_is_small(vdi):
    lists = pvdi.VDI(vdi.camera, (4000, 20), np.zeros(80001, int), [], [], [], [], vdi.bounds)
    data, _ = lists._repr_mimebundle_()
    assert png(data).shape == (4, 800, 4)


def test_a_widget_shows_its_present_view_over_its_background(widget, vdi):
    widget.camera, widget.background = vdi.camera.azimuth(90), "navy"
    data, _ = widget._repr_mimebundle_()
    assert WIDGET_VIEW in data
    np.testing.assert_array_equal(png(data), widget.screenshot())


def test_without_a_device_there_is_a_viewer_and_no_picture(vdi, monkeypatch):
    def render(*_, **__):
        raise pvdi.NoDeviceError("none")

    monkeypatch.setattr("pyvista_vdi.web.still.render", render)
    data, _ = vdi._repr_mimebundle_()
    assert set(data) == {"text/plain", WIDGET_VIEW}


def test_without_anywidget_there_is_a_picture_and_the_extra_is_named(vdi, monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "pyvista_vdi.web.widget")
    data = vdi._repr_mimebundle_()
    assert set(data) == {"text/plain", "text/html", "image/png"}
    for kind in ("text/plain", "text/html"):
        assert "pyvista-vdi[notebook]" in data[kind]
    assert repr(vdi) in data["text/plain"]
    assert data["image/png"] in data["text/html"]
    monkeypatch.setattr("pyvista_vdi.web.notebook.still", lambda _vdi: None)
    assert set(vdi._repr_mimebundle_()) == {"text/plain"}


def test_a_terminal_shows_the_repr(vdi, monkeypatch):
    ipython = pytest.importorskip("IPython")
    monkeypatch.setattr(ipython, "get_ipython", object)
    assert mime_bundle(vdi) == {}
    formats, _ = ipython.core.formatters.DisplayFormatter().format(vdi)
    assert formats == {"text/plain": repr(vdi)}


# -- PyVista's backend -----------------------------------------------------------------------------


@pytest.fixture
def plotter():
    pv = pytest.importorskip("pyvista")
    plotter = pv.Plotter(off_screen=True, window_size=SIZE, notebook=True)
    yield plotter
    plotter.close()


def as_image(volume):
    import pyvista as pv

    image = pv.ImageData(dimensions=volume.array.shape[::-1], spacing=volume.spacing)
    image["density"] = volume.array.ravel()
    return image


def show(plotter):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return plotter.show(jupyter_backend="vdi", return_viewer=True)


@pytest.mark.gl
def test_a_plotter_and_its_viewer_have_one_camera(plotter):
    actor = plotter.add_vdi(as_image(soft_ball()), cmap="bone", show_scalar_bar=False)
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
    assert "view_angle" in widget.camera
    plotter.set_background("white")
    before = widget._file
    vdi = actor.regenerate()
    plotter.render()
    assert widget.background == "#ffffff"
    assert widget.vdi is vdi
    assert widget._file != before
    plotter.screenshot(scale=2)  # in tiles, each of which has a camera of its own
    assert widget.camera == viewer_camera(plotter.camera)
    plotter.close()
    widget.camera = turned  # the browser still has the VDI


@pytest.mark.gl
def test_what_is_seen_of_a_vdi_in_its_plotter_is_seen_in_the_viewer(plotter):
    """Where it has been moved and turned to, through how much of it one sees, and its clipping."""
    actor = plotter.add_vdi(
        as_image(soft_ball()), cmap="bone", show_scalar_bar=False, regenerate="never"
    )
    plotter.set_background("black")
    widget = show(plotter)
    actor.rotate_z(25)
    actor.position = (0.3, -0.1, 0.2)
    actor.opacity_multiplier = 0.5
    plane = pytest.importorskip("vtkmodules.vtkCommonDataModel").vtkPlane()
    plane.SetOrigin(1.2, 0.8, 1.3)
    plane.SetNormal(-1, 0.3, 0)
    actor.mapper.AddClippingPlane(plane)
    plotter.render()
    assert widget.clipping_planes == [[1.2, 0.8, 1.3, -1, 0.3, 0]]
    np.testing.assert_array_equal(widget.vdi.camera.model_transform[:3, 3], (0.3, -0.1, 0.2))
    expected = pvdi.render(
        actor.vdi,
        pvdi.Camera.from_any(plotter.camera, model_transform=widget.vdi.camera.model_transform),
        SIZE,
        clipping_planes=widget.clipping_planes,
        opacity_multiplier=0.5,
    )[..., :3]
    # One step for rounding, another for that of the moved view
    assert np.abs(widget.screenshot(window_size=SIZE) / 255 - expected).max() <= 2 / 255
    assert expected.max() > 0.2


@pytest.mark.gl
def test_what_the_viewer_leaves_out_is_named(plotter):
    import pyvista as pv

    actor = plotter.add_vdi(as_image(soft_ball()), cmap="bone", show_scalar_bar=False)
    plotter.add_mesh(pv.Sphere(), name="a ball")
    plotter.screenshot()
    actor.mapper.SetCropping(True)
    actor.mapper.SetCroppingRegionPlanes(0, 1, 0, 1, 0, 1)
    actor.mapper.SetCroppingRegionFlagsToCross()
    plotter.show_grid()
    with pytest.warns(UserWarning, match=r"without cropping \(\w+\), CubeAxes.*: see all by"):
        show_plotter(plotter)


@pytest.mark.gl
def test_a_scene_is_sent_again_when_something_in_it_is_another(plotter):
    import pyvista as pv

    plotter.add_vdi(as_image(soft_ball()), cmap="bone", regenerate="never")
    sphere = plotter.add_mesh(pv.Sphere(), color="w")
    widget = show(plotter)
    scenes = [widget._scene]
    plotter.camera.azimuth = 30
    plotter.render()
    assert widget._scene is scenes[0]  # the view has a trait of its own
    for change in (
        lambda: setattr(sphere.prop, "color", "red"),
        lambda: setattr(sphere, "position", (1, 0, 0)),
        lambda: plotter.add_text("a text"),
        lambda: setattr(sphere, "visibility", False),
        lambda: plotter.set_background("w", top="b"),
    ):
        change()
        plotter.render()
        scenes.append(widget._scene)
    assert len(set(scenes)) >= len(scenes) - 1  # a background is no part of it
    assert widget._gradient.startswith("linear-gradient")


@pytest.mark.gl
def test_a_view_that_rests_gets_a_vdi_of_its_own(plotter):
    """As in a window on the screen, and seen by the viewer, in the loop that cells run in."""

    async def in_a_kernel():
        actor = plotter.add_vdi(
            as_image(soft_ball()), cmap="bone", show_scalar_bar=False, regenerate_below=1.0
        )
        widget = show(plotter)
        first, file = widget.vdi, widget._file
        turned = viewer_camera(pvdi.Camera.from_any(plotter.camera).azimuth(70))
        widget.set_state({"camera": turned})
        while widget.vdi is first:
            await asyncio.sleep(0.02)
        assert widget.vdi is actor.vdi
        assert widget._file != file
        assert widget.camera == turned  # to the last bit: nobody has touched it
        generating = viewer_camera(widget.vdi.camera)
        np.testing.assert_allclose(generating["position"], turned["position"], rtol=1e-12)

    asyncio.run(asyncio.wait_for(in_a_kernel(), 300))


@pytest.mark.gl
def test_pyvista_takes_the_backend_by_itself_where_trame_is_not_installed(plotter):
    import pyvista as pv

    names = [backend.name for backend in pv.registered_jupyter_backends()]
    if names != ["vdi"]:
        pytest.skip(f"other backends are installed: {', '.join(names)}")
    actor = plotter.add_vdi(as_image(soft_ball()), cmap="bone", show_scalar_bar=False)
    assert plotter.show(return_viewer=True).vdi is actor.vdi


@pytest.mark.gl
def test_a_scene_without_vdis_is_shown_as_ever(plotter, monkeypatch):
    import pyvista as pv

    monkeypatch.setattr(pv, "registered_jupyter_backends", tuple)
    plotter.add_mesh(pv.Sphere())
    assert isinstance(show(plotter), Image.Image)


@pytest.mark.gl
def test_without_anywidget_a_plotter_shows_a_picture_and_says_why(plotter, monkeypatch):
    import pyvista as pv

    monkeypatch.setattr(pv, "registered_jupyter_backends", tuple)
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "pyvista_vdi.web.widget")
    monkeypatch.delitem(sys.modules, "pyvista_vdi.web.plotter_widget", raising=False)
    plotter.add_vdi(as_image(soft_ball()), cmap="bone", show_scalar_bar=False)
    with pytest.warns(UserWarning, match=r"pyvista-vdi\[notebook\]"):
        shown = plotter.show(jupyter_backend="vdi", return_viewer=True)
    assert isinstance(shown, Image.Image)


def test_pyvista_finds_the_backend():
    (entry,) = importlib.metadata.entry_points(group="pyvista.jupyter_backends", name="vdi")
    assert entry.load() is show_plotter


@pytest.mark.gl
def test_the_example_s_cells_run():
    example = Path(__file__).parents[2] / "examples" / "notebook.ipynb"
    names = {}
    for cell in json.loads(example.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            exec("".join(cell["source"]), names)
    assert names["widget"].camera == viewer_camera(names["vdi"].camera.azimuth(40))
    assert names["plotter"].camera.position[2] > 0
    names["plotter"].close()


# -- the view in a page ----------------------------------------------------------------------------

#: A page with a model as anywidget hands it in, and two views of it, as of two outputs.
PAGE = """<!doctype html><meta charset="utf-8"><div id="one" style="width: 192px"></div>
<div id="two" style="width: 192px"></div><script type="module">
import widget from "./widget.js";
const heard = {}, values = STATE;
const fetched = async (name) => new DataView(await (await fetch(name)).arrayBuffer());
values._file = await fetched("x.vdi");
if (values._scene) values._scene = await fetched("x.scene");
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
window.viewers = [...document.querySelectorAll("vdi-viewer")];
window.textOf = (bytes) => btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(""));
await Promise.all(viewers.map((viewer) => viewer.ready));
window.begun = true;
</script>"""


def test_the_view_draws_and_shares_its_camera(open_page, widget, vdi):
    planes = [[0.1, 0, 0, -1, 0.2, 0]]
    state = {"camera": widget.camera, "background": "#ffffff", "_picture_size": SIZE}
    state["clipping_planes"] = planes
    files = {
        "widget.html": PAGE.replace("STATE", json.dumps(state)),
        "widget.js": VDIWidget._esm,
        "x.vdi": widget._file,
    }
    page = open_page(name="widget.html", files=files)
    page.wait_for("window.begun")
    assert page.evaluate("viewers.map((viewer) => viewer.clientWidth)") == [SIZE[0]] * 2
    assert page.evaluate("sent") == []  # nobody has turned it

    # By the kernel: both views follow, and tell it nothing that it knows
    turned = viewer_camera(vdi.camera.azimuth(25))
    page.evaluate("(camera) => model.set('camera', camera)", turned)
    assert page.evaluate("viewers.map((viewer) => viewer.camera)") == [turned, turned]
    shot = page.evaluate(
        f"viewers[1].screenshot({{ width: {SIZE[0]}, height: {SIZE[1]} }})"
        ".then((shot) => textOf(shot.data))"
    )
    got = np.frombuffer(base64.b64decode(shot), np.uint8).reshape(*SIZE[::-1], 4) / 255
    sent = vdi.with_precision("8-byte")
    expected = pvdi.render(sent, vdi.camera.azimuth(25), clipping_planes=planes)
    apart = np.abs(got - expected).max(axis=2)
    assert np.mean(apart <= 2 / 255) >= 0.999  # the bound of issue 17

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
    assert camera_of(first).position != vdi.camera.position
    assert page.evaluate("sent.length") <= 5

    page.evaluate("model.set('background', null)")
    assert page.evaluate("viewers[0].background") == "transparent"
    page.evaluate("leave.forEach((go) => go())")
    left = "[model.listeners(), document.querySelectorAll('vdi-viewer').length]"
    assert page.evaluate(left) == [0, 0]


@pytest.mark.gl
def test_the_view_shows_a_plotter_s_scene_and_another_in_its_place(open_page, plotter):
    import pyvista as pv

    plotter.add_vdi(as_image(soft_ball()), cmap="bone", show_scalar_bar=False, regenerate="never")
    center = np.add(plotter.center, (0, 0, 0.9))
    ball = plotter.add_mesh(pv.Sphere(radius=0.2, center=center), color="red", lighting=False)
    plotter.view_xy()
    plotter.set_background("k")
    widget = show(plotter)
    state = {"camera": widget.camera, "background": None, "_picture_size": SIZE}
    state |= {"clipping_planes": [], "_scene": True}
    files = {
        "widget.html": PAGE.replace("STATE", json.dumps(state)),
        "widget.js": widget._esm,
        "x.vdi": widget._file,
        "x.scene": widget._scene,
    }
    page = open_page(name="widget.html", files=files)
    page.wait_for("window.begun")
    size = f"{{ width: {SIZE[0]}, height: {SIZE[1]} }}"

    def red():
        shot = page.evaluate(f"viewers[0].screenshot({size}).then((shot) => textOf(shot.data))")
        got = np.frombuffer(base64.b64decode(shot), np.uint8).reshape(*SIZE[::-1], 4).astype(int)
        return got[..., 0] - got[..., 1] > 200

    expected = plotter.screenshot().astype(int)
    expected = expected[..., 0] - expected[..., 1] > 200
    assert expected.sum() > 40
    assert (red() != expected).sum() < 0.1 * expected.sum()  # pixels of the silhouette
    ball.visibility = False
    plotter.render()
    page.evaluate(
        """(text) => {
          const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
          window.before = viewers[0].scene;
          model.set("_scene", new DataView(bytes.buffer));
          return viewers[0].scene.whole.then(() => true);
        }""",
        base64.b64encode(widget._scene).decode(),
    )
    assert not red().any()
