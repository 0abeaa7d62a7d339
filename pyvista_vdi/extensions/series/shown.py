"""What a mapper draws of a series: the step that is due; others are read in the background."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import Cancelled, InvalidArgumentError
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_float, as_whole
from pyvista_vdi.model.collection import RATE
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.options import MediumOptions
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.quality.background import BackgroundThread, Job
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput, Input

#: Bytes of steps that are kept, so that the next round need not read them.
MEMORY = 1 << 30
#: Bytes of a step on a device over those of its arrays, which are kept as well.
ON_DEVICE = 1.2


class Decoding(Job):
    """Work beside the frames, and not in turns with them: what it makes is what they wait for."""

    def done(self, paused: Callable[[], bool] = lambda: False) -> Any:
        """Do the work, and return its result."""
        return self.work(get_runtime(self.device), lambda fraction: None)


class SeveralInput(Input):
    """What is shown of several VDIs: a thread of its own reads the next ones to the device.

    Those that are ready are kept as long as they fit in :attr:`memory`.
    """

    collection: Any
    #: VDIs that are read before they are shown.
    ahead = 3
    #: Returns which are to be read ahead, the first one first.
    _coming: Callable[[], list[int]]
    #: Drops what memory is not enough for.
    _trim: Callable[[], None]
    #: Indices and weights of what is shown, the nearest first.
    _weights: list[tuple[int, float]]

    def __init__(self, vdis: Any, thread: str) -> None:
        super().__init__()
        self.collection = vdis
        self.device: Any = None
        self.memory: float = MEMORY
        self._lock = threading.Lock()
        self._ready: dict[int, VDI] = {}  # by index
        self._broken: set[int] = set()
        self._unsaid: list[Exception] = []  # why they are
        self._worker = BackgroundThread(thread)
        self._kept: dict[int, DeferredInput] = {}  # of what is shown, where it keeps values

    def vdi(self) -> VDI:
        """Return the VDI that is shown, read now if it is not ready."""
        self.last = self._seen(self._weights[0][0])
        return self.last

    @property
    def deferred(self) -> DeferredVDI | None:  # type: ignore[override]
        """The values of the VDI that is shown, where it keeps them."""
        shown: Any = self._at(self._weights[0][0])
        return shown if isinstance(shown, DeferredVDI) else None

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds of the VDI that was shown last, or of the first."""
        return self.collection.bounds if self.last is None else self.last.bounds

    def stamp(self) -> Any:
        """Return which VDI is shown, and the time stamp of what classifies it."""
        return self._weights[0][0], self.prop and (id(self.prop), self.prop.GetMTime())

    def on_devices(self) -> list[Any]:
        """Return the VDIs that are ready, and what was classified of those that are shown."""
        with self._lock:
            ready = [*self._ready.values()]
        return [self.last, *ready, *(one.last for one in self._kept.values())]

    def look(self, camera: Camera, device: Any) -> None:
        """Read, for a device, what a view needs, or what comes next."""
        self.device = device
        self._read_ahead()

    def rest(self) -> None:
        """Leave no thread; the next frame may begin anew."""
        self._worker.clear()
        self._worker.join()
        with self._lock:
            self._ready.clear()

    def _seen(self, i: int) -> VDI:
        """Return a VDI, with the colours that the property gives it where it keeps values."""
        vdi: Any = self._at(i)
        if not isinstance(vdi, DeferredVDI) or self.prop is None:
            return as_vdi(vdi)  # refuses what has no colours
        kept = self._kept.get(i)
        if kept is None or (kept.deferred, kept.prop) != (vdi, self.prop):
            shown = dict(self._weights)
            self._kept = {k: one for k, one in self._kept.items() if k in shown}
            kept = self._kept[i] = DeferredInput(vdi, self.prop)
        return as_vdi(kept.vdi())

    def _wanted(self) -> int | None:
        """Return the next VDI to be read; None where enough are."""
        with self._lock:
            known = self._ready.keys() | self._broken
            return next((i for i in self._coming() if i not in known), None)

    def _at(self, i: int) -> Any:
        """Return a VDI, read now if it is not ready."""
        with self._lock:
            known = self._ready.get(i)
        return self._keep(i, self.collection[i]) if known is None else known

    def _keep(self, i: int, vdi: VDI) -> VDI:
        with self._lock:
            self._ready[i] = vdi
            self._trim()
        return vdi

    def _read_ahead(self) -> None:
        """Have read what is wanted, VDI after VDI, until enough are ready."""
        if not self._worker.running and self._wanted() is not None:
            self._worker.put(Decoding(lambda on, _report: self._decode(on), self.device))

    def _decode(self, runtime: Runtime) -> bool:
        for _ in range(self.ahead):  # then a frame must have come: nobody may be looking
            if (i := self._wanted()) is None or not self._worker.running:
                break
            try:
                self._keep(i, self._read(i, runtime))
            except Cancelled:
                raise
            except Exception as error:  # it is said by whoever needs it, and the next may be whole
                with self._lock:
                    self._broken.add(i)
                    self._unsaid.append(error)
        return True

    def _read(self, i: int, runtime: Runtime) -> VDI:
        """Read a VDI, and bring its lists, with colours or values, to the device."""
        vdi: Any = self.collection[i]
        prepared_vdi(runtime, vdi)
        return vdi  # type: ignore[no-any-return]


class SeriesInput(SeveralInput):
    """The step of a series that is shown; one after the other at a rate, where it plays.

    The thread that draws asks for :meth:`vdi` in its frames and calls :meth:`advance` between two
    of them. Where reading is slower than the rate, the steps that will be due when they are ready
    are read, so that what is shown is late by a frame at most. Steps that come last of all are
    dropped first.
    """

    collection: VDISeries
    _place: int

    def __init__(self, series: VDISeries, clock: Callable[[], float] = time.perf_counter) -> None:
        super().__init__(series, "pyvista-vdi series")
        #: Steps per second, and whether one is shown after the other.
        self.rate, self.playing = RATE, False
        self._clock, self._loop = clock, True
        # Places go on where the series begins anew: place p is step p modulo the steps
        self._since: float | None = None  # when the place before was due; None before a frame
        self._seconds = 0.0  # that the last step took to be ready
        self._begin(0)

    @property
    def player(self) -> SeriesInput:  # type: ignore[override]
        """What chooses among the steps: this."""
        return self

    @property
    def step(self) -> int:
        """Index of the step that is shown; negative ones that are set are from the end."""
        return self._weights[0][0]

    @step.setter
    def step(self, step: int) -> None:
        n = len(self.collection)
        if not -n <= as_whole(step) < n:
            raise InvalidArgumentError(
                f"step must be a whole number from {-n}, the first one, to {n - 1}; got {step!r}"
            )
        self._begin(int(step) % n)

    @property
    def time(self) -> float:
        """Time of the step that is shown; of one that is set the nearest step is shown."""
        return self.collection.times[self.step]

    @time.setter
    def time(self, time: float) -> None:
        self.step = self.collection.nearest(time)

    def play(
        self, rate: float = RATE, *, loop: bool = True, memory_limit: int | None = None
    ) -> None:
        """Show one step after the other, ``rate`` a second, from the one that is shown.

        Time does not wait: steps that are not ready when theirs comes are left out. Without an
        event loop, as off-screen, a frame shows the step of the moment; for a movie set
        :attr:`time`. ``loop``: whether the first step follows the last. ``memory_limit``: bytes
        that decoded steps may take; 1 GiB by default.
        """
        if isinstance(rate, bool) or not 0 < as_float(rate) < math.inf:
            raise InvalidArgumentError(f"rate must be steps per second, above 0; got {rate!r}")
        self.memory = MediumOptions(memory_limit=memory_limit).memory_limit or self.memory
        self.rate, self._loop = as_float(rate), bool(loop)
        last = len(self.collection) - 1
        self._begin(0 if not loop and self.step == last else self.step)
        self.playing = last > 0
        self.tell()

    def pause(self) -> None:
        """Stay at the step that is shown."""
        self.playing = False

    def advance(self) -> bool:
        """Show the last step that is due and ready; whether it is another one."""
        if not self.playing:
            return False
        now, n = self._clock(), len(self.collection)
        self._since = now if self._since is None else self._since
        due = self._due_at(now)
        with self._lock:
            # Further back than a round the same steps come again
            places = range(due, max(self._place, due - n), -1)
            before, ready = self._place, self._ready
            self._place = next((place for place in places if place % n in ready), before)
            self._weights = [(self._place % n, 1.0)]
            self._trim()
            left = any(step not in self._broken for step in range(self._place + 1, n))
            error = self._unsaid.pop() if self._unsaid else None
        if not self._loop and due >= n - 1 and not left:
            self.pause()
        else:
            self._read_ahead()
        if error is not None:
            raise error
        return self._place != before

    def rest(self) -> None:
        """Pause, and leave no thread; playing may begin anew."""
        self.pause()
        super().rest()

    def _begin(self, step: int) -> None:
        """Show a step; time goes on from it."""
        with self._lock:
            self._place = self._from = step
            self._weights = [(step, 1.0)]
            self._since = None
            self._trim()

    def _due_at(self, now: float) -> int:
        """Return the place whose time has come at a moment."""
        since = now if self._since is None else self._since
        place = self._from + int((now - since) * self.rate)
        return place if self._loop else min(place, len(self.collection) - 1)

    def _trim(self) -> None:
        """Drop what memory is not enough for, first what is shown in the longest time.

        In a round that does not fit, the same steps are kept in each.
        """
        n = len(self.collection)
        # A step may be shown although the next one is due already
        first = max(self._place, self._due_at(self._clock()) - 1) if self.playing else self._place
        last = sorted(self._ready, key=lambda step: (step != self.step, (step - first) % n))
        taken = sum(vdi.nbytes for vdi in self._ready.values()) * (1 + ON_DEVICE)
        while len(last) > self.ahead + 1 and taken > self.memory:
            taken -= self._ready.pop(last.pop()).nbytes * (1 + ON_DEVICE)

    def _coming(self) -> list[int]:
        """Return the steps that will be due when they are ready; none where it does not play."""
        if not self.playing:
            return []
        n = len(self.collection)
        first = max(self._place + 1, self._due_at(self._clock() + self._seconds))
        last = first + self.ahead if self._loop else min(first + self.ahead, n)
        return [place % n for place in range(first, last)]

    def _read(self, i: int, runtime: Runtime) -> VDI:
        began = self._clock()
        vdi = super()._read(i, runtime)
        self._seconds = self._clock() - began
        return vdi
