"""Pages from disk in a real Firefox, by WebDriver BiDi, which it speaks itself.

``PYVISTA_VDI_FIREFOX`` names the executable where it is not in the path.
"""

import asyncio
import os
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import pyvista as pv
from browsers import HELPERS, array_of, picture
from plugin_scenes import soft_ball
from virtual_screen import virtual_screen

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

aiohttp = pytest.importorskip("aiohttp")
pytestmark = pytest.mark.slow

SIZE = (161, 91)

#: WebGL by software, in a container whose root has no sandbox.
PREFERENCES = {"webgl.force-enabled": "true", "security.sandbox.content.level": "0"}

SOFTWARE = {"LIBGL_ALWAYS_SOFTWARE": "1", "MOZ_X11_EGL": "1"}

SHOT = f"""async () => {{
  {HELPERS}
  const viewer = document.querySelector("vdi-viewer");
  await viewer.ready;
  return textOf((await viewer.screenshot({{ width: {SIZE[0]}, height: {SIZE[1]} }})).data);
}}"""


async def evaluated(port, url, script):
    """Open a page, and call a function there; return its answer."""
    async with aiohttp.ClientSession() as session:
        for _ in range(600):
            try:
                socket = await session.ws_connect(f"ws://127.0.0.1:{port}/session", max_msg_size=0)
                break
            except aiohttp.ClientError:
                await asyncio.sleep(0.1)
        numbers = iter(range(1, 100))

        async def call(method, **params):
            number = next(numbers)
            await socket.send_json({"id": number, "method": method, "params": params})
            async for message in socket:
                answer = message.json()
                if answer.get("id") == number:
                    assert answer["type"] == "success", answer
                    return answer["result"]
            raise AssertionError("Firefox has gone")

        await call("session.new", capabilities={})
        tree = await call("browsingContext.getTree")
        context = tree["contexts"][0]["context"]
        await call("browsingContext.navigate", context=context, url=url, wait="interactive")
        answer = await call(
            "script.callFunction",
            functionDeclaration=script,
            awaitPromise=True,
            target={"context": context},
        )
        assert answer["type"] == "success", answer["exceptionDetails"]["text"]
        return answer["result"]["value"]


def picture_in_firefox(folder, page, script=SHOT):
    """The picture of a page's viewer, premultiplied, uint8 (H, W, 4); ``page``: path or address."""
    named = os.environ.get("PYVISTA_VDI_FIREFOX")
    executable = named or shutil.which("firefox-esr") or shutil.which("firefox")
    if executable is None:
        pytest.skip("no Firefox is in the path: install the system's package 'firefox-esr'")
    profile = folder / "profile"
    profile.mkdir()
    (profile / "user.js").write_text(
        "".join(f'user_pref("{name}", {value});\n' for name, value in PREFERENCES.items())
    )
    with virtual_screen() as display:  # headless it has no WebGL without a GPU
        process = subprocess.Popen(
            [executable, "--profile", profile, "--remote-debugging-port", "0"],
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "HOME": str(folder), "DISPLAY": display, **SOFTWARE},
        )
        try:
            addresses = (re.search(r"ws://[^:]*:(\d+)", line) for line in process.stderr)
            port = next(filter(None, addresses))[1]
            url = page if isinstance(page, str) else page.as_uri()
            with ThreadPoolExecutor(1) as apart:  # Playwright's loop may run in this thread
                text = apart.submit(asyncio.run, evaluated(port, url, script)).result()
        finally:
            process.terminate()
            process.wait()
            process.stderr.close()
    return array_of(text, np.uint8).reshape(*SIZE[::-1], 4)


def assert_as_rendered(folder, page, vdi, script=SHOT):
    expected = pvdi.render(vdi, vdi.camera, SIZE) * 255.0
    assert expected.max() > 200
    # 8 bits, and other roundings of float32
    assert np.abs(picture_in_firefox(folder, page, script) - expected).max() <= 1


def test_a_page_from_disk_is_drawn_as_render_draws_it(tmp_path, default_runtime):
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    vdi = pvdi.generate(volume, camera, SIZE, cmap="viridis", clim=(0, 1))
    assert_as_rendered(tmp_path, vdi.save(tmp_path / "ball.html"), vdi.with_precision("8-byte"))


@pytest.mark.gl
def test_a_scene_is_drawn_as_vtk_draws_it(tmp_path):
    """Opaque and translucent meshes and a line about a VDI."""
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.add_vdi(soft_ball(), cmap="viridis", opacity="linear", show_scalar_bar=False)
    plotter.add_mesh(pv.Sphere(radius=0.4, center=(1.2, 0.9, 0.9)), color="tomato")
    plotter.add_mesh(pv.Cube(center=(-1, 0.9, 0.9)), color="b", opacity=0.5)
    plotter.add_mesh(pv.Line((-2, -1, 0), (2, 1, 1)), color="k", line_width=3)
    plotter.vdi.export_html(tmp_path / "scene.html")
    picture = picture_in_firefox(tmp_path, tmp_path / "scene.html").astype(float)
    got = picture[..., :3] + 255 - picture[..., 3:]
    expected = plotter.screenshot()[..., :3].astype(float)
    plotter.close()
    assert np.ptp(expected) > 200
    assert np.abs(got - expected).mean() <= 1  # .4 seen, by silhouettes


def test_a_page_of_a_series_shows_its_steps(tmp_path, default_runtime):
    """The last step, by which all that it is written by is decoded: zstd, worker, differences."""
    balls = [soft_ball() for _ in range(3)]
    for k, ball in enumerate(balls):
        ball["v"] = ball["v"] * (1 - 0.1 * k)
    camera = filling_camera(balls[0].bounds, SIZE)
    series = pvdi.generate_series(balls, camera, SIZE, cmap="viridis", clim=(0, 255))
    page = series.save(tmp_path / "balls.html")
    seek = SHOT.replace("await viewer.ready;", "await viewer.ready; viewer.time = 2;", 1)
    assert_as_rendered(tmp_path, page, pvdi.read(page)[2], seek)


def test_a_link_made_in_chromium_opens_in_firefox(tmp_path, default_runtime, open_page):
    """The same view and look, in the picture of another browser's graphics."""
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    vdi = pvdi.generate(volume, camera, SIZE, cmap="viridis", clim=(0, 1))
    page = open_page(url=vdi.save(tmp_path / "ball.html").as_uri())
    page.ready()
    page.evaluate(
        """async () => {
          viewer.camera = { ...viewer.camera, position: [2.1, 1 / 3, -1.7], view_angle: 41 };
          viewer.look = { brightness: 1.5, opacity: 2, clip: [0.1, 1, 0, 1, 0, 0.7] };
          await new Promise((next) => setTimeout(next, 500));
        }"""
    )
    shown = picture(page, SIZE).astype(int)
    assert np.ptp(shown) > 200
    seen = picture_in_firefox(tmp_path, page.evaluate("location.href"))
    assert np.abs(seen - shown).max() <= 1
