"""A client of a server: what it wishes, what it has been sent, and what is to be done next.

All methods run in the thread of the event loop; the *stages*, an estimate, a picture or one VDI,
run in the server's few threads. A client has at most one stage in them, so that threads take
clients in turn: each one stage, then the next client's. The latest wish is read when a stage
begins.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

from pyvista_vdi.errors import Cancelled, VDIError
from pyvista_vdi.extensions.web.encode import encoded
from pyvista_vdi.extensions.web.messages import Wish
from pyvista_vdi.extensions.web.source import Made, Source
from pyvista_vdi.quality.regeneration_policy import AT_HOME, estimate_is_old, is_poor

#: Farther than this (View.distance) from the view that a full VDI is made for, it is given up: a
#: coarse one is what a view in motion needs. Coarse ones are never given up for another wish, so
#: that however fast wishes follow each other, there are pictures.
_FULL_OUT_OF_DATE = 0.1

#: Seconds for which a view must have rested before its full VDI is made. The volume's picture shows
#: it meanwhile; the full VDI, five to ten times a coarse one's bytes, is for turns from there.
SETTLED = 5.0


class Client:
    """What a server knows of one connection.

    Parameters
    ----------
    source : Source
        What is served.
    threads : Executor
        Where stages run.
    below : float
        Estimated SSIM below which a view gets a VDI of its own.

    Attributes
    ----------
    waiting : (Made, bytes) or None
        The VDI that is to be sent next, and its file. At most one waits: nothing more is made
        until it is on its way.
    notes : dict
        Messages to be sent, the last of each type.
    news : asyncio.Event
        Set when there is something to send.
    left : asyncio.Event
        Set when the connection is to end.
    """

    def __init__(self, source: Source, threads: Executor, below: float) -> None:
        self.wish = Wish()
        self.waiting: tuple[Made, bytes] | None = None
        self._picture: tuple[Wish, bytes] | None = None
        self._pictured = 0  # Wish.said of what a picture was made of last
        self.notes: dict[str, dict[str, Any]] = {}
        self.news = asyncio.Event()
        self.left = asyncio.Event()
        self._source = source
        self._threads = threads
        self._below = below
        self._woken = asyncio.Event()
        self._made: Made | None = None  # made last
        self._shown: Made | None = None  # sent last, and whole
        self._latest: Made | None = None  # made last, also where nobody waits for it any more
        self._closed = False
        self._judged: tuple[Made, Wish, float] | None = None
        self._stage = ""
        self._told: str | None = None
        self._begun_for = Wish()
        self._cancelled = threading.Event()
        self._failed: Wish | None = None
        self._settled = False
        self._settling: asyncio.TimerHandle | None = None

    def hear(self, wish: Wish) -> None:
        """Take note of what the client wants now."""
        self.wish = wish
        self._stop_settling()
        if not wish.moving:
            self._settling = asyncio.get_running_loop().call_later(SETTLED, self._settle)
        if self._stage == "full" and self.is_out_of_date(self._begun_for):
            self._cancelled.set()
        if self._stage == "picture":
            self._cancelled.set()  # it is of one view
        self._woken.set()

    def next_file(self) -> tuple[Made, bytes] | None:
        """Return the VDI that is to be sent now, once; the next one is made meanwhile."""
        waiting, self.waiting = self.waiting, None
        if waiting is not None:
            self._woken.set()
        return waiting

    def next_picture(self) -> tuple[Wish, bytes] | None:
        """Return the volume's picture that is to be sent now, once, if it still is what is seen."""
        picture, self._picture = self._picture, None
        if picture is None:
            return None
        self._woken.set()
        return picture if picture[0].said == self.wish.said else None

    def sent(self, made: Made) -> None:
        """Take note that the client has a VDI."""
        self._source.forget(self._shown)
        self._shown = made

    def given_up(self, made: Made) -> None:
        """Take note that the client was not sent all of a VDI: it draws the one before."""
        self._source.forget(made)
        if self._made is made:
            self._made, self._judged = self._shown, None
            self._woken.set()

    def is_outdone(self, made: Made) -> bool:
        """Whether a VDI that is being sent is to give way: a full one may, a coarse one never.

        Not because the view has moved on: it serves views around its own, too, and what was sent
        of it would be lost. Only where that asks for another, which then waits.
        """
        outdone = self.waiting is not None or made.wish.content != self.wish.content
        return made.level == "full" and outdone

    def is_out_of_date(self, wish: Wish) -> bool:
        """Whether a full VDI for a former wish is not worth making."""
        return wish.content != self.wish.content or self._apart(wish) > _FULL_OUT_OF_DATE

    def _settle(self) -> None:
        self._settled = True
        self._woken.set()

    def _stop_settling(self) -> None:
        self._settled = False
        if self._settling is not None:
            self._settling.cancel()

    def close(self) -> None:
        """Cancel what is being made."""
        self._stop_settling()
        self._cancelled.set()
        self._closed = True
        for made in (self._made, self._shown, self._latest):
            self._source.forget(made)

    async def work(self) -> None:
        """Do one stage after the other, for as long as the client is there."""
        while True:
            await self._woken.wait()
            self._woken.clear()
            while stage := self._next_stage():
                await self._do(stage)
            self._tell_doing(None)

    def _next_stage(self) -> str:
        """Return ``"picture"``, ``"estimate"``, ``"first"`` or ``"full"``, or nothing."""
        wish, made = self.wish, self._made
        if wish.view is None or self._failed == wish:
            return ""
        if not wish.moving and self._pictured != wish.said and self._picture is None:
            return "picture"  # before all: it is what the view looks like, and takes least bytes
        if self.waiting is not None:
            return ""
        if made is None or made.wish.content != wish.content:
            return "first"
        rest = "full" if made.level == "coarse" and self._settled else ""
        if self._apart(made.wish) <= AT_HOME:
            return rest
        judged = self._judged
        if (
            judged is None
            or judged[0] is not made
            or judged[1].planes != wish.planes
            or estimate_is_old(self._apart(judged[1]), moving=wish.moving)
        ):
            return "estimate"
        return "first" if is_poor(judged[2], self._below, moving=wish.moving) else rest

    def _apart(self, other: Wish) -> float:
        """Distance of the client's view from that of a former wish."""
        assert self.wish.view is not None
        assert other.view is not None
        return self.wish.view.distance(other.view, self._source.bounds)

    async def _do(self, stage: str) -> None:
        self._stage, self._begun_for = stage, self.wish
        self._cancelled = threading.Event()
        works: dict[str, Callable[..., Any]] = {
            "estimate": self._estimate,
            "picture": self._make_picture,
        }
        self._tell_doing(stage if stage in works else "vdi")
        try:
            done = await asyncio.get_running_loop().run_in_executor(
                self._threads, works.get(stage, self._make), stage, self._cancelled
            )
        except Cancelled:
            return
        except VDIError as error:
            self._failed = self._begun_for
            self._tell("error", message=str(error))
            return
        finally:
            self._stage = ""
        if stage == "estimate":
            self._judged = done
            return
        if stage == "picture":
            self._picture, self._pictured = done, done[0].said
            self.news.set()
            return
        made, file = done
        self._made, self._judged = made, None
        if file:
            self.waiting = made, file
            self.news.set()

    def _tell_doing(self, doing: str | None) -> None:
        if doing != self._told:
            self._told = doing
            self._tell("status", doing=doing)

    def _tell(self, kind: str, **entries: Any) -> None:
        self.notes[kind] = {"type": kind, **entries}
        self.news.set()

    def _estimate(self, _: str, cancelled: threading.Event) -> tuple[Made, Wish, float]:
        wish, made = self.wish, self._made
        assert made is not None
        return made, wish, self._source.estimate(made, wish, cancelled.is_set)

    def _make_picture(self, _: str, cancelled: threading.Event) -> tuple[Wish, bytes]:
        wish = self._begun_for = self.wish
        return wish, self._source.picture(wish, cancelled.is_set)

    def _make(self, stage: str, cancelled: threading.Event) -> tuple[Made, bytes]:
        wish = self._begun_for = self.wish
        level = self._source.first_level(wish) if stage == "first" else stage
        made, vdi = self._source.make(wish, level, cancelled.is_set)
        self._latest = made
        try:
            return made, b"" if vdi is None else encoded(vdi)
        except BaseException:
            self._source.forget(made)
            raise
        finally:
            if self._closed:  # while it was being made
                self._source.forget(made)
