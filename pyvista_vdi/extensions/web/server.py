"""Serves VDIs of a volume to pages: the volume stays here, pages draw what they were sent last.

docs/web.md, "Served", says what is sent and what is let in.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import ipaddress
import logging
import secrets
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import quote, urlsplit

from pyvista_vdi.errors import Cancelled, InvalidArgumentError, VDIError, needing
from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.page import html_page
from pyvista_vdi.extensions.web.source import BadMessageError, Source, Wish, wish_after
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion
from pyvista_vdi.model.arguments import records_of
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.types import DeviceLike, OcclusionLike, VolumeLike

with needing('serving needs aiohttp: pip install "pyvista-vdi[web]"'):
    from aiohttp import WSCloseCode, WSMsgType, web
    from aiohttp.typedefs import Handler

#: Bytes of one message of a VDI: a slow line takes it long before a client counts as gone.
CHUNK = 64 * 1024
#: What is said stands over the picture, as high as its text: the viewer's size, which is the view
#: that is asked for, depends on none of it.
_STYLE = """\
body { display: flex; flex-direction: column; color: #d0d0d0; font: 14px sans-serif; }
vdi-viewer { flex: 1; min-height: 0; }
form { position: relative; display: flex; flex-wrap: wrap; gap: 4px 16px; padding: 6px 10px;
  align-items: center; min-height: 1.5em; }
label { display: flex; gap: 6px; align-items: center; }
@media (pointer: coarse) { input { min-height: 36px; } }
output { position: absolute; right: 0; bottom: 100%; max-width: 100%; box-sizing: border-box;
  padding: 4px 10px; background: #000c; text-align: right; overflow-wrap: anywhere;
  pointer-events: none; }
output:empty { padding: 0; }
"""

_BODY = """\
<vdi-viewer id="viewer" hash></vdi-viewer>
<form><span id="controls" style="display: contents"></span><output id="status"></output></form>
<script type="module" nonce="%s">
%s
const byId = (id) => document.getElementById(id);
window.remote = connectPage(byId("viewer"), byId("controls"), byId("status"));
</script>
"""


class Server(contextlib.AbstractContextManager["Server"]):
    """Makes VDIs for the views of its clients; see :func:`serve`.

    Attributes
    ----------
    token : str
        What a URL must carry.
    host, port : str, int
        Where it listens; the port that was found free, if 0 was asked for.
    url : str
        What a browser is to open, once it listens.
    heartbeat : float
        Seconds between two signs of life that are asked of a client, which has half as many to
        give one.
    """

    def __init__(
        self,
        source: Source,
        *,
        host: str = "127.0.0.1",
        port: int = 8765,
        token: str | None = None,
        hosts: Sequence[str] = (),
        max_clients: int = 256,
        heartbeat: float = 20.0,
    ) -> None:
        if token == "":
            raise InvalidArgumentError(
                "token is empty, which would let in whoever finds the port: "
                "give another text, or None for a random one"
            )
        self.token = secrets.token_urlsafe(16) if token is None else token
        self.host, self.port, self.heartbeat = host, port, heartbeat
        self.clients: set[web.WebSocketResponse] = set()
        self._source, self._max_clients = source, max_clients
        # As browsers write names, in small letters
        self._hosts = {name.lower() for name in ("localhost", host, *hosts) if name}
        # While one packs and compresses a VDI, the device works for the other
        self._threads = ThreadPoolExecutor(2, "pyvista-vdi serve")
        self._loop: asyncio.AbstractEventLoop | None = None  # while it listens

    def start(self) -> Server:
        """Listen, in a thread of its own; return when it does.

        Raises
        ------
        InvalidArgumentError
            If it cannot listen there.
        """
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        # The log of requests would hold the token
        self._runner = web.AppRunner(self.application(), access_log=None)
        try:
            asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result()
        except (OSError, OverflowError) as error:
            self.close()
            raise InvalidArgumentError(
                f"cannot listen at {self.host}, port {self.port}: {error}; "
                "choose another, or 0: a free one"
            ) from error
        name = f"[{self.host}]" if ":" in self.host else self.host
        self.url = f"http://{name}:{self.port}/?token={quote(self.token, safe='')}"
        return self

    async def _listen(self) -> None:
        await self._runner.setup()
        await web.TCPSite(self._runner, self.host, self.port).start()
        self.port = self._runner.addresses[0][1]

    def wait(self) -> None:
        """Return when it has ended; Ctrl-C ends it."""
        with self, contextlib.suppress(KeyboardInterrupt):
            while self._loop is not None:
                time.sleep(0.2)

    def close(self) -> None:
        """End all connections and what is being made, and wait until that has happened."""
        loop, self._loop = self._loop, None
        if loop is not None:
            asyncio.run_coroutine_threadsafe(self._runner.cleanup(), loop).result()
            loop.call_soon_threadsafe(loop.stop)
            self._thread.join()
            loop.close()
        self._threads.shutdown(cancel_futures=True)

    def __exit__(self, *_: object) -> None:
        self.close()

    def application(self) -> web.Application:
        """Return what answers requests, for an event loop of the caller's."""

        async def end_clients(_: web.Application) -> None:
            goodbye: Any = {"code": WSCloseCode.GOING_AWAY, "message": b"the server ends"}
            ending = [socket.close(**goodbye, drain=False) for socket in self.clients]
            await asyncio.gather(*ending)

        app = web.Application(middlewares=[self._guard])
        app.add_routes([web.get("/", self._page), web.get("/socket", self._socket)])
        app.on_shutdown.append(end_clients)
        return app

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Admit requests that know the token, from a page of ours, by a name of ours."""
        try:
            # A number is a name of ours: it cannot be made to point here
            name = urlsplit(f"//{request.host}").hostname or ""
            ours = name in self._hosts or bool(ipaddress.ip_address(name))
        except ValueError:
            ours = False
        origin = request.headers.get("Origin")
        given = request.query.get("token", "").encode()
        if not ours:
            # A page of another site whose name was made to point here (DNS rebinding)
            why = "this server does not go by that name"
        elif origin is not None and origin.partition("://")[2] != request.host:
            why = "pages of other sites are not let in"
        elif not hmac.compare_digest(given, self.token.encode()):
            why = "this address is no longer valid: open the one that the server printed last"
        else:
            return await handler(request)
        return web.Response(status=403, text=f"{why}\n")

    async def _page(self, request: web.Request) -> web.Response:
        """Send the viewer, its controls and the connection; only this script runs in the page."""
        nonce, host = secrets.token_urlsafe(16), request.host
        policy = (
            f"default-src 'none'; script-src 'nonce-{nonce}' blob:; worker-src blob:; "
            "style-src 'unsafe-inline'; img-src data: blob:; "
            f"connect-src 'self' ws://{host} wss://{host}; base-uri 'none'; form-action 'none'"
        )
        body = _BODY % (nonce, viewer_script("remote.js", module=True))
        text = html_page("A volume, to be turned", body, "#202020", policy, _STYLE)
        headers = {  # of a page whose address has the token
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "SAMEORIGIN",
        }
        return web.Response(text=text, content_type="text/html", headers=headers)

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        """Hear a client, and have what it asks for made and sent, until one of these ends."""
        if len(self.clients) >= self._max_clients:
            return web.Response(status=503, text="there are as many clients as this server takes")
        socket = web.WebSocketResponse(
            timeout=3.0,  # seconds that a client has to answer a goodbye
            max_msg_size=16 * 1024,
            heartbeat=self.heartbeat,
            compress=False,
        )
        if not socket.can_prepare(request):
            return web.Response(
                status=426,
                text="this address is a WebSocket's: open the server's page\n",
                headers={"Upgrade": "websocket", "Sec-WebSocket-Version": "13"},
            )
        await socket.prepare(request)
        self.clients.add(socket)
        wish, wishes = Wish(), asyncio.Queue[Wish]()
        answering = asyncio.ensure_future(self._answer(socket, wishes))
        try:
            async for message in socket:
                if message.type is not WSMsgType.TEXT:
                    raise BadMessageError("messages are text")
                before, wish = wish, wish_after(message.data, wish, self._source.offer)
                if wish != before and wish.view is not None:
                    if not wishes.empty():
                        wishes.get_nowait()  # the last one counts
                    wishes.put_nowait(wish)
        except BadMessageError as error:
            # The protocol has 123 bytes for a reason, none of them a part of a letter
            why = str(error).encode("ascii", "replace")[:120]
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=why, drain=False)
        finally:
            self.clients.discard(socket)
            wishes.put_nowait(wish)  # which gives up what is being made
            answering.cancel()
            gone = not socket.closed or socket.close_code == WSCloseCode.ABNORMAL_CLOSURE
            if gone and request.transport is not None:
                request.transport.abort()  # what it has not taken is not kept
        return socket

    async def _answer(self, socket: web.WebSocketResponse, wishes: asyncio.Queue[Wish]) -> None:
        """Make and send a VDI of each wish; another wish gives up what is being made."""
        loop = asyncio.get_running_loop()
        try:
            await socket.send_json({"type": "hello", "protocol": 3, **self._source.offer})
            while wish := await wishes.get():
                await socket.send_json({"type": "status", "doing": "vdi"})
                try:
                    lists, file = await loop.run_in_executor(
                        self._threads, self._source.make, wish, lambda: not wishes.empty()
                    )
                except Cancelled:
                    continue
                except VDIError as error:
                    await socket.send_json({"type": "status", "doing": None})
                    await socket.send_json({"type": "error", "message": str(error)})
                    continue
                if file:
                    size = {"bytes": len(file), "lists": lists}
                    await socket.send_json({"type": "vdi", **size, "step": wish.step})
                for first in range(0, len(file), CHUNK):
                    await socket.send_bytes(file[first : first + CHUNK])
                await socket.send_json({"type": "status", "doing": None})
        except ConnectionError:
            pass  # who is gone needs nothing more
        except Exception:
            logging.getLogger(__name__).exception("a client was sent away")
            failed: Any = {"code": WSCloseCode.INTERNAL_ERROR, "message": b"the server has failed"}
            await socket.close(**failed, drain=False)


def serve(
    volume: VolumeLike | Sequence[VolumeLike],
    *,
    host: str = "127.0.0.1",
    port: int = 8765,
    token: str | None = None,
    hosts: Sequence[str] = (),
    lists: int = 1280 * 720,
    max_supersegments: int = 8,
    sample_distance: float | None = None,
    ambient_occlusion: OcclusionLike | None = None,
    memory_limit: int | None = None,
    max_clients: int = 256,
    device: DeviceLike | None = None,
    wait: bool = True,
    **classification: Any,
) -> Server:
    """Serve VDIs of a volume to web pages, which draw them at their own rate.

    A page draws the VDI that it has. Where its view rests the server makes another, of what is in
    view. The time step can be changed in the page.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume, or sequence of them
        What :func:`pyvista_vdi.generate` takes; several are time steps. Of any object with a length
        (and ``__getitem__``) items are read when somebody wants to see them.
    host : str
        Address to listen at; by default only this machine can connect. ``"0.0.0.0"`` lets in
        whoever has the URL, and what is sent is not encrypted: rather forward a port by SSH.
    port : int
        Port to listen at; 0 takes a free one.
    token : str, optional
        What URLs must carry, not empty; a random one by default.
    hosts : sequence of str
        Names, besides ``localhost`` and addresses, by which browsers may call this server.
    lists : int
        Most lists of a VDI; fewer where fewer of the page's pixels show the volume.
    max_supersegments, sample_distance, ambient_occlusion, memory_limit
        As for :func:`pyvista_vdi.generate`; shorter lists by default, which are sent sooner.
    max_clients : int
        Most pages at once.
    device : str, DeviceInfo or Runtime, optional
        See :func:`pyvista_vdi.list_devices`; all clients share it, one piece of work each in turn.
    wait : bool
        Print the URL, and return when Ctrl-C ends the server; ``False`` returns it at once, and
        ``close()`` ends it.
    **classification
        As for :func:`pyvista_vdi.generate`.

    Returns
    -------
    Server
        With ``url`` and ``close()``; a context manager.

    Raises
    ------
    InvalidArgumentError
        If it cannot listen there, or an argument cannot be used.
    MissingDependencyError
        If aiohttp is not installed.
    """
    (looks,) = records_of(classification, "serve", Classification, others=serve.__kwdefaults__)
    options = GenerationOptions(
        max_supersegments=max_supersegments,
        sample_distance=sample_distance,
        ambient_occlusion=AmbientOcclusion.from_any(ambient_occlusion),
        memory_limit=memory_limit,
        precision="8-byte",
    )
    # Texts, arrays and VTK's data sets have a length, too
    single = isinstance(volume, str) or hasattr(volume, "dtype") or hasattr(volume, "GetClassName")
    several = hasattr(volume, "__len__") and hasattr(volume, "__getitem__") and not single
    steps: Any = volume if several else [volume]
    source = Source(steps, looks, options, lists=lists, device=device)
    server = Server(
        source, host=host, port=port, token=token, hosts=hosts, max_clients=max_clients
    ).start()
    if wait:
        print(f"Serving at {server.url} (Ctrl-C ends it)", flush=True)  # noqa: T201
        server.wait()
    return server
