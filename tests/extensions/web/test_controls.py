"""The bar of a viewer and its settings: names, keys, fingers, the editor, links, pictures."""

import numpy as np
import pytest
from browsers import assert_axe_finds_nothing, picture
from in_node import in_node
from PIL import Image
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

#: Of pictures that are compared, and of viewers: large enough for a bar and its settings.
SIZE, ROOM = (161, 91), (480, 330)
PHONE = {"viewport": {"width": 300, "height": 420}, "has_touch": True, "is_mobile": True}

BAR = ["Reset the view", "Save the picture (PNG)", "Settings"]
CLIPS = [f"Clip {axis} {end}" for axis in "xyz" for end in ("from", "to")]
FACTORS = ["Brightness", "Opacity"]
EDITOR = [
    *(f"Point {k} of 3" for k in (1, 2, 3)),
    *("Add a point", "Remove the point", "Colours", "Level", "Window"),
]

#: What a screen reader says of what has the focus.
FOCUSED = """(() => {
  const at = viewer.shadowRoot.activeElement;
  return at && (at.getAttribute("aria-label") ?? at.labels?.[0]?.children[0].textContent ?? "");
})()"""

RANGE = (0.0, 192.0)
START = [0, 0, 0.5, 0.125, 1, 0.5]
OTHERS = [([0, 0, 0.25, 0.4, 0.5, 0, 0.75, 0.8, 1, 0.2], RANGE), ([0, 0, 0.5, 0, 1, 1], (60, 100))]


def look(points, clim=RANGE):
    """From red to yellow, with points (x, opacity) at multiples of a 64th."""
    x = np.linspace(0, 1, 65)
    colors = np.stack([np.ones(65), x, np.zeros(65)], axis=1)
    return pvdi.TransferFunction(colors, np.interp(x, points[::2], points[1::2]), clim)


@pytest.fixture(scope="module")
def kept(default_runtime):
    """A ball that keeps its values."""
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    return pvdi.generate(volume, camera, SIZE, classification="deferred", value_range=RANGE)


@pytest.fixture
def ball(data, open_page):
    """A page that shows the ball, in a viewer of this test's own."""
    page = open_page(ROOM)
    page.page.mouse.move(0, 0)
    page.load(data)
    return page


@pytest.fixture
def from_disk(open_page, tmp_path):
    """Open a page of a VDI, or of one that keeps values."""

    def from_disk(shown, *, hash_="", **options):
        how = {} if isinstance(shown, pvdi.VDI) else {"transfer_function": look(START)}
        path = shown.save(tmp_path / "a.html", **how)
        page = open_page(url=path.as_uri() + hash_, **options)
        page.ready()
        return page

    return from_disk


def opened(page):
    """Open the settings, by keys."""
    opener = page.page.get_by_label("Settings", exact=True).first
    opener.focus()
    page.page.keyboard.press("Enter")
    page.wait_for("viewer.shadowRoot.querySelector('details').open")


def pressed(page, name, *keys):
    """Press keys at the control of a name."""
    for key in keys:
        page.page.get_by_label(name, exact=True).filter(visible=True).first.press(key)


def tabbed(page):
    """Where Tab goes from the picture, until it leaves the viewer or is back, as in windows."""
    page.evaluate("viewer.shadowRoot.querySelector('canvas').focus()")
    begun, names = page.evaluate(FOCUSED), []
    while True:
        page.page.keyboard.press("Tab")
        name = page.evaluate(FOCUSED)
        if name in (None, begun):
            return names
        names.append(name)
        assert len(names) < 50


def points_of(page):
    return page.evaluate("(viewer.look.transfer ?? viewer.values.start).points")


# -- names, keys and fingers -----------------------------------------------------------------------


def test_keys_reach_and_use_every_control(ball):
    assert tabbed(ball) == BAR
    opened(ball)
    assert tabbed(ball) == [*BAR, "Settings", *FACTORS, *CLIPS, "As it was made"]
    camera = ball.evaluate("viewer.camera")
    ball.evaluate("viewer.camera = { ...viewer.camera, view_angle: 12 }")
    pressed(ball, "Reset the view", "Enter")
    assert ball.evaluate("viewer.camera") == camera
    for name in (*FACTORS, *CLIPS):
        before = ball.evaluate("viewer.look")
        pressed(ball, name, "ArrowLeft" if name.endswith("to") else "ArrowRight")
        assert ball.evaluate("viewer.look") != before, name
        assert ball.page.get_by_label(name, exact=True).get_attribute("aria-valuetext")
    assert ball.evaluate("viewer.camera") == camera  # arrows were the sliders'
    pressed(ball, "As it was made", "Enter")
    whole = {"brightness": 1, "opacity": 1, "clip": [0, 1, 0, 1, 0, 1]}
    assert ball.evaluate("viewer.look") == whole
    pressed(ball, "As it was made", "Escape")
    assert ball.evaluate(FOCUSED) == "Settings"

    # What is saved is what is seen
    ball.evaluate("viewer.background = [0.2, 0.4, 0.6], document.title = 'A ball: soft/1'")
    before = picture(ball, ROOM).astype(float)
    expected = before[..., :3] + (1 - before[..., 3:] / 255) * [51, 102, 153]
    with ball.page.expect_download() as found:
        pressed(ball, "Save the picture (PNG)", "Enter")
    assert found.value.suggested_filename == "A ball soft1.png"
    saved = np.asarray(Image.open(found.value.path()))[..., :3]
    assert np.abs(saved - expected).max() <= 2  # straight colours have eight bits, too
    ball.evaluate("viewer.setAttribute('controls', 'none')")
    assert ball.page.get_by_role("button").count() == 0


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("of", ["colours", "values"])
def test_axe_finds_nothing(of, scheme, vdi, kept, from_disk):
    options = {"viewport": PHONE["viewport"], "color_scheme": scheme, "reduced_motion": "reduce"}
    page = from_disk(vdi if of == "colours" else kept, **options)
    assert_axe_finds_nothing(page)
    opened(page)
    assert_axe_finds_nothing(page)


# -- keys that are the page's ----------------------------------------------------------------------

#: A page with shortcuts of its own, which hears keys before and after what has the focus.
LISTENING = """
window.reached = [];
for (const kind of ["keydown", "keypress", "keyup"]) {
  for (const capture of [true, false]) {
    document.addEventListener(kind, ({ key, defaultPrevented }) => {
      if (!["Shift", "Control", "Alt", "Meta"].includes(key)) {
        reached.push([kind, capture, key, defaultPrevented]);
      }
    }, { capture });
  }
}
"""

TAKEN = ["ArrowLeft", "ArrowUp", "Shift+ArrowRight", "+", "-", "r", "Shift+R"]
NOT_TAKEN = [
    *("a", "d", "1", "Escape", "Enter", "Delete", "PageDown", "Space", ",", "Shift+Enter"),
    *("Control+s", "Alt+r", "Meta+r", "Control+ArrowLeft", "Control+-"),
]


def test_keys_that_it_takes_reach_nothing_else_and_others_do(data, open_page):
    """What is typed elsewhere is none of its, and arrows that it takes do not scroll the page."""
    page = open_page(ROOM, before=LISTENING)
    page.load(data)
    page.evaluate("document.body.append(...['input', 'p'].map((n) => document.createElement(n)))")
    page.evaluate("document.querySelector('p').tabIndex = 0, document.body.style.height = '5000px'")
    canvas = "viewer.shadowRoot.querySelector('canvas')"

    def told(at, *keys):
        page.evaluate(f"{at}.focus({{ preventScroll: true }}), reached.length = 0")
        for key in keys:
            page.page.keyboard.press(key)
        return page.evaluate("reached")

    camera = page.evaluate("viewer.camera")
    for key in TAKEN:
        page.evaluate("(camera) => { viewer.camera = camera }", camera)
        if key in ("r", "Shift+R"):
            told(canvas, "ArrowLeft")
            assert page.evaluate("viewer.camera") != camera
        assert told(canvas, key) == [], key
        assert (page.evaluate("viewer.camera") == camera) == (key in ("r", "Shift+R")), key
    assert page.evaluate("scrollY") == 0
    elsewhere = "document.querySelector('p')"
    for key in NOT_TAKEN:
        assert told(canvas, key) == told(elsewhere, key) != [], key
    page.evaluate("viewer.shadowRoot.querySelector('details').open = true")
    assert told(canvas.replace("canvas", ".panel>label input"), "a") == told(elsewhere, "a")
    keys = [*"rR+-= ,.", "ArrowLeft"]
    assert told("document.querySelector('input')", *keys) == told(elsewhere, *keys)
    assert page.evaluate("document.querySelector('input').value") == "rR+-= ,."
    assert page.evaluate("viewer.camera") == camera


# -- the editor ------------------------------------------------------------------------------------


def assert_like(page, vdi, camera, most=1.0):
    expected = pvdi.render(vdi, camera, SIZE) * 255.0
    off = np.abs(page.screenshot(camera, SIZE) - expected)
    assert off.max() <= most, off.max()


def edit(page, points, clim):
    page.evaluate(
        "(transfer) => { viewer.look = { transfer }; }", {"clim": list(clim), "points": points}
    )


def test_pictures_of_values_are_those_of_render(kept, from_disk, tmp_path):
    # 8 bits, and float32 of two devices
    page, packed, turned = from_disk(kept), kept.with_precision("8-byte"), kept.camera.azimuth(20)
    for camera in (kept.camera, turned):
        assert_like(page, packed.classified(transfer_function=look(START)), camera)
    for points, clim in OTHERS:
        edit(page, points, clim)
        assert_like(page, packed.classified(transfer_function=look(points, clim)), turned)
    # Of exact values, without a look: means are looked up to a 3825th of the range
    lengths = [page.evaluate("[...viewer.values.histogram]")]
    page.load(kept.save(tmp_path / "kept.vdi", compression="deflate").read_bytes())
    lengths.append(page.evaluate("[...viewer.values.histogram]"))
    assert np.abs(np.subtract(*lengths)).sum() < 0.05 * np.sum(lengths[1])
    page.evaluate("viewer.look = {}")
    colors = page.evaluate("viewer.transferFunction.colors")
    ramp = pvdi.TransferFunction(colors, np.linspace(0, 1, 256), RANGE)
    assert_like(page, kept.classified(transfer_function=ramp), turned, 2.0)


def test_mouse_keys_and_fingers_edit_and_a_link_has_it(kept, from_disk):
    page = from_disk(kept, **PHONE)
    opened(page)
    made = picture(page, SIZE)
    assert points_of(page) == START
    assert tabbed(page) == [*BAR, "Settings", *EDITOR, *CLIPS, "As it was made"]
    page.evaluate("viewer.shadowRoot.querySelector('.panel').scrollTop = 0")
    point = page.page.get_by_role("slider", name="Point 2 of 3").bounding_box()
    x, y = point["x"] + point["width"] / 2, point["y"] + point["height"] / 2
    session = page.page.context.new_cdp_session(page.page)
    for kind, up in (("touchStart", 0), ("touchMove", 20), ("touchMove", 40)):
        at = [{"x": x, "y": y - up}]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert points_of(page)[3] == pytest.approx(0.125 + 40 / 120, abs=0.03)
    assert np.abs(picture(page, SIZE) - made.astype(float)).max() > 10
    page.page.mouse.click(x + 40, y - 60)
    assert len(points_of(page)) == 8
    pressed(page, "Point 4 of 4", "ArrowDown")
    pressed(page, "As it was made", "Enter")
    np.testing.assert_array_equal(picture(page, SIZE), made)

    pressed(page, "Point 2 of 3", "ArrowUp", "Shift+ArrowUp", "ArrowRight")
    np.testing.assert_allclose(points_of(page)[2:4], (0.51, 0.235), atol=1e-9)
    pressed(page, "Point 2 of 3", "Home")
    assert points_of(page)[2] == 0  # not beyond its neighbour
    pressed(page, "Point 2 of 3", "+")
    assert page.evaluate(FOCUSED) == "Point 3 of 4"
    for count in (4, 3, 2, 1):  # the last one stays
        pressed(page, f"Point {min(count, 3)} of {count}", "Delete")
    assert len(points_of(page)) == 2
    pressed(page, "Window", "ArrowLeft")
    pressed(page, "Level", "ArrowRight")
    clim = page.evaluate("viewer.look.transfer.clim")
    np.testing.assert_allclose(clim, (1.44, 192.48))  # by steps of 1/200
    page.page.get_by_label("Colours").last.select_option("viridis")
    assert page.evaluate("viewer.transferFunction.colors[0]") != [1, 0, 0]

    page.wait_for("location.hash.includes('viridis')")
    seen, link = picture(page, SIZE), page.evaluate("location.hash")
    other = from_disk(kept, hash_=link)
    assert other.evaluate("viewer.look") == page.evaluate("viewer.look")
    np.testing.assert_array_equal(picture(other, SIZE), seen)
    other.evaluate("location.hash = ''")
    other.wait_for("!viewer.look.transfer")


def test_colour_maps_are_those_of_matplotlib():
    matplotlib = pytest.importorskip("matplotlib")
    maps = in_node(
        """async () => {
          const { COLORMAPS, colorsOf } = await from("colormaps.js");
          return COLORMAPS.map((name) => [name, colorsOf(name)]);
        }"""
    )
    for name, colors in maps:
        expected = matplotlib.colormaps[name](np.linspace(0, 1, 256))[:, :3]
        assert np.abs(np.array(colors) - expected).max() <= 2.01 / 255, name


# -- links -----------------------------------------------------------------------------------------

INFOS = """
window.infos = [];
console.info = (text) => infos.push(text);
"""


def test_a_link_shows_what_was_seen_and_the_address_is_followed(vdi, from_disk):
    page = from_disk(vdi, hash_="#other=1", before=INFOS)
    home = page.evaluate("viewer.camera")
    page.evaluate(
        """() => {
          viewer.camera = { ...viewer.camera, position: [2.1, 1 / 3, -1.7], view_angle: 41 };
          viewer.look = { brightness: 1.5, opacity: 2, clip: [0.1, 1, 0, 1, 0, 0.7] };
        }"""
    )
    page.wait_for("location.hash.startsWith('#other=1&view=') && location.hash.includes('clip')")
    link = page.evaluate("location.hash")
    other = from_disk(vdi, hash_=link, before=INFOS)
    assert other.evaluate("viewer.look.clip") == [0.1, 1, 0, 1, 0, 0.7]
    np.testing.assert_array_equal(picture(other, SIZE), picture(page, SIZE))
    assert other.evaluate("location.hash") == link
    change = "location.hash.replace(encodeURIComponent('\"opacity\":2'), '%22opacity%22%3A3')"
    other.evaluate(f"location.hash = {change}")
    other.wait_for("viewer.look.opacity === 3")
    other.evaluate("location.hash = '#elsewhere'")  # a place in the page, say
    other.evaluate("location.hash = '#view={}'")
    other.wait_for("infos.length === 1")
    assert "is not followed: A camera's position" in other.evaluate("infos[0]")
    assert other.evaluate("viewer.look.opacity") == 3
    other.evaluate("location.hash = ''")
    other.wait_for("viewer.look.opacity === 1")
    assert other.evaluate("viewer.camera") == home
