"""Served VDIs: what clients get, whom the server lets in, and that none can harm another.

All tests talk to servers by the same client: hence more than 500 lines.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import urllib.request

import aiohttp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from slow_line import SlowLine
from web_client import PATIENCE, WebClient, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi import web
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.web import messages, session
from pyvista_vdi.web import server as web_server
from pyvista_vdi.web.server import Server
from pyvista_vdi.web.source import Source

pytestmark = pytest.mark.usefixtures("settled_at_once")

SIZE = (160, 120)
HIGH, LOW = soft_ball(), soft_ball(scale=0.5)
CAMERA = filling_camera(HIGH.bounds, SIZE)
LOOK = {"clim": (0, 255), "opacity": "linear", "cmap": "bone"}


@pytest.fixture(scope="module")
def server(default_runtime):
    with web.serve([HIGH, LOW], port=0, wait=False, announce=None, **LOOK) as serving:
        yield serving


@pytest.fixture
def talk(server, tmp_path):
    """Run ``story(client, another)``: two clients of one server."""

    def run(story, *, of=server):
        async def told():
            async with WebClient(of, tmp_path) as one, WebClient(of, tmp_path) as other:
                return await story(one, other)

        return asyncio.run(told())

    return run


def _ssim(old, new):
    return pvdi.compare_images(old, new).ssim


# -- what is sent ----------------------------------------------------------------------------------


def test_a_view_gets_a_coarse_vdi_and_then_a_full_one(talk):
    async def story(client, _):
        await client.look_from(CAMERA, SIZE)
        return [await client.vdi(), await client.vdi()], client.messages

    (coarse, full), said = talk(story)
    assert [m["level"] for m in said if m["type"] == "vdi"] == ["coarse", "full"]
    truth = pvdi.render_volume(HIGH, CAMERA, SIZE, **LOOK)
    # The ball is smooth, so that even these show it
    assert math.prod(coarse.window_size) < math.prod(full.window_size) / 3
    assert coarse.counts.max() <= 3
    assert _ssim(pvdi.render(coarse, CAMERA, SIZE), truth) > 0.93
    assert _ssim(pvdi.render(full, CAMERA, SIZE), truth) > 0.99
    assert full.precision == "8-byte"
    assert full.metadata == {}


def _decoded(file):
    """Return an image file as a premultiplied picture."""
    pixels = np.asarray(Image.open(io.BytesIO(file)).convert("RGBA"), np.float32) / 255
    pixels[..., :3] *= pixels[..., 3:]
    return pixels


def test_a_view_at_rest_gets_the_volumes_own_picture_first(talk):
    plane = (0, 0, 0, 1, 0, 0)

    async def story(client, _):
        await client.look_from(CAMERA, SIZE, moving=True)
        await client.vdi()
        await client.look_from(CAMERA, SIZE)
        first = await client.picture()
        assert first[0]["said"] == client.said == 2
        await client.vdi("full")
        await client.say("clip", planes=[plane])
        clipped = await client.picture()
        await client.say("clip", planes=[])
        await client.say("time", step=1)
        other = await client.picture()
        while other[0]["said"] != client.said:
            other = await client.picture()
        await client.look_from(CAMERA.replace(focal_point=(9, 0, 0)), SIZE)
        empty = await client.message("picture")
        return [first, clipped, other], empty, client.messages

    pictures, empty, said = talk(story)
    assert [m["type"] for m in said if m["type"] in ("picture", "vdi")][:2] == ["vdi", "picture"]
    assert empty["bytes"] == 0
    arguments = ({}, {"clipping_planes": [plane]}, {})
    for (head, file), volume, more in zip(pictures, (HIGH, HIGH, LOW), arguments, strict=True):
        truth = pvdi.render_volume(volume, CAMERA, SIZE, **LOOK, **more)
        assert head["bytes"] == len(file)
        # Eight bits of straight colour and of opacity: half a step of each
        assert np.abs(_decoded(file) - truth).max() <= 1.01 / 255


def test_a_full_vdi_follows_where_a_view_settles(talk, monkeypatch):
    async def story(client, _):
        with monkeypatch.context() as patch:
            patch.setattr(session, "SETTLED", 3600.0)
            await client.look_from(CAMERA, SIZE)
            await client.vdi()
            await client.say("clip", planes=[])
            await client.picture()
            before = [m["level"] for m in client.messages if m["type"] == "vdi"]
            patch.setattr(session, "SETTLED", 0.1)
            await client.look_from(CAMERA, SIZE)
            await client.vdi("full")
            return before

    assert talk(story) == ["coarse"]


def test_only_lists_in_view_are_sent(talk):
    near = CAMERA.replace(view_angle=8, focal_point=(0.5, 0, 0.2))

    async def story(client, _):
        await client.look_from(near, SIZE)
        within = await client.vdi("full")
        await client.look_from(CAMERA.replace(focal_point=(9, 0, 0)), SIZE)
        await client.idle()
        return within, client.messages

    vdi, said = talk(story)
    assert vdi.window_size == SIZE
    whole = pvdi.generate(HIGH, near, SIZE, precision="8-byte", max_supersegments=8, **LOOK)
    assert np.array_equal(pvdi.render(vdi, near, SIZE), pvdi.render(whole, near, SIZE))
    assert said[-1] == {"type": "status", "doing": None}  # nothing is in view: nothing was sent
    assert sum(m["type"] == "vdi" for m in said) == 2


def test_another_is_made_only_where_the_view_error_asks_for_it(talk):
    near = CAMERA.replace(view_angle=8)

    async def story(client, _):
        await client.look_from(near, SIZE)
        await client.vdi("full")
        before = len(client.messages)
        await client.look_from(near.azimuth(2), SIZE)
        await client.idle()
        turned = client.messages[before:]
        await client.look_from(CAMERA, SIZE)  # most of this picture was not in the first
        return turned, await client.vdi("full")

    turned, whole = talk(story)
    assert {"type": "status", "doing": "estimate"} in turned
    assert not any(m["type"] == "vdi" for m in turned)
    assert (
        _ssim(pvdi.render(whole, CAMERA, SIZE), pvdi.render_volume(HIGH, CAMERA, SIZE, **LOOK))
        > 0.99
    )


def test_transfer_function_and_time_are_changed_by_messages(talk):
    async def story(client, _):
        assert client.hello["steps"] == 2
        assert client.hello["look"] == {"cmap": "bone", "opacity": "linear"}
        await client.look_from(CAMERA, SIZE)
        await client.vdi("full")
        await client.say("look", cmap="hot", opacity=[0, 0.2, 1], clim=[0, 200])
        hot = await client.vdi("full")
        await client.say("time", step=1)
        return hot, await client.vdi("full")

    for vdi, volume in zip(talk(story), (HIGH, LOW), strict=True):
        look = {"cmap": "hot", "opacity": [0, 0.2, 1], "clim": (0, 200)}
        whole = pvdi.generate(volume, CAMERA, SIZE, precision="8-byte", max_supersegments=8, **look)
        picture, other = pvdi.render(vdi, CAMERA, SIZE), pvdi.render(whole, CAMERA, SIZE)
        assert _ssim(picture, other) > 0.999  # the same rays but for rounding


def test_clipping_is_the_pages_and_asks_for_no_vdi(talk):
    async def story(client, _):
        await client.look_from(CAMERA, SIZE)
        await client.vdi("full")
        before = len(client.messages)
        await client.say("clip", planes=[[0, 0, 0, 1, 0, 0]])
        await client.look_from(CAMERA.azimuth(4), SIZE)
        await client.idle()
        return client.messages[before:]

    assert not any(m["type"] == "vdi" for m in talk(story))


def test_wishes_that_follow_each_other_fast_end_in_pictures(talk):
    last = CAMERA.azimuth(200)

    async def story(client, _):
        for angle in range(0, 200, 2):
            await client.look_from(CAMERA.azimuth(angle), SIZE, moving=True)
            await client.say("look", clim=[0, 200 + angle % 7])
        moving = await client.vdi()  # although another was wished for ever since
        await client.look_from(last, SIZE)
        full = await client.vdi("full")
        while full.camera.position != last.position:
            full = await client.vdi("full")
        return moving

    assert talk(story).n_supersegments > 0


def test_errors_of_the_engine_are_said_to_the_client(talk, monkeypatch):
    def fails(*_):
        raise pvdi.DeviceMemoryError("too little")

    async def story(client, _):
        with monkeypatch.context() as patch:
            patch.setattr(Source, "make", fails)
            await client.look_from(CAMERA, SIZE)
            error = await client.message("error")
        await client.look_from(CAMERA.azimuth(1), SIZE)
        return error, await client.vdi()

    error, _ = talk(story)
    assert error["message"] == "too little"


def test_what_is_wrong_is_said_after_what_is_done(server):
    """A page shows the last: also where a status waits since before the error."""
    said = []

    async def story():
        client = session.Client(server._source, server._threads, 0.95)
        client._tell_doing("vdi")
        client._tell("error", message="too little")
        client._tell_doing(None)
        sending = asyncio.ensure_future(server._send(client, put))
        while len(said) < 3:
            await asyncio.sleep(0)
        sending.cancel()

    async def put(text):
        said.append(json.loads(text)["type"])

    asyncio.run(story())
    assert said == ["hello", "status", "error"]


def test_a_busy_client_does_not_keep_another_waiting(talk):
    async def story(busy, quiet):
        await busy.look_from(CAMERA, SIZE, moving=True)
        await quiet.look_from(CAMERA, SIZE)
        waiting = asyncio.ensure_future(quiet.vdi("full"))
        sent = 0
        while not waiting.done():
            await busy.say("look", clim=[0, 200 + sent % 2])
            await busy.file()
            sent += 1
        return sent

    # The quiet one needs two turns. There are two threads, and a turn of full lists takes some of
    # the busy one's, which are coarse: by the lists, four.
    assert talk(story) <= 20


@pytest.mark.slow
def test_a_full_vdi_on_a_slow_line_gives_way(server, tmp_path):
    """What is seen changes while a full VDI is under way: the rest of that is not sent."""
    size = (480, 360)

    async def story():
        line = SlowLine(server.port, rate=1e6, latency=0.05)
        async with line, WebClient(server, tmp_path, port=line.port) as client:
            await client.look_from(CAMERA, size)
            await client.vdi("coarse")
            head = await client.message("vdi")
            await client.say("look", clim=[0, 200])
            while client.head is head:
                came = sum(map(len, client.parts))
                await client.receive()
            await client.vdi("full")
            return head, came

    head, came = asyncio.run(story())
    assert head["level"] == "full"
    assert came < head["bytes"]


# -- who is let in ---------------------------------------------------------------------------------


def _get(server, path="/", query=None, **headers):
    async def got():
        url = f"http://127.0.0.1:{server.port}{path}"
        params = {"token": server.token} if query is None else query
        async with (
            aiohttp.ClientSession() as session,
            session.get(url, params=params, headers=headers) as response,
        ):
            return response.status, await response.text(), response.headers

    return asyncio.run(got())


@pytest.mark.parametrize("query", [{}, {"token": ""}, {"token": "x"}, {"token": "ü"}])
@pytest.mark.parametrize("path", ["/", "/socket", "/nothing"])
def test_without_the_token_there_is_nothing(server, path, query):
    assert _get(server, path, query)[0] == 403


@pytest.mark.parametrize("path", ["/etc/passwd", "/../../etc/passwd", "/%2e%2e/x", "/viewer.js"])
def test_no_file_is_reachable(server, path):
    assert _get(server, path)[0] == 404


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "["])
def test_other_names_are_refused(server, host):
    """DNS rebinding: a name of theirs that points here."""
    assert _get(server, Host=host)[0] in (400, 403)


def test_addresses_and_localhost_are_names_of_ours(server):
    for host in ("localhost", f"localhost:{server.port}", "[::1]:80", "10.0.0.7"):
        assert _get(server, "/nothing", Host=host)[0] == 404


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "http://["]
)
def test_pages_of_others_cannot_connect(server, origin):
    assert _get(server, "/socket", Origin=origin)[0] == 403


def test_names_are_taken_as_browsers_write_them(own_server):
    server = own_server(hosts=["MyBox"])
    for host in ("mybox", "MYBOX:80"):
        assert _get(server, "/nothing", Host=host)[0] == 404


def test_any_text_is_a_token_but_none(own_server):
    server = own_server(token="a+b c&d=é#")
    with urllib.request.urlopen(server.url) as response:
        assert response.status == 200
    with pytest.raises(InvalidArgumentError, match="token is empty"):
        own_server(token="")


def test_our_page_can_connect(server, tmp_path):
    async def story():
        headers = {"Origin": f"http://127.0.0.1:{server.port}"}
        async with WebClient(server, tmp_path, headers=headers) as client:
            return client.hello

    assert asyncio.run(story())["protocol"] == 1


# -- attacks ---------------------------------------------------------------------------------------

VIEW = {
    "type": "view",
    "camera": {"position": [0, -5, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1]},
    "size": [64, 48],
}

BAD = [
    "",
    "{",
    "[]",
    "1",
    "null",
    '{"type": []}',
    '{"type": "view"}',
    '{"type": "file", "path": "/etc/passwd"}',
    "[" * 10_000,
    json.dumps({**VIEW, "size": [0, 48]}),
    json.dumps({**VIEW, "size": [64, 48.5]}),
    json.dumps({**VIEW, "size": [10**9, 10**9]}),
    json.dumps({**VIEW, "size": [True, True]}),
    json.dumps({**VIEW, "more": 1}),
    json.dumps({**VIEW, "moving": 1}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "position": [0, 0, 0]}}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "position": [math.nan, 0, 0]}}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "position": [math.inf, 0, 0]}}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "position": [10**400, 0, 0]}}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "position": "abc"}}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "view_angle": 180}}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "parallel_scale": -1}}),
    json.dumps({**VIEW, "camera": {**VIEW["camera"], "model_transform": []}}),
    json.dumps({**VIEW, "camera": None}),
    json.dumps({"type": "look", "cmap": "../../etc/passwd"}),
    json.dumps({"type": "look", "opacity": [0.5] * 1000}),
    json.dumps({"type": "look", "opacity": {}}),
    json.dumps({"type": "look", "clim": [1, 1]}),
    json.dumps({"type": "time", "step": 2}),
    json.dumps({"type": "time", "step": -1}),
    json.dumps({"type": "clip", "planes": [[0, 0, 0, 0, 0, 0]]}),
    json.dumps({"type": "clip", "planes": [[0, 0, 0, 1, 0, 0]] * 7}),
    json.dumps({"type": "é" * 40}),  # the reason, which has it, is cut
]


def test_a_bad_message_ends_its_client_and_nothing_else(server, tmp_path):
    async def story():
        async with WebClient(server, tmp_path) as good:
            codes = []
            for text in [*BAD, b"binary", "x" * 100_000]:
                async with WebClient(server, tmp_path) as bad:
                    send = bad.socket.send_bytes if isinstance(text, bytes) else None
                    await (send or bad.socket.send_str)(text)
                    codes.append(await bad.end())
            await good.look_from(CAMERA, SIZE)
            await good.vdi()
            return codes

    *codes, huge = asyncio.run(story())
    assert codes == [1008] * (len(BAD) + 1)
    assert huge == 1009


_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)
_entries = st.fixed_dictionaries(
    {"type": st.sampled_from(["view", "look", "clip", "time"])},
    optional={
        name: _json | st.lists(st.floats(), min_size=2, max_size=6)
        for name in ("camera", "size", "moving", "cmap", "opacity", "clim", "planes", "step")
    },
)


@given(_entries | _json)
def test_any_message_is_taken_or_refused(message):
    offer = messages.Offer(2, ("bone",), ("linear",))
    with contextlib.suppress(messages.BadMessageError):
        assert isinstance(
            messages.wish_after(json.dumps(message), messages.Wish(), offer), messages.Wish
        )


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "camera",
    [
        {"position": [1e12, 0, 0], "focal_point": [0, 0, 0]},
        {"position": [0, 0, 1e-12], "focal_point": [0, 0, 0], "view_up": [1, 0, 0]},
        {"position": [0, 0.1, 0], "focal_point": [0, 0, 0], "view_angle": 179.9},
        {"position": [0, -1e9, 0], "focal_point": [0, 0, 0], "parallel_scale": 1e-12},
        {"position": [0, -9, 0], "focal_point": [0, 0, 0], "parallel_scale": 1e12},
    ],
)
def test_extreme_views_harm_nobody(talk, camera):
    async def story(client, other):
        camera.setdefault("view_up", [0, 0, 1])
        await client.say("view", camera=camera, size=[48, 8192])
        await client.idle()
        await other.look_from(CAMERA, SIZE)
        return await other.vdi()

    assert talk(story).n_supersegments > 0


@pytest.fixture
def own_server(default_runtime):
    """Return ``make(**options)``: a server with other limits."""
    with contextlib.ExitStack() as stack:

        def make(**options):
            looks = Classification(LOOK, "serve")
            source = Source([HIGH], looks, GenerationOptions(precision="8-byte"), lists=10**6)
            return stack.enter_context(Server(source, port=0, **options).start())

        yield make


@pytest.mark.slow
def test_a_client_that_stops_reading_is_dropped(own_server, tmp_path):
    server = own_server(stalled=0.5)

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


def test_what_is_made_for_a_client_that_has_left_is_let_go(own_server, tmp_path, monkeypatch):
    server, encode = own_server(), session.encoded
    making, gone = threading.Event(), threading.Event()

    def slowly(vdi):
        making.set()
        assert gone.wait(PATIENCE)
        return encode(vdi)

    async def story():
        async with WebClient(server, tmp_path) as client:
            await client.look_from(CAMERA, SIZE, moving=True)
            assert await asyncio.to_thread(making.wait, PATIENCE)
            assert server._source._kept
        while server.clients:
            await asyncio.sleep(0.01)
        gone.set()
        while server._source._kept:
            await asyncio.sleep(0.01)

    monkeypatch.setattr(session, "encoded", slowly)
    asyncio.run(asyncio.wait_for(story(), PATIENCE))


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

    files = asyncio.run(story())
    assert all(head["level"] == "full" for head, _ in files)


# -- life ------------------------------------------------------------------------------------------


def test_a_port_in_use_is_a_sentence(server):
    with pytest.raises(InvalidArgumentError, match=rf"port {server.port} .* is in use: choose an"):
        web.serve(HIGH, port=server.port, wait=False, **LOOK)


def test_an_address_of_others_is_a_sentence():
    with pytest.raises(InvalidArgumentError, match=r"cannot listen at 203\.0\.113\.1"):
        web.serve(HIGH, host="203.0.113.1", port=0, wait=False, **LOOK)


def test_closing_tells_the_clients(own_server, tmp_path, monkeypatch):
    monkeypatch.setattr(web_server, "_GOODBYE", PATIENCE)  # the machine may be busy
    server = own_server()

    async def story():
        async with WebClient(server, tmp_path) as client:
            await client.look_from(CAMERA, (640, 480))
            closing = asyncio.get_running_loop().run_in_executor(None, server.close)
            code = await client.end()
            await closing
            return code

    assert asyncio.run(story()) == 1001


def test_a_fixed_look_offers_no_other(own_server, default_runtime, tmp_path):
    table = pvdi.TransferFunction([(0, 0, 0.2), (1, 0.5, 0)], [0, 0.5], (0, 255))
    with web.serve(HIGH, port=0, wait=False, announce=None, transfer_function=table) as server:

        async def story():
            async with WebClient(server, tmp_path) as client:
                await client.say("look", cmap="bone")
                return client.hello, await client.end()

        hello, code = asyncio.run(story())
    assert hello["cmaps"] == hello["opacities"] == []
    assert code == 1008


def test_steps_are_any_object_with_a_length_and_items(default_runtime):
    class Steps:
        def __len__(self):
            return 2

        def __getitem__(self, step):
            return [HIGH, LOW][step]

    with web.serve(Steps(), port=0, wait=False, announce=None, **LOOK) as server:
        assert server._source.offer.steps == 2


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
                socket_url = url.replace("/?", "/socket?")
                async with (
                    aiohttp.ClientSession() as session,
                    session.ws_connect(socket_url) as connection,
                ):
                    return json.loads((await connection.receive()).data)

            assert asyncio.run(hello())["steps"] == 2
            process.send_signal(signal.CTRL_C_EVENT if os.name == "nt" else signal.SIGINT)
            assert process.wait(PATIENCE) == 0
            assert process.stdout.read() == "The server has ended\n"
        finally:
            process.kill()
