"""``plotter.vdi.export_html``: series and sets in a page; PyVista is not patched."""

import numpy as np
import pytest
import pyvista as pv
from browsers import picture
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

pytestmark = pytest.mark.gl

SIZE = (161, 91)
N = 4
LOOKS = {"cmap": "viridis", "opacity": "linear", "clim": (0, 255)}
#: What draws VDIs as they are, whatever the view.
AS_IT_IS = {"show_scalar_bar": False, "draw": "vdi", "regenerate": "never"}
#: Of 255, as in test_scene.py.
MEAN = 0.6


@pytest.fixture
def plotter():
    made = pv.Plotter(off_screen=True, window_size=SIZE)
    made.set_background("black")
    yield made
    made.close()


@pytest.fixture
def from_disk(open_page, tmp_path):
    """Write a plotter's page, and open it."""

    def from_disk(plotter, size=SIZE):
        path = tmp_path / "scene.html"
        plotter.vdi.export_html(path)
        viewport = {"width": size[0], "height": size[1]}
        return open_page(url=path.as_uri(), viewport=viewport, offline=True)

    return from_disk


def ball(step):
    """A ball that moves."""
    volume = soft_ball(16)
    volume.origin = np.add(volume.origin, (0.2 * step, 0, 0))
    return volume


@pytest.fixture(scope="module")
def series(default_runtime):
    camera = filling_camera((-1, 1.6, -1, 1, -1, 1), SIZE)
    return pvdi.generate_series([ball(k) for k in range(N)], camera, SIZE, range(N), **LOOKS)


def look_from(plotter, view):
    plotter.camera.position, plotter.camera.focal_point = view.position, view.focal_point
    plotter.camera.up, plotter.camera.view_angle = view.view_up, view.view_angle
    plotter.camera_set = True


def assert_as_plotter(page, plotter):
    plotter.render()
    want = plotter.screenshot(return_img=True)[..., :3].astype(float)
    assert np.ptp(want) > 60
    assert np.abs(picture(page, SIZE)[..., :3] - want).mean() <= MEAN


def test_a_series_is_whole_in_the_page_and_plays(plotter, from_disk, series, tmp_path):
    """The first VDI is a single one, and the series no more than half as dense."""
    single = plotter.add_vdi(series[0].with_precision("8-byte"), **AS_IT_IS)
    single.position = (0, 2.1, 0)
    actor = plotter.add_vdi(series, **AS_IT_IS)
    actor.opacity_multiplier = 0.5
    plotter.remove_all_lights()
    plotter.add_light(pv.Light(light_type="headlight"))
    plotter.add_mesh(pv.Sphere(radius=0.3, center=(0, 0, 1)), color="tomato")
    look_from(plotter, series.camera)
    page = from_disk(plotter)
    page.ready()
    assert page.evaluate("viewer.series.times") == list(range(N))
    for time in (0, N - 1):
        page.evaluate("(time) => { viewer.time = time; return viewer.ready.then(() => 0) }", time)
        actor.time = time
        assert_as_plotter(page, plotter)
    assert page.page.locator("vdi-viewer .controls").is_visible()
    again = pvdi.read(tmp_path / "scene.html")
    assert isinstance(again, pvdi.VDISeries)
    assert again.times == series.times


def test_subplots_are_refused(tmp_path):
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), window_size=SIZE)
    with pytest.raises(pvdi.InvalidArgumentError, match="one renderer, and this plotter has 2"):
        plotter.vdi.export_html(tmp_path / "scene.html")
    plotter.close()
    assert not list(tmp_path.iterdir())


def test_a_scene_without_vdis_is_a_page_too(plotter, from_disk):
    plotter.remove_all_lights()
    plotter.add_light(pv.Light(light_type="headlight"))
    plotter.add_mesh(pv.Sphere(), color="tomato")
    hidden = plotter.add_vdi(soft_ball(8), show_scalar_bar=False)
    hidden.visibility = False
    page = from_disk(plotter)
    page.ready()
    assert_as_plotter(page, plotter)
