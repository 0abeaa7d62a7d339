"""Which step of a series is shown, and when; steps are decoded ahead, behind the frames."""

from __future__ import annotations

import math
import operator
import threading
import time
from collections.abc import Callable
from typing import Any

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import Cancelled, InvalidArgumentError
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.model.checks import as_float, memory_limit_bytes
from pyvista_vdi.model.collection import RATE
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.worker import Job, Worker
from pyvista_vdi.raycasting.prepared import kept_values, prepared_vdi

#: Steps that are decoded before their time comes: what takes longer than the others finds them.
_AHEAD = 3
#: Bytes of decoded steps that are kept, so that the next round need not decode them.
MEMORY = 1 << 30
#: Bytes of a step on a device over those of its arrays, which are kept as well.
ON_DEVICE = 1.2
#: Share of the last step's decoding in what the next one is expected to take.
_LAST = 0.3


def bring(runtime: Runtime, vdi: Any) -> None:
    """Bring a VDI's lists to a device, with its colours or with the values that it keeps."""
    if isinstance(vdi, DeferredVDI):
        kept_values(runtime, vdi)
    else:
        prepared_vdi(runtime, vdi)


class Decoding(Job):
    """Work beside the frames, and not in turns with them: what it makes is what they wait for."""

    def done(self) -> Any:
        """Do the work on a queue of this thread's own, and return its result."""
        runtime = get_runtime(self._device)
        with runtime.queue_scope():
            return self._work(runtime, self._report)


class Player:
    """Shows one step of a series after the other, at a rate, leaving out what is not ready.

    The thread that draws asks for :attr:`vdi` in its frames and calls :meth:`advance` between two
    of them. Another thread decodes the steps that come next and brings them to the device. Where
    that is slower than the rate, it takes the steps that will be due when they are ready, so that
    what is shown is late by a frame at most. Decoded steps are kept as long as they fit in
    :attr:`memory`; those that come last of all are let go of first.
    """

    def __init__(self, series: VDISeries, clock: Callable[[], float] = time.perf_counter) -> None:
        self.series = series
        self.dropped = 0
        self.device: Any = None
        self.memory: float = MEMORY
        self._clock = clock
        self._rate, self._loop = RATE, True
        # Places go on where the series begins anew: place p is step p modulo the steps
        self._place = 0
        self._since: float | None = None  # when the place before was due; None before a frame
        self._from = 0
        self._playing = False
        self._lock = threading.Lock()
        self._ready: dict[int, VDI] = {}  # by step
        self._bytes: dict[int, float] = {}  # that each takes
        self._instead: VDI | None = None  # of the step that is shown
        self._broken: set[int] = set()
        self._unsaid: list[Exception] = []  # why they are
        self._seconds = 0.0  # that a step takes to be ready
        self._worker = Worker("pyvista-vdi series")

    @property
    def step(self) -> int:
        """Index of the step that is shown."""
        return self._place % len(self.series)

    @step.setter
    def step(self, step: int) -> None:
        n = len(self.series)
        try:
            index = operator.index(step)
        except TypeError:
            index = n
        if not -n <= index < n:
            raise InvalidArgumentError(
                f"step must be a whole number from 0 to {n - 1}, or from -{n} to -1 from the end; "
                f"got {step!r}"
            )
        with self._lock:
            self._move(index % n)
        self._from, self._since = self._place, None

    @property
    def decoded(self) -> list[VDI]:
        """The steps that are ready."""
        with self._lock:
            return list(self._ready.values())

    @property
    def time(self) -> float:
        """Time of the step that is shown."""
        return self.series.times[self.step]

    @time.setter
    def time(self, time: float) -> None:
        self.step = self.series.nearest(time)

    @property
    def vdi(self) -> VDI:
        """The step that is shown, decoded now if it is not ready."""
        step = self.step
        with self._lock:
            known = self._instead or self._ready.get(step)
        if known is None:
            known = self.series[step]
            with self._lock:
                self._keep(step, known)
        return known

    def replace(self, vdi: VDI) -> None:
        """Show another VDI of the step that is shown, as long as it is."""
        with self._lock:
            self._instead = vdi

    @property
    def playing(self) -> bool:
        """Whether one step is shown after the other."""
        return self._playing

    @property
    def rate(self) -> float:
        """Steps per second."""
        return self._rate

    def play(
        self, rate: float = RATE, *, loop: bool = True, memory_limit: float | str | None = None
    ) -> None:
        """Go on from the step that is shown, or from the first where the last one is."""
        rate_ = as_float(rate)
        if isinstance(rate, bool) or not 0 < rate_ < math.inf:
            raise InvalidArgumentError(f"rate must be steps per second, above 0; got {rate!r}")
        limit = memory_limit_bytes(memory_limit)
        if limit is not None:
            self.memory = limit
        n = len(self.series)
        with self._lock:
            self._rate, self._loop = rate_, bool(loop)
            self._place %= n
            if not loop and self._place == n - 1:
                self._move(0)
        self.dropped = 0
        self._from, self._since, self._playing = self._place, None, n > 1

    def pause(self) -> None:
        """Stay at the step that is shown."""
        self._playing = False

    def advance(self) -> bool:
        """Show the last step that is due and ready; whether it is another one."""
        if not self._playing:
            return False
        if self._since is None:
            self._since = self._clock()
        place = self._next()
        if place is not None:
            with self._lock:
                self.dropped += place - self._place - 1
                self._move(place)
        if self._is_over():
            self.pause()
        elif not self._worker.running and self._wanted() is not None:
            self._worker.put(Decoding(lambda on, _report: self._decode(on), self.device))
        with self._lock:
            error = self._unsaid.pop() if self._unsaid else None
        if error is not None:
            raise error
        return place is not None

    def close(self) -> None:
        """Pause, and leave no thread; playing may begin anew."""
        self.pause()
        self._worker.clear()
        self._worker.join()
        self._ready.clear()
        self._bytes.clear()

    def _due_at(self, now: float) -> int:
        """Return the place whose time has come at a moment."""
        since = now if self._since is None else self._since
        place = self._from + int((now - since) * self._rate)
        return place if self._loop else min(place, len(self.series) - 1)

    def _is_over(self) -> bool:
        """Whether time is at the last step, and none that could be shown is left."""
        last = len(self.series) - 1
        if self._loop or self._due_at(self._clock()) < last:
            return False
        return all(step in self._broken for step in range(self._place + 1, last + 1))

    def _next(self) -> int | None:
        """Return the last place that is due and ready, beyond that which is shown."""
        due, n = self._due_at(self._clock()), len(self.series)
        with self._lock:
            # Further back than a round the same steps come again
            for place in range(due, max(self._place, due - n), -1):
                if place % n in self._ready:
                    return place
        return None

    def _move(self, place: int) -> None:
        """Show a place."""
        self._place, self._instead = place, None
        self._trim()

    def _keep(self, step: int, vdi: VDI) -> None:
        """Keep a decoded step."""
        self._ready[step], self._bytes[step] = vdi, vdi.nbytes * (1 + ON_DEVICE)
        self._trim()

    def _trim(self) -> None:
        """Drop what memory is not enough for, first what is shown in the longest time.

        In a round that does not fit, the same steps are kept in each.
        """
        n = len(self.series)
        # A step may be shown although the next one is due already
        first = max(self._place, self._due_at(self._clock()) - 1) if self._playing else self._place
        last = sorted(self._ready, key=lambda step: (step != self.step, (step - first) % n))
        while len(last) > _AHEAD + 1 and sum(self._bytes.values()) > self.memory:
            step = last.pop()
            del self._ready[step], self._bytes[step]

    def _wanted(self) -> int | None:
        """Return the next step to be decoded; None where enough are."""
        n = len(self.series)
        with self._lock:
            # Where steps take longer than they are shown, those of the moment when they are ready
            first = max(self._place + 1, self._due_at(self._clock() + self._seconds))
            last = first + _AHEAD if self._loop else min(first + _AHEAD, n)
            for place in range(first, last):
                step = place % n
                if step not in self._ready and step not in self._broken:
                    return step
        return None

    def _decode(self, runtime: Runtime) -> bool:
        """Decode what is wanted, step after step, until enough are ready."""
        for _ in range(_AHEAD):  # then a frame must have come: nobody may be looking
            step = self._wanted()
            if step is None or not self._playing:
                break
            began = self._clock()
            try:
                vdi = self.series[step]
                bring(runtime, vdi)
            except Cancelled:
                raise
            except Exception as error:  # advance() says it, and the next steps may be whole
                with self._lock:
                    self._broken.add(step)
                    self._unsaid.append(error)
                continue
            took = self._clock() - began
            with self._lock:
                self._seconds += (took - self._seconds) * (_LAST if self._seconds else 1)
                self._keep(step, vdi)
        return True
