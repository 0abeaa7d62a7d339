"""Who works on a device now: frames first, background work in short turns between them.

A frame that a person waits for is drawn inside ``Turns.foreground``; a thread whose work may take
its time works inside ``Turns.background``. Background work runs in *turns*, only while no frame is
in progress; within its turn it calls ``give_way`` between two *pieces* of work. A frame that
arrives waits for the piece in progress. Where frames follow each other without pause, background
work still gets a turn after each, as long as a fixed share of a recent frame
(docs/decisions/background.md).
"""

import contextlib
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from pyvista_vdi.errors import Cancelled

#: What a turn may take, as a share of a recent frame's time. Frames without pause then take 1.3
#: times as long, which leaves room below 1.5 for waking threads and for a piece that runs over.
SHARE = 0.3
#: A turn is no shorter, seconds: below, handing over costs more than the work.
SHORTEST_TURN = 0.001
#: A piece is no longer, seconds, however long frames take: a cancelled thread ends as soon.
LONGEST_PIECE = 0.025
#: Frames that "a recent frame" is the median of; before the first, one took so many seconds.
RECENT_FRAMES, FIRST_FRAME = 5, 1 / 60
#: Pieces of one kind of work whose slowest says how fast the next will be: more than a slice of
#: rays has, so that a march through nothing does not make the next one through much too long.
RECENT_PIECES = 32
#: A piece is planned for this share of the time that it may take: work per item varies.
CAUTION = 0.8
#: Seconds between two looks at whether a waiting thread's work is still wanted.
POLL = 0.02


class Worker:
    """A thread inside :meth:`Turns.background`.

    ``cancelled`` says whether the work is no longer wanted, ``paused`` whether it is to wait;
    ``turn_began`` when its turn began, by ``time.perf_counter``.
    """

    def __init__(
        self, cancelled: Callable[[], bool], paused: Callable[[], bool] = lambda: False
    ) -> None:
        self.cancelled, self.paused = cancelled, paused
        self.turn_began = 0.0
        self._rates: dict[str, deque[float]] = {}  # items per second of the last pieces

    def piece(self, kind: str, seconds: float) -> int | None:
        """Return how many items of a kind of work fill so many seconds; None if never tried."""
        rates = self._rates.get(kind)
        return max(1, int(min(rates) * seconds * CAUTION)) if rates else None

    def took(self, kind: str, items: int, seconds: float) -> None:
        """Note what a piece took."""
        rates = self._rates.setdefault(kind, deque(maxlen=RECENT_PIECES))
        rates.append(items / max(seconds, 1e-9))


class ThisThread(threading.local):
    """The calling thread: as one that works in turns, and whether it draws a frame."""

    worker: Worker | None = None
    in_frame = False


class Turns:
    """The order in which frames and background work use one device."""

    def __init__(self) -> None:
        self._changed = threading.Condition()  # re-entrant
        self.thread = ThisThread()
        self._frames = 0  # in progress
        self._arriving = 0  # frames that wait to begin
        self._waiting: deque[Worker] = deque()
        self._holder: Worker | None = None  # whose turn it is
        self._owed = False  # a frame has ended while background work waited
        self._recent: deque[float] = deque([FIRST_FRAME], maxlen=RECENT_FRAMES)

    @contextlib.contextmanager
    def foreground(self) -> Iterator[None]:
        """Draw a frame that a person waits for inside the ``with`` block.

        Background work on this device rests meanwhile. The block begins when the piece of
        background work in progress is done, or after a turn of it, if it could not go on before the
        last frame. Blocks of several threads run side by side; inside another, or in background
        work, a block changes nothing. Do not begin one while holding a lock that background work
        may need.
        """
        if self.thread.worker is not None or self.thread.in_frame:
            yield
            return
        self._begin_frame()
        began = time.perf_counter()
        try:
            yield
        finally:
            self._end_frame()
            self._recent.append(time.perf_counter() - began)

    def _begin_frame(self) -> None:
        with self._changed:
            self._arriving += 1
            try:
                while self._holder is not None or (self._owed and self._next() is not None):
                    self._changed.wait()
            finally:
                self._arriving -= 1
            self._frames += 1
        self.thread.in_frame = True

    def _end_frame(self) -> None:
        self.thread.in_frame = False
        with self._changed:
            self._frames -= 1
            self._owed = self._next() is not None
            self._changed.notify_all()

    @contextlib.contextmanager
    def background(
        self,
        cancelled: Callable[[], bool] = lambda: False,
        paused: Callable[[], bool] = lambda: False,
    ) -> Iterator[None]:
        """Work inside the ``with`` block only when no frame is in progress.

        Nor while ``paused()`` is true: frames then wait for nothing of it. Launches and copies are
        cut into pieces that take no longer than a turn; each is finished when the call returns.
        ``cancelled`` is asked between pieces: True ends the work with :class:`Cancelled`.
        """
        if self.thread.worker is not None or self.thread.in_frame:
            raise RuntimeError("background work cannot begin inside a frame or background work")
        worker = Worker(cancelled, paused)
        self._take_turn(worker)
        self.thread.worker = worker
        try:
            yield
        finally:
            self.thread.worker = None
            self._end_turn(worker)

    def give_way(self) -> float:
        """Stand aside for others if this thread's turn is over.

        Returns the seconds that the next piece may take, infinite outside background work; raises
        Cancelled if the work is no longer wanted.
        """
        worker = self.thread.worker
        if worker is None:
            return float("inf")
        if worker.cancelled():
            raise Cancelled("background work was cancelled")
        turn = max(SHORTEST_TURN, SHARE * statistics.median(list(self._recent)))
        left = worker.turn_began + turn - time.perf_counter()
        over = left <= 0.15 * turn  # no useful piece fits
        with self._changed:  # throughout, so that who is let in finds this thread waiting already
            if (over and (self._arriving or self._waiting)) or worker.paused():
                self._end_turn(worker)
            if self._holder is not worker:
                self._take_turn(worker)
        return min(turn if over else left, LONGEST_PIECE)

    def _next(self) -> Worker | None:
        """Return who waits for a turn first, and may work."""
        return next((worker for worker in self._waiting if not worker.paused()), None)

    def _take_turn(self, worker: Worker) -> None:
        def is_free() -> bool:
            frames_first = self._frames > 0 or (self._arriving > 0 and not self._owed)
            return not frames_first and self._holder is None and self._next() is worker

        with self._changed:
            self._waiting.append(worker)
            try:
                # A frame may be ending this very work and wait for its end: look now and then
                while not self._changed.wait_for(is_free, POLL):
                    if worker.cancelled():
                        raise Cancelled("background work was cancelled")
                self._holder, self._owed = worker, False
            finally:
                self._waiting.remove(worker)
                self._changed.notify_all()
        worker.turn_began = time.perf_counter()

    def _end_turn(self, worker: Worker) -> None:
        with self._changed:
            if self._holder is worker:
                self._holder = None
                self._changed.notify_all()

    @contextlib.contextmanager
    def aside(self) -> Iterator[None]:
        """Leave the device to others inside the ``with`` block, whose work needs none."""
        worker, in_frame = self.thread.worker, self.thread.in_frame
        if worker is not None:
            self._end_turn(worker)
        elif in_frame:
            self._end_frame()
        try:
            yield
        finally:
            if in_frame:
                self._begin_frame()
        if worker is not None:
            self._take_turn(worker)

    @contextlib.contextmanager
    def holding(self, lock: Any) -> Iterator[None]:
        """Hold a lock under which device work is done.

        Whoever holds it may be waiting for this thread's frame or turn to end, so a thread that
        finds it taken leaves either until it gets it.
        """
        taken = lock.acquire(blocking=False)
        try:
            if not taken:
                with self.aside():
                    taken = lock.acquire()
            yield
        finally:
            if taken:
                lock.release()
