"""The bar of a viewer: names, keys, fingers, and what each control does to the picture."""

import io
import json

import numpy as np
import pytest
from browsers import assert_axe_finds_nothing, picture
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.web.page import page as page_of
from pyvista_vdi.extensions.web.placing import thinned

#: Of pictures that are compared, and of viewers: large enough for a bar.
SIZE, ROOM = (161, 91), (420, 340)

BAR = [
    *("Reset the view", "View and marks", "Brightness, opacity and clipping"),
    *("Save the picture (PNG)", "Full screen", "Keys and gestures"),
]
VIEWS = [
    *("Seen from +x", "Seen from \u2212x", "Seen from +y", "Seen from \u2212y"),
    *("Seen from +z", "Seen from \u2212z", "Seen iso, from between the axes"),
]
MARKS = ["Axes", "Orientation cube", "Bounds", "Colour bar", "Position under the pointer"]
SLIDERS = [
    *("Brightness", "Opacity"),
    *(f"Clip {axis} {end}" for axis in "xyz" for end in ("from", "to")),
]

#: The axis that a view is along.
SEEN_FROM = """(() => {
  const { position, focal_point } = viewer.camera;
  const arm = position.map((x, k) => x - focal_point[k]), length = Math.hypot(...arm);
  const k = arm.findIndex((x) => Math.abs(x) > 0.999 * length);
  return k < 0 ? "between" : `${arm[k] > 0 ? "+" : "-"}${"xyz"[k]}`;
})()"""

#: What a screen reader says of what has the focus.
FOCUSED = """(() => {
  const at = viewer.shadowRoot.activeElement;
  return at && (at.getAttribute("aria-label") ?? at.closest("label")?.textContent ?? "");
})()"""


@pytest.fixture
def ball(data, open_page):
    """A page that shows the ball, in a viewer of this test's own."""
    page = open_page(ROOM)
    page.page.mouse.move(0, 0)
    page.evaluate("(bytes) => viewer.load(Uint8Array.from(bytes)).then(() => true)", list(data))
    return page


def pressed(page, name, *keys):
    """Press keys at the control of a name."""
    for key in keys:
        page.page.get_by_label(name, exact=True).filter(visible=True).first.press(key)


def tabbed(page):
    """Where Tab goes from the picture, until it leaves the viewer or is back, as in windows."""
    page.evaluate("viewer.shadowRoot.querySelector('canvas').focus()")
    picture, names = page.evaluate(FOCUSED), []
    while True:
        page.page.keyboard.press("Tab")
        name = page.evaluate(FOCUSED)
        if name in (None, picture):
            return names
        names.append(name)
        assert len(names) < 50


def nameless(page):
    """Parts of the accessibility tree that are used and have no name, or the same as another."""
    session = page.page.context.new_cdp_session(page.page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    kinds = {"button", "slider", "checkbox", "spinbutton", "combobox", "group", "image", "Canvas"}
    seen = [node for node in nodes if not node["ignored"] and node["role"]["value"] in kinds]
    assert seen
    return [node["role"]["value"] for node in seen if not node.get("name", {}).get("value")]


def test_keys_reach_every_control_and_each_has_a_name(ball):
    assert tabbed(ball) == BAR
    assert not nameless(ball)
    for opener, inside in (
        ("View and marks", [*VIEWS, *MARKS]),
        ("Brightness, opacity and clipping", [*SLIDERS, "As it was made"]),
        ("Keys and gestures", ["Keys and gestures"]),
    ):
        pressed(ball, opener, "Enter")
        assert tabbed(ball) == [*BAR, *inside]
        assert not nameless(ball)
        ball.page.get_by_label(opener, exact=True).first.focus()
        ball.page.keyboard.press("Escape")
    assert tabbed(ball) == BAR


def test_keys_use_every_control(vdi, ball):
    camera = ball.evaluate("viewer.camera")
    centre = np.reshape(vdi.bounds, (3, 2)).mean(axis=1)
    pressed(ball, "View and marks", "Enter")
    directions = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    towards = [np.multiply(sign, one) for one in directions for sign in (1, -1)] + [np.ones(3)]
    for name, direction in zip(VIEWS, towards, strict=True):
        pressed(ball, name, "Enter")
        seen = ball.evaluate("viewer.camera")
        arm = np.subtract(seen["position"], seen["focal_point"])
        np.testing.assert_allclose(seen["focal_point"], centre, atol=1e-9)
        length = np.linalg.norm(direction) * np.linalg.norm(arm)
        assert direction @ arm == pytest.approx(length, rel=1e-12), name
    marks = "viewer.shadowRoot.querySelector('canvas:not([role]):not([hidden])') !== null"
    for name in MARKS[:4]:
        pressed(ball, name, "Space")
        ball.wait_for(marks)
        pressed(ball, name, "Space")
        ball.wait_for(f"!({marks})")
    pressed(ball, "Axes", "Escape")
    assert ball.evaluate(FOCUSED) == "View and marks"
    pressed(ball, "Reset the view", "Enter")
    assert ball.evaluate("viewer.camera") == camera

    pressed(ball, "View and marks", "Enter")
    pressed(ball, "Orientation cube", "Space")
    x, y = 47, ROOM[1] - 47
    for face, place in (("+z", (x, y - 18)), ("+x", (x - 15, y + 9)), ("+y", (x + 15, y + 9))):
        pressed(ball, "View and marks", *(["Enter"] if face != "+z" else []))
        pressed(ball, "Seen iso, from between the axes", "Enter")
        ball.page.mouse.click(*place)
        assert ball.evaluate(SEEN_FROM) == face
    ball.page.mouse.click(200, 200)  # beside it
    assert ball.evaluate(SEEN_FROM) == "+y"
    pressed(ball, "Reset the view", "Enter")

    pressed(ball, "Brightness, opacity and clipping", "Enter")
    for name in SLIDERS:
        before = ball.evaluate("viewer.look")
        pressed(ball, name, "ArrowLeft" if name.endswith("to") else "ArrowRight")
        assert ball.evaluate("viewer.look") != before, name
        assert ball.page.get_by_label(name, exact=True).get_attribute("aria-valuetext")
    assert ball.evaluate("viewer.camera") == camera  # arrows were the sliders'
    pressed(ball, "As it was made", "Enter")
    whole = {"brightness": 1, "opacity": 1, "clip": [0, 1, 0, 1, 0, 1]}
    assert ball.evaluate("viewer.look") == whole

    canvas = ball.page.locator("canvas[role]")
    canvas.press("?")
    keys = ball.page.get_by_role("group", name="Keys and gestures")
    assert "back to the first view" in keys.inner_text()
    canvas.press("Escape")
    assert keys.count() == 0
    canvas.press("f")
    ball.wait_for("document.fullscreenElement === viewer")
    pressed(ball, "Full screen", "Enter")
    ball.wait_for("document.fullscreenElement === null")


def test_a_saved_picture_is_what_is_seen(vdi, ball):
    ball.evaluate("viewer.background = [0.2, 0.4, 0.6], document.title = 'A ball: soft/1'")
    before = picture(ball, ROOM).astype(float)
    expected = before[..., :3] + (1 - before[..., 3:] / 255) * [51, 102, 153]
    with ball.page.expect_download() as found:
        pressed(ball, "Save the picture (PNG)", "Enter")
    assert found.value.suggested_filename == "A ball soft1.png"
    saved = np.asarray(Image.open(found.value.path()))
    assert saved.shape[1::-1] == ROOM
    assert (saved[..., 3] == 255).all()
    assert np.abs(saved[..., :3] - expected).max() <= 2  # straight colours have eight bits, too

    # The same by the right button, which moves the view when it is dragged
    ball.page.mouse.click(100, 100, button="right")
    assert ball.evaluate(FOCUSED) == "Save the picture (PNG)"
    with ball.page.expect_download():
        ball.page.keyboard.press("Enter")
    assert ball.page.get_by_role("group", name="Picture", exact=True).count() == 0
    camera = ball.evaluate("viewer.camera")
    ball.page.mouse.move(100, 100)
    ball.page.mouse.down(button="right")
    ball.page.mouse.move(100, 130)
    ball.page.mouse.up(button="right")
    assert ball.evaluate("viewer.camera") != camera
    assert ball.page.get_by_role("group", name="Picture", exact=True).count() == 0


def test_looks_are_drawn_as_render_draws_them(vdi, ball):
    turned = vdi.camera.azimuth(25)
    own = ball.screenshot(turned, SIZE).astype(float)

    def off(expected):
        return np.abs(ball.screenshot(turned, SIZE) - expected).max()

    ball.evaluate("viewer.look = { opacity: 2.5 }")
    dense = thinned(vdi, 2.5)
    assert np.abs(pvdi.render(dense, turned, SIZE) * 255 - own).max() > 10
    assert off(pvdi.render(dense, turned, SIZE) * 255) <= 1

    ball.evaluate("viewer.look = { brightness: 1.7 }")
    exact = pvdi.render(vdi, turned, SIZE) * 255
    bright = exact.copy()
    bright[..., :3] = np.minimum(1.7 * exact[..., :3], exact[..., 3:])
    assert off(bright) <= 1

    ball.evaluate("viewer.look = { clip: [0.25, 1, 0, 0.6, 0, 1] }")
    low, high = np.reshape(vdi.bounds, (3, 2)).T
    x, y = low[0] + 0.25 * (high - low)[0], low[1] + 0.6 * (high - low)[1]
    planes = [(x, 0, 0, 1, 0, 0), (0, y, 0, 0, -1, 0)]
    cut = pvdi.render(vdi, turned, SIZE, clipping_planes=planes) * 255
    assert np.abs(cut - own).max() > 10
    assert off(cut) <= 1
    ball.evaluate("viewer.look = {}")
    np.testing.assert_array_equal(ball.screenshot(turned, SIZE), own)  # to the last bit


@pytest.mark.parametrize(
    ("look", "why"),
    [
        ("{ brightness: 0 }", "brightness is a factor from 1/16 to 16; got 0"),
        ("{ opacity: NaN }", "opacity is a factor"),
        ("{ clip: [0, 1] }", "clip is six finite numbers"),
        ("{ clip: [0.6, 0.5, 0, 1, 0, 1] }", "from a lower to a higher share"),
    ],
)
def test_looks_that_are_none_are_refused(look, why, open_page):
    page = open_page(SIZE)
    told = page.evaluate(
        f"() => {{ try {{ viewer.look = {look} }} catch (e) {{ return String(e) }} }}"
    )
    assert told.startswith("TypeError")
    assert why in told


@pytest.mark.parametrize("parallel", [False, True])
def test_the_point_under_the_pointer_has_half_of_what_is_seen_before_it(parallel, vdi, ball):
    lens = "parallel_scale: 1.2" if parallel else "view_angle: viewer.camera.view_angle"
    x, y = ROOM[0] // 2 + 20, ROOM[1] // 2 - 10
    point = ball.evaluate(
        f"""async () => {{
          const {{ position, focal_point, view_up }} = viewer.camera;
          viewer.camera = {{ position, focal_point, view_up, {lens} }};
          for (let point; ; await new Promise((next) => setTimeout(next, 20))) {{
            if ((point = viewer.pointAt({x}, {y}))) return point;
          }}
        }}"""
    )
    assert ball.evaluate("viewer.pointAt(1, 1)") is None
    shown = int(picture(ball, ROOM)[y, x, 3])
    assert shown > 100
    low, high = np.reshape(vdi.bounds, (3, 2)).T
    assert (low <= point).all()
    assert (point <= high).all()
    # It lies on the pixel's ray: moved by a pixel along the picture it is under the next one
    camera = ball.evaluate("viewer.camera")
    forward = np.subtract(camera["focal_point"], camera["position"])
    forward /= np.linalg.norm(forward)
    up = np.array(camera["view_up"]) - (camera["view_up"] @ forward) * forward
    up /= np.linalg.norm(up)
    arm = np.subtract(point, camera["position"])
    tangent = np.tan(np.radians(camera["view_angle"] / 2)) if not parallel else 0
    half = camera["parallel_scale"] if parallel else tangent * (arm @ forward)
    seen = np.array([arm @ np.cross(forward, up), arm @ up]) / half * ROOM[1] / 2
    np.testing.assert_allclose(seen, (x + 0.5 - ROOM[0] / 2, ROOM[1] / 2 - y - 0.5), atol=1e-2)
    # No more than half of it is seen before the supersegment that begins there
    plane = {"origin": (point - 1e-3 * forward).tolist(), "normal": (-forward).tolist()}
    ball.evaluate("(plane) => { viewer.clippingPlanes = [plane] }", plane)
    assert int(picture(ball, ROOM)[y, x, 3]) <= shown / 2 + 1
    # And more than half as soon as there are many of them: behind the middle there is too little
    assert (point - (low + high) / 2) @ forward < 0.1 * np.linalg.norm(high - low)


@pytest.mark.parametrize("width", [390, 1400])
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_panels_fit_the_page_and_are_read_on_it(scheme, width, vdi, open_page, tmp_path):
    (tmp_path / "a.html").write_bytes(page_of(vdi))
    viewport = {"width": width, "height": 700}
    page = open_page(
        url=(tmp_path / "a.html").as_uri(),
        viewport=viewport,
        color_scheme=scheme,
        reduced_motion="reduce",
    )
    page.ready()
    style = """(name) => {
      const { backgroundColor, color, transitionDuration } =
        getComputedStyle(viewer.shadowRoot.querySelector(name));
      const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
      return [backgroundColor, color, transitionDuration].map(numbers);
    }"""
    page.page.mouse.move(200, 300)
    behind, ink, fades = page.evaluate(style, ".bar")
    assert fades == [0]
    assert (ink[0] - behind[0] > 150) if scheme == "dark" else (behind[0] - ink[0] > 150)
    for name in ("View and marks", "Brightness, opacity and clipping", "Keys and gestures"):
        page.page.get_by_role("button", name=name).click()
        box = page.page.get_by_role("group", name=name).bounding_box()
        bar = page.page.get_by_role("group", name="Controls of the picture").bounding_box()
        for each in (box, bar):
            assert each["x"] >= 0
            assert each["x"] + each["width"] <= width
            assert each["y"] + each["height"] <= 700
        assert box["y"] >= bar["y"] + bar["height"]
    assert page.evaluate("document.scrollingElement.scrollWidth") == width


def test_fingers_use_it_and_do_not_touch_what_has_faded(vdi, open_page, tmp_path):
    (tmp_path / "a.html").write_bytes(page_of(vdi))
    page = open_page(
        url=(tmp_path / "a.html").as_uri(),
        viewport={"width": 390, "height": 700},
        has_touch=True,
        is_mobile=True,
    )
    page.ready()
    tap = page.page.touchscreen.tap
    opener = page.page.get_by_role("button", name="View and marks")
    box = opener.bounding_box()
    at = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.evaluate("void document.body.append(document.createElement('vdi-viewer'))")
    page.page.wait_for_timeout(3500)  # that of a viewer which waits for its data has not faded
    page.wait_for("!viewer.shadowRoot.querySelector('.frame.awake')")
    waiting = "document.body.lastChild"
    assert page.evaluate(f"!!{waiting}.shadowRoot.querySelector('.frame.awake')")
    page.evaluate(f"{waiting}.remove()")
    tap(*at)
    page.page.wait_for_timeout(500)
    assert opener.get_attribute("aria-expanded") == "false"
    for _ in range(20):  # on a busy machine it may have faded again
        if opener.get_attribute("aria-expanded") == "true":
            break
        tap(*at)
        page.page.wait_for_timeout(500)
    assert opener.get_attribute("aria-expanded") == "true"
    assert min(box["width"], box["height"]) >= 36
    before = page.evaluate("viewer.camera")
    page.page.get_by_role("button", name="Seen iso, from between the axes").tap()
    assert page.evaluate("viewer.camera") != before
    page.page.get_by_label("Position under the pointer").tap()
    page.evaluate("viewer.ready.then(() => true)")
    tap(195, 350)
    page.wait_for("/^x .* y .* z /.test(viewer.shadowRoot.querySelector('.place').textContent)")


@pytest.mark.slow
def test_fingers_reach_and_use_every_control(vdi, open_page, tmp_path):
    """Of a page of a series, which has them all."""
    pages = pvdi.VDISeries([vdi, thinned(vdi, 0.2)], [0.0, 1.0]).save(tmp_path / "a.html")
    viewport = {"width": 390, "height": 700}
    page = open_page(url=pages.as_uri(), viewport=viewport, has_touch=True, is_mobile=True)
    page.ready()
    used = set()

    def tap(name, role, along=0.5):
        used.add(name)
        box = page.page.get_by_role(role, name=name, exact=True).bounding_box()
        assert box["height"] >= 18
        page.page.touchscreen.tap(box["x"] + along * box["width"], box["y"] + box["height"] / 2)

    def tap_until(name, done, role="button"):
        """More than once where the bar has faded, which a first touch wakes."""
        for _ in range(20):
            tap(name, role)
            page.page.wait_for_timeout(500)
            if page.evaluate(done):
                return
        raise AssertionError(name)

    def is_open(name):
        expanded = "b.getAttribute('aria-expanded') === 'true'"
        opener = f"[...viewer.shadowRoot.querySelectorAll('button')].find((b) => {expanded})"
        return f"({opener}?.getAttribute('aria-label') === '{name}')"

    tap_until("View and marks", is_open("View and marks"))
    for name in VIEWS:
        before = page.evaluate("viewer.camera")
        tap(name, "button")
        page.wait_for(
            f"JSON.stringify(viewer.camera) !== '{json.dumps(before, separators=(',', ':'))}'"
        )
    for name in MARKS:
        tap(name, "checkbox")
        assert page.page.get_by_role("checkbox", name=name).is_checked()
    page.page.touchscreen.tap(47, 700 - 40 - 47 - 18)  # the face above of the cube
    page.wait_for(f"{SEEN_FROM} === '+z'")
    assert not page.evaluate(is_open("View and marks"))  # by a touch beside the panel
    tap_until("Brightness, opacity and clipping", is_open("Brightness, opacity and clipping"))
    for name in SLIDERS:
        before = page.evaluate("JSON.stringify(viewer.look)")
        tap(name, "slider", 0.7 if name.endswith("to") else 0.3)
        page.wait_for(f"JSON.stringify(viewer.look) !== '{before}'")
    tap("As it was made", "button")
    page.wait_for("viewer.look.clip[0] === 0 && viewer.look.brightness === 1")
    tap_until("Keys and gestures", is_open("Keys and gestures"))
    tap_until("Keys and gestures", f"!{is_open('Keys and gestures')}")
    said = "viewer.shadowRoot.querySelector('.hint')"
    tap_until("Copy a link to what is seen", f"/link/.test({said}.textContent)")
    begins = "JSON.stringify(viewer.camera) === JSON.stringify(viewer.home)"
    tap_until("Reset the view", begins)
    with page.page.expect_download():
        tap_until("Save the picture (PNG)", "true")
    tap_until("Full screen", "document.fullscreenElement === viewer")
    tap_until("Full screen", "document.fullscreenElement === null")
    tap("Time", "slider", 0.9)
    page.wait_for("viewer.time === 1")
    tap("Play", "button")
    page.wait_for("viewer.playing")
    tap("Pause", "button")
    page.wait_for("!viewer.playing")
    openers = {"View and marks", "Brightness, opacity and clipping", "Keys and gestures"}
    known = "input, button:not(.menu *)"
    labels = page.evaluate(
        f"""[...viewer.shadowRoot.querySelectorAll("{known}")].map((each) =>
          each.getAttribute("aria-label") ?? each.closest("label").textContent)"""
    )
    assert used | openers >= set(labels)


def test_without_controls_there_are_none(vdi, open_page, tmp_path):
    (tmp_path / "a.html").write_bytes(page_of(vdi, controls="none"))
    page = open_page(url=(tmp_path / "a.html").as_uri(), viewport={"width": 390, "height": 300})
    page.ready()
    assert page.page.get_by_role("button").count() == 0
    canvas = page.page.locator("canvas[role]")
    before = page.evaluate("viewer.camera")
    canvas.press("ArrowLeft")
    assert page.evaluate("viewer.camera") != before
    canvas.press("?")
    page.page.mouse.click(100, 100, button="right")
    assert page.page.get_by_role("group").count() == 0
    page.evaluate("viewer.removeAttribute('controls')")
    assert page.page.get_by_role("button").count() == len(BAR) + 1  # and the link's


@pytest.mark.parametrize("kind", ["html", "series"])
def test_other_controls_are_refused_before_anything_is_written(kind, vdi, tmp_path):
    shown = vdi if kind == "html" else pvdi.VDISeries([vdi], [0.0])
    with pytest.raises(InvalidArgumentError, match=r"controls must be 'all' or 'none'; got 'bar'"):
        shown.save(tmp_path / "a.html", controls="bar")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_axe_finds_nothing(scheme, vdi, open_page, tmp_path):
    (tmp_path / "a.html").write_bytes(page_of(vdi))
    url, viewport = (tmp_path / "a.html").as_uri(), {"width": 390, "height": 700}
    page = open_page(url=url, viewport=viewport, color_scheme=scheme, reduced_motion="reduce")
    page.ready()
    for name in (None, "View and marks", "Brightness, opacity and clipping", "Keys and gestures"):
        if name:
            page.page.get_by_role("button", name=name).click()
        assert_axe_finds_nothing(page)


def test_marks_are_in_the_picture_that_is_saved(ball):
    pressed(ball, "View and marks", "Enter")
    pressed(ball, "Bounds", "Space")
    with ball.page.expect_download() as found:
        pressed(ball, "Save the picture (PNG)", "Enter")
    saved = np.asarray(Image.open(io.BytesIO(found.value.path().read_bytes()))).astype(int)
    own = picture(ball, ROOM)
    outside = own[..., 3] == 0
    assert saved[outside][:, :3].max() > 200  # lines of the box, over black
