"""The element of pages, in a real browser: what it shows, tells and does, among other things."""

from io import BytesIO

import numpy as np
import pytest
from browsers import CONTEXTS, COUNTING, VIEWER, file_of, in_base64, picture
from plugin_scenes import soft_ball
from rewriting import described
from skimage.io import imread

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import VDI

#: Odd, so that no ray of a smaller picture runs along a border of lists.
SIZE = (161, 91)

#: The last frame has all pixels.
AT_REST = "heard.filter(([name]) => name === 'framedrawn').at(-1)?.[1].full"

#: The view, as text.
CAMERA = "JSON.stringify(viewer.camera)"

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
def ball(data, open_page):
    """A page that shows the ball, in a viewer that tests share."""
    return open_page(SIZE, data=data)


@pytest.fixture
def around(open_page, data):
    """Open a page with this body, in which ``{viewer}`` stands for one of some attributes."""

    def around(body, head="", attributes="", size=SIZE, **options):
        markup = VIEWER.format(
            attributes=f'src="ball.vdi" {attributes}', width=size[0], height=size[1]
        )
        text = PAGE.format(head=head, body=body.replace("{viewer}", markup))
        files = {"around.html": text, "ball.vdi": data}
        return open_page(name="around.html", files=files, **options)

    return around


def all_ready(page):
    return page.evaluate(
        """Promise.all([...document.querySelectorAll("vdi-viewer")].map((v) => v.ready))
             .then((all) => all.map((v) => v.status.state))"""
    )


# -- what is shown ---------------------------------------------------------------------------------


def test_a_file_is_shown_as_render_draws_it(vdi, data, open_page):
    page = open_page(SIZE, attributes='src="ball.vdi"', files={"ball.vdi": data})
    page.ready()
    status = page.evaluate("viewer.status")
    told = [status[name] for name in ("state", "supersegments", "lists", "progress")]
    assert told == ["full", vdi.n_supersegments, list(SIZE), 1]
    page.wait_for(AT_REST)
    camera = page.evaluate("viewer.camera")
    for name in ("position", "focal_point", "view_up", "view_angle"):
        np.testing.assert_array_equal(camera[name], getattr(vdi.camera, name))
    np.testing.assert_allclose(page.evaluate("viewer.bounds"), vdi.bounds)
    parallel = vdi.camera.azimuth(130).replace(parallel_projection=True, parallel_scale=1.0)
    turned = vdi.camera.azimuth(40), vdi.camera.elevation(-70)
    page.assert_shows(vdi, SIZE, vdi.camera, *turned, parallel)


def test_what_is_on_the_page_is_the_picture_over_its_background(vdi, ball):
    ball.evaluate("viewer.background = [0.2, 0.4, 0.6]")
    ball.wait_for(AT_REST)
    area = {"x": 0, "y": 0, "width": SIZE[0], "height": SIZE[1]}
    shown = pvdi.render(vdi, vdi.camera, SIZE)
    expected = (shown[..., :3] + (1 - shown[..., 3:]) * [0.2, 0.4, 0.6]) * 255
    for _ in range(200):  # the browser shows what was drawn when it comes to it
        off = np.abs(imread(BytesIO(ball.page.screenshot(clip=area)))[..., :3] - expected).max()
        if off <= 2:  # rounded twice, once by the canvas and once by the page
            break
        ball.page.wait_for_timeout(100)
    assert off <= 2


def test_looks_are_drawn_as_render_draws_them(vdi, ball):
    turned = vdi.camera.azimuth(25)
    own = ball.screenshot(turned, SIZE).astype(float)

    def off(expected):
        return np.abs(ball.screenshot(turned, SIZE) - expected).max()

    ball.evaluate("viewer.look = { opacity: 2.5 }")
    denser = VDI(
        vdi.camera, SIZE, vdi.offsets, vdi.front, vdi.back, vdi.color, 2.5 * vdi.optical_depth,
        vdi.bounds, depth_origin=vdi.depth_origin,
    )  # fmt: skip
    dense = pvdi.render(denser, turned, SIZE) * 255
    assert np.abs(dense - own).max() > 10
    assert off(dense) <= 1
    ball.evaluate("viewer.look = { brightness: 1.7 }")
    bright = pvdi.render(vdi, turned, SIZE) * 255
    bright[..., :3] = np.minimum(1.7 * bright[..., :3], bright[..., 3:])
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
    refused = """() => {
      const plane = { origin: [0, 0, 0], normal: [1, 0, 0] };
      try { viewer.clippingPlanes = Array(25).fill(plane); } catch ({ message }) { return message; }
    }"""
    assert "At most 24 planes clip a VDI; got 25" in ball.evaluate(refused)


@pytest.mark.every(2)
@pytest.mark.parametrize("parallel", [False, True])
def test_the_point_under_a_pixel_has_half_of_what_is_seen_before_it(parallel, vdi, data, open_page):
    room = (420, 340)
    page = open_page(room)
    page.load(data)
    lens = "parallel_scale: 1.2" if parallel else "view_angle: viewer.camera.view_angle"
    x, y = room[0] // 2 + 20, room[1] // 2 - 10
    point = page.evaluate(
        f"""() => {{
          const {{ position, focal_point, view_up }} = viewer.camera;
          viewer.camera = {{ position, focal_point, view_up, {lens} }};
          return viewer.pointAt({x}, {y});
        }}"""
    )
    assert page.evaluate("viewer.pointAt(1, 1)") is None
    shown = int(picture(page, room)[y, x, 3])
    assert shown > 100
    # It lies on the pixel's ray
    camera = page.evaluate("viewer.camera")
    forward = np.subtract(camera["focal_point"], camera["position"])
    forward /= np.linalg.norm(forward)
    up = np.array(camera["view_up"]) - (camera["view_up"] @ forward) * forward
    up /= np.linalg.norm(up)
    arm = np.subtract(point, camera["position"])
    tangent = np.tan(np.radians(camera["view_angle"] / 2)) if not parallel else 0
    half = camera["parallel_scale"] if parallel else tangent * (arm @ forward)
    seen = np.array([arm @ np.cross(forward, up), arm @ up]) / half * room[1] / 2
    np.testing.assert_allclose(seen, (x + 0.5 - room[0] / 2, room[1] / 2 - y - 0.5), atol=1e-2)
    # No more than half of it is seen before the supersegment that begins there
    plane = {"origin": (point - 1e-3 * forward).tolist(), "normal": (-forward).tolist()}
    page.evaluate("(plane) => { viewer.clippingPlanes = [plane] }", plane)
    assert int(picture(page, room)[y, x, 3]) <= shown / 2 + 1
    # And more than half as soon as there are many of them: behind the middle there is too little
    low, high = np.reshape(vdi.bounds, (3, 2)).T
    assert (point - (low + high) / 2) @ forward < 0.1 * np.linalg.norm(high - low)


def test_a_narrow_window_shows_all_of_the_picture(vdi, data, open_page):
    """Its width is seen in a wider angle; a wider one is as ever."""
    narrow, wide = (61, 121), (241, 91)
    page = open_page(narrow, attributes=f'fit="{SIZE[0]}/{SIZE[1]}"')
    page.load(data)
    half = np.tan(np.radians(vdi.camera.view_angle) / 2) * (SIZE[0] / SIZE[1]) / (61 / 121)
    angle = float(2 * np.degrees(np.arctan(half)))
    assert page.evaluate("viewer.camera.view_angle") == vdi.camera.view_angle
    for size, seen in ((narrow, vdi.camera.replace(view_angle=angle)), (wide, vdi.camera)):
        expected = pvdi.render(vdi, seen, size) * 255.0
        assert np.abs(page.screenshot(vdi.camera, size) - expected).max() <= 1.0


def test_dense_screens_other_sizes_and_the_browser_s_zoom(data, open_page):
    page = open_page((100, 60), device_scale_factor=2, viewport={"width": 400, "height": 300})
    page.load(data)
    edges = "(({width, height}) => [width, height])(viewer.shadowRoot.querySelector('canvas'))"
    assert page.evaluate(edges) == [200, 120]
    page.evaluate("viewer.style.width = '130px'")
    page.wait_for(f"{edges}[0] === 260")
    session = page.page.context.new_cdp_session(page.page)
    metrics = {"width": 400, "height": 300, "deviceScaleFactor": 3, "mobile": False}
    session.send("Emulation.setDeviceMetricsOverride", metrics)
    page.wait_for(f"{edges}[0] === 390")


# -- what people do --------------------------------------------------------------------------------


def test_people_turn_it_by_mouse_wheel_and_keys(vdi, ball):
    cameras = [ball.evaluate("viewer.camera")]

    def moved():
        ball.wait_for("viewer.status.state === 'full'")
        cameras.append(ball.evaluate("viewer.camera"))
        assert cameras[-1] != cameras[-2]
        return cameras[-1]

    mouse, keyboard = ball.page.mouse, ball.page.keyboard
    mouse.move(80, 50)
    mouse.down()
    mouse.move(110, 60)
    mouse.up()
    expected = ball.evaluate(
        """async ([camera, size]) => (await import("./interaction.js"))
          .dragged("rotate", camera, [80, 41], [110, 31], size)""",
        [cameras[0], SIZE],
    )
    turned = moved()
    for name, value in expected.items():
        np.testing.assert_allclose(turned[name], value, err_msg=name)
    mouse.wheel(0, -100)
    moved()
    distance = [np.linalg.norm(np.subtract(c["position"], c["focal_point"])) for c in cameras[-2:]]
    assert distance[0] / distance[1] == pytest.approx(1.1**2)
    keyboard.press("ArrowLeft")
    moved()
    keyboard.press("r")
    np.testing.assert_allclose(moved()["position"], vdi.camera.position)
    ball.wait_for(AT_REST)
    assert sum(name == "camerachange" for name, _ in ball.evaluate("heard")) >= 4


@pytest.mark.every(2)
@pytest.mark.parametrize("transform", ["scale(0.5)", "rotate(90deg)"])
def test_drags_are_in_the_viewer_s_own_pixels(transform, around):
    """However a page has turned or scaled it."""
    style = f"<style>body {{ margin: 0 }} vdi-viewer {{ transform: {transform} }}</style>"
    page = around("<div style='padding: 100px'>{viewer}</div>", style)
    page.ready()
    x, y = 100 + SIZE[0] / 2, 100 + SIZE[1] / 2
    to = (x + 10, y) if "scale" in transform else (x, y + 20)  # its own: 20 to the right
    before = page.evaluate("viewer.camera")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(*to)
    page.page.mouse.up()
    expected = page.evaluate(
        """async ([camera, size]) => (await import("./interaction.js"))
          .dragged("rotate", camera, [80, 45], [100, 45], size)""",
        [before, SIZE],
    )
    after = page.evaluate("viewer.camera")
    np.testing.assert_allclose(after["position"], expected["position"], atol=1e-6)


SCROLLED = "<p>above</p>{viewer}" + "<p>below</p>" * 20
PHONE = {"viewport": {"width": 200, "height": 260}, "has_touch": True, "is_mobile": True}
NARROW = '<meta name="viewport" content="width=device-width">'


def touch(page, *fingers):
    """Move fingers over the page, each from a place to another."""
    session = page.page.context.new_cdp_session(page.page)
    steps = [("touchStart", 0), *(("touchMove", k / 10) for k in range(1, 11)), ("touchEnd", None)]
    for kind, share in steps:
        at = [] if share is None else [np.add(a, np.subtract(b, a) * share) for a, b in fingers]
        points = [{"x": float(x), "y": float(y), "id": k} for k, (x, y) in enumerate(at)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    page.page.wait_for_timeout(300)
    return page.evaluate(f"[scrollY, {CAMERA}]")


def test_fingers_turn_pinch_and_scroll_past_it(around):
    """What is under two fingers stays under them: twice as far apart is twice as near."""
    page = around(SCROLLED, NARROW, size=(200, 260), **PHONE)
    page.ready()
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
    page = around(
        "{viewer}", NARROW + "<style>body { margin: 0 }</style>", size=(200, 260), **PHONE
    )
    page.ready()
    still = page.evaluate(CAMERA)
    assert touch(page, [(100, 240), (100, 40)])[1] != still


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("body", "attributes", "key", "zooms"),
    [
        (SCROLLED, "", None, False),
        ("{viewer}", "", None, True),
        (SCROLLED, "", "Control", True),
        (SCROLLED, 'gestures="all"', None, True),
    ],
)
def test_the_wheel_is_the_page_s_where_that_scrolls(body, attributes, key, zooms, around):
    page = around(body, attributes=attributes, viewport={"width": 300, "height": 300})
    page.ready()
    before = page.evaluate(CAMERA)
    page.page.mouse.move(80, 80)
    if key:
        page.page.keyboard.down(key)
    page.page.mouse.wheel(0, 100)
    page.page.wait_for_timeout(300)
    assert (page.evaluate(CAMERA) != before) == zooms
    assert (page.evaluate("scrollY") > 0) == (body == SCROLLED and not zooms)
    hint = page.page.locator("vdi-viewer").get_by_role("status")
    assert hint.is_visible() == (not zooms)
    if not zooms:  # worked in, it is the viewer's
        page.evaluate("scrollTo(0, 0)")
        page.page.mouse.click(80, 80)
        page.page.mouse.wheel(0, -100)
        page.page.wait_for_timeout(300)
        assert page.evaluate(CAMERA) != before


# -- loading ---------------------------------------------------------------------------------------

#: A file of two pieces, the second of which comes when ``goOn()`` is called.
IN_PIECES = """([text]) => {
  const bytes = bytesOf(text), rest = Promise.withResolvers();
  async function* pieces() {
    yield bytes.subarray(0, 1000);
    await rest.promise;
    yield bytes.subarray(1000);
  }
  window.goOn = rest.resolve;
  window.first = viewer.load({ [Symbol.asyncIterator]: pieces }).then(() => true);
}"""


def test_an_element_that_was_off_the_page_goes_on_loading(vdi, data, open_page):
    """And who waits for what is given up waits for what is shown."""
    page = open_page(SIZE)
    page.evaluate(IN_PIECES, [in_base64(data)])
    page.evaluate(
        """async () => {
          const { parentNode } = viewer;
          viewer.remove();
          await new Promise((done) => setTimeout(done));
          parentNode.append(viewer);
          goOn();
          await Promise.all([first, viewer.ready]);
        }"""
    )
    page.assert_shows(vdi, SIZE)
    page.evaluate(IN_PIECES, [in_base64(data)])
    page.evaluate("void (window.ready = viewer.ready)")
    page.evaluate(  # a file that a visitor chose
        "(text) => viewer.load(new File([bytesOf(text)], 'ball.vdi')).then(() => true)",
        in_base64(data),
    )
    assert page.evaluate("Promise.all([first, ready]).then(() => viewer.status.state)") == "full"
    message = "viewer.screenshot().catch(({ message }) => message)"
    assert "off the page" in page.evaluate(f"viewer.remove(), {message}")


#: Show one file after the other in the same element: what it says, or what is then seen.
SHOW = """async (names) => {
  const said = [];
  for (const name of names) {
    heard.length = 0;
    viewer.src = name;
    const outcome = await viewer.ready.then(() => "shown", (error) => error.message);
    const told = heard.filter(([kind]) => kind === "error").map(([, { message }]) => message);
    const { state, level } = viewer.status, alert = viewer.shadowRoot.querySelector("[role=alert]");
    const seen = { alert: alert.hidden ? "" : alert.innerText, state, told };
    if (outcome === "shown") {
      const { data } = await viewer.screenshot({ width: 64, height: 36 });
      said.push({ ...seen, level, shown: textOf(data) });
    } else said.push({ ...seen, outcome });
  }
  return said;
}"""


def test_broken_files_are_a_sentence_and_nothing_else(data, open_page):
    """How it is said; test_decode.py has in which places files are broken."""
    changed = bytearray(data)
    changed[len(data) // 2] ^= 1
    bad = {data[: len(data) // 2]: "truncated", bytes(changed): "damaged", b"": "it is empty"}
    bad[b"<p>Not found, but with status 200"] = "this is no VDI file: it begins"
    bad[described(data, camera=None)] = "camera"
    files = {f"{k}.vdi": content for k, content in enumerate(bad)}
    page = open_page(SIZE, files={"good.vdi": data, **files}, expected="404")
    words = {name: bad[content] for name, content in files.items()}
    words |= {"none.vdi": "none.vdi cannot be read: 404", "http://[": "http://[ cannot be read"}
    names = [*words]
    whole, *said, again = page.evaluate(SHOW, ["good.vdi", *names, "good.vdi"])
    assert (whole["state"], whole["level"], whole["alert"]) == ("full", "full", "")
    assert again == whole  # whatever came between
    for name, answer in zip(names, said, strict=True):
        assert answer["state"] == "error", name
        assert answer["told"] == [answer["outcome"]] == [answer["alert"]]
        assert not any(word in answer["alert"] for word in ("undefined", "NaN", "not a function"))
        assert words[name] in answer["alert"]


@pytest.mark.slow
def test_another_address_is_looked_at_where_it_lies(data, open_page):
    """What it gives in the same place is seen from the same view."""
    far = soft_ball(16)
    far.origin = np.add(far.origin, (100, 0, 0))
    elsewhere = pvdi.generate(far, filling_camera(far.bounds, SIZE), SIZE, cmap="bone")
    page = open_page(SIZE, files={"a.vdi": data, "b.vdi": data, "far.vdi": file_of(elsewhere)})
    positions = []
    for name in ("a.vdi", "b.vdi", "far.vdi"):
        page.evaluate(f"viewer.src = '{name}', viewer.ready.then(() => true)")
        positions.append(page.evaluate("viewer.camera.position"))
        if name == "a.vdi":
            page.evaluate("viewer.camera = {...viewer.camera, position: [3, 2, 1]}")
    assert positions[1] == [3, 2, 1]
    np.testing.assert_allclose(positions[2], elsewhere.camera.position)


# -- graphics --------------------------------------------------------------------------------------


def test_without_webgl_there_is_a_sentence_and_a_still_picture(open_page):
    dot = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"
    page = open_page(SIZE, attributes=f'still="{dot}"', before=WITHOUT_WEBGL)
    message = page.evaluate("viewer.status.message ?? ''")
    assert page.evaluate("viewer.ready.catch((error) => error.message)") == message
    assert "no WebGL 2" in message
    assert page.page.locator("vdi-viewer img").first.is_visible()


def test_viewers_share_one_context_and_follow_each_other(around):
    """Browsers keep some sixteen, and take the oldest from who still shows it."""
    page = around("{viewer}" * 20, before=CONTEXTS)
    assert all_ready(page) == ["full"] * 20
    assert page.evaluate("contexts.length") == 1
    covered = page.evaluate(f"[...document.querySelectorAll('vdi-viewer')].map({COVERED})")
    assert min(covered) == max(covered) > 0.2
    angles = page.evaluate(
        """() => {
          const [one, other] = document.querySelectorAll("vdi-viewer");
          for (const [from, to] of [[one, other], [other, one]]) {
            from.addEventListener("camerachange", () => { to.camera = from.camera; });
          }
          one.camera = { ...one.camera, view_angle: 20 };
          return [one.camera.view_angle, other.camera.view_angle];
        }"""
    )
    assert angles == [20, 20]


@pytest.mark.every(2)
@pytest.mark.parametrize("between", ["", "viewer.remove(); document.body.append(viewer);"])
def test_lost_graphics_are_made_up_for(between, vdi, data, open_page):
    page = open_page(SIZE, before=CONTEXTS, expected="CONTEXT_LOST|context")
    page.load(data)
    page.evaluate(
        f"""async () => {{
          contexts.at(-1).getExtension("WEBGL_lose_context").loseContext();
          {between}
          await new Promise((resolve) => setTimeout(resolve, 50));
        }}"""
    )
    assert page.evaluate(f"({COVERED})(viewer)") > 0.2  # what was drawn stays
    page.assert_shows(vdi, SIZE, vdi.camera.azimuth(20))
    assert page.evaluate("contexts.at(-1).isContextLost()") is False


@pytest.mark.slow
def test_memory_is_that_of_the_viewers_in_sight(around):
    """Of forty viewers, in a window of four; all are drawn when they are seen."""
    page = around("{viewer}" * 40, before=COUNTING, viewport={"width": 200, "height": 400})
    all_ready(page)
    textures = []
    for _ in range(2):
        for k in (0, 10, 20, 30, 39):
            page.evaluate(f"document.querySelectorAll('vdi-viewer')[{k}].scrollIntoView()")
            page.evaluate(
                f"""() => {{
                  window.viewer = document.querySelectorAll("vdi-viewer")[{k}];
                  const {{ position: [x, y, z], ...rest }} = viewer.camera;
                  viewer.camera = {{ ...rest, position: [x + 0.01, y, z] }};
                }}"""
            )
            page.ready()
            page.page.wait_for_timeout(2500)
            assert page.evaluate(f"({COVERED})(viewer)") > 0.2
            # Five are in sight and five beside them, each with three textures of lists and two of
            # pictures; a browser may be late to say which have left
            page.wait_for(f"alive.Texture <= {10 * 5}")
            textures.append(page.evaluate("alive.Texture"))
    assert max(textures[5:]) <= max(textures[:5]), textures


@pytest.mark.slow
def test_memory_stays_flat_over_frames_and_swaps(vdi, data, open_page):
    """Ten thousand frames, two hundred other VDIs, and twenty other elements."""
    page = open_page((64, 36), before=COUNTING)
    page.load(data)
    page.evaluate(
        f"""() => {{
          const bytes = bytesOf({in_base64(data)!r});
          window.use = async (frames, swaps) => {{
            for (let k = 0; k < frames; ++k) {{
              const angle = k / 50, {{ position: [x, y, z], ...rest }} = viewer.camera;
              const drawn = new Promise((resolve) =>
                viewer.addEventListener("framedrawn", resolve, {{ once: true }}));
              viewer.camera = {{ ...rest, position: [x + 1e-4 * Math.cos(angle), y, z] }};
              await drawn;
              if (k % Math.ceil(frames / swaps) === 0) await viewer.load(bytes.slice());
            }}
          }};
        }}"""
    )
    page.evaluate("use(500, 20)")
    session = page.page.context.new_cdp_session(page.page)

    def used():
        page.evaluate("heard.length = 0")  # of this page, not of the viewer
        session.send("HeapProfiler.collectGarbage")
        heap = session.send("Runtime.getHeapUsage")["usedSize"]
        return page.evaluate("JSON.stringify(alive)"), heap

    alive, heap = used()
    page.evaluate("use(10000, 200)")
    again, later = used()
    assert again == alive
    assert later < heap + 2e6
    for _ in range(20):  # browsers keep some 16 contexts
        page.load(data)
        page.evaluate(
            """() => {
              const next = document.createElement("vdi-viewer");
              next.style.cssText = viewer.style.cssText;
              viewer.replaceWith(next);
              window.viewer = next;
            }"""
        )
    page.load(data)
    page.assert_shows(vdi, SIZE)


# -- pages -----------------------------------------------------------------------------------------


def test_a_strict_policy_leaves_a_viewer_its_looks_and_its_shape_on_paper(around):
    head = """<meta http-equiv="Content-Security-Policy" content="default-src 'self'">"""
    page = around("<vdi-viewer src='ball.vdi' aria-label='a ball'></vdi-viewer>", head)
    page.ready()
    looks = "[viewer.offsetWidth > 100, viewer.offsetHeight > 50, getComputedStyle(viewer).display]"
    assert page.evaluate(looks) == [True, True, "block"]
    assert page.evaluate(f"({COVERED})(viewer)") > 0.2
    assert page.page.get_by_role("img", name="a ball").is_visible()
    page.evaluate("viewer.removeAttribute('aria-label')")
    assert page.page.get_by_role("img", name="volume, to be turned").is_visible()
    fit = "getComputedStyle(viewer.shadowRoot.querySelector('canvas')).objectFit"
    assert page.evaluate(fit) == "fill"
    page.page.emulate_media(media="print")
    assert page.evaluate(fit) == "contain"
    assert page.page.get_by_role("group", name="Controls of the picture").count() == 0


def test_what_is_set_before_the_module_has_come_is_taken(around):
    script = """<script>
      const early = document.querySelector("vdi-viewer");
      early.background = "rgb(255, 0, 0)";
      early.clippingPlanes = [{ origin: [0, 0, 0], normal: [1, 0, 0] }];
    </script>"""
    page = around("{viewer}" + script)
    page.ready()
    assert page.evaluate("getComputedStyle(viewer).backgroundColor") == "rgb(255, 0, 0)"
    assert page.evaluate("viewer.clippingPlanes.length") == 1


#: A scene with nothing in it, packed as scenes are, and one that is damaged.
SCENES = """async () => {
  const { Scene } = await import("./scene.js");
  const head = { camera: null, view: null, meshes: [], pictures: [],
    vdis: [{ file: null, planes: [], opacity: 1,
      matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }] };
  const stream = new Blob([JSON.stringify(head)]).stream();
  const packed = stream.pipeThrough(new CompressionStream("deflate"));
  const good = new Uint8Array(await new Response(packed).arrayBuffer());
  window.goodScene = () => new Scene(good);
  window.brokenScene = () => new Scene(new Uint8Array([1, 2, 3]));
}"""


def test_a_damaged_scene_is_made_up_for_by_the_next_and_each_has_one_viewer(vdi, data, open_page):
    page = open_page(SIZE)
    page.load(data)
    page.evaluate(SCENES)
    for after in ("null", "goodScene()"):
        said = page.evaluate(
            f"""async () => {{
              viewer.scene = brokenScene();
              await viewer.scene.whole.catch(() => {{}});
              await new Promise((next) => setTimeout(next));
              const bad = viewer.status;
              viewer.scene = {after};
              await viewer.scene?.whole;
              await viewer.ready;
              return [bad.state, bad.message, viewer.status.state, viewer.status.message ?? ""];
            }}"""
        )
        assert said[0] == "error"
        assert "scene beside the VDI is damaged" in said[1]
        assert said[2:] == ["full", ""]
    page.assert_shows(vdi, SIZE)
    said = page.evaluate(
        """() => {
          const { scene } = viewer, other = document.createElement("vdi-viewer");
          const refused = () => {
            try { other.scene = scene; return ""; } catch ({ message }) { return message; }
          };
          const first = refused();
          viewer.scene = null;
          return [first, refused()];
        }"""
    )
    assert "shown by one viewer" in said[0]
    assert said[1] == ""
