"""Served VDIs: what clients get, whom the server lets in, and that none can harm another."""

import asyncio
import io
import json
import math
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import aiohttp
import numpy as np
import pytest
from aiohttp.test_utils import TestClient, TestServer
from plugin_scenes import soft_volume

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.web.server import Server
from pyvista_vdi.extensions.web.source import Source
from pyvista_vdi.io.vdi_file import reader
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.standard_cases import filling_camera

#: Seconds for whatever must happen: far more than it takes, also beside other tests.
PATIENCE = 120
SIZE = (160, 120)
HIGH, LOW = soft_volume(), soft_volume(scale=0.5)
CAMERA = filling_camera(HIGH.bounds, SIZE)
LOOK = {"clim": (0, 255), "opacity": "linear", "cmap": "bone"}
#: What a server makes of a view.
MADE = {"precision": "8-byte", "max_supersegments": 8}
#: Bytes that the system holds of what a server has sent; with its own choice, megabytes, a client
#: that takes nothing would have been sent everything.
HELD = 1 << 14


def source_of(*volumes, lists=1280 * 720, **look):
    options = GenerationOptions(max_supersegments=8, precision="8-byte")
    return Source(volumes, Classification(**look), options, lists=lists)


@pytest.fixture(scope="module")
def source(default_runtime):
    return source_of(HIGH, LOW, **LOOK)


class Client:
    """A connection to a server, that is no browser."""

    def __init__(self, socket):
        self.socket, self.said = socket, []

    async def say(self, kind, **entries):
        await self.socket.send_json({"type": kind, **entries})

    async def look_from(self, camera, size=SIZE):
        names = ("position", "focal_point", "view_up", "view_angle")
        await self.say("view", camera={name: getattr(camera, name) for name in names}, size=size)

    async def hear(self, kind):
        """Return the next message of a kind."""
        while True:
            message = await self.socket.receive(PATIENCE)
            if message.type is aiohttp.WSMsgType.TEXT:
                self.said.append(json.loads(message.data))
                if self.said[-1]["type"] == kind:
                    return self.said[-1]
            else:  # of a VDI that nobody asks for
                assert message.type is aiohttp.WSMsgType.BINARY, message

    async def vdi(self):
        """Return the next VDI, as it is read from its file."""
        size, file = (await self.hear("vdi"))["bytes"], b""
        while len(file) < size:
            file += await self.socket.receive_bytes(timeout=PATIENCE)
        return reader.read("a.vdi", stream=io.BytesIO(file))

    async def idle(self):
        """Wait until the server has done something for this client, and has nothing more to do."""
        while (await self.hear("status"))["doing"] is None:
            pass
        while (await self.hear("status"))["doing"] is not None:
            pass

    async def end(self):
        """Return the code by which the server ends the connection."""
        while not self.socket.closed:
            await self.socket.receive(PATIENCE)
        return self.socket.close_code

    @property
    def vdis(self):
        return sum(message["type"] == "vdi" for message in self.said)


def told(story, source, *, clients=1, **options):
    """Return what a story tells of a server, of what opens it more connections, and of clients."""
    server = Server(source, token="t", **options)

    def bound(host, port, family):
        made = socket.socket(family)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, HELD)
        made.bind((host, port))
        return made

    async def run():
        tested = TestServer(server.application(), socket_factory=bound)
        many = aiohttp.TCPConnector(limit=0)
        async with TestClient(tested, connector=many) as http:

            async def connect(**how):
                client = Client(await http.ws_connect("/socket?token=t", max_msg_size=0, **how))
                client.hello = await client.hear("hello")
                return client

            server.ask = http.get
            return await story(server, connect, *[await connect() for _ in range(clients)])

    try:
        return asyncio.run(asyncio.wait_for(run(), PATIENCE))
    finally:
        server.close()


def by_clients(number, **options):
    """Make a test of what clients of a server say and are told."""

    def made(story):
        def test(source):
            told(lambda *given: story(*given[2:]), source, clients=number, **options)

        test.__name__, test.__doc__ = story.__name__, story.__doc__
        return test

    return made


@by_clients(1)
async def test_a_view_gets_a_vdi_of_its_own_with_the_lists_in_view(client):
    near = CAMERA.replace(view_angle=8, focal_point=(0.5, 0, 0.2))
    await client.look_from(near)
    vdi = await client.vdi()
    whole = pvdi.generate(HIGH, near, SIZE, **MADE, **LOOK)
    assert np.array_equal(pvdi.render(vdi, near, SIZE), pvdi.render(whole, near, SIZE))
    assert (vdi.precision, vdi.metadata, vdi.window_size) == ("8-byte", {}, SIZE)
    await client.say("time", step=1)
    later = pvdi.generate(LOW, near, SIZE, **MADE, **LOOK)
    pictures = (pvdi.render(each, near, SIZE) for each in (await client.vdi(), later))
    assert pvdi.compare_images(*pictures).ssim > 0.999  # the same rays but for rounding
    await client.hear("status")
    await client.look_from(CAMERA.replace(focal_point=(9, 0, 0)))
    await client.idle()
    assert client.said[-1] == {"type": "status", "doing": None}
    assert client.vdis == 2  # nothing is in view: nothing was sent


class Failing:
    """A source that fails."""

    def __init__(self, source):
        self.offer = source.offer

    def make(self, wish, cancelled):
        raise pvdi.DeviceMemoryError("too little")


def test_errors_are_said_after_what_is_done(source):
    """A page shows the last that is said."""

    async def story(_server, _connect, client):
        await client.look_from(CAMERA)
        assert (await client.hear("error"))["message"] == "too little"
        assert client.said[-2] == {"type": "status", "doing": None}

    told(story, Failing(source))


@by_clients(2)
async def test_a_busy_client_does_not_keep_another_waiting(busy, quiet):
    await busy.look_from(CAMERA)
    await quiet.look_from(CAMERA)
    waiting, sent = asyncio.ensure_future(quiet.vdi()), 0
    while not waiting.done():
        await busy.say("time", step=(sent + 1) % 2)
        await busy.vdi()
        sent += 1
    assert sent <= 4  # two threads take clients in turn


@by_clients(1)
async def test_a_slow_client_is_sent_fewer_vdis_and_no_queue(client):
    """The first, the one that was made when the first had been sent, and the last."""
    size = (480, 360)
    await client.look_from(CAMERA, size)
    await client.hear("vdi")
    for angle in range(1, 20):  # while the first is on its way
        await client.look_from(CAMERA.azimuth(angle), size)
    while (await client.vdi()).camera.position != CAMERA.azimuth(19).position:
        pass
    assert client.vdis <= 3


QUERIES = [{}, {"token": ""}, {"token": "ü"}]
FILES = ["/../../etc/passwd", "/%2e%2e/x", "/viewer.js"]
#: DNS rebinding: names of theirs that point here.
HOSTS = ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "["]
OUR_HOSTS = ["localhost", "localhost:80", "[::1]:80", "10.0.0.7", "mybox", "MYBOX:80"]
#: Of requests that ask for no socket, or for one of a version that there is not.
NO_SOCKETS = [{}, {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "7"}]
ORIGINS = ["http://evil.example", "null", "http://127.0.0.1:1", "http://["]


def test_who_is_let_in(source):
    """Who knows the token, by a name of ours, from no page of others; and to no file."""
    asked = [
        *((path, query, {}, {403}) for path in ("/", "/socket", "/nothing") for query in QUERIES),
        *((path, None, {}, {404}) for path in FILES),
        *(("/", None, {"Host": host}, {400, 403}) for host in HOSTS),
        *(("/nothing", None, {"Host": host}, {404}) for host in OUR_HOSTS),
        *(("/socket", None, {"Origin": origin}, {403}) for origin in ORIGINS),
        *(("/socket", None, headers, {426}) for headers in NO_SOCKETS),
    ]

    async def story(server, _connect):
        for path, query, headers, statuses in asked:
            params = {"token": "t"} if query is None else query
            async with server.ask(path, params=params, headers=headers) as response:
                assert response.status in statuses, (path, query, headers)

    told(story, source, clients=0, hosts=["MyBox"])


def test_any_text_is_a_token_but_none_and_our_page_can_connect(source):
    with Server(source, port=0, token="a+b c&d=é#").start() as server:
        headers = {"Origin": f"http://127.0.0.1:{server.port}"}
        with urllib.request.urlopen(urllib.request.Request(server.url, headers=headers)) as page:
            assert page.status == 200
        why = rf"port {server.port}: .* in use; choose another"
        with pytest.raises(InvalidArgumentError, match=why):
            Server(source, port=server.port).start()
    with pytest.raises(InvalidArgumentError, match=r"cannot listen at 203\.0\.113\.1"):
        Server(source, host="203.0.113.1", port=0).start()
    with pytest.raises(InvalidArgumentError, match="token is empty"):
        Server(source, token="")


EYE = {"position": [0, -5, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1]}
VIEW = {"type": "view", "camera": EYE, "size": [64, 48]}
OTHER_VIEWS = [
    *({"size": size} for size in ([0, 48], [64, 48.5], [10**9, 10**9], [True, True])),
    *({"more": 1}, {"camera": None}),
]
PLACES = ([0, 0, 0], [math.nan, 0, 0], [10**400, 0, 0], "abc")
OTHER_EYES = [
    *({"position": place} for place in PLACES),
    *({"view_angle": 180}, {"parallel_scale": -1}, {"model_transform": []}),
]
OTHERS = [
    {"type": "look", "cmap": "bone"},
    *({"type": "time", "step": step} for step in (2, -1)),
    {"type": "clip", "planes": []},
    {"type": "file", "path": "/etc/passwd"},
    {"type": "é" * 40},  # the reason, which has it, is cut
]
BAD = [
    *("", "{", "[]", "1", "null", '{"type": []}', '{"type": "view"}', "[" * 10_000),
    *(json.dumps({**VIEW, **other}) for other in OTHER_VIEWS),
    *(json.dumps({**VIEW, "camera": {**EYE, **other}}) for other in OTHER_EYES),
    *map(json.dumps, OTHERS),
]


def test_a_bad_message_ends_its_client_and_nothing_else(source):
    async def story(_server, connect, good):
        codes = []
        for text in [*BAD, b"binary", "x" * 100_000]:
            bad = await connect()
            await (bad.socket.send_bytes if isinstance(text, bytes) else bad.socket.send_str)(text)
            codes.append(await bad.end())
        await good.look_from(CAMERA)
        await good.vdi()
        return codes

    *codes, huge = told(story, source)
    assert codes == [1008] * (len(BAD) + 1)
    assert huge == 1009


def test_a_client_that_takes_nothing_is_dropped(source):
    async def story(server, connect, deaf):
        await deaf.look_from(CAMERA, (480, 360))
        while server.clients:
            await asyncio.sleep(0.01)
        client = await connect()
        await client.look_from(CAMERA)
        return await client.vdi()

    assert told(story, source, heartbeat=0.3).n_supersegments > 0


def test_of_256_clients_some_are_killed_and_the_others_lose_nothing(source):
    """The next one is told that there is no place, until there is."""

    async def story(server, connect, *clients):
        with pytest.raises(aiohttp.WSServerHandshakeError, match="503"):
            await connect()
        killed, others = clients[:-8], clients[-8:]
        for k, client in enumerate(others):
            await client.look_from(CAMERA.azimuth(k), (32, 24))
        for client in killed:
            await client.look_from(CAMERA, (640, 480))
            client.socket.get_extra_info("socket").shutdown(socket.SHUT_RDWR)
        views = [
            (await client.vdi()).camera.azimuth(-k).position for k, client in enumerate(others)
        ]
        np.testing.assert_allclose(views, [CAMERA.position] * 8, atol=1e-12)
        while len(server.clients) > len(others):
            await asyncio.sleep(0.01)
        await connect()

    told(story, source, clients=256)


VERB = ["-m", "pyvista_vdi", "serve", "0.nrrd", "1.nrrd", "--port", "0", "--cmap", "bone"]
EXAMPLE = [str(Path(__file__).parents[3] / "examples" / "serve.py"), "0"]


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C of one process alone")
@pytest.mark.parametrize(("arguments", "steps"), [(VERB, 2), (EXAMPLE, 8)])
def test_the_command_and_the_example_serve_until_ctrl_c(
    arguments, steps, tmp_path, default_runtime
):
    import nrrd

    for step in range(2):
        nrrd.write(str(tmp_path / f"{step}.nrrd"), HIGH.array, index_order="C")
    command = [sys.executable, *arguments]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        try:
            line = process.stdout.readline()
            url = re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", line)[0]

            async def hello():
                async with (
                    aiohttp.ClientSession() as session,
                    session.ws_connect(url.replace("/?", "/socket?")) as connection,
                ):
                    return json.loads((await connection.receive()).data)

            assert asyncio.run(hello())["steps"] == steps
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()
