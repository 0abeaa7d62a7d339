"""Every ``Plotter.add_*`` in a page, one by one: as docs/web.md says, and as PyVista draws it."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from browsers import picture, show_scene
from PIL import Image
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.web.scenes.scene import scene_of
from pyvista_vdi.extensions.web.still import part_of
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

slow = pytest.mark.slow
pytestmark = pytest.mark.gl

SIZE = (240, 135)

#: Of 255, without texts: the issue's. Measured: 0.1 to 0.45, by lines within the VDI, whose depths
#: VTK has by samples.
MEAN = 0.5

#: With texts, whose fonts are the browser's: measured, 0.4 to 1.4 by how much is written.
WRITTEN = 2.0

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
    "add_transfer_function_editor": lambda p: p.add_transfer_function_editor(
        p.add_volume(GRID, show_scalar_bar=False)
    ),
    "add_vdi_clip_plane": lambda p: p.add_vdi_clip_plane(p.volume),
    "add_vdi": lambda p: p.add_vdi(BALL, show_scalar_bar=False),
    "add_volume": lambda p: p.add_volume(GRID, show_scalar_bar=False),
    "add_volume_clip_plane": lambda p: p.add_volume_clip_plane(
        GRID, origin=GRID.center, show_scalar_bar=False
    ),
}

#: Those whose texts cannot be turned off.
WITH_TEXT = {
    "add_mesh_isovalue", "add_mesh_threshold", "add_point_labels", "add_point_scalar_labels",
    "add_slider_widget", "add_text", "add_text_slider_widget", "add_title",
}  # fmt: skip

#: Of the fast tests: a sample of each kind.
AT_ONCE = {
    "add_bounding_box", "add_background_image", "add_camera_orientation_widget", "add_logo_widget",
    "add_axes_at_origin", "add_ruler", "add_mesh_slice_orthogonal", "add_slider_widget",
}  # fmt: skip

METHODS = sorted(name for name in dir(pv.Plotter) if name.startswith("add_"))
SLOW = [pytest.param(m, marks=[] if m in AT_ONCE else slow) for m in METHODS]


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


@pytest.fixture
def page(open_page):
    return open_page((16, 9))


def shown(page, plotter, renderer=None):
    """Show a renderer in a page; return what is left out, and both pictures."""
    renderer = renderer or plotter.renderer
    plotter.show(auto_close=False)
    plotter.render()  # VTK lays scalar bars out by two frames
    scene = scene_of(renderer, renderer.actors)
    show_scene(page, scene)
    return scene.left_out, *both(page, plotter, scene, renderer)


def both(page, plotter, scene, renderer=None):
    """The page's picture of a renderer and the plotter's, RGB."""
    renderer = renderer or plotter.renderer
    seen = picture(page, renderer.GetSize()).astype(float)
    under = np.array(re.findall(r"[\d.]+(?=%)", scene.background), float)[:3] * 2.55
    got = seen[..., :3] + (1 - seen[..., 3:] / 255) * under
    return got, part_of(plotter.screenshot(return_img=True)[..., :3].astype(float), renderer)


def far(got, want):
    return np.abs(got - want).mean()


def test_the_docs_name_every_method():
    assert set(METHODS) <= set(documented())
    assert set(METHODS) <= set(CALLS)


@pytest.mark.every(3)
@pytest.mark.parametrize("method", SLOW)
def test_a_method_is_drawn_or_named_as_the_docs_say(method, plotter, page):
    said = documented()[method]
    CALLS[method](plotter)
    left_out, got, want = shown(page, plotter)
    if said == "not drawn":
        assert [what for what in left_out if what.startswith(method)]
        return
    assert far(got, want) <= (WRITTEN if method in WITH_TEXT else MEAN)
    assert (left_out != []) == (said not in ("drawn", "nothing to be seen, and no warning"))
    assert all(method in what for what in left_out)


def front(plotter):
    plotter.add_mesh(pv.Cube(center=(-1, 0, 1)), style="wireframe", color="k", culling="front")


def back(plotter):
    plotter.add_mesh(SPHERE.extract_all_edges(), color="b", line_width=3, culling="back")


def points(plotter):
    looks = {"style": "points", "point_size": 5, "culling": "front"}
    plotter.add_mesh(pv.Cube(center=(-1, 0, 1)), color="k", **looks)


def solid(plotter):
    box = pv.Box((-0.7, 0.7, -0.7, 0.7, -0.7, 0.7))
    plotter.add_mesh(box, color="r", culling="front", lighting=False)


@pytest.mark.every(9)
@pytest.mark.parametrize("add", [front, pytest.param(back, marks=slow), points, solid])
def test_only_polygons_have_sides_that_are_culled(add, plotter, page):
    before = shown(page, plotter)[2]
    add(plotter)
    left_out, got, want = shown(page, plotter)
    assert left_out == []
    assert far(before, want) > 1
    assert far(got, want) <= MEAN


@pytest.mark.every(4)
@pytest.mark.parametrize("vertical", [False, True])
@pytest.mark.parametrize("kind", ["few", "log", "outside", "categories"])
def test_the_boxes_of_a_scalar_bar_have_its_colours(kind, vertical, plotter, page):
    mesh, more, bar = SPHERE.copy(), {}, {}
    mesh["w"] = np.linspace(1, 100, mesh.n_points)
    if kind == "few":
        bar = {"n_colors": 4}
    elif kind == "log":
        more, bar = {"log_scale": True}, {"n_colors": 5}
    elif kind == "outside":
        more, bar = {"below_color": "b", "above_color": "r"}, {"nan_annotation": True}
    plotter.add_mesh(mesh, scalars="w", opacity=0.0, show_scalar_bar=False, **more)
    if kind == "categories":
        plotter.mapper.lookup_table.annotations = {1: " ", 20: " ", 30: " "}
        plotter.mapper.lookup_table.SetIndexedLookup(True)
    size = {"width": 0.3, "height": 0.9} if vertical else {"width": 0.8, "height": 0.3}
    place = {"position_x": 0.1, "position_y": 0.05, "vertical": vertical}
    drawn = plotter.add_scalar_bar(title="", n_labels=0, **size, **place, **bar)
    drawn.SetDrawAnnotations(kind == "categories")
    left_out, got, want = shown(page, plotter)
    assert left_out == []
    assert far(got, want) <= MEAN


@pytest.mark.parametrize("vertical", [False, pytest.param(True, marks=slow)])
def test_notes_of_a_scalar_bar_stand_where_vtk_has_them(vertical, plotter, page):
    plotter.window_size = (400, 300)
    plotter.add_mesh(SPHERE, scalars="z", opacity=0.0, show_scalar_bar=False)
    plotter.mapper.lookup_table.annotations = {0.3: "low", 0.7: "high"}
    place = {"position_x": 0.4, "position_y": 0.3, "vertical": vertical}
    size = {"width": 0.2, "height": 0.6} if vertical else {"width": 0.5, "height": 0.2}
    plotter.add_scalar_bar(title="", n_labels=0, color="k", **place, **size)
    left_out, got, want = shown(page, plotter)
    assert left_out == []
    boxes = []
    for pixels in (got, want):
        rows, columns = np.nonzero(pixels.max(axis=2) < 100)
        boxes.append((rows.min(), rows.max(), columns.min(), columns.max()))
    # Letters of another font are wider and higher by some pixels
    assert np.abs(np.subtract(*boxes)).max() <= 10, boxes


def turned(page, plotter):
    """Another view of both."""
    plotter.camera_position = [(-3.6, 2.9, 1.3), (0.2, 0, 0), (0.3, 1, 0)]
    plotter.render()
    view = plotter.camera
    page.evaluate(
        "(view) => { viewer.camera = { ...viewer.camera, ...view }; }",
        {
            "position": list(view.position),
            "focal_point": list(view.focal_point),
            "view_up": list(view.up),
        },
    )


WIDGETS = ["add_camera_orientation_widget", "add_axes", "add_north_arrow_widget"]


@pytest.mark.parametrize(
    "method", [WIDGETS[0], *(pytest.param(w, marks=slow) for w in WIDGETS[1:])]
)
def test_orientation_widgets_turn_with_the_view(method, plotter, page):
    CALLS[method](plotter)
    plotter.show(auto_close=False)
    shown(page, plotter)
    turned(page, plotter)
    scene = scene_of(plotter.renderer)
    assert far(*both(page, plotter, scene)) <= MEAN


@pytest.mark.parametrize("options", [{"scale": 0.6}, pytest.param({"scale": 1.7}, marks=slow)])
def test_a_background_image_stays_behind_all(options, plotter, page):
    plotter.set_background("y")
    plotter.add_background_image("image.png", **options)
    assert far(*shown(page, plotter)[1:]) <= MEAN
    turned(page, plotter)
    assert far(*both(page, plotter, scene_of(plotter.renderer))) <= MEAN


SIDES = ["side", *(pytest.param(side, marks=slow) for side in ("corner", "right", "top"))]


@pytest.mark.parametrize("side", SIDES)
def test_a_page_has_the_plotters_background(side, plotter, open_page, tmp_path):
    plotter.set_background("y", **{side: "b"})
    plotter.vdi.export_html(tmp_path / "scene.html")
    viewport = {"width": SIZE[0], "height": SIZE[1]}
    page = open_page(url=(tmp_path / "scene.html").as_uri(), viewport=viewport, offline=True)
    page.ready()
    page.evaluate("new Promise(requestAnimationFrame).then(() => true)")
    got = Image.open(io.BytesIO(page.page.screenshot())).convert("RGB")
    want = plotter.screenshot(return_img=True)[..., :3].astype(float)
    assert far(np.asarray(got, float), want) <= MEAN


def test_lines_are_as_thin_before_an_image(plotter, page):
    plotter.add_background_image("image.png")
    plotter.add_bounding_box(color="k", line_width=2)
    assert far(*shown(page, plotter)[1:]) <= MEAN


@pytest.mark.parametrize("as_global", [False, pytest.param(True, marks=slow)])
def test_background_images_of_subplots(as_global, vdi, page):
    plotter = pv.Plotter(off_screen=True, window_size=SIZE, shape=(1, 2), border=False)
    for column in (0, 1):
        plotter.subplot(0, column)
        plotter.add_vdi(vdi, regenerate="never", show_scalar_bar=False)
    plotter.add_background_image("image.png", as_global=as_global)
    for renderer in plotter.renderers:
        assert far(*shown(page, plotter, renderer)[1:]) <= MEAN
    plotter.close()


def test_planes_and_lights_that_are_too_many_are_named(plotter):
    plane = vtkPlane()
    plane.SetNormal(0, 0, 1)
    clipped = plotter.add_mesh(pv.Cube(), name="box")
    for _ in range(8):
        clipped.mapper.AddClippingPlane(plane)
        plotter.add_light(pv.Light(position=(1, 2, 3)))
    left_out = scene_of(plotter.renderer, plotter.renderer.actors, needs_vdi=False).left_out
    assert "2 of its clipping planes (box)" in left_out
    assert any("of its lights (add_light)" in what for what in left_out)


def test_names_are_the_users_own(plotter):
    plotter.add_legend([("a", "r")], name="key")
    plotter.show_bounds()
    plotter.add_mesh(SPHERE, style="points_gaussian", name="dust")
    plotter.enable_eye_dome_lighting()
    plotter.add_mesh_threshold(GRID.copy(), **PLAIN)
    plotter.add_slider_widget(ignore, (0, 1))
    left_out = scene_of(plotter.renderer, plotter.renderer.actors, needs_vdi=False).left_out
    assert left_out == [
        "enable_eye_dome_lighting",
        "add_legend (key)",
        "show_bounds",
        'style="points_gaussian" (dust)',
        "the interaction of add_mesh_threshold",
        "the interaction of add_slider_widget",
    ]
