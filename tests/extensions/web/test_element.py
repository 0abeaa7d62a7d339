"""The element of pages, in a real browser: what it shows, tells and does."""

from io import BytesIO

import numpy as np
import pytest
import pyvista as pv
from browsers import COUNTING, in_base64
from rewriting import described
from skimage.io import imread

import pyvista_vdi as pvdi

#: Odd, so that no ray of a smaller picture runs along a border of lists.
SIZE = (161, 91)

#: The last frame has all pixels.
AT_REST = "heard.filter(([name]) => name === 'framedrawn').at(-1)?.[1].full"

WITHOUT_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind === "webgl2" ? null : getContext.call(this, kind, ...rest);
};
"""


@pytest.fixture
def ball(data, open_page):
    """A page that shows the ball, in a viewer that tests share."""
    return open_page(SIZE, data=data)


def heard(page, name):
    return [detail for event, detail in page.evaluate("heard") if event == name]


def test_a_file_is_shown_as_render_draws_it(vdi, data, open_page):
    page = open_page(SIZE, attributes='src="ball.vdi"', files={"ball.vdi": data})
    page.ready()
    status = page.evaluate("viewer.status")
    assert status["state"] == "full"
    assert status["supersegments"] == vdi.n_supersegments
    assert status["lists"] == list(SIZE)
    page.wait_for(AT_REST)
    camera = page.evaluate("viewer.camera")
    for name in ("position", "focal_point", "view_up", "view_angle"):
        np.testing.assert_array_equal(camera[name], getattr(vdi.camera, name))
    parallel = vdi.camera.azimuth(130).replace(parallel_projection=True, parallel_scale=1.0)
    turned = vdi.camera.azimuth(40), vdi.camera.elevation(-70)
    page.assert_shows(vdi, SIZE, vdi.camera, *turned, parallel)


def test_what_is_on_the_page_is_the_picture_over_its_background(vdi, ball):
    ball.evaluate("viewer.background = [0.2, 0.4, 0.6]")
    ball.wait_for(AT_REST)
    area = {"x": 0, "y": 0, "width": SIZE[0], "height": SIZE[1]}
    picture = pvdi.render(vdi, vdi.camera, SIZE)
    expected = (picture[..., :3] + (1 - picture[..., 3:]) * [0.2, 0.4, 0.6]) * 255
    for _ in range(200):  # the browser shows what was drawn when it comes to it
        shown = imread(BytesIO(ball.page.screenshot(clip=area)))[..., :3]
        off = np.abs(shown - expected).max()
        if off <= 2:  # rounded twice, once by the canvas and once by the page
            break
        ball.page.wait_for_timeout(100)
    assert off <= 2


#: What is done by which button, with which keys, and how far.
DRAGS = {
    "rotate": ("Left", {}, (37, -21)),
    "pan": ("Left", {"shift": 1}, (-30, 14)),
    "spin": ("Left", {"control": 1}, (25, 9)),
    "dolly": ("Right", {}, (3, 17)),
}


@pytest.mark.every(2)
@pytest.mark.parametrize("parallel", [False, True])
def test_drags_are_those_of_vtks_trackball_camera(parallel, ball):
    """By VTK's own style, with its own events, in a window of the same size."""
    plotter = pv.Plotter(off_screen=True, window_size=(300, 200))
    plotter.enable_trackball_style()
    plotter.show(auto_close=False)
    interactor, camera = plotter.iren.interactor, plotter.camera
    interactor.EnableRenderOff()
    interactor.GetInteractorStyle().SetAutoAdjustCameraClippingRange(0)
    camera.SetPosition(1, 2, 5)
    camera.SetFocalPoint(0.5, 0.1, 0)
    camera.SetViewUp(0.1, 1, 0.2)
    camera.SetViewAngle(33)
    camera.SetParallelScale(1.5)
    camera.SetParallelProjection(parallel)
    camera.OrthogonalizeViewUp()
    lens = "ParallelScale" if parallel else "ViewAngle"
    names = {"position": "Position", "focal_point": "FocalPoint", "view_up": "ViewUp"}
    names["parallel_scale" if parallel else "view_angle"] = lens

    def state():
        return {name: getattr(camera, f"Get{theirs}")() for name, theirs in names.items()}

    for what, (button, keys, (dx, dy)) in DRAGS.items():
        before, at = state(), (140, 120)
        to = (at[0] + dx, at[1] + dy)
        for event, place in (("ButtonPress", at), ("MouseMove", to), ("ButtonRelease", to)):
            interactor.SetEventInformation(*place, keys.get("control", 0), keys.get("shift", 0))
            interactor.InvokeEvent(f"{'' if event == 'MouseMove' else button}{event}Event")
        after = ball.evaluate(
            """async (given) =>
              (await import("./interaction.js")).dragged(...given, [300, 200])""",
            [what, before, at, to],
        )
        expected = state()
        assert any(not np.allclose(expected[k], before[k], atol=1e-3) for k in expected), what
        for name, value in expected.items():
            # VTK goes through the focal point's depth in the window, in float64
            np.testing.assert_allclose(after[name], value, atol=1e-6, err_msg=what)
    plotter.close()


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
    assert len(heard(ball, "camerachange")) >= 4


def test_two_fingers_pinch(data, open_page):
    """What is under the fingers stays under them: twice as far apart is twice as near."""
    page = open_page((300, 200), has_touch=True)
    page.load(data)
    before = page.evaluate("viewer.camera")
    page.evaluate(
        """() => {
          const canvas = viewer.shadowRoot.querySelector("canvas");
          canvas.setPointerCapture = () => {};
          const send = (kind, pointerId, clientX) => canvas.dispatchEvent(new PointerEvent(
            kind, { pointerId, clientX, clientY: 100, pointerType: "touch", bubbles: true }));
          send("pointerdown", 1, 125);
          send("pointerdown", 2, 175);
          for (let k = 1; k <= 25; ++k) {
            send("pointermove", 1, 125 - k);
            send("pointermove", 2, 175 + k);
          }
          send("pointerup", 1, 100);
          send("pointerup", 2, 200);
        }"""
    )
    after = page.evaluate("viewer.camera")
    apart = [np.subtract(c["position"], c["focal_point"]) for c in (before, after)]
    np.testing.assert_allclose(2 * apart[1], apart[0], rtol=1e-9)
    np.testing.assert_allclose(after["focal_point"], before["focal_point"], atol=1e-2)


PLANE = "{ origin: [0, 0, 0], normal: [1, 0, 0] }"
REFUSED = [
    ("camera", "{}", "position is three finite numbers"),
    ("camera", "{...it, position: it.focal_point}", "are the same point"),
    ("camera", "{...it, view_angle: 180}", "view_angle is a positive number below 180"),
    ("camera", "{...it, view_angle: undefined, parallel_scale: -1}", "parallel_scale is"),
    ("camera", "{...it, view_up: [0, 0, 0]}", "view_up"),
    ("camera", "{...it, window_center: [0, NaN]}", "window_center is two finite numbers"),
    ("clippingPlanes", "[{ origin: [0, 0, 0], normal: [0, 0, 0] }]", "normal is not zero"),
    ("clippingPlanes", "[{ origin: [0, NaN, 0], normal: [1, 0, 0] }]", "origin is three finite"),
    ("clippingPlanes", "[{ normal: [1, 0, 0] }]", "origin is three finite numbers; got undefined"),
    ("clippingPlanes", f"Array(25).fill({PLANE})", "At most 24 planes clip a VDI; got 25"),
]


def test_views_and_planes_that_show_nothing_are_refused(ball):
    ball.evaluate(f"viewer.clippingPlanes = [{PLANE}]")
    for name, value, message in REFUSED:
        before, answer, after = ball.evaluate(
            f"""() => {{
              const it = viewer.{name}, tell = (after) => [it, after, viewer.{name}];
              try {{ viewer.{name} = {value}; }} catch (error) {{ return tell(error.message); }}
              return tell("taken");
            }}"""
        )
        assert message in answer
        assert after == before


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


@pytest.mark.every(3)
@pytest.mark.parametrize("apart", ["", "await new Promise((done) => setTimeout(done));"])
def test_an_element_that_is_moved_goes_on_loading(apart, vdi, data, open_page):
    """Also one that has been off the page for a while."""
    page = open_page(SIZE)
    page.evaluate(IN_PIECES, [in_base64(data)])
    page.evaluate(
        f"""async () => {{
          const {{ parentNode }} = viewer;
          viewer.remove();
          {apart}
          parentNode.append(viewer);
          goOn();
          await Promise.all([first, viewer.ready]);
        }}"""
    )
    page.assert_shows(vdi, SIZE)


@pytest.mark.slow
def test_who_waits_for_what_is_given_up_waits_for_what_is_shown(data, open_page):
    page = open_page(SIZE)
    page.evaluate(IN_PIECES, [in_base64(data)])
    page.evaluate("void (window.ready = viewer.ready)")
    page.load(data)
    assert page.evaluate("Promise.all([first, ready]).then(() => viewer.status.state)") == "full"
    # Off the page there is no picture
    message = "viewer.screenshot().catch(({ message }) => message)"
    assert "off the page" in page.evaluate(f"viewer.remove(), {message}")


@pytest.mark.slow
def test_what_is_wrong_with_what_was_decoded_ends_the_load(open_page):
    answer = open_page(SIZE).evaluate(
        """async () => {
          const { askPort } = await import("./port.js");
          const port = { postMessage() { port.onmessage({ data: { prepared: 1 } }); } };
          const hear = () => { throw new Error("too large"); };
          return askPort(port, {}, hear).catch(({ message }) => message);
        }"""
    )
    assert answer == "too large"


#: Show one file after the other in the same element: what it says, or what is then seen.
SHOW = """async (names) => {
  const said = [];
  for (const name of names) {
    heard.length = 0;
    viewer.setAttribute("src", name);
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
    """How it is said; tests/extensions/web/test_decode.py has in which places files are broken."""
    changed = bytearray(data)
    changed[len(data) // 2] ^= 1
    bad = {data[: len(data) // 2]: "truncated", bytes(changed): "damaged", b"": "it is empty"}
    bad[b"<p>Not found, but with status 200"] = "this is no VDI file: it begins"
    bad[b"PK\3\4" + b"\0" * 100] = "VDI"
    for change in ({"n_supersegments": 10**9}, {"camera": None}, {"version": 99}, {"arrays": {}}):
        bad[described(data, **change)] = "VDI"
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
    assert page.page.locator("vdi-viewer").get_by_role("alert").is_hidden()


def test_without_webgl_there_is_a_sentence_and_a_still_picture(open_page):
    dot = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"
    page = open_page(SIZE, attributes=f'still="{dot}"', before=WITHOUT_WEBGL)
    message = page.evaluate("viewer.status.message ?? ''")
    assert page.evaluate("viewer.ready.catch((error) => error.message)") == message
    assert "no WebGL 2" in message
    assert page.page.locator("vdi-viewer img").first.is_visible()


def test_dense_screens_and_other_sizes(data, open_page):
    page = open_page((100, 60), device_scale_factor=2)
    page.load(data)
    edges = "(({width, height}) => [width, height])(viewer.shadowRoot.querySelector('canvas'))"
    assert page.evaluate(edges) == [200, 120]
    page.evaluate("viewer.style.width = '130px'")
    page.wait_for(f"{edges}[0] === 260")
    page.wait_for(AT_REST)


@pytest.mark.slow
def test_elements_come_and_go(vdi, data, open_page):
    page = open_page(SIZE)
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


@pytest.mark.slow
def test_memory_stays_flat_over_frames_and_swaps(data, open_page):
    """Ten thousand frames, and two hundred other VDIs, whose textures replace those before."""
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
              viewer.camera = {{ ...rest, position: [x + 0.1 * Math.cos(angle), y, z] }};
              await drawn;
              if (k % Math.ceil(frames / swaps) === 0) await viewer.showBytes(bytes.slice());
              heard.length = 0;
            }}
            await viewer.showBytes(bytes.slice());
          }};
        }}"""
    )
    session = page.page.context.new_cdp_session(page.page)

    def memory():
        page.wait_for("viewer.status.state === 'full'")
        session.send("HeapProfiler.collectGarbage")
        used = session.send("Runtime.getHeapUsage")
        return page.evaluate("alive"), used["usedSize"] + used.get("backingStorageSize", 0)

    page.evaluate("use(500, 20)")
    objects, used = memory()
    page.evaluate("use(10000, 200)")
    objects_after, used_after = memory()
    assert objects_after == objects
    # Compiled code comes and goes. The 200 VDIs, if kept, would be some 40 MB
    assert used_after < used + 2e6
