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
from browsers import HELPERS, array_of
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


def picture_in_firefox(folder, page):
    """The picture of a page's viewer, premultiplied, uint8 (H, W, 4)."""
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
            with ThreadPoolExecutor(1) as apart:  # Playwright's loop may run in this thread
                text = apart.submit(asyncio.run, evaluated(port, page.as_uri(), SHOT)).result()
        finally:
            process.terminate()
            process.wait()
            process.stderr.close()
    return array_of(text, np.uint8).reshape(*SIZE[::-1], 4)


def test_a_page_from_disk_is_drawn_as_render_draws_it(tmp_path, default_runtime):
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    vdi = pvdi.generate(volume, camera, SIZE, cmap="viridis", clim=(0, 1))
    shown = picture_in_firefox(tmp_path, vdi.save(tmp_path / "ball.html"))
    expected = pvdi.render(vdi.with_precision("8-byte"), camera, SIZE) * 255.0
    assert expected.max() > 200
    # 8 bits, and other roundings of float32
    assert np.abs(shown - expected).max() <= 1
