"""Viewers among what else is on a page: other viewers, scrolling, printing, strict policies."""

import numpy as np
import pytest
from browsers import CONTEXTS, COUNTING, VIEWER, file_of, in_base64
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (161, 91)

#: A page with the module, and what is to stand in its head and body.
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">{head}
<script type="module" src="element.js"></script><body>{body}"""

#: How much of a viewer's canvas is not transparent.
COVERED = """(viewer) => {
  const canvas = viewer.shadowRoot.querySelector("canvas");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return data.filter((value, k) => k % 4 === 3 && value > 0).length / (data.length / 4);
}"""


@pytest.fixture(scope="module")
def vdi(default_runtime):
    volume = soft_ball()
    return pvdi.generate(volume, filling_camera(volume.bounds, SIZE), SIZE, cmap="bone")


@pytest.fixture(scope="module")
def data(vdi):
    return file_of(vdi)


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


# -- many viewers ----------------------------------------------------------------------------------


def test_viewers_share_one_context(around):
    """Browsers keep some sixteen, and take the oldest from who still shows it."""
    page = around("{viewer}" * 20, before=CONTEXTS)
    assert all_ready(page) == ["full"] * 20
    assert page.evaluate("contexts.length") == 1
    covered = page.evaluate(f"[...document.querySelectorAll('vdi-viewer')].map({COVERED})")
    assert min(covered) == max(covered) > 0.2


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


@pytest.mark.parametrize("between", ["", "viewer.remove(); document.body.append(viewer);"])
def test_lost_graphics_are_made_up_for(between, vdi, data, open_page):
    page = open_page(SIZE, before=CONTEXTS, expected="CONTEXT_LOST|context")
    page.load(data)
    page.evaluate(
        f"""async () => {{
          const gl = contexts.at(-1);
          gl.getExtension("WEBGL_lose_context").loseContext();
          {between}
          await new Promise((resolve) => setTimeout(resolve, 50));
        }}"""
    )
    assert page.evaluate(f"({COVERED})(viewer)") > 0.2  # what was drawn stays
    page.assert_shows(vdi, SIZE, vdi.camera.azimuth(20))
    assert page.evaluate("contexts.at(-1).isContextLost()") is False


# -- sizes -----------------------------------------------------------------------------------------


def test_the_browser_s_zoom_is_drawn_anew(around):
    page = around(
        "{viewer}", head="<style>body { margin: 0 }</style>", viewport={"width": 400, "height": 300}
    )
    page.ready()
    session = page.page.context.new_cdp_session(page.page)
    metrics = {"width": 400, "height": 300, "deviceScaleFactor": 2, "mobile": False}
    session.send("Emulation.setDeviceMetricsOverride", metrics)
    page.wait_for(f"viewer.shadowRoot.querySelector('canvas').width === {2 * SIZE[0]}")


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
    page.evaluate("viewer.removeAttribute('fit')")
    page.assert_shows(vdi, narrow)


def test_pages_of_one_file_ask_for_all_of_the_picture(vdi, tmp_path, open_page):
    vdi.save(tmp_path / "ball.html")
    page = open_page(url=(tmp_path / "ball.html").as_uri(), viewport={"width": 120, "height": 260})
    page.ready()
    shown = page.evaluate(f"({COVERED})(viewer)")
    pixels = pvdi.render(vdi, vdi.camera, (120, 68))[..., 3] > 0
    assert shown == pytest.approx(pixels.sum() / (120 * 260), rel=0.05)


# -- what people do --------------------------------------------------------------------------------

SCROLLED = "<p>above</p>{viewer}" + "<p>below</p>" * 20
PHONE = {"viewport": {"width": 390, "height": 500}, "has_touch": True, "is_mobile": True}
NARROW = '<meta name="viewport" content="width=device-width">'


def swipe(page, by):
    """Move a finger over the viewer, by pixels to the right and down."""
    session = page.page.context.new_cdp_session(page.page)
    for kind, k in [("touchStart", 0), *(("touchMove", k) for k in range(1, 11)), ("touchEnd", 0)]:
        at = [] if kind == "touchEnd" else [{"x": 195 + by[0] * k / 10, "y": 300 + by[1] * k / 10}]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
    page.page.wait_for_timeout(300)
    return page.evaluate("[scrollY, JSON.stringify(viewer.camera)]")


def test_a_page_is_scrolled_past_a_viewer_by_finger(around):
    page = around(SCROLLED, NARROW, size=(390, 500), **PHONE)
    page.ready()
    still = page.evaluate("JSON.stringify(viewer.camera)")
    assert swipe(page, (150, 0))[0] == 0
    turned = page.evaluate("JSON.stringify(viewer.camera)")
    assert turned != still
    scrolled, camera = swipe(page, (0, -250))
    assert scrolled > 100
    assert camera == turned


def test_a_finger_turns_all_ways_where_nothing_scrolls(around):
    page = around(
        "{viewer}", NARROW + "<style>body { margin: 0 }</style>", size=(390, 500), **PHONE
    )
    page.ready()
    still = page.evaluate("JSON.stringify(viewer.camera)")
    assert swipe(page, (0, -250))[1] != still


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("body", "attributes", "key", "zooms"),
    [
        (SCROLLED, "", None, False),
        ("{viewer}", "", None, True),
        (SCROLLED, "", "Control", True),
        (SCROLLED, 'gestures="all"', None, True),
        ("{viewer}", 'gestures="shared"', None, False),
    ],
)
def test_the_wheel_is_the_page_s_where_that_scrolls(body, attributes, key, zooms, around):
    page = around(body, attributes=attributes, viewport={"width": 300, "height": 300})
    page.ready()
    before = page.evaluate("JSON.stringify(viewer.camera)")
    page.page.mouse.move(80, 80)
    if key:
        page.page.keyboard.down(key)
    page.page.mouse.wheel(0, 100)
    page.page.wait_for_timeout(300)
    assert (page.evaluate("JSON.stringify(viewer.camera)") != before) == zooms
    assert (page.evaluate("scrollY") > 0) == (body == SCROLLED and not zooms)
    hint = page.page.locator("vdi-viewer").get_by_role("status")
    assert hint.is_visible() == (not zooms)
    if not key and body == SCROLLED and not zooms:  # worked in, it is the viewer's
        page.evaluate("scrollTo(0, 0)")
        page.page.mouse.click(80, 80)
        page.page.mouse.wheel(0, -100)
        page.page.wait_for_timeout(300)
        assert page.evaluate("JSON.stringify(viewer.camera)") != before


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


def test_who_asked_for_less_motion_sees_a_series_stand_still(open_page, vdi, tmp_path):
    volumes = [soft_ball() for _ in range(2)]
    series = pvdi.generate_series(volumes, vdi.camera, SIZE, [0.0, 1.0], cmap="bone")
    series.save(tmp_path / "film.html", autoplay=True)
    url = (tmp_path / "film.html").as_uri()
    page = open_page(url=url, reduced_motion="reduce")
    page.ready()
    assert page.evaluate("viewer.playing") is False
    page = open_page(url=url)
    page.wait_for("viewer.playing")


# -- the element -----------------------------------------------------------------------------------


def test_a_strict_policy_leaves_a_viewer_its_looks(around):
    head = """<meta http-equiv="Content-Security-Policy" content="default-src 'self'">"""
    page = around("<vdi-viewer src='ball.vdi'></vdi-viewer>", head)
    page.ready()
    looks = "[viewer.offsetWidth > 100, viewer.offsetHeight > 50, getComputedStyle(viewer).display]"
    assert page.evaluate(looks) == [True, True, "block"]
    assert page.evaluate(f"({COVERED})(viewer)") > 0.2


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


def test_a_file_that_a_visitor_chose_is_shown(vdi, data, open_page):
    page = open_page(SIZE)
    page.evaluate(
        "(text) => viewer.load(new File([bytesOf(text)], 'ball.vdi')).then(() => true)",
        in_base64(data),
    )
    page.assert_shows(vdi, SIZE)


def test_its_name_its_address_and_its_shape_on_paper(around):
    """A name of the page's is the picture's, and ``src`` is a property, too."""
    page = around("{viewer}", attributes='aria-label="a ball"', expected="404")
    page.ready()
    assert page.page.get_by_role("img", name="a ball").is_visible()
    page.evaluate("viewer.removeAttribute('aria-label')")
    assert page.page.get_by_role("img", name="volume, to be turned").is_visible()

    fit = "getComputedStyle(viewer.shadowRoot.querySelector('canvas')).objectFit"
    assert page.evaluate(fit) == "fill"
    page.page.emulate_media(media="print")
    assert page.evaluate(fit) == "contain"

    assert page.evaluate("viewer.src") == "ball.vdi"
    failed = "viewer.src = 'none.vdi', viewer.ready.catch(({ message }) => message)"
    assert "none.vdi cannot be read: 404" in page.evaluate(failed)
    assert page.evaluate("viewer.getAttribute('src')") == "none.vdi"


def test_a_scene_that_is_damaged_is_made_up_for_by_the_next(vdi, data, open_page):
    page = open_page(SIZE, script='import { Scene } from "./scene.js"; window.Scene = Scene;')
    page.load(data)
    for after in ("null", "new Scene(good)"):
        said = page.evaluate(
            f"""async () => {{
              const packed = async (blob) => new Uint8Array(await new Response(
                blob.stream().pipeThrough(new CompressionStream("deflate"))).arrayBuffer());
              const head = {{ camera: null, size: [1, 1], meshes: [], pictures: [], arrays: [],
                vdis: [{{ file: null, planes: [],
                  matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }}] }};
              const json = JSON.stringify(head), text = json + " ".repeat(-json.length & 3);
              const good = await packed(new Blob([new Uint32Array([text.length]), text]));
              const broken = new Scene(new Uint8Array([1, 2, 3]));
              viewer.scene = broken;
              await broken.whole.catch(() => {{}});
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


def test_a_scene_is_shown_by_one_viewer(open_page, vdi, data):
    page = open_page(SIZE, script='import { Scene } from "./scene.js"; window.Scene = Scene;')
    page.load(data)
    said = page.evaluate(
        """() => {
          const broken = new Scene(new Uint8Array([1]));
          const other = document.createElement("vdi-viewer");
          broken.loaded.catch(() => {});
          viewer.scene = broken;
          const refused = () => {
            try { other.scene = broken; return ""; } catch ({ message }) { return message; }
          };
          const first = refused();
          viewer.scene = null;
          return [first, refused()];
        }"""
    )
    assert "shown by one viewer" in said[0]
    assert said[1] == ""


def test_viewers_follow_each_other(around):
    """Both tell the other of each view, without end if an equal one were another."""
    page = around("{viewer}{viewer}")
    all_ready(page)
    page.evaluate(
        """() => {
          const [one, other] = document.querySelectorAll("vdi-viewer");
          for (const [from, to] of [[one, other], [other, one]]) {
            from.addEventListener("camerachange", () => { to.camera = from.camera; });
          }
          one.camera = { ...one.camera, view_angle: 20 };
        }"""
    )
    angles = "[...document.querySelectorAll('vdi-viewer')].map((v) => v.camera.view_angle)"
    assert page.evaluate(angles) == [20, 20]


def test_another_address_is_looked_at_where_it_lies(vdi, data, open_page):
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
