"""The element of pages, in a real browser: what it shows, tells and does."""

from __future__ import annotations

import base64
from io import BytesIO

import numpy as np
import pytest
from plugin_scenes import soft_ball
from skimage.io import imread

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

#: Odd, so that no ray of a smaller picture runs along a border of lists.
SIZE = (161, 91)

#: Of 255: a picture has 8 bits, and float32 of two devices composites; A's tests have the rest.
CLOSE = 1.0

#: The last frame has all pixels.
AT_REST = "heard.filter(([name]) => name === 'framedrawn').at(-1)[1].full"

WITHOUT_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind === "webgl2" ? null : getContext.call(this, kind, ...rest);
};
"""


@pytest.fixture(scope="module")
def vdi(default_runtime):
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    return pvdi.generate(volume, camera, SIZE, cmap="viridis", clim=(0, 1))


@pytest.fixture(scope="module")
def data(vdi, tmp_path_factory):
    path = tmp_path_factory.mktemp("web") / "ball.vdi"
    vdi.save(path, compression="deflate")
    return path.read_bytes()


def worst(picture, vdi, camera):
    expected = pvdi.render(vdi, camera, picture.shape[1::-1]) * 255.0
    return np.abs(picture - expected).max()


def heard(page, name):
    return [detail for event, detail in page.evaluate("heard") if event == name]


def test_a_file_is_shown_as_render_draws_it(vdi, data, open_page):
    page = open_page(SIZE, attributes='src="ball.vdi"', files={"ball.vdi": data})
    page.evaluate("viewer.ready.then(() => true)")
    status = page.evaluate("viewer.status")
    assert status["state"] == "full"
    assert status["supersegments"] == vdi.n_supersegments
    assert status["lists"] == list(SIZE)
    page.wait_for(AT_REST)
    camera = page.evaluate("viewer.camera")
    for name in ("position", "focal_point", "view_up", "view_angle"):
        np.testing.assert_array_equal(camera[name], getattr(vdi.camera, name))
    for view in (vdi.camera, vdi.camera.azimuth(40), vdi.camera.elevation(-70)):
        assert worst(page.screenshot(view, SIZE), vdi, view) <= CLOSE
    parallel = vdi.camera.azimuth(130).replace(parallel_projection=True, parallel_scale=1.0)
    assert worst(page.screenshot(parallel, SIZE), vdi, parallel) <= CLOSE


def test_what_is_on_the_page_is_the_picture_over_its_background(vdi, data, open_page):
    page = open_page(SIZE)
    page.load(data)
    page.evaluate("viewer.background = [0.2, 0.4, 0.6]")
    page.wait_for(AT_REST)
    area = {"x": 0, "y": 0, "width": SIZE[0], "height": SIZE[1]}
    picture = pvdi.render(vdi, vdi.camera, SIZE)
    expected = (picture[..., :3] + (1 - picture[..., 3:]) * [0.2, 0.4, 0.6]) * 255
    for _ in range(200):  # the browser shows what was drawn when it comes to it
        shown = imread(BytesIO(page.page.screenshot(clip=area)))[..., :3]
        off = np.abs(shown - expected).max()
        if off <= 2:  # rounded twice, once by the canvas and once by the page
            break
        page.page.wait_for_timeout(100)
    assert off <= 2


CHANGES = [
    ("rotate", (37, -21)), ("pan", (-30, 14)), ("spin", (25, 9)), ("dolly", (3, 17)),
]  # fmt: skip


@pytest.mark.every(2)
@pytest.mark.parametrize("parallel", [False, True])
def test_drags_are_those_of_vtks_trackball_camera(parallel, data, open_page):
    """By VTK's own style, with its own events, in a window of the same size."""
    vtk = pytest.importorskip("vtk")
    page = open_page((300, 200))
    page.load(data)
    page.evaluate("import('./interaction.js').then((m) => { window.dragged = m.dragged; })")
    window, renderer = vtk.vtkRenderWindow(), vtk.vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetSize(300, 200)
    window.AddRenderer(renderer)
    interactor = vtk.vtkRenderWindowInteractor()
    interactor.SetRenderWindow(window)
    interactor.EnableRenderOff()
    style = vtk.vtkInteractorStyleTrackballCamera()
    style.SetAutoAdjustCameraClippingRange(0)
    interactor.SetInteractorStyle(style)
    interactor.SetSize(300, 200)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(1, 2, 5)
    camera.SetFocalPoint(0.5, 0.1, 0)
    camera.SetViewUp(0.1, 1, 0.2)
    camera.SetViewAngle(33)
    camera.SetParallelScale(1.5)
    camera.SetParallelProjection(parallel)
    camera.OrthogonalizeViewUp()

    def state():
        scale = {"parallel_scale": camera.GetParallelScale()}
        angle = {"view_angle": camera.GetViewAngle()}
        return {
            "position": camera.GetPosition(),
            "focal_point": camera.GetFocalPoint(),
            "view_up": camera.GetViewUp(),
            **(scale if parallel else angle),
        }

    buttons = {
        "rotate": ("Left", 0, 0),
        "pan": ("Left", 0, 1),
        "spin": ("Left", 1, 0),
        "dolly": ("Right", 0, 0),
    }
    for what, (dx, dy) in CHANGES:
        before, at = state(), (140, 120)
        button, control, shift = buttons[what]
        interactor.SetEventInformation(*at, control, shift)
        interactor.InvokeEvent(f"{button}ButtonPressEvent")
        interactor.SetEventInformation(at[0] + dx, at[1] + dy, control, shift)
        interactor.InvokeEvent("MouseMoveEvent")
        interactor.InvokeEvent(f"{button}ButtonReleaseEvent")
        after = page.evaluate(
            "([what, camera, from, to]) => dragged(what, camera, from, to, [300, 200])",
            [what, before, at, (at[0] + dx, at[1] + dy)],
        )
        expected = state()
        assert any(not np.allclose(expected[k], before[k], atol=1e-3) for k in expected), what
        for name, value in expected.items():
            # VTK goes through the focal point's depth in the window, in float64
            np.testing.assert_allclose(after[name], value, atol=1e-6, err_msg=what)


def test_people_turn_it_by_mouse_wheel_and_keys(vdi, data, open_page):
    page = open_page((300, 200))
    page.load(data)
    cameras = [page.evaluate("viewer.camera")]

    def moved():
        page.wait_for("viewer.status.state === 'full'")
        camera = page.evaluate("viewer.camera")
        assert camera != cameras[-1]
        cameras.append(camera)
        return camera

    mouse = page.page.mouse
    mouse.move(150, 100)
    mouse.down()
    mouse.move(180, 110)
    mouse.up()
    expected = page.evaluate(
        """async (camera) => (await import("./interaction.js"))
          .dragged("rotate", camera, [150, 100], [180, 90], [300, 200])""",
        cameras[0],
    )
    turned = moved()
    for name, value in expected.items():
        np.testing.assert_allclose(turned[name], value, err_msg=name)
    mouse.wheel(0, -100)
    distance = [
        np.linalg.norm(np.subtract(c["position"], c["focal_point"])) for c in (cameras[-1], moved())
    ]
    assert distance[0] / distance[1] == pytest.approx(1.1**2)
    page.page.keyboard.press("ArrowLeft")
    moved()
    page.page.keyboard.press("r")
    np.testing.assert_allclose(moved()["position"], vdi.camera.position)
    # At rest all pixels are drawn
    page.wait_for(AT_REST)
    assert len(heard(page, "camerachange")) >= 4


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


def test_a_view_that_shows_nothing_is_refused(data, open_page):
    page = open_page(SIZE)
    page.load(data)
    before = page.evaluate("viewer.camera")
    for camera, message in (
        ("{}", "position is three finite numbers"),
        ("{...viewer.camera, position: viewer.camera.focal_point}", "are the same point"),
        ("{...viewer.camera, view_angle: 180}", "view_angle is a positive number below 180"),
        ("{...viewer.camera, view_angle: undefined, parallel_scale: -1}", "parallel_scale is"),
        ("{...viewer.camera, view_up: [0, 0, 0]}", "view_up"),
        ("{...viewer.camera, window_center: [0, NaN]}", "window_center is two finite numbers"),
    ):
        tried = f"try {{ viewer.camera = {camera} }} catch (error) {{ return error.message }}"
        answer = page.evaluate(f"() => {{ {tried} }}")
        assert message in answer
        assert page.evaluate("viewer.camera") == before


@pytest.mark.slow
def test_planes_that_clip_nothing_or_all_are_refused(data, open_page):
    page = open_page(SIZE)
    page.load(data)
    plane = "{ origin: [0, 0, 0], normal: [1, 0, 0] }"
    page.evaluate(f"viewer.clippingPlanes = [{plane}]")
    for planes, message in (
        ("[{ origin: [0, 0, 0], normal: [0, 0, 0] }]", "normal is not zero"),
        ("[{ origin: [0, NaN, 0], normal: [1, 0, 0] }]", "origin is three finite numbers"),
        ("[{ normal: [1, 0, 0] }]", "origin is three finite numbers; got undefined"),
        (f"Array(9).fill({plane})", "At most 8 planes clip a VDI; got 9"),
    ):
        tried = (
            f"try {{ viewer.clippingPlanes = {planes} }} catch (error) {{ return error.message }}"
        )
        assert message in page.evaluate(f"() => {{ {tried} }}")
        assert len(page.evaluate("viewer.clippingPlanes")) == 1


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
    page.evaluate(IN_PIECES, [base64.b64encode(data).decode()])
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
    assert worst(page.screenshot(vdi.camera, SIZE), vdi, vdi.camera) <= CLOSE


@pytest.mark.slow
def test_who_waits_for_what_is_given_up_waits_for_what_is_shown(data, open_page):
    page = open_page(SIZE)
    page.evaluate(IN_PIECES, [base64.b64encode(data).decode()])
    page.evaluate("void (window.ready = viewer.ready)")
    page.load(data)
    assert page.evaluate("Promise.all([first, ready]).then(() => viewer.status.state)") == "full"


@pytest.mark.slow
def test_there_is_no_picture_of_an_element_off_the_page(data, open_page):
    page = open_page(SIZE)
    page.load(data)
    message = "viewer.screenshot().catch(({ message }) => message)"
    assert "off the page" in page.evaluate(f"viewer.remove(), {message}")


@pytest.mark.slow
def test_what_is_wrong_with_what_was_decoded_ends_the_load(open_page):
    page = open_page(SIZE)
    answer = page.evaluate(
        """async () => {
          const { askPort } = await import("./port.js");
          const port = { postMessage() { port.onmessage({ data: { prepared: 1 } }); } };
          const hear = () => { throw new Error("too large"); };
          return askPort(port, {}, hear).catch(({ message }) => message);
        }"""
    )
    assert answer == "too large"


def test_what_is_no_vdi_is_said_on_the_page(data, open_page):
    page = open_page(SIZE, expected="404")
    page.load(data)
    for source in ("'none.vdi'", "bytesOf(btoa('no VDI at all'))"):
        answer = page.evaluate(
            f"""viewer.load({source}.length > 8 ? {source} : new URL({source}, document.baseURI))
              .then(() => "shown", (error) => error.message)"""
        )
        assert answer == heard(page, "error")[-1]["message"] != "shown"
        assert page.evaluate("viewer.status")["state"] == "error"
        alert = page.page.locator("vdi-viewer").get_by_role("alert")
        assert alert.inner_text() == answer
    page.load(data)
    assert page.evaluate("viewer.status.state") == "full"


def test_a_lost_context_is_restored(vdi, data, open_page):
    page = open_page(SIZE, expected="CONTEXT_LOST|context")
    page.load(data)
    page.evaluate(
        """() => new Promise((resolve) => {
          const canvas = viewer.shadowRoot.querySelector("canvas");
          const extension = canvas.getContext("webgl2").getExtension("WEBGL_lose_context");
          canvas.addEventListener("webglcontextrestored", () => resolve());
          canvas.addEventListener("webglcontextlost", () =>
            setTimeout(() => extension.restoreContext(), 0));
          extension.loseContext();
        })"""
    )
    view = vdi.camera.azimuth(20)
    assert worst(page.screenshot(view, SIZE), vdi, view) <= CLOSE


def test_without_webgl_there_is_a_sentence_and_a_still_picture(open_page):
    dot = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"
    page = open_page(SIZE, attributes=f'still="{dot}"', before=WITHOUT_WEBGL)
    message = page.evaluate("viewer.status.message ?? ''")
    assert page.evaluate("viewer.ready.catch((error) => error.message)") == message
    assert "no WebGL 2" in message
    assert page.page.locator("vdi-viewer img").first.is_visible()


def test_dense_screens_and_other_sizes(vdi, data, open_page):
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
    assert worst(page.screenshot(vdi.camera, SIZE), vdi, vdi.camera) <= CLOSE


#: Counts what a page has of each kind of WebGL's objects.
COUNTING = """
window.alive = {};
const of = WebGL2RenderingContext.prototype;
for (const kind of ["Texture", "Framebuffer", "Program", "VertexArray", "Shader"]) {
  const [make, free] = [of["create" + kind], of["delete" + kind]];
  alive[kind] = 0;
  of["create" + kind] = function (...rest) { ++alive[kind]; return make.apply(this, rest); };
  of["delete" + kind] = function (what) { alive[kind] -= !!what; return free.call(this, what); };
}
"""


@pytest.mark.slow
def test_memory_stays_flat_over_frames_and_swaps(data, open_page):
    """Ten thousand frames, and two hundred other VDIs, whose textures replace those before."""
    page = open_page((64, 36), before=COUNTING)
    page.load(data)
    page.evaluate(
        f"""async () => {{
          const bytes = bytesOf({base64.b64encode(data).decode()!r});
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
