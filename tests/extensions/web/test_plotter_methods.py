"""Every ``Plotter.add_*`` in a page, one by one: drawn, or named, as docs/web.md says."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.web.scene import scene_of

pytestmark = pytest.mark.gl

SIZE = (240, 135)

#: Of 255. Measured: .1 to .45, by the gradient, which VTK dithers.
MEAN = 0.5

BALL = soft_ball(12)
SPHERE = pv.Sphere(radius=0.4, center=(0.9, 0.5, 0.5))
SPHERE["z"] = SPHERE.points[:, 2]
GRID = pv.ImageData(dimensions=(6, 6, 6), spacing=(0.14,) * 3, origin=(0.9, -0.9, 0.3))
GRID["x"] = GRID.points[:, 0] + GRID.points[:, 1]
POINTS = np.array([[-1.0, 0.5, 0.5], [1, 1, 1], [0, -1, 1]])
SEGMENTS = np.array([[-1.0, -1, 1], [1, 1, 1], [0, 1, 1], [1, 0, -1]])
LABELLED = pv.PolyData(POINTS[1:])
LABELLED["x"] = [1.0, 2.0]
PLAIN = {"show_scalar_bar": False, "scalars": "x"}


def ignore(*_):
    """A callback."""


def striped(height=20, width=30):
    image = pv.ImageData(dimensions=(width, height, 1))
    pixels = np.full((height, width, 3), (250, 220, 40), np.uint8)
    pixels[::4], pixels[:, :8] = (20, 60, 200), (200, 30, 30)
    image["pixels"] = pixels.reshape(-1, 3)
    return image


@pytest.fixture(autouse=True)
def image_file(tmp_path, monkeypatch):
    """The file image.png."""
    monkeypatch.chdir(tmp_path)
    Image.fromarray(striped(60, 90)["pixels"].reshape(60, 90, 3)).save("image.png")


#: Calls of a plotter's methods; what is written is turned off where that can be done.
CALLS = {
    "add_actor": lambda p: p.add_actor(pv.Actor(pv.DataSetMapper(SPHERE.copy()))),
    "add_affine_transform_widget": lambda p: p.add_affine_transform_widget(p.actors["sphere"]),
    "add_arrows": lambda p: p.add_arrows(POINTS, -POINTS, 0.5, color="r"),
    "add_axes": lambda p: p.add_axes(labels_off=True, viewport=(0, 0, 0.3, 0.5)),
    "add_axes_at_origin": lambda p: p.add_axes_at_origin(labels_off=True),
    "add_background_image": lambda p: p.add_background_image("image.png"),
    "add_blurring": lambda p: p.add_blurring(),
    "add_bounding_box": lambda p: p.add_bounding_box(color="k"),
    "add_box_axes": lambda p: p.add_box_axes(),
    "add_box_widget": lambda p: p.add_box_widget(ignore, color="r"),
    "add_camera3d_widget": lambda p: p.add_camera3d_widget(),
    "add_camera_orientation_widget": lambda p: p.add_camera_orientation_widget(),
    "add_chart": lambda p: p.add_chart(pv.Chart2D()),
    "add_checkbox_button_widget": lambda p: p.add_checkbox_button_widget(ignore, size=20),
    "add_composite": lambda p: p.add_composite(
        pv.MultiBlock([pv.Cone(center=(-1, 0, 1)), GRID]), color="w"
    ),
    "add_cursor": lambda p: p.add_cursor((0.7, 1.5, 0, 0.7, 0, 1), (1, 0.5, 0.5), "r"),
    "add_floor": lambda p: p.add_floor(color="g", show_edges=True),
    "add_key_event": lambda p: p.add_key_event("x", lambda: None),
    "add_legend": lambda p: p.add_legend([("a", "r")]),
    "add_legend_scale": lambda p: p.add_legend_scale(),
    "add_light": lambda p: p.add_light(pv.Light(position=(2, 2, 5), color="r")),
    "add_line_widget": lambda p: p.add_line_widget(ignore, color="r"),
    "add_lines": lambda p: p.add_lines(SEGMENTS, color="b", width=3),
    "add_logo_widget": lambda p: p.add_logo_widget(striped(), opacity=0.7),
    "add_measurement_widget": lambda p: p.add_measurement_widget(),
    "add_mesh": lambda p: p.add_mesh(GRID, **PLAIN),
    "add_mesh_clip_box": lambda p: p.add_mesh_clip_box(GRID.copy(), **PLAIN),
    "add_mesh_clip_plane": lambda p: p.add_mesh_clip_plane(GRID.copy(), **PLAIN),
    "add_mesh_isovalue": lambda p: p.add_mesh_isovalue(GRID.copy(), **PLAIN),
    "add_mesh_slice": lambda p: p.add_mesh_slice(GRID.copy(), **PLAIN),
    "add_mesh_slice_orthogonal": lambda p: p.add_mesh_slice_orthogonal(GRID.copy(), **PLAIN),
    "add_mesh_slice_spline": lambda p: p.add_mesh_slice_spline(GRID.copy(), **PLAIN),
    "add_mesh_threshold": lambda p: p.add_mesh_threshold(GRID.copy(), **PLAIN),
    "add_north_arrow_widget": lambda p: p.add_north_arrow_widget(viewport=(0, 0, 0.3, 0.5)),
    "add_on_render_callback": lambda p: p.add_on_render_callback(ignore),
    "add_orientation_widget": lambda p: p.add_orientation_widget(pv.Cone(), color="r"),
    "add_plane_widget": lambda p: p.add_plane_widget(ignore, color="r"),
    "add_point_labels": lambda p: p.add_point_labels(POINTS, [*"abc"], always_visible=True),
    "add_point_scalar_labels": lambda p: p.add_point_scalar_labels(
        LABELLED, "x", font_size=6, always_visible=True
    ),
    "add_points": lambda p: p.add_points(POINTS, color="r", point_size=8),
    "add_radio_button_widget": lambda p: p.add_radio_button_widget(ignore, "group", size=20),
    "add_ruler": lambda p: p.add_ruler(POINTS[0], POINTS[1]),
    "add_scalar_bar": lambda p: p.add_scalar_bar(title="", n_labels=0, mapper=p.mapper),
    "add_silhouette": lambda p: p.add_silhouette(SPHERE, color="r"),
    "add_slider_widget": lambda p: p.add_slider_widget(ignore, (0, 1)),
    "add_sphere_widget": lambda p: p.add_sphere_widget(ignore, center=POINTS[0]),
    "add_spline_widget": lambda p: p.add_spline_widget(ignore),
    "add_text": lambda p: p.add_text("text", font_size=8),
    "add_text_slider_widget": lambda p: p.add_text_slider_widget(ignore, ["a", "b"]),
    "add_timer_event": lambda p: p.add_timer_event(1, 1, ignore),
    "add_title": lambda p: p.add_title("title", font_size=8),
    "add_vdi": lambda p: p.add_vdi(BALL, show_scalar_bar=False),
    "add_volume": lambda p: p.add_volume(GRID, show_scalar_bar=False),
    "add_volume_clip_plane": lambda p: p.add_volume_clip_plane(
        GRID, origin=GRID.center, show_scalar_bar=False
    ),
}

METHODS = sorted(name for name in dir(pv.Plotter) if name.startswith("add_"))


def documented():
    """What docs/web.md says of each method, by the rows of its table."""
    page = Path(__file__).parents[3] / "docs" / "web.md"
    rows = re.findall(
        r"^\| (`add_.*?) \| (.*?) \|$", page.read_text(encoding="utf-8"), re.MULTILINE
    )
    return {name: what for names, what in rows for name in re.findall(r"`(add_\w+)`", names)}


@pytest.fixture(scope="module")
def vdi():
    camera = pvdi.Camera((3, 2.4, 3.6), (0, 0, 0), (0, 1, 0))
    return pvdi.generate(BALL, camera, SIZE, cmap="viridis", opacity="linear")


@pytest.fixture
def plotter(vdi):
    made = pv.Plotter(off_screen=True, window_size=SIZE)
    made.add_vdi(vdi, regenerate="never", show_scalar_bar=False)
    made.add_mesh(SPHERE.copy(), scalars="z", show_scalar_bar=False, name="sphere")
    made.camera_position = [(3.6, 2.9, 4.3), (0.2, 0, 0), (0, 1, 0)]
    yield made
    made.close()


def test_the_docs_name_every_method():
    assert set(METHODS) <= set(documented())
    assert set(METHODS) <= set(CALLS)


@pytest.mark.parametrize("method", METHODS)
def test_what_a_method_adds_is_drawn_or_named_as_the_docs_say(method, plotter):
    CALLS[method](plotter)
    plotter.show(auto_close=False)
    left_out = scene_of(plotter.renderer).left_out
    assert (left_out == []) == (documented()[method] == "yes"), left_out


def test_a_page_has_the_plotters_background(vdi, open_page, tmp_path):
    """One that is not from the bottom to the top is named."""
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.add_vdi(vdi, regenerate="never", show_scalar_bar=False)
    plotter.set_background("y", top="b")
    plotter.vdi.export_html(tmp_path / "scene.html")
    viewport = {"width": SIZE[0], "height": SIZE[1]}
    page = open_page(url=(tmp_path / "scene.html").as_uri(), viewport=viewport, offline=True)
    page.ready()
    page.evaluate("new Promise(requestAnimationFrame).then(() => true)")
    got = np.asarray(Image.open(io.BytesIO(page.page.screenshot())).convert("RGB"), float)
    want = plotter.screenshot(return_img=True)[..., :3].astype(float)
    plotter.set_background("y", side="b")
    assert "a background's gradient" in scene_of(plotter.renderer).left_out[0]
    plotter.close()
    assert np.abs(got - want).mean() <= MEAN
