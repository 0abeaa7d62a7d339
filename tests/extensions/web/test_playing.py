"""Series and sets in a page: each step, or view, drawn as Python draws it.

javascript/player.test.js has which is shown when, and what is said of wrong ones.
"""

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.sets.generate import orbit, spread
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (97, 55)
N = 9
VIEWS = 14


def grid():
    return np.meshgrid(*(np.linspace(-1, 1, 20),) * 3, indexing="ij")


@pytest.fixture(scope="module")
def path(default_runtime, tmp_path_factory):
    """The file of a ball that moves."""
    z, y, x = grid()

    def ball(i):
        centre = 0.1 * i - 0.4
        return pvdi.Volume((1 - np.sqrt((x - centre) ** 2 + y**2 + z**2)).clip(0).astype("f4"))

    camera = filling_camera(ball(0).bounds, SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 1)}
    times = [0.5 * i for i in range(N)]
    made = pvdi.generate_series(map(ball, range(N)), camera, SIZE, times, **looks)
    path = tmp_path_factory.mktemp("series") / "ball.vdis"
    return made.save(path, precision="8-byte", compression="deflate")


@pytest.fixture(scope="module")
def series(path):
    return pvdi.read(path)


@pytest.fixture(scope="module")
def set_path(default_runtime, tmp_path_factory):
    """The file of lumps that are seen from all sides."""
    z, y, x = grid()
    lumps = np.sin(5 * x) * np.cos(4 * y + 1) * np.sin(5 * z + 2)
    volume = pvdi.Volume(((1 + lumps) * (x**2 + y**2 + z**2 < 0.8)).astype("f4"))
    around = filling_camera(volume.bounds, SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 2)}
    views = orbit(around, volume.bounds, spread(VIEWS, (0, 0, 1), 180))
    made = pvdi.generate_set(volume, views, SIZE, max_supersegments=6, **looks)
    return made.save(tmp_path_factory.mktemp("sets") / "lumps.vdiset", compression="deflate")


@pytest.fixture(scope="module")
def vdis(set_path):
    read = pvdi.read(set_path)
    read.blend = 0
    return read


def shown_from(open_page, path):
    """Open a page that shows a file."""
    return open_page(SIZE, attributes=f'src="{path.name}"', files={path.name: path.read_bytes()})


# -- series ----------------------------------------------------------------------------------------


def test_it_plays_by_slider_button_and_keys(series, path, open_page):
    """Keys of its own and no others; and it turns meanwhile."""
    page = shown_from(open_page, path)
    page.ready()
    assert page.evaluate("[viewer.series.times, viewer.series.length]") == [list(series.times), N]
    turned = series.camera.azimuth(40)
    page.assert_shows(series[0], SIZE, turned)
    page.evaluate("viewer.time = 99")
    page.ready()
    page.assert_shows(series[N - 1], SIZE, turned)  # the view stays
    bar = page.page.locator("vdi-viewer .controls")
    slider, button = bar.locator("input"), bar.locator("button")
    slider.fill("4")
    page.wait_for("viewer.time === 2")
    assert bar.locator("output").inner_text() == "2"
    canvas, keyboard = page.page.locator("vdi-viewer canvas").first, page.page.keyboard
    canvas.focus()
    for key in ("Period", "Period", "Comma", "a", "Control+Comma"):
        keyboard.press(key)
    assert page.evaluate("[viewer.time, viewer.playing]") == [2.5, False]
    slider.focus()
    keyboard.press("ArrowLeft")
    assert page.evaluate("viewer.time") == 2
    keyboard.press("Space")
    assert page.evaluate("viewer.playing")
    assert button.get_attribute("aria-label") == "Pause"
    turned = series.camera.azimuth(60)
    page.evaluate("(position) => { viewer.camera = { ...viewer.camera, position }; }",
                  list(turned.position))  # fmt: skip
    button.click()
    page.ready()
    assert not page.evaluate("viewer.playing")
    page.assert_shows(series[series.nearest(page.evaluate("viewer.time"))], SIZE, turned)
    assert slider.input_value() == str(page.evaluate("viewer.series.nearest(viewer.time)"))
    with pytest.raises(Exception, match="is a number"):
        page.evaluate("() => { viewer.time = 'x'; }")


def test_a_page_plays_from_disk_and_is_read_as_files_are(series, open_page, tmp_path):
    """It stands still for who asks for less motion, also in the midst of it."""
    path = series.save(tmp_path / "a ball.html", autoplay=True, background=(0.1, 0.2, 0.3))
    page = open_page(url=path.as_uri(), viewport={"width": 160, "height": 90})
    page.wait_for("viewer.series?.complete && viewer.playing && viewer.time > 1")
    assert page.page.title() == "a ball"
    page.page.emulate_media(reduced_motion="reduce")
    page.wait_for("!viewer.playing")
    page.evaluate("viewer.time = 4")
    page.assert_shows(series[8], SIZE, series.camera)
    assert all(a.equals(b) for a, b in zip(pvdi.read(path), series, strict=True))


# -- sets ------------------------------------------------------------------------------------------


def test_each_view_is_drawn_by_the_vdi_nearest_to_it(vdis, set_path, open_page, tmp_path):
    page = shown_from(open_page, set_path)
    page.ready()
    np.testing.assert_allclose(page.evaluate("viewer.camera.position"), vdis.camera.position)
    page.wait_for(f"viewer.set.length === {VIEWS}")  # the rest is read behind the first
    assert page.evaluate("[viewer.series, viewer.time, viewer.playing]") == [None, None, False]
    seen = set()
    for view in orbit(vdis.camera, vdis.bounds, spread(5, (0, 0, 1), 180)):
        page.assert_shows(vdis, SIZE, view)
        seen.add(vdis.nearest(view))
        assert page.evaluate("viewer.set.nearest") == vdis.nearest(view)
    assert len(seen) > 3
    # Of two eyes in one line the nearer one's distance counts as well
    near = vdis.camera.replace(position=0.5 * np.add(vdis.camera.position, vdis.camera.focal_point))
    page.assert_shows(vdis, SIZE, near)
    assert page.page.locator("vdi-viewer .controls").is_hidden()
    with pytest.raises(Exception, match="no series"):
        page.evaluate("viewer.play()")

    html = pvdi.read(set_path).save(tmp_path / "lumps.html", title="Lumps", background=(1, 1, 1))
    again = pvdi.read(html)
    assert isinstance(again, pvdi.VDISet)
    assert all(one.equals(other) for one, other in zip(again, vdis, strict=True))
    shown = open_page(url=html.as_uri())
    shown.wait_for("viewer.set?.length === 14")
    shown.assert_shows(vdis, SIZE, vdis.camera.azimuth(100))
