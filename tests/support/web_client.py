"""A client of ``pyvista_vdi.extensions.web.serve`` that is no browser."""

from __future__ import annotations

import asyncio
import json
from urllib.parse import urlsplit

import aiohttp
import numpy as np

import pyvista_vdi as pvdi

#: Seconds for whatever must happen: far more than it takes, also beside other tests.
PATIENCE = 120


class WebClient:
    """One connection. ``async with`` gives it when the server has said hello."""

    def __init__(self, server, folder, *, port=None, headers=None):
        parts = urlsplit(server.url)
        host = f"{parts.hostname}:{port or parts.port}"
        self.url = f"http://{host}/socket?{parts.query}"
        self._folder, self._headers = folder, headers
        self.messages = []
        self.head, self.parts = None, []  # of the VDI that comes, or came last

    async def __aenter__(self):
        self._session = aiohttp.ClientSession()
        try:
            self.socket = await self._session.ws_connect(
                self.url,
                headers=self._headers,
                max_msg_size=0,
                timeout=aiohttp.ClientWSTimeout(ws_close=1),
            )
        except BaseException:
            await self._session.close()
            raise
        self.hello = await self.message("hello")
        return self

    async def __aexit__(self, *_):
        await self.socket.close()
        await self._session.close()

    async def say(self, kind, **entries):
        await self.socket.send_str(json.dumps({"type": kind, **entries}))

    async def look_from(self, camera, size):
        names = ["position", "focal_point", "view_up"]
        names.append("parallel_scale" if camera.parallel_projection else "view_angle")
        state = {name: getattr(camera, name) for name in names}
        await self.say("view", camera=state, size=size)

    async def receive(self):
        """Return the next message: a dictionary, bytes, or the end's code."""
        message = await asyncio.wait_for(self.socket.receive(), PATIENCE)
        if message.type is aiohttp.WSMsgType.TEXT:
            self.messages.append(json.loads(message.data))
            if self.messages[-1]["type"] == "vdi":
                self.head, self.parts = self.messages[-1], []
            return self.messages[-1]
        if message.type is aiohttp.WSMsgType.BINARY:
            self.parts.append(message.data)
            return message.data
        return self.socket.close_code

    async def message(self, kind):
        """Return the next message of a kind."""
        while True:
            found = await self.receive()
            if isinstance(found, dict) and found["type"] == kind:
                return found
            assert not isinstance(found, int), f"the server has ended the connection: {found}"

    @property
    def is_whole(self):
        """Whether all of the VDI has come that the last head was of."""
        return self.head is not None and sum(map(len, self.parts)) == self.head["bytes"]

    async def file(self):
        """Return the head and the bytes of the next VDI that comes whole."""
        while True:
            found = await self.receive()
            assert not isinstance(found, int), f"the server has ended the connection: {found}"
            if isinstance(found, bytes) and self.is_whole:
                return self.head, b"".join(self.parts)

    async def vdi(self):
        """Return the next VDI as it was read from its file."""
        _, file = await self.file()
        path = self._folder / "received.vdi"
        path.write_bytes(file)
        return pvdi.read(path)

    async def idle(self):
        """Wait until the server has done something for this client, and has nothing more to do."""
        while (await self.message("status"))["doing"] is None:
            pass
        while (await self.message("status"))["doing"] is not None:
            pass

    async def end(self):
        """Return the code by which the server ends the connection."""
        while not isinstance(found := await self.receive(), int):
            pass
        return found


def soft_ball(n=24, scale=1.0):
    """A ball that is denser towards its middle, bounds -1..1, scalars 0 to 255 times scale."""
    x = np.linspace(-1, 1, n)
    radius = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    values = 255 * scale * np.clip(1 - radius, 0, 1)
    return pvdi.Volume(values.astype(np.uint8), (2 / (n - 1),) * 3, (-1,) * 3)
