"""The element of pages, in a real browser: what it shows, tells and does, among other things."""

from io import BytesIO

import numpy as np
import pytest
from browsers import CONTEXTS, VIEWER
from rewriting import described
from skimage.io import imread

import pyvista_vdi as pvdi
from pyvista_vdi.model.vdi import VDI

#: Odd, so that no ray of a smaller picture runs along a border of lists.
SIZE = (161, 91)

#: The view, as text.
CAMERA = "JSON.stringify(viewer.camera)"

#: Wait until the page has heard and drawn what came before.
NEXT_FRAMES = """new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(
  () => done(true))))"""

WITHOUT_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind === "webgl2" ? null : getContext.call(this, kind, ...rest);
};
"""

#: A page with the module, and what is to stand in its head and body.
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">{head}
<script type="module" src="element.js"></script><body>{body}"""

#: How much of a viewer's canvas is not transparent.
COVERED = """(viewer) => {
  const canvas = viewer.shadowRoot.querySelector("canvas");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return data.filter((value, k) => k % 4 === 3 && value > 0).length / (data.length / 4);
}"""


@pytest.fixture
def around(open_page, data):
    """Open a page with this body, in which ``{viewer}`` stands for one of some attributes."""

    def around(body, head="", attributes="", size=SIZE, files=(), **options):
        markup = VIEWER.format(
            attributes=f'src="ball.vdi" {attributes}', width=size[0], height=size[1]
        )
        text = PAGE.format(head=head, body=body.replace("{viewer}", markup))
        files = {"around.html": text, "ball.vdi": data, **dict(files)}
        page = open_page(name="around.html", files=files, **options)
        page.ready()
        return page

    return around


# -- what is shown ---------------------------------------------------------------------------------


def test_a_file_is_shown_as_render_draws_it(vdi, data, open_page):
    page = open_page(SIZE, attributes='src="ball.vdi"', files={"ball.vdi": data})
    page.ready()
    status = page.evaluate("viewer.status")
    assert (status["state"], status["supersegments"]) == ("full", vdi.n_supersegments)
    camera = page.evaluate("viewer.camera")
    for name in ("position", "focal_point", "view_up", "view_angle"):
        np.testing.assert_array_equal(camera[name], getattr(vdi.camera, name))
    parallel = vdi.camera.azimuth(130).replace(parallel_projection=True, parallel_scale=1.0)
    page.evaluate("viewer.screenshot({ width: 8192, height: 1 }).then(() => 0)")  # the largest
    # On the page, over its background
    page.evaluate("viewer.background = [0.2, 0.4, 0.6]")
    page.evaluate(NEXT_FRAMES)
    area = {"x": 0, "y": 0, "width": SIZE[0], "height": SIZE[1]}
    shown = pvdi.render(vdi, vdi.camera, SIZE)
    expected = (shown[..., :3] + (1 - shown[..., 3:]) * [0.2, 0.4, 0.6]) * 255
    off = np.abs(imread(BytesIO(page.page.screenshot(clip=area)))[..., :3] - expected).max()
    assert off <= 2  # rounded twice, once by the canvas and once by the page
    page.assert_shows(vdi, SIZE, vdi.camera.elevation(-70), parallel)


def test_looks_are_drawn_as_render_draws_them(vdi, data, open_page):
    ball = open_page(SIZE)
    ball.load(data)
    turned = vdi.camera.azimuth(25)
    own = ball.screenshot(turned, SIZE).astype(float)
    denser = VDI(
        vdi.camera, SIZE, vdi.offsets, vdi.front, vdi.back, vdi.color, 2.5 * vdi.optical_depth,
        vdi.bounds, depth_origin=vdi.depth_origin,
    )  # fmt: skip
    bright = pvdi.render(vdi, turned, SIZE) * 255
    bright[..., :3] = np.minimum(1.7 * bright[..., :3], bright[..., 3:])
    low, high = np.reshape(vdi.bounds, (3, 2)).T
    x, y = low[0] + 0.25 * (high - low)[0], low[1] + 0.6 * (high - low)[1]
    planes = [(x, 0, 0, 1, 0, 0), (0, y, 0, 0, -1, 0)]
    cut = pvdi.render(vdi, turned, SIZE, clipping_planes=planes) * 255
    for look, expected in (
        ("opacity: 2.5", pvdi.render(denser, turned, SIZE) * 255),
        ("brightness: 1.7", bright),
        ("clip: [0.25, 1, 0, 0.6, 0, 1]", cut),
    ):
        ball.evaluate(f"viewer.look = {{ {look} }}")
        assert np.abs(expected - own).max() > 10
        assert np.abs(ball.screenshot(turned, SIZE) - expected).max() <= 1, look
    ball.evaluate("viewer.look = {}")
    np.testing.assert_array_equal(ball.screenshot(turned, SIZE), own)  # to the last bit


# -- what people do --------------------------------------------------------------------------------


def test_people_turn_it_by_mouse_and_wheel(around):
    """Drags are in the viewer's own pixels, however a page has turned it."""
    style = "<style>body { margin: 0 } vdi-viewer { transform: rotate(90deg) }</style>"
    page = around("<div style='padding: 100px'>{viewer}</div>", style)
    x, y = 100 + SIZE[0] / 2, 100 + SIZE[1] / 2
    before = page.evaluate("viewer.camera")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y + 20)  # its own: 20 to the right
    page.page.mouse.up()
    expected = page.evaluate(
        """async ([camera, size]) => (await import("./interaction.js"))
          .dragged("rotate", camera, [80, 45], [100, 45], size)""",
        [before, SIZE],
    )
    np.testing.assert_allclose(
        page.evaluate("viewer.camera.position"), expected["position"], atol=1e-6
    )
    far = "Math.hypot(...viewer.camera.position.map((p, k) => p - viewer.camera.focal_point[k]))"
    distance = page.evaluate(far)
    page.page.mouse.wheel(0, -250)  # a notch at most
    page.wait_for(f"{distance} / {far} > 1.2")
    assert distance / page.evaluate(far) == pytest.approx(1.1**2)


SCROLLED = "<p>above</p>{viewer}" + "<p>below</p>" * 20
PHONE = {"viewport": {"width": 200, "height": 260}, "has_touch": True, "is_mobile": True}
NARROW = '<meta name="viewport" content="width=device-width">'


def touch(page, *fingers):
    """Move fingers over the page, each from a place to another; return scroll and view."""
    session = page.page.context.new_cdp_session(page.page)
    steps = [("touchStart", 0), *(("touchMove", k / 10) for k in range(1, 11)), ("touchEnd", None)]
    for kind, share in steps:
        at = [] if share is None else [np.add(a, np.subtract(b, a) * share) for a, b in fingers]
        points = [{"x": float(x), "y": float(y), "id": k} for k, (x, y) in enumerate(at)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    page.evaluate(NEXT_FRAMES)
    return page.evaluate(f"[scrollY, {CAMERA}]")


def test_fingers_turn_pinch_and_scroll_past_it(around):
    """What is under two fingers stays under them: twice as far apart is twice as near."""
    page = around(SCROLLED, NARROW, size=(200, 260), **PHONE)
    still = page.evaluate(CAMERA)
    turned = touch(page, [(40, 150), (160, 150)])
    assert turned[0] == 0
    assert turned[1] != still
    before = page.evaluate("viewer.camera")
    touch(page, [(85, 150), (70, 150)], [(115, 150), (130, 150)])
    after = page.evaluate("viewer.camera")
    apart = [np.subtract(c["position"], c["focal_point"]) for c in (before, after)]
    np.testing.assert_allclose(2 * apart[1], apart[0], rtol=1e-3)
    still = page.evaluate(CAMERA)
    scrolled, camera = touch(page, [(100, 240), (100, 40)])
    assert scrolled > 100
    assert camera == still
    # Where nothing scrolls a finger turns all ways
    head = NARROW + "<style>body { margin: 0 }</style>"
    page = around("{viewer}", head, size=(200, 260), **PHONE)
    still = page.evaluate(CAMERA)
    assert touch(page, [(100, 240), (100, 40)])[1] != still


def test_the_wheel_is_the_page_s_where_that_scrolls(around):
    page = around(SCROLLED, viewport={"width": 300, "height": 300})
    mouse, before = page.page.mouse, page.evaluate(CAMERA)
    mouse.move(80, 80)
    mouse.wheel(0, 50)
    page.wait_for("scrollY > 0")
    assert page.evaluate(CAMERA) == before
    # With Ctrl, or where a page says so, it is the viewer's
    page.evaluate("scrollTo(0, 0)")
    page.page.keyboard.down("Control")
    mouse.wheel(0, 50)
    page.page.keyboard.up("Control")
    page.wait_for(f"{CAMERA} !== {before!r}")
    before = page.evaluate(f"viewer.setAttribute('gestures', 'all'), {CAMERA}")
    mouse.wheel(0, -50)
    page.wait_for(f"{CAMERA} !== {before!r}")
    assert page.evaluate("scrollY") == 0


# -- loading ---------------------------------------------------------------------------------------

#: Show one file after the other in the same element: what it says, or what is then seen.
SHOW = """async (names) => {
  const said = [];
  for (const name of names) {
    errors.length = 0;
    viewer.src = name;
    const outcome = await viewer.ready.then(() => "shown", (error) => error.message);
    const { state } = viewer.status, alert = viewer.shadowRoot.querySelector("[role=alert]");
    said.push({ alert: alert.hidden ? "" : alert.innerText, state, told: [...errors], outcome });
  }
  return said;
}"""


def test_broken_files_are_a_sentence_and_nothing_else(data, open_page):
    """How it is said; test_decode.py has in which places files are broken."""
    bad = {data[: len(data) // 2]: "truncated", b"": "it is empty"}
    bad[b"<p>Not found, but with status 200"] = "this is no VDI file: it begins"
    bad[described(data, camera=None)] = "camera"
    files = {f"{k}.vdi": content for k, content in enumerate(bad)}
    page = open_page(SIZE, files={"good.vdi": data, **files}, expected="404")
    words = {name: bad[content] for name, content in files.items()}
    words |= {"none.vdi": "none.vdi cannot be read: 404", "http://[": "http://[ cannot be read"}
    names = [*words]
    whole, *said, again = page.evaluate(SHOW, ["good.vdi", *names, "good.vdi"])
    assert whole == {"alert": "", "state": "full", "told": [], "outcome": "shown"}
    assert again == whole  # whatever came between
    for name, answer in zip(names, said, strict=True):
        assert answer["state"] == "error", name
        assert answer["told"] == [answer["outcome"]] == [answer["alert"]]
        assert not any(word in answer["alert"] for word in ("undefined", "NaN", "not a function"))
        assert words[name] in answer["alert"]


# -- graphics --------------------------------------------------------------------------------------


def test_without_webgl_there_is_a_sentence_and_a_still_picture(open_page):
    dot = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"
    page = open_page(SIZE, attributes=f'still="{dot}"', before=WITHOUT_WEBGL)
    message = page.evaluate("viewer.status.message ?? ''")
    assert page.evaluate("viewer.ready.catch((error) => error.message)") == message
    assert "no WebGL 2" in message
    assert page.page.locator("vdi-viewer img").first.is_visible()


def test_viewers_share_one_context_and_make_up_for_a_lost_one(vdi, around):
    """Browsers keep some sixteen, and take the oldest from who still shows it."""
    page = around("{viewer}" * 20, before=CONTEXTS, expected="CONTEXT_LOST|context")
    page.evaluate(
        """() => Promise.all([...document.querySelectorAll("vdi-viewer")].map((v) => v.ready))
             .then(() => true)"""
    )
    assert page.evaluate("contexts.length") == 1
    covered = page.evaluate(f"[...document.querySelectorAll('vdi-viewer')].map({COVERED})")
    assert min(covered) == max(covered) > 0.2
    page.evaluate("void contexts[0].getExtension('WEBGL_lose_context').loseContext()")
    page.wait_for("contexts[0].isContextLost()")
    assert page.evaluate(f"({COVERED})(viewer)") > 0.2  # what was drawn stays
    page.assert_shows(vdi, SIZE, vdi.camera.azimuth(20))
    assert page.evaluate("contexts.at(-1).isContextLost()") is False


# -- pages -----------------------------------------------------------------------------------------


def test_a_strict_policy_leaves_a_viewer_its_looks(around):
    policy = "default-src 'self'; worker-src 'none'"
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    early = """document.querySelector("vdi-viewer").clippingPlanes =
      [{ origin: [0, 0, 0], normal: [1, 0, 0] }];"""
    body = "<vdi-viewer src='ball.vdi' aria-label=it></vdi-viewer><script src='early.js'></script>"
    hear = "console.warn = (text) => (window.warned = text);"
    page = around(body, head, files={"early.js": early}, before=hear, expected="worker")
    assert page.evaluate("/on the page's own thread.*worker-src.*another entry/.test(warned)")
    assert page.evaluate("viewer.clippingPlanes.length") == 1  # set before the module had come
    looks = "[viewer.offsetWidth > 100, viewer.offsetHeight > 50, getComputedStyle(viewer).display]"
    assert page.evaluate(looks) == [True, True, "block"]
    assert page.evaluate(f"({COVERED})(viewer)") > 0.1
    assert page.page.get_by_role("img", name="it").is_visible()
