"""Serves VDIs of a volume to pages: the volume stays here, pages draw what they were sent last.

docs/web.md, "Served", says what is sent and what is let in.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import hmac
import inspect
import ipaddress
import json
import logging
import secrets
import threading
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import SplitResult, quote, urlsplit

from pyvista_vdi.errors import Cancelled, InvalidArgumentError, MissingDependencyError, VDIError
from pyvista_vdi.extensions.web.camera import viewer_camera
from pyvista_vdi.extensions.web.messages import MAX_MESSAGE, BadMessageError, Wish, wish_after
from pyvista_vdi.extensions.web.placing import encoded
from pyvista_vdi.extensions.web.served_page import served_page
from pyvista_vdi.extensions.web.source import Source
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.types import DeviceLike, MemoryLike, OcclusionLike, VolumeLike

try:
    from aiohttp import WSCloseCode, WSMsgType, web
except ImportError as error:
    raise MissingDependencyError(
        'serving needs aiohttp, which is not installed: pip install "pyvista-vdi[web]"'
    ) from error

#: Version of what is said on the socket.
PROTOCOL = 2
#: Where a server listens unless it is told.
HOST, PORT = "127.0.0.1", 8765
#: Most lists of a VDI unless told otherwise.
LISTS = 1280 * 720
#: Longest list unless told otherwise. What is sent serves views near its own until the next: on the
#: brain, 20 degrees away, lists of 20 would bring .004 of SSIM for 2.2 times the bytes.
LONGEST = 8
#: Most clients at once; the next is told so.
MAX_CLIENTS = 256
#: Bytes of one message of a VDI: what a slow line takes in less than STALLED.
CHUNK = 64 * 1024
#: Seconds for which a client may take nothing of what it is sent before it is dropped.
STALLED = 30.0
#: Seconds between two signs of life that are asked of a client.
_HEARTBEAT = 20.0
#: Seconds that a client has to answer a goodbye.
_GOODBYE = 3.0
#: Threads in which VDIs are made: while one packs and compresses, the device works for the other.
_THREADS = 2

_log = logging.getLogger(__name__)

_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class _Client:
    """What a server knows of one connection."""

    def __init__(self) -> None:
        self.wish = Wish()  # the last
        self.wished = asyncio.Event()  # that another wish has come
        self.left = asyncio.Event()
        self.cancelled = threading.Event()  # what is being made for it

    def hear(self, wish: Wish) -> None:
        """Take note of what the client wants now; what is made of another wish is given up."""
        if wish != self.wish:
            self.wish = wish
            self.cancelled.set()
            self.wished.set()


class Server:
    """Makes VDIs for the views of its clients; see :func:`serve`.

    Attributes
    ----------
    token : str
        What a URL must carry.
    host, port : str, int
        Where it listens; the port that was found free, if 0 was asked for.
    """

    def __init__(
        self,
        source: Source,
        *,
        host: str = HOST,
        port: int = PORT,
        token: str | None = None,
        hosts: Sequence[str] = (),
        max_clients: int = MAX_CLIENTS,
        stalled: float = STALLED,
    ) -> None:
        if token == "":
            raise InvalidArgumentError(
                "token is empty, which would let in whoever finds the port: "
                "give another text, or None for a random one"
            )
        self.token = secrets.token_urlsafe(16) if token is None else token
        self.host, self.port = host, port
        self.clients: set[_Client] = set()
        self._source = source
        # As browsers write names, in small letters
        self._hosts = {name.lower() for name in ("localhost", host, *hosts) if name}
        self._max_clients = max_clients
        self._stalled = stalled
        self._threads = ThreadPoolExecutor(_THREADS, "pyvista-vdi serve")
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ended: asyncio.Event | None = None

    @property
    def url(self) -> str:
        """What a browser is to open."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/?token={quote(self.token, safe='')}"

    def start(self) -> Server:
        """Listen, in a thread of its own; return when it does.

        Raises
        ------
        InvalidArgumentError
            If it cannot listen there.
        """
        listening: threading.Event = threading.Event()
        failed: list[Exception] = []

        def run() -> None:
            try:
                asyncio.run(self._serve(listening.set))
            except Exception as error:
                failed.append(error)
                listening.set()

        self._thread = threading.Thread(target=run, name="pyvista-vdi server", daemon=True)
        self._thread.start()
        listening.wait()
        if failed:
            self._threads.shutdown()
            raise _cannot_listen(failed[0], self.host, self.port) from failed[0]
        return self

    def wait(self) -> None:
        """Return when it has ended; Ctrl-C ends it."""
        assert self._thread is not None
        try:
            while self._thread.is_alive():
                self._thread.join(0.5)  # a wait without end would not let Ctrl-C through on Windows
        finally:
            self.close()

    def close(self) -> None:
        """End all connections and what is being made, and wait until that has happened."""
        if self._loop is not None and self._ended is not None:
            with contextlib.suppress(RuntimeError):  # it has ended by itself
                self._loop.call_soon_threadsafe(self._ended.set)
        if self._thread is not None:
            self._thread.join()
        self._threads.shutdown(cancel_futures=True)

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    async def _serve(self, listening: Callable[[], None]) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        # The log of requests would hold the token
        runner = web.AppRunner(self.application(), access_log=None, shutdown_timeout=2 * _GOODBYE)
        await runner.setup()
        try:
            site = web.TCPSite(runner, self.host, self.port)
            await site.start()
            self.port = runner.addresses[0][1]
            listening()
            await self._ended.wait()
        finally:
            await runner.cleanup()

    def application(self) -> web.Application:
        """Return what answers requests, for an event loop of the caller's."""
        app = web.Application(middlewares=[self._guard], client_max_size=MAX_MESSAGE)
        app.router.add_get("/", self._page)
        app.router.add_get("/socket", self._socket)
        app.on_shutdown.append(self._end_clients)
        return app

    async def _end_clients(self, _: web.Application) -> None:
        for client in list(self.clients):
            client.left.set()

    @web.middleware
    async def _guard(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        """Admit requests that know the token, from a page of ours, by a name of ours."""
        if not self._is_ours(_place(f"//{request.host}")):
            # A page of another site whose name was made to point here (DNS rebinding)
            return _refused("this server does not go by that name")
        origin = request.headers.get("Origin")
        if origin is not None and _place(origin).netloc != request.host:
            return _refused("pages of other sites are not let in")
        given = request.query.get("token", "").encode()
        if not hmac.compare_digest(given, self.token.encode()):
            return _refused(
                "this address is no longer valid, or never was: "
                "open the one that the server printed when it was started"
            )
        return await handler(request)

    def _is_ours(self, place: SplitResult) -> bool:
        name = place.hostname or ""
        try:
            ipaddress.ip_address(name)  # names can be made to point here, numbers cannot
        except ValueError:
            return name in self._hosts
        return True

    async def _page(self, request: web.Request) -> web.Response:
        text, headers = served_page(request.host)
        return web.Response(text=text, content_type="text/html", headers=headers)

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if len(self.clients) >= self._max_clients:
            return web.Response(status=503, text="there are as many clients as this server takes")
        connection = web.WebSocketResponse(
            max_msg_size=MAX_MESSAGE, heartbeat=_HEARTBEAT, compress=False
        )
        if not connection.can_prepare(request):
            return web.Response(
                status=426,
                text="this address is a WebSocket's: open the server's page\n",
                headers={"Upgrade": "websocket", "Sec-WebSocket-Version": "13"},
            )
        client = _Client()
        self.clients.add(client)
        try:
            await connection.prepare(request)
            await self._talk(client, connection, request.transport)
        finally:
            self.clients.discard(client)
            client.cancelled.set()
            if request.transport is not None and not connection.closed:
                request.transport.abort()  # also where it takes nothing that it is sent
        return connection

    async def _talk(
        self, client: _Client, connection: web.WebSocketResponse, transport: Any
    ) -> None:
        """Hear a client, make and send what it asks for, until one of these ends."""
        doing: tuple[Awaitable[Any], ...] = (
            self._hear(client, connection),
            self._answer(client, connection, transport),
            client.left.wait(),
        )
        tasks = [asyncio.ensure_future(one) for one in doing]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            ends = await asyncio.gather(*tasks, return_exceptions=True)
        code, reason = WSCloseCode.GOING_AWAY, "the server ends"
        for error in ends:
            if isinstance(error, BadMessageError):
                code, reason = WSCloseCode.POLICY_VIOLATION, str(error)
            elif isinstance(error, ConnectionError):
                return
            elif isinstance(error, Exception):
                _log.error("a client was sent away", exc_info=error)
                code, reason = WSCloseCode.INTERNAL_ERROR, "the server has failed"
        with contextlib.suppress(asyncio.TimeoutError, ConnectionError):
            # The protocol has 123 bytes for a reason, none of them a part of a letter
            closing = connection.close(code=code, message=reason.encode("ascii", "replace")[:120])
            await asyncio.wait_for(closing, _GOODBYE)

    async def _hear(self, client: _Client, connection: web.WebSocketResponse) -> None:
        async for message in connection:
            if message.type is not WSMsgType.TEXT:
                raise BadMessageError("messages are text")
            client.hear(wish_after(message.data, client.wish, self._source.offer))

    async def _answer(
        self, client: _Client, connection: web.WebSocketResponse, transport: Any
    ) -> None:
        """Make and send a VDI of the last wish, and of what is wished meanwhile the last again."""

        async def tell(**entries: Any) -> None:
            await self._put(connection, transport, json.dumps(entries))

        await tell(**self._hello())
        while True:
            await client.wished.wait()
            client.wished.clear()
            wish, client.cancelled = client.wish, threading.Event()
            if wish.view is None:
                continue
            await tell(type="status", doing="vdi")
            try:
                lists, file = await asyncio.get_running_loop().run_in_executor(
                    self._threads, self._made, wish, client.cancelled.is_set
                )
            except Cancelled:
                continue
            except VDIError as error:
                await tell(type="status", doing=None)
                await tell(type="error", message=str(error))
                continue
            if file:
                await tell(type="vdi", bytes=len(file), lists=lists, step=wish.step)
                for first in range(0, len(file), CHUNK):
                    await self._put(connection, transport, file[first : first + CHUNK])
            await tell(type="status", doing=None)

    def _made(self, wish: Wish, cancelled: Callable[[], bool]) -> tuple[tuple[int, int], bytes]:
        vdi = self._source.make(wish, cancelled)
        return ((0, 0), b"") if vdi is None else (vdi.window_size, encoded(vdi, coarse=True))

    async def _put(
        self, connection: web.WebSocketResponse, transport: Any, data: str | bytes
    ) -> None:
        """Send one message, or drop a client that takes none for too long."""
        # Not asyncio.wait_for, which before Python 3.12 may lose that the task was cancelled
        drop = asyncio.get_running_loop().call_later(self._stalled, transport.abort)
        try:
            if isinstance(data, str):
                await connection.send_str(data)
            else:
                await connection.send_bytes(data)
        finally:
            drop.cancel()

    def _hello(self) -> dict[str, Any]:
        source = self._source
        return {
            "type": "hello",
            "protocol": PROTOCOL,
            "bounds": list(source.bounds),
            "camera": viewer_camera(filling_camera(source.bounds, (4, 3))),
            "steps": source.offer.steps,
            "cmaps": list(source.offer.cmaps),
            "opacities": list(source.offer.opacities),
            "look": source.started_with,
            "range": list(source.range),
        }


def serve(
    volume: VolumeLike | Sequence[VolumeLike],
    *,
    host: str = HOST,
    port: int = PORT,
    token: str | None = None,
    hosts: Sequence[str] = (),
    lists: int = LISTS,
    max_supersegments: int = LONGEST,
    sample_distance: float | None = None,
    ambient_occlusion: OcclusionLike | None = None,
    memory_limit: MemoryLike | None = None,
    max_clients: int = MAX_CLIENTS,
    device: DeviceLike | None = None,
    announce: Callable[[str], object] | None = print,
    wait: bool = True,
    **classification: Any,
) -> Server:
    """Serve VDIs of a volume to web pages, which draw them at their own rate.

    A page draws the VDI that it has. Where its view rests the server makes another, of what is in
    view. Colour map, opacity, range and time step can be changed in the page.

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
    device : str, int or device, optional
        See :func:`pyvista_vdi.list_devices`; all clients share it, one piece of work each in turn.
    announce : callable, optional
        Called with a line that has the URL.
    wait : bool
        Return when Ctrl-C ends the server; ``False`` returns it at once, and ``close()`` ends it.
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
    looks = Classification.composited(classification, "serve", _NAMES)
    options = GenerationOptions.checked(
        max_supersegments=max_supersegments,
        sample_distance=sample_distance,
        ambient_occlusion=ambient_occlusion,
        memory_limit=memory_limit,
        precision="8-byte",
    )
    steps: Any = volume if _is_sequence(volume) else [volume]
    source = Source(steps, looks, options, lists=lists, device=device)
    server = Server(
        source,
        host=host,
        port=port,
        token=token,
        hosts=hosts,
        max_clients=max_clients,
    ).start()
    if announce is not None:
        announce(f"Serving at {server.url} (Ctrl-C ends it)")
    if wait:
        with contextlib.suppress(KeyboardInterrupt):
            server.wait()
    return server


_NAMES = tuple(name for name in inspect.signature(serve).parameters if name != "classification")


def _is_sequence(volume: Any) -> bool:
    """Whether it is several volumes: texts, arrays and VTK's data sets have a length, too."""
    if isinstance(volume, str) or hasattr(volume, "dtype") or hasattr(volume, "GetClassName"):
        return False
    return hasattr(volume, "__len__") and hasattr(volume, "__getitem__")


def _place(url: str) -> SplitResult:
    """Return the parts of a URL; none of what is no URL."""
    try:
        return urlsplit(url)
    except ValueError:
        return urlsplit("")


def _refused(why: str) -> web.Response:
    return web.Response(status=403, text=f"{why}\n")


def _cannot_listen(error: Exception, host: str, port: int) -> Exception:
    if not isinstance(error, OSError | OverflowError):
        return error
    if getattr(error, "errno", None) == errno.EADDRINUSE:
        return InvalidArgumentError(
            f"port {port} of {host} is in use: choose another, or 0 for one that is free"
        )
    why = getattr(error, "strerror", None) or error
    return InvalidArgumentError(f"cannot listen at {host}, port {port}: {why}; choose another")
