"""Pages with values: the editor of their transfer function, and what it makes of the picture."""

import json

import numpy as np
import pytest
from browsers import SITE, assert_axe_finds_nothing, picture
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.options import declared
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (160, 90)
VIEWPORT = {"width": 420, "height": 480}
PANEL = "Transfer function and clipping"
RANGE = (0.0, 192.0)
PRESETS = ["Ramp", "Soft", "Peak", "Step"]
#: A few milliseconds are expected of each step.
PATIENCE = 20_000


def look(points, clim=RANGE):
    """From red to yellow, with points (x, opacity) at multiples of a 64th."""
    x = np.linspace(0, 1, 65)
    colors = np.stack([np.ones(65), x, np.zeros(65)], axis=1)
    return pvdi.TransferFunction(colors, np.interp(x, points[::2], points[1::2]), clim)


START = [0, 0, 0.5, 0.125, 1, 0.5]
OTHERS = [([0, 0, 0.25, 0.4, 0.5, 0, 0.75, 0.8, 1, 0.2], RANGE), ([0, 0, 0.5, 0, 1, 1], (60, 100))]


@pytest.fixture(scope="module")
def kept(default_runtime):
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    return pvdi.generate(volume, camera, SIZE, classification="deferred", value_range=RANGE)


@pytest.fixture
def opened(kept, tmp_path, open_page):
    """A page of the VDI, from disk, with the editor open."""

    def opened(hash_="", **options):
        path = kept.save(tmp_path / "a.html", transfer_function=look(START))
        page = open_page(url=path.as_uri() + hash_, **{"viewport": VIEWPORT, **options})
        page.page.set_default_timeout(PATIENCE)
        page.ready()
        opener = page.page.get_by_role("button", name=PANEL)
        opener.focus()  # which wakes the bar for a finger, too
        opener.press("Enter")
        return page

    return opened


def focused(page):
    """The name of what has the focus in the viewer."""
    return page.evaluate(
        """(() => {
          const at = viewer.shadowRoot.activeElement;
          return at && (at.getAttribute("aria-label") ?? at.labels?.[0]?.children[0].textContent);
        })()"""
    )


def points_of(page):
    return page.evaluate("(viewer.look.transfer ?? viewer.values.start).points")


def edit(page, points, clim):
    page.evaluate(
        "(transfer) => { viewer.look = { transfer }; }", {"clim": list(clim), "points": points}
    )


def assert_like(page, vdi, camera, most=1.0):
    expected = pvdi.render(vdi, camera, SIZE) * 255.0
    off = np.abs(page.screenshot(camera, SIZE) - expected)
    assert off.max() <= most, off.max()


def test_pictures_are_those_of_render(kept, opened):
    # As assert_shows has it: 8 bits, and float32 of two devices
    page, packed, turned = opened(), kept.with_precision("8-byte"), kept.camera.azimuth(20)
    for camera in (kept.camera, turned):
        assert_like(page, packed.classified(transfer_function=look(START)), camera)
    for points, clim in OTHERS:
        edit(page, points, clim)
        shown = packed.classified(transfer_function=look(points, clim))
        assert_like(page, shown, turned)


@pytest.mark.slow
def test_exact_values_are_shown_and_a_file_without_a_look_has_a_ramp(kept, open_page, tmp_path):
    page = open_page(SIZE)
    page.load(kept.save(tmp_path / "kept.vdi").read_bytes())
    assert points_of(page) == [0, 0, 1, 1]
    assert page.evaluate("viewer.values.range") == list(RANGE)
    lengths = page.evaluate("[...viewer.values.histogram]")
    places = (np.arange(len(lengths)) + 0.5) / len(lengths)
    mean = np.average(kept.mean, weights=kept.steps)
    assert np.average(places, weights=lengths) == pytest.approx(mean, abs=0.5 / len(lengths))
    # Means are looked up to a 3825th of the range, spreads to a 16th of themselves
    edit(page, *OTHERS[0])
    x = np.linspace(0, 1, 256)
    colors = page.evaluate("viewer.transferFunction.colors")
    opacities = np.interp(x, OTHERS[0][0][::2], OTHERS[0][0][1::2])
    told = pvdi.TransferFunction(colors, opacities, RANGE)
    assert_like(page, kept.classified(transfer_function=told), kept.camera, 2.0)


@pytest.mark.slow
def test_a_mouse_adds_and_drags_points_and_undo_goes_back(opened):
    page = opened()
    mouse, before = page.page.mouse, picture(page, SIZE)
    assert points_of(page) == START
    point = page.page.get_by_role("slider", name="Point 2 of 3").bounding_box()
    x, y = point["x"] + point["width"] / 2, point["y"] + point["height"] / 2
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 9, y - 30, steps=3)
    mouse.up()
    moved = points_of(page)
    assert len(moved) == 6
    assert moved[2] > 0.5
    assert moved[3] == pytest.approx(0.125 + 30 / 120, abs=0.02)
    assert np.abs(picture(page, SIZE) - before.astype(float)).max() > 10
    mouse.click(x + 40, y - 60)
    assert len(points_of(page)) == 8
    for _ in range(2):
        page.page.get_by_role("button", name="Undo").click()
    assert "transfer" not in page.evaluate("viewer.look")
    np.testing.assert_array_equal(picture(page, SIZE), before)


@pytest.mark.slow
def test_a_finger_drags_a_point_and_chooses_a_preset(opened):
    page = opened(has_touch=True, is_mobile=True)
    before = picture(page, SIZE)
    point = page.page.get_by_role("slider", name="Point 2 of 3").bounding_box()
    x, y = point["x"] + point["width"] / 2, point["y"] + point["height"] / 2
    session = page.page.context.new_cdp_session(page.page)
    for kind, up in (("touchStart", 0), ("touchMove", 20), ("touchMove", 40)):
        session.send(
            "Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y - up}]}
        )
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert points_of(page)[3] == pytest.approx(0.125 + 40 / 120, abs=0.03)
    assert np.abs(picture(page, SIZE) - before.astype(float)).max() > 10
    page.page.get_by_role("button", name="Opacity: Ramp").tap()
    assert points_of(page) == [0, 0, 1, 1]


def test_keys_do_all_of_it(opened):
    page = opened()

    def press(name, *keys, role="slider"):
        for key in keys:
            page.page.get_by_role(role, name=name, exact=True).press(key)

    press("Point 2 of 3", "ArrowUp", "Shift+ArrowUp", "ArrowRight")
    np.testing.assert_allclose(points_of(page)[2:4], (0.51, 0.235), atol=1e-9)
    press("Point 2 of 3", "+")
    assert len(points_of(page)) == 8
    assert focused(page) == "Point 3 of 4"
    press("Point 3 of 4", "Delete")
    assert len(points_of(page)) == 6
    for _ in range(5):
        page.page.keyboard.press("Control+z")
    assert "transfer" not in page.evaluate("viewer.look")
    press("Window", "ArrowLeft")
    press("Level", "ArrowRight")
    low, high = page.evaluate("viewer.look.transfer.clim")
    assert high - low < RANGE[1]
    page.page.get_by_label("Colours").last.select_option("viridis")
    press("Opacity: Peak", "Enter", role="button")
    assert page.evaluate("viewer.look.transfer.cmap") == "viridis"
    assert page.evaluate("viewer.transferFunction.colors[0]") != [1, 0, 0]
    press("As it was made", "Enter", role="button")
    assert "transfer" not in page.evaluate("viewer.look")
    page.page.get_by_role("slider", name="Point 1 of 3").focus()
    names = []
    while not names or names[-1] not in (None, "Clip x from"):
        page.page.keyboard.press("Tab")
        names.append(focused(page))
    assert names == [
        *("Point 2 of 3", "Point 3 of 3", "Add a point", "Remove the point", "Undo"),
        *("Colours", "Level", "Window", *(f"Opacity: {name}" for name in PRESETS)),
        "Clip x from",
    ]


@pytest.mark.slow
def test_a_link_has_the_transfer_function(opened):
    page = opened()
    page.page.get_by_label("Colours").last.select_option("hot")
    page.page.get_by_role("button", name="Opacity: Step").click()
    page.wait_for("location.hash.includes('points')")
    seen, link = picture(page, SIZE), page.evaluate("location.hash")
    other = opened(link)
    assert other.evaluate("viewer.look") == page.evaluate("viewer.look")
    np.testing.assert_array_equal(picture(other, SIZE), seen)
    other.evaluate("location.hash = ''")
    other.wait_for("!viewer.look.transfer")


def test_colour_maps_are_those_of_matplotlib(open_page):
    matplotlib = pytest.importorskip("matplotlib")
    page = open_page()
    maps = page.evaluate(
        f"""async () => {{
          const {{ COLORMAPS, colorsOf }} = await import("{SITE}colormaps.js");
          return JSON.stringify(COLORMAPS.map((name) => [name, colorsOf(name)]));
        }}"""
    )
    places = np.linspace(0, 1, 256)
    for name, colors in json.loads(maps):
        expected = matplotlib.colormaps[name](places)[:, :3]
        assert np.abs(np.array(colors) - expected).max() <= 2.01 / 255, name


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.slow
def test_axe_finds_nothing(scheme, opened):
    assert_axe_finds_nothing(opened(color_scheme=scheme))


def test_a_page_takes_the_words_of_classified():
    from pyvista_vdi.extensions.web import _LOOK
    from pyvista_vdi.model.classification import Classification

    light = {"shade", "ambient", "diffuse", "specular", "specular_power"}
    assert set(declared(Classification)) - set(_LOOK) - light == {
        *("scalars", "preference", "interpolation", "blending"),
    }
