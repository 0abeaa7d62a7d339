"""A line between a client and a server that is as slow as one asks: a proxy on this machine."""

from __future__ import annotations

import asyncio
import contextlib
import socket

#: Bytes taken up at a time: a few packets, so that a slow line is even.
_PIECE = 4096
#: Bytes that the system may hold before the line: with fewer, local connections stand still at
#: times, and with its own choice, megabytes, whatever is sent has been sent.
_HELD = 65536
#: Seconds by which a piece may be late without the line being slower for it.
_LATE = 0.05


class SlowLine:
    """Forwards connections to a port at so many bytes a second, so many seconds later.

    ``port`` is where it listens, ``down`` the bytes that came from the other port so far.
    """

    def __init__(self, to, *, rate, latency):
        self._to, self._rate, self._latency = to, rate, latency
        self._ends = []
        self.down = 0

    async def __aenter__(self):
        self._server = await asyncio.start_server(self._connected, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_):
        self._server.close()
        for writer in self._ends:
            writer.transport.abort()
        await asyncio.gather(*(w.wait_closed() for w in self._ends), return_exceptions=True)

    async def _connected(self, reader, writer):
        way = socket.socket()
        way.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _HELD)
        way.setblocking(False)
        await asyncio.get_running_loop().sock_connect(way, ("127.0.0.1", self._to))
        there, back = await asyncio.open_connection(sock=way, limit=_PIECE)
        self._ends += [writer, back]
        with contextlib.suppress(ConnectionError, asyncio.CancelledError):
            await asyncio.gather(self._carry(there, writer, down=True), self._carry(reader, back))

    async def _carry(self, reader, writer, *, down=False):
        loop = asyncio.get_running_loop()
        line = asyncio.Queue(max(1, int(self._rate * self._latency / _PIECE)))  # what is on it

        async def deliver():
            while (item := await line.get()) is not None:
                due, data = item
                await asyncio.sleep(max(0.0, due - loop.time()))
                writer.write(data)
                with contextlib.suppress(ConnectionError):  # who is gone needs nothing more
                    await writer.drain()
            writer.close()

        async def take_up():
            free = loop.time()
            while data := await reader.read(_PIECE):
                # Not from now on: sleeps last longer than asked for, which would slow the line
                free = max(free, loop.time() - _LATE) + len(data) / self._rate
                self.down += len(data) * down
                await line.put((free + self._latency, data))
                await asyncio.sleep(max(0.0, free - loop.time()))
            await line.put(None)

        await asyncio.gather(deliver(), take_up())
