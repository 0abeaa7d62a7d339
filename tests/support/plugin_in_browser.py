"""A plotter that a browser watches through a real trame server; the browser is simulated.

Run as a script, with the names of cases: it prints "all well", or what failed. Cells of a notebook
import it as well.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import itertools
import sys
import time
import traceback
import warnings

import aiohttp
import msgpack
import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, add_judge, soft_ball
from skimage.io import imread
from skimage.metrics import structural_similarity
from trame.app import get_server
from trame.ui.vuetify3 import SinglePageLayout
from trame_pyvista.ui import plotter_ui
from trame_server.protocol import CoreServer
from trame_vtk.modules.vtk import get_helper
from wslink.chunking import UnChunker, generate_chunks

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.quality.rate import FrameRate

LONG = 250.0
WINDOW = (241, 203)


class Browser:
    """What a page with a remote view sends to the server and gets from it.

    Attributes
    ----------
    pictures : list of numpy.ndarray
        What was sent, int (H, W, 3).
    """

    def __init__(self, socket, view):
        self.pictures = []
        self._socket = socket
        self._view = view
        self._numbers = itertools.count()

    async def call(self, method, *arguments, name="rpc"):
        """Call a procedure of the server."""
        message = {"wslink": "1.0", "id": f"{name}:c0:{next(self._numbers)}", "method": method}
        message |= {"args": list(arguments), "kwargs": {}}
        for chunk in generate_chunks(msgpack.packb(message), 0):
            await self._socket.send_bytes(chunk)

    async def listen(self):
        """Keep the pictures that come."""
        whole = UnChunker()
        whole.set_max_message_size(2**30)
        async for message in self._socket:
            content = whole.process_chunk(message.data)
            result = content.get("result") if isinstance(content, dict) else None
            if isinstance(result, dict) and result.get("format") == "jpeg":
                self.pictures.append(imread(io.BytesIO(result["image"])).astype(int))

    async def mouse(self, action, x, y, *, held=True):
        """Send a mouse event at a place, each 0 to 1."""
        event = {"view": self._view, "action": action, "x": x, "y": y, "buttonLeft": int(held)}
        rest = ("buttonMiddle", "buttonRight", "shiftKey", "ctrlKey", "altKey", "metaKey")
        await self.call("viewport.mouse.interaction", event | dict.fromkeys(rest, 0))


@contextlib.asynccontextmanager
async def browsing(plotter, server):
    """A browser that shows the plotter's window, as the server draws it."""
    view = get_helper(server).id(plotter.render_window)
    url = f"http://127.0.0.1:{server.port}/ws"
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(url, max_msg_size=0) as socket,
    ):
        browser = Browser(socket, view)
        listening = asyncio.create_task(browser.listen())
        secret = {"secret": CoreServer.authentication_token}
        await browser.call("wslink.hello", secret, name="system")
        await browser.call("viewport.image.push.observer.add", view)
        await until(lambda: browser.pictures)
        yield browser
        listening.cancel()


async def until(happened):
    """Let the loop go on until something is so."""
    end = time.monotonic() + LONG
    while not happened():
        assert time.monotonic() < end, "it has not happened"
        await asyncio.sleep(0.01)


@contextlib.asynccontextmanager
async def served(plotter, mode):
    """A trame server with a view of the plotter; the server, and the view."""
    server = get_server(client_type="vue3")
    with SinglePageLayout(server) as layout, layout.content:
        view = plotter_ui(plotter, mode=mode)
    task = server.start(
        exec_mode="task", port=0, host="127.0.0.1", open_browser=False, show_connection_info=False
    )
    await server.ready
    yield server, view
    await server.stop()
    await task


def scene(**options):
    """A plotter with a ball of two supersegments per list."""
    plotter = pv.Plotter(off_screen=True, window_size=WINDOW)
    volume = soft_ball()
    actor = plotter.add_vdi(volume, max_supersegments=2, **{"draw": "vdi", **LOOKS, **options})
    actor.prop.interpolation_type = "linear"
    plotter.camera_position = ((6, 0, 0), (0, 0, 0), (0, 0, 1))
    return plotter, actor, volume


async def turned_by_hand(plotter, actor, volume, browser):
    """Previews while a hand moves; at rest a VDI of the view comes by itself, and its picture."""
    first = actor.vdi
    await browser.mouse("down", 0.5, 0.5)
    places = itertools.cycle([*np.linspace(0.5, 0.9, 9), *np.linspace(0.9, 0.5, 9)])
    end = time.monotonic() + LONG
    while actor.status.mode != "preview":
        assert time.monotonic() < end, "no preview"
        seen = len(browser.pictures)
        await browser.mouse("move", next(places), 0.5)
        await until(lambda seen=seen: len(browser.pictures) > seen)
    await browser.mouse("move", 0.85, 0.4)
    await browser.mouse("up", 0.85, 0.4, held=False)
    await until(lambda: actor.status.mode == "full")
    plotter.camera.zoom(3)
    plotter.render()
    source = actor.mapper.GetSource()
    await until(lambda: source.GetCamera().view_angle == pytest.approx(plotter.camera.view_angle))
    assert actor.vdi is not first
    assert actor.status.angle < 1e-6
    await shows(plotter, volume, browser)


async def changed(plotter, actor, volume, browser):
    """New data are seen at once, and their VDI by itself."""
    volume["v"][:] = volume["v"] * 0.5
    plotter.render()
    await shows(plotter, volume, browser)
    await until(lambda: not actor.status.stand_in and actor.status.progress is None)
    await shows(plotter, volume, browser)


async def shows(plotter, volume, browser):
    """Wait for the browser to have VTK's picture of the volume."""
    judge = pv.Plotter(off_screen=True, window_size=plotter.window_size)
    add_judge(judge, volume)
    judge.camera = plotter.camera.copy()
    judge.show(auto_close=False)
    wanted = np.asarray(judge.screenshot(return_img=True)).astype(int)
    judge.close()
    # As for files and windows, less what JPEG takes
    await until(
        lambda: (
            structural_similarity(browser.pictures[-1], wanted, channel_axis=2, data_range=255)
            > 0.97
        )
    )


async def follows_the_view():
    """A remote view: previews, a VDI of the view at rest, and changes, as on screen."""
    plotter, actor, volume = scene(settings=pvdi.Settings(regenerate_below=0.9999))
    async with served(plotter, "server") as (server, _), browsing(plotter, server) as browser:
        await turned_by_hand(plotter, actor, volume, browser)
        await changed(plotter, actor, volume, browser)
    plotter.close()


async def warns_where_the_browser_draws():
    """A view of both kinds warns of the missing VDI when it is drawn in the browser, not before."""
    plotter, _, _ = scene()
    async with served(plotter, "trame") as (server, view), browsing(plotter, server):
        view.update()
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", VDIWarning)
            server.state[f"{plotter._id_name}_use_server_rendering"] = False
            server.state.flush()
            await until(lambda: said)
        assert "exported without its VDI" in str(said[0].message)
    plotter.close()


async def warns_of_an_export_and_of_a_local_view():
    """An export has no VDI, whoever looks at what; nor has a view that the browser draws."""
    for mode, write in (("trame", "export_geometry"), ("client", "update")):
        plotter, _, _ = scene()
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", VDIWarning)
            async with served(plotter, mode) as (_, view):
                getattr(view, write)()
        assert ["exported without its VDI" in str(s.message) for s in said] == [True]
        plotter.close()


CASES = (
    follows_the_view,
    warns_where_the_browser_draws,
    warns_of_an_export_and_of_a_local_view,
)


def main():
    """Run all cases, or those that are named."""
    warnings.simplefilter("error", VDIWarning)
    # Every preview as coarse as it may be, whatever frames take
    FrameRate.chosen = lambda rate, full: 1
    failed = 0
    for case in CASES:
        if len(sys.argv) > 1 and case.__name__ not in sys.argv[1:]:
            continue
        try:
            asyncio.run(case())
        except Exception:
            failed += 1
            traceback.print_exc()
    print("all well" if not failed else f"{failed} failed", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
