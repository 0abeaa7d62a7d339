"""Served VDIs: what clients get, whom the server lets in, and that none can harm another."""

import asyncio
import contextlib
import inspect
import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import aiohttp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_line import SlowLine
from web_client import PATIENCE, WebClient, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions import web
from pyvista_vdi.extensions.web import messages
from pyvista_vdi.extensions.web.server import Server
from pyvista_vdi.extensions.web.source import Source
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (160, 120)
HIGH, LOW = soft_ball(), soft_ball(scale=0.5)
CAMERA = filling_camera(HIGH.bounds, SIZE)
LOOK = {"clim": (0, 255), "opacity": "linear", "cmap": "bone"}
#: What a server makes of a view.
MADE = {"precision": "8-byte", "max_supersegments": 8}


def serve(volumes, **how):
    return web.serve(volumes, port=0, wait=False, announce=None, **how)


@pytest.fixture(scope="module")
def server(default_runtime):
    with serve([HIGH, LOW], **LOOK) as serving:
        yield serving


@pytest.fixture
def own_server(default_runtime):
    """Return ``make(**options)``: a server with other limits."""
    with contextlib.ExitStack() as stack:

        def make(**options):
            looks = Classification.composited(LOOK, "serve")
            source = Source([HIGH], looks, GenerationOptions(precision="8-byte"), lists=10**6)
            return stack.enter_context(Server(source, port=0, **options).start())

        yield make


def by_clients(story):
    """Make a test of what one or two clients of the server say and are told."""
    number = len(inspect.signature(story).parameters)

    def test(server, tmp_path):
        async def told():
            async with contextlib.AsyncExitStack() as stack:
                clients = [WebClient(server, tmp_path) for _ in range(number)]
                await story(*[await stack.enter_async_context(client) for client in clients])

        asyncio.run(told())

    test.__name__, test.__doc__ = story.__name__, story.__doc__
    return test


def by_a_client(server, folder, story, **how):
    """Return what a client of a server of its own is told."""

    async def told():
        async with WebClient(server, folder, **how) as client:
            return await story(client)

    return asyncio.run(asyncio.wait_for(told(), PATIENCE))


def hello_of(server, folder, **how):
    async def hello(client):
        return client.hello

    return by_a_client(server, folder, hello, **how)


def ssim(vdi, volume, **look):
    truth = pvdi.render_volume(volume, CAMERA, SIZE, **{**LOOK, **look})
    return pvdi.compare_images(pvdi.render(vdi, CAMERA, SIZE), truth).ssim


def vdis(said):
    return [message for message in said if message["type"] == "vdi"]


@by_clients
async def test_a_view_gets_a_vdi_of_its_own(client):
    await client.look_from(CAMERA, SIZE)
    vdi = await client.vdi()
    assert ssim(vdi, HIGH) > 0.99
    assert vdi.precision == "8-byte"
    assert vdi.metadata == {}
    await client.look_from(CAMERA.azimuth(40), SIZE)
    assert (await client.vdi()).camera.position == CAMERA.azimuth(40).position


@by_clients
async def test_only_lists_in_view_are_sent(client):
    near = CAMERA.replace(view_angle=8, focal_point=(0.5, 0, 0.2))
    await client.look_from(near, SIZE)
    vdi = await client.vdi()
    await client.message("status")
    await client.look_from(CAMERA.replace(focal_point=(9, 0, 0)), SIZE)
    await client.idle()
    assert vdi.window_size == SIZE
    whole = pvdi.generate(HIGH, near, SIZE, **MADE, **LOOK)
    assert np.array_equal(pvdi.render(vdi, near, SIZE), pvdi.render(whole, near, SIZE))
    assert client.messages[-1] == {"type": "status", "doing": None}
    assert len(vdis(client.messages)) == 1  # nothing is in view: nothing was sent


@by_clients
async def test_transfer_function_and_time_are_changed_by_messages(client):
    assert client.hello["steps"] == 2
    assert client.hello["look"] == {"cmap": "bone", "opacity": "linear"}
    await client.look_from(CAMERA, SIZE)
    await client.vdi()
    look = {"cmap": "hot", "opacity": [0, 0.2, 1], "clim": [0, 200]}
    wishes = (("look", look, HIGH), ("time", {"step": 1}, LOW))
    for kind, wish, volume in wishes:
        await client.say(kind, **wish)
        vdi = await client.vdi()
        whole = pvdi.generate(volume, CAMERA, SIZE, **MADE, **look)
        pictures = (pvdi.render(each, CAMERA, SIZE) for each in (vdi, whole))
        assert pvdi.compare_images(*pictures).ssim > 0.999  # the same rays but for rounding


@by_clients
async def test_of_wishes_that_follow_each_other_fast_the_last_one_counts(client):
    last = CAMERA.azimuth(200)
    for angle in range(0, 200, 2):
        await client.look_from(CAMERA.azimuth(angle), SIZE)
        await client.say("look", clim=[0, 200 + angle % 7])
    await client.look_from(last, SIZE)
    while (await client.vdi()).camera.position != last.position:
        pass
    assert len(vdis(client.messages)) < 100  # what is out of date is not made, nor kept to be sent


@by_clients
async def test_errors_of_the_engine_are_said_to_the_client(client):
    """After what is done, also where a status waits since before: a page shows the last."""

    def fails(*_):
        raise pvdi.DeviceMemoryError("too little")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Source, "make", fails)
        await client.look_from(CAMERA, SIZE)
        assert (await client.message("error"))["message"] == "too little"
    assert client.messages[-2] == {"type": "status", "doing": None}
    await client.look_from(CAMERA.azimuth(1), SIZE)
    await client.vdi()


@by_clients
async def test_a_busy_client_does_not_keep_another_waiting(busy, quiet):
    await busy.look_from(CAMERA, SIZE)
    await quiet.look_from(CAMERA, SIZE)
    waiting = asyncio.ensure_future(quiet.vdi())
    sent = 0
    while not waiting.done():
        await busy.say("look", clim=[0, 200 + sent % 2])
        await busy.file()
        sent += 1
    assert sent <= 4  # two threads take clients in turn


@pytest.mark.slow
def test_a_slow_client_is_sent_fewer_vdis_and_no_queue(server, tmp_path):
    async def story():
        line = SlowLine(server.port, rate=1e6, latency=0.05)
        async with line, WebClient(server, tmp_path, port=line.port) as client:
            await client.look_from(CAMERA, (480, 360))
            await client.message("vdi")
            for angle in range(1, 30):  # while the first is on its way
                await client.look_from(CAMERA.azimuth(angle), (480, 360))
            while (await client.vdi()).camera.position != CAMERA.azimuth(29).position:
                pass
            return len(vdis(client.messages))

    # The first, the one that was made when the first had been sent, and the last
    assert asyncio.run(asyncio.wait_for(story(), PATIENCE)) <= 3


async def status_of(server, path, query, headers):
    url = f"http://127.0.0.1:{server.port}{path}"
    params = {"token": server.token} if query is None else query
    async with (
        aiohttp.ClientSession() as session,
        session.get(url, params=params, headers=headers) as response,
    ):
        return response.status


QUERIES = [{}, {"token": ""}, {"token": "x"}, {"token": "ü"}]
FILES = ["/etc/passwd", "/../../etc/passwd", "/%2e%2e/x", "/viewer.js"]
#: DNS rebinding: names of theirs that point here.
HOSTS = ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "["]
OUR_HOSTS = ["localhost", "localhost:80", "[::1]:80", "10.0.0.7", "mybox", "MYBOX:80"]
#: Of requests that ask for no socket, or for one of a version that there is not.
NO_SOCKETS = [{}, {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "7"}]
ORIGINS = ["http://evil.example", "null", "http://127.0.0.1:1", "http://["]


@pytest.mark.parametrize(
    ("path", "query", "headers", "statuses"),
    [
        *((path, query, {}, {403}) for path in ("/", "/socket", "/nothing") for query in QUERIES),
        *((path, None, {}, {404}) for path in FILES),
        *(("/", None, {"Host": host}, {400, 403}) for host in HOSTS),
        *(("/nothing", None, {"Host": host}, {404}) for host in OUR_HOSTS),
        *(("/socket", None, {"Origin": origin}, {403}) for origin in ORIGINS),
        *(("/socket", None, headers, {426}) for headers in NO_SOCKETS),
    ],
)
def test_who_is_let_in(path, query, headers, statuses, default_runtime, own_server):
    """Who knows the token, by a name of ours, from no page of others; and to no file."""
    server = own_server(hosts=["MyBox"])
    assert asyncio.run(status_of(server, path, query, headers)) in statuses


def test_any_text_is_a_token_but_none_and_our_page_can_connect(own_server, tmp_path):
    server = own_server(token="a+b c&d=é#")
    with urllib.request.urlopen(server.url) as response:
        assert response.status == 200
    headers = {"Origin": f"http://127.0.0.1:{server.port}"}
    assert hello_of(server, tmp_path, headers=headers)["protocol"] == 2
    with pytest.raises(InvalidArgumentError, match="token is empty"):
        own_server(token="")


EYE = {"position": [0, -5, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1]}
VIEW = {"type": "view", "camera": EYE, "size": [64, 48]}
OTHER_VIEWS = [
    *({"size": size} for size in ([0, 48], [64, 48.5], [10**9, 10**9], [True, True])),
    *({"more": 1}, {"camera": None}),
]
PLACES = ([0, 0, 0], [math.nan, 0, 0], [math.inf, 0, 0], [10**400, 0, 0], "abc")
OTHER_EYES = [
    *({"position": place} for place in PLACES),
    *({"view_angle": 180}, {"parallel_scale": -1}, {"model_transform": []}),
]
OTHERS = [
    *({"type": "look", "opacity": opacity} for opacity in ([0.5] * 1000, {})),
    {"type": "look", "cmap": "../../etc/passwd"},
    {"type": "look", "clim": [1, 1]},
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


def test_a_bad_message_ends_its_client_and_nothing_else(server, tmp_path):
    async def story(good):
        codes = []
        for text in [*BAD, b"binary", "x" * 100_000]:
            async with WebClient(server, tmp_path) as bad:
                socket = bad.socket
                await (socket.send_bytes if isinstance(text, bytes) else socket.send_str)(text)
                codes.append(await bad.end())
        await good.look_from(CAMERA, SIZE)
        await good.vdi()
        return codes

    *codes, huge = by_a_client(server, tmp_path, story)
    assert codes == [1008] * (len(BAD) + 1)
    assert huge == 1009


_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)
_entries = st.fixed_dictionaries(
    {"type": st.sampled_from(["view", "look", "time"])},
    optional={
        name: _json | st.lists(st.floats(), min_size=2, max_size=6)
        for name in ("camera", "size", "cmap", "opacity", "clim", "step")
    },
)


@settings(max_examples=50)
@given(_entries | _json)
def test_any_message_is_taken_or_refused(message):
    offer = {"steps": 2, "cmaps": ["bone"], "opacities": ["linear"]}
    with contextlib.suppress(messages.BadMessageError):
        wish = messages.wish_after(json.dumps(message), messages.Wish(), offer)
        assert isinstance(wish, messages.Wish)


EXTREMES = [
    {"position": [1e12, 0, 0]},
    {"position": [0, 0, 1e-12], "view_up": [1, 0, 0]},
    {"position": [0, 0.1, 0], "view_angle": 179.9},
    {"position": [0, -1e9, 0], "parallel_scale": 1e-12},
    {"position": [0, -9, 0], "parallel_scale": 1e12},
]


@by_clients
async def test_extreme_views_harm_nobody(client, other):
    for eye in EXTREMES:
        await client.say("view", camera={**EYE, **eye}, size=[12, 8192])
        await client.idle()
    await other.look_from(CAMERA, SIZE)
    assert (await other.vdi()).n_supersegments > 0


@pytest.mark.slow
def test_a_client_that_stops_reading_is_dropped(own_server, tmp_path):
    server = own_server(heartbeat=0.5)

    async def story():
        # All but: a chunk of a VDI would take it half a minute
        line = SlowLine(server.port, rate=2000, latency=0)
        async with line, WebClient(server, tmp_path, port=line.port) as deaf:
            await deaf.look_from(CAMERA, (640, 480))
            while server.clients:
                await asyncio.sleep(0.01)
        async with WebClient(server, tmp_path) as client:
            await client.look_from(CAMERA, SIZE)
            return await client.vdi()

    assert asyncio.run(asyncio.wait_for(story(), PATIENCE)).n_supersegments > 0


def test_what_is_made_for_a_client_that_has_left_is_given_up(own_server, tmp_path, monkeypatch):
    server, make = own_server(), Source.make
    making, ended = threading.Event(), []

    def slowly(source, wish, cancelled):
        making.set()
        while not cancelled():
            time.sleep(0.01)
        ended.append(wish)
        return make(source, wish, cancelled)

    async def leave(client):
        await client.look_from(CAMERA, SIZE)
        assert await asyncio.to_thread(making.wait, PATIENCE)

    async def given_up():
        while server.clients or not ended:
            await asyncio.sleep(0.01)

    monkeypatch.setattr(Source, "make", slowly)
    by_a_client(server, tmp_path, leave)
    asyncio.run(asyncio.wait_for(given_up(), PATIENCE))


@pytest.mark.slow
def test_two_hundred_clients_at_once(own_server, tmp_path):
    server = own_server(max_clients=200)

    async def story():
        async with contextlib.AsyncExitStack() as stack:
            clients = [WebClient(server, tmp_path) for _ in range(200)]
            for client in clients:
                await stack.enter_async_context(client)
            with pytest.raises(aiohttp.WSServerHandshakeError, match="503"):
                await WebClient(server, tmp_path).__aenter__()
            await asyncio.gather(
                *(c.look_from(CAMERA.azimuth(k), (32, 24)) for k, c in enumerate(clients))
            )
            return await asyncio.gather(*(c.file() for c in clients))

    assert all(head["bytes"] == len(file) for head, file in asyncio.run(story()))


def test_where_nobody_can_listen_is_a_sentence(server):
    for host, port, why in (
        ("127.0.0.1", server.port, rf"port {server.port} .* is in use: choose an"),
        ("203.0.113.1", 0, r"cannot listen at 203\.0\.113\.1"),
    ):
        with pytest.raises(InvalidArgumentError, match=why):
            web.serve(HIGH, host=host, port=port, wait=False, **LOOK)


def test_closing_tells_the_clients(own_server, tmp_path):
    server = own_server()

    async def story(client):
        await client.look_from(CAMERA, (640, 480))
        closing = asyncio.get_running_loop().run_in_executor(None, server.close)
        code = await client.end()
        await closing
        return code

    assert by_a_client(server, tmp_path, story) == 1001


def test_a_fixed_look_offers_no_other(default_runtime, tmp_path):
    async def story(client):
        await client.say("look", cmap="bone")
        return client.hello, await client.end()

    table = pvdi.TransferFunction([(0, 0, 0.2), (1, 0.5, 0)], [0, 0.5], (0, 255))
    with serve(HIGH, transfer_function=table) as server:
        hello, code = by_a_client(server, tmp_path, story)
    assert hello["cmaps"] == hello["opacities"] == []
    assert code == 1008


@pytest.mark.parametrize(("look", "shown"), [({}, None), ({"clim": (10, 90)}, [10, 90])])
def test_pages_show_the_range_that_is_in_effect(look, shown, default_runtime, tmp_path):
    with serve(HIGH, cmap="bone", **look) as server:
        found = hello_of(server, tmp_path)["range"]
    assert found == (list(HIGH.finite_range()) if shown is None else shown)


def test_steps_are_any_object_with_a_length_and_items(default_runtime, tmp_path):
    class Steps:
        def __len__(self):
            return 2

        def __getitem__(self, step):
            return [HIGH, LOW][step]

    with serve(Steps(), **LOOK) as server:
        assert hello_of(server, tmp_path)["steps"] == 2


def test_the_command_serves_until_ctrl_c(tmp_path, default_runtime):
    import nrrd

    for step in range(2):
        nrrd.write(str(tmp_path / f"{step}.nrrd"), HIGH.array, index_order="C")
    command = [sys.executable, "-m", "pyvista_vdi", "serve", "0.nrrd", "1.nrrd", "--port", "0"]
    flags = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if os.name == "nt" else {}
    with subprocess.Popen(
        [*command, "--cmap", "bone"], cwd=tmp_path, stdout=subprocess.PIPE, text=True, **flags
    ) as process:
        try:
            line = process.stdout.readline()
            url = re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", line)[0]

            async def hello():
                async with (
                    aiohttp.ClientSession() as session,
                    session.ws_connect(url.replace("/?", "/socket?")) as connection,
                ):
                    return json.loads((await connection.receive()).data)

            assert asyncio.run(hello())["steps"] == 2
            process.send_signal(signal.CTRL_C_EVENT if os.name == "nt" else signal.SIGINT)
            assert process.wait(PATIENCE) == 0
            assert process.stdout.read() == "The server has ended\n"
        finally:
            process.kill()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C of one process alone")
@pytest.mark.parametrize(
    ("name", "arguments"),
    [("serve.py", ["0"]), ("trame_app.py", ["--port", "0", "--server", "--host", "127.0.0.1"])],
)
def test_an_example_serves_a_page_until_ctrl_c(name, arguments, default_runtime):
    example = Path(__file__).parents[3] / "examples" / name
    command = [sys.executable, "-u", str(example), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            found = (re.search(r"http://127\.0\.0\.1:\d+/\S*", line) for line in process.stdout)
            with urllib.request.urlopen(next(match[0] for match in found if match)) as response:
                assert "<!doctype html" in response.read().decode().lower()
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) in (0, -signal.SIGINT)
        finally:
            process.kill()
