"""Scenes in a page: what is seen among VDIs is what VTK draws of the same plotter."""

import warnings

import numpy as np
import pytest
import pyvista as pv
from browsers import picture, show_scene
from plugin_scenes import soft_ball
from skimage.metrics import structural_similarity

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.extensions.web.scene import scene_of
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

pytestmark = pytest.mark.gl

#: Odd, so that no ray runs along a border of lists.
SIZE = (241, 135)

#: The viewer on a page of which only pictures are taken.
SMALL = (16, 9)

#: Of 255. Measured: .04 to 1.0, by silhouettes and lines, whose samples lie elsewhere in a pixel.
MEAN = 1.2

#: Measured: .99 to .9997.
SSIM = 0.98

#: Of RGB: what is seen of one channel, less the others.
WEIGHTS = ((1, -1, -1), (-1, 1, -1), (-1, -1, 1))


@pytest.fixture
def plotter():
    made = pv.Plotter(off_screen=True, window_size=SIZE)
    yield made
    made.close()


def ball(plotter, *, at=(0, 0, 0), direction=None, **more):
    volume = soft_ball(20, direction=direction)
    volume.origin = np.add(volume.origin, at)
    looks = {"cmap": "viridis", "opacity": "linear", "show_scalar_bar": False}
    return plotter.add_vdi(volume, **{**looks, **more})


@pytest.fixture
def page(open_page):
    return open_page(SMALL)


def give(page, plotter):
    """Show a plotter, and its scene, of which nothing is left out, in a page."""
    plotter.show(auto_close=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error", VDIWarning)
        scene = scene_of(plotter, "the page")
    show_scene(page, scene)
    return scene


def shot(page, size=SIZE):
    """The page's picture from the view it is in, premultiplied RGBA, int."""
    return picture(page, size).astype(int)


def shot_over_white(page, size=SIZE):
    seen = shot(page, size)
    return seen[..., :3] + (255 - seen[..., 3:])


def assert_as_vtk(page, plotter, *, mean=MEAN, ssim=SSIM):
    seen, renderer = shot(page), plotter.renderer
    bottom = 255 * np.array(renderer.GetBackground())
    top = 255 * np.array(renderer.GetBackground2()) if renderer.GetGradientBackground() else bottom
    share = ((np.arange(SIZE[1])[::-1] + 0.5) / SIZE[1])[:, None, None]
    got = seen[..., :3] + (1 - seen[..., 3:] / 255) * (share * top + (1 - share) * bottom)
    want = plotter.screenshot(return_img=True)[..., :3].astype(float)
    assert np.ptp(want) > 60
    assert np.abs(got - want).mean() <= mean
    assert structural_similarity(got, want, channel_axis=2, data_range=255) >= ssim


def meshes(plotter):
    """Before, behind and through a VDI; colours of points and of cells; smooth and flat."""
    ball(plotter)
    plotter.add_mesh(pv.Sphere(radius=0.4, center=(1.2, 0.9, 0.9)), color="tomato")
    torus = pv.ParametricTorus(ringradius=1.4, crosssectionradius=0.3).translate((-1, -1, -1))
    torus["x"] = torus.points[:, 0]
    looks = {"cmap": "coolwarm", "show_scalar_bar": False}
    plotter.add_mesh(torus, scalars="x", **looks, smooth_shading=True)
    box = pv.Box((-0.2, 1.3, -0.2, 1.3, -0.2, 1.3), level=2).cast_to_unstructured_grid()
    box.cell_data["c"] = np.arange(box.n_cells) % 7
    plotter.add_mesh(box, scalars="c", **looks)
    turns = np.linspace(0, 12, 60)
    spiral = np.stack([1.4 * np.cos(turns), 1.4 * np.sin(turns), turns / 5 - 1], 1)
    plotter.add_mesh(pv.lines_from_points(spiral), color="gold")
    plotter.add_points(np.random.default_rng(0).normal(size=(30, 3)), color="red", point_size=7)
    plotter.add_mesh(pv.Cube(center=(-1, 1, 0)).extract_all_edges(), color="k")


def test_vdis_apart_and_a_mesh_between_them_are_drawn_as_vtk_draws_them(plotter, page):
    ball(plotter, at=(0.2, 0.3, 1.6), cmap="hot", opacity=[0, 0.6, 0.9])
    actor = ball(plotter, at=(-0.2, -0.3, -1.6))
    plotter.add_mesh(pv.Sphere(radius=0.9), color="g", lighting=False)
    plotter.show(auto_close=False)
    actor.rotate_z(30)
    actor.scale = (1, 1.4, 1)
    actor.opacity_multiplier = 2
    plotter.enable_parallel_projection()
    plotter.view_xy()
    give(page, plotter)
    assert_as_vtk(page, plotter, mean=0.3)
    look_from_behind(page)
    plotter.view_xy(negative=True)
    plotter.render()
    assert_as_vtk(page, plotter, mean=0.3)


def test_opaque_things_hide_a_vdi_and_are_hidden_where_they_are(plotter, page):
    """Three discs without light along one ray, in a VDI that is clipped and opaque."""
    actor = ball(plotter, opacity=[1, 1], cmap=["white", "white"])
    plane = vtkPlane()
    plane.SetOrigin(0, 0, 0.3)
    plane.SetNormal(0, 0, -1)
    actor.mapper.AddClippingPlane(plane)
    for x, z, color in ((-0.6, 0.4, "r"), (0, 0.2, "g"), (0.6, -1.5, "b")):
        disc = pv.Disc(center=(x, 0, z), inner=0, outer=0.2)
        plotter.add_mesh(disc, color=color, lighting=False)
    plotter.view_xy()
    plotter.set_background("k")
    give(page, plotter)
    # Before the clipped front, behind it by 0.1, and behind all; then seen from there
    assert seen(page) == [True, False, False]
    look_from_behind(page)
    assert seen(page) == [False, False, True]


def look_from_behind(page):
    page.evaluate(
        """() => {
          const { position: [x, y, z], ...more } = viewer.camera;
          viewer.camera = { ...more, position: [x, y, -z] };
        }"""
    )


def seen(page):
    """Whether red, green and blue are seen, not mixed with others."""
    colors = shot(page, (81, 45))[..., :3]
    strengths = [(colors * weight).sum(axis=2).max() for weight in WEIGHTS]
    assert all(strength > 250 or strength < 5 for strength in strengths)
    return [bool(strength > 250) for strength in strengths]


def test_texts_and_scalar_bars_are_vtks_and_axes_only_in_their_view(plotter, page):
    ball(plotter, opacity=[0, 0])
    plotter.add_scalar_bar(title="Height", n_labels=3, color="k")
    plotter.add_text("A corner", position="upper_left", font_size=8, color="b")
    plotter.add_axes(viewport=(0, 0, 0.4, 0.6), color="k")
    plotter.show(auto_close=False)
    with pytest.warns(VDIWarning, match="without axes in other views than the first$"):
        scene = scene_of(plotter, "the page")
    show_scene(page, scene)
    # 8 bits are rounded twice
    want = plotter.screenshot(return_img=True)[..., :3].astype(int)
    assert np.abs(shot_over_white(page) - want).mean() < MEAN
    assert np.abs(shot_over_white(page) - want)[: SIZE[1] // 3].max() <= 2
    corner = np.s_[SIZE[1] // 2 :, : SIZE[0] // 4]
    assert shot_over_white(page)[corner].min() < 100
    look_from_behind(page)
    assert shot_over_white(page)[corner].min() == 255
    assert shot_over_white(page)[: SIZE[1] // 3].min() < 100


@pytest.fixture
def from_disk(open_page):
    def from_disk(path, **options):
        viewport = {"width": SIZE[0], "height": SIZE[1]}
        return open_page(url=path.as_uri(), viewport=viewport, offline=True, **options)

    return from_disk


def test_export_html_writes_a_page_that_shows_the_scene(plotter, from_disk, tmp_path):
    meshes(plotter)
    plotter.remove_all_lights()
    plotter.add_light(pv.Light(light_type="headlight"))
    plotter.set_background("navy", top="white")
    before = plotter.volume.regenerate()
    plotter.camera_position = "xy"
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing is missing, and nothing deprecated
        assert plotter.vdi.export_html(tmp_path / "scene.htm") is None
    path = tmp_path / "scene.html"
    page = from_disk(path)
    page.ready()
    assert_as_vtk(page, plotter)
    assert page.evaluate("getComputedStyle(viewer).backgroundImage").startswith("linear-gradient")
    view = page.evaluate("viewer.camera")
    np.testing.assert_allclose(view["position"], plotter.camera.position)
    page.evaluate("viewer.camera = {...viewer.camera, position: [9, 0, 0]}; viewer.resetCamera()")
    assert page.evaluate("viewer.camera") == view
    assert plotter.volume.vdi is before
    assert pvdi.read(path).equals(plotter.volume.regenerate().with_precision("8-byte"))


def test_a_series_beside_a_vdi_and_a_mesh_is_whole_in_the_page_and_plays(
    plotter, from_disk, tmp_path
):
    """The first VDI is a single one, and the series no more than half as dense."""
    volumes = [soft_ball(16) for _ in range(3)]
    for step, volume in enumerate(volumes):
        volume.origin = np.add(volume.origin, (0.2 * step, 0, 0))
    camera = filling_camera((-1, 1.4, -1, 1, -1, 1), SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 255)}
    series = pvdi.generate_series(volumes, camera, SIZE, range(3), **looks)
    as_it_is = {"show_scalar_bar": False, "draw": "vdi", "regenerate": "never"}
    single = plotter.add_vdi(series[0].with_precision("8-byte"), **as_it_is)
    single.position = (0, 2.1, 0)
    actor = plotter.add_vdi(series, **as_it_is)
    actor.opacity_multiplier = 0.5
    plotter.add_mesh(pv.Sphere(radius=0.3, center=(0, 0, 1)), color="tomato", lighting=False)
    plotter.add_mesh(pv.Sphere(center=np.multiply(2, camera.position)))  # behind the eye
    plotter.camera_position = (camera.position, camera.focal_point, camera.view_up)
    plotter.camera.view_angle = camera.view_angle
    plotter.set_background("k")
    path = tmp_path / "scene.html"
    plotter.vdi.export_html(path)
    page = from_disk(path)
    page.ready()
    assert page.evaluate("viewer.series.times") == [0, 1, 2]
    for time in (0, 2):
        page.evaluate("(time) => { viewer.time = time; return viewer.ready.then(() => 0) }", time)
        actor.player.time = time
        plotter.render()
        assert_as_vtk(page, plotter)
    again = pvdi.read(path)
    assert isinstance(again, pvdi.VDISeries)
    assert again.times == series.times
