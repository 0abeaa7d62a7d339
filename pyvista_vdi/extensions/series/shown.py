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
from pyvista_vdi.model.checks import as_float, as_whole, memory_limit_bytes
from pyvista_vdi.model.collection import RATE
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.background import BackgroundThread, Job
from pyvista_vdi.raycasting.prepared import kept_values, prepared_vdi
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput, Input
from pyvista_vdi.vtk_pipeline.interaction.timer import period_of

#: Steps that are read before their time comes: what takes longer than the others finds them.
_AHEAD = 3
#: Bytes of steps that are kept, so that the next round need not read them.
MEMORY = 1 << 30
#: Bytes of a step on a device over those of its arrays, which are kept as well.
ON_DEVICE = 1.2
#: Share of the last step's reading in what the next one is expected to take.
_LAST = 0.3


def bring(runtime: Runtime, vdi: Any) -> None:
    """Bring a VDI's lists to a device, with its colours or with the values that it keeps."""
    if isinstance(vdi, DeferredVDI):
        kept_values(runtime, vdi)
    else:
        prepared_vdi(runtime, vdi)


class Decoding(Job):
    """Work beside the frames, and not in turns with them: what it makes is what they wait for."""

    def done(self, paused: Callable[[], bool] = lambda: False) -> Any:
        """Do the work on a queue of this thread's own, and return its result."""
        runtime = get_runtime(self._device)
        with runtime.queue_scope():
            return self._work(runtime, self._report)


class SeriesInput(Input):
    """The step of a series that is shown; one after the other at a rate, where it plays.

    The thread that draws asks for :meth:`vdi` in its frames and calls :meth:`advance` between two
    of them. Another thread reads the steps that come next and brings them to the device. Where that
    is slower than the rate, it takes the steps that will be due when they are ready, so that what
    is shown is late by a frame at most. Steps are kept as long as they fit in :attr:`memory`; those
    that come last of all are dropped first.
    """

    collection: VDISeries

    def __init__(self, series: VDISeries, clock: Callable[[], float] = time.perf_counter) -> None:
        super().__init__()
        self.series = self.collection = series
        self.dropped = 0
        self.device: Any = None
        self.memory: float = MEMORY
        #: Steps per second, and whether one is shown after the other.
        self.rate, self.playing = RATE, False
        self._clock, self._loop = clock, True
        # Places go on where the series begins anew: place p is step p modulo the steps
        self._place = self._from = 0
        self._since: float | None = None  # when the place before was due; None before a frame
        self._lock = threading.Lock()
        self._ready: dict[int, VDI] = {}  # by step
        self._broken: set[int] = set()
        self._unsaid: list[Exception] = []  # why they are
        self._seconds = 0.0  # that a step takes to be ready
        self._worker = BackgroundThread("pyvista-vdi series")
        self._kept: DeferredInput | None = None  # of the step, where it keeps values

    @property
    def player(self) -> SeriesInput:  # type: ignore[override]
        """What chooses among the steps: this."""
        return self

    @property
    def step(self) -> int:
        """Index of the step that is shown."""
        return self._place % len(self.series)

    @step.setter
    def step(self, step: int) -> None:
        n = len(self.series)
        if not -n <= as_whole(step) < n:
            raise InvalidArgumentError(
                f"step must be a whole number from 0 to {n - 1}, or from -{n} to -1 from the end; "
                f"got {step!r}"
            )
        self._begin(int(step) % n)

    @property
    def time(self) -> float:
        """Time of the step that is shown."""
        return self.series.times[self.step]

    @time.setter
    def time(self, time: float) -> None:
        self.step = self.series.nearest(time)

    @property
    def current(self) -> Any:
        """The step that is shown, read now if it is not ready."""
        step = self.step
        known = self._ready.get(step)
        return self._keep(step, self.series[step]) if known is None else known

    def vdi(self) -> VDI:
        """Return the step's VDI; of values what the property makes of them."""
        step = self.current
        if isinstance(step, DeferredVDI) and self.prop is not None:
            if self._kept is None or (self._kept.deferred, self._kept.prop) != (step, self.prop):
                self._kept = DeferredInput(step, self.prop)
            step = self._kept.vdi()
        self._vdi = as_vdi(step)  # refuses what has no colours
        return self._vdi

    @property
    def deferred(self) -> DeferredVDI | None:  # type: ignore[override]
        """The step's values, where it keeps them."""
        return step if isinstance(step := self.current, DeferredVDI) else None

    def classified_by(self, prop: Any) -> Input:
        """Set the property that classifies the values of all steps from now on."""
        self.prop = prop
        return self

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds of the step that was shown last, or of the first."""
        return self.series.bounds if self._vdi is None else self._vdi.bounds

    def stamp(self) -> Any:
        """Return the step, and the time stamp of what classifies it."""
        return self.step, self.prop and (id(self.prop), self.prop.GetMTime())

    def shared(self) -> Input:
        """Return an input that shows the same step, and plays by itself."""
        other = SeriesInput(self.series)
        other.step, other.prop = self.step, self.prop
        return other

    def on_devices(self) -> list[Any]:
        """Return the steps that are ready, and what was classified of that which is shown."""
        with self._lock:
            return [self._vdi, *self._ready.values()]

    def look(self, camera: Camera, device: Any) -> None:
        """Read for a device."""
        self.device = device

    @property
    def busy(self) -> bool:
        """Whether it plays."""
        return self.playing

    @property
    def period(self) -> int:  # type: ignore[override]
        """Milliseconds between two looks at what goes on."""
        return period_of(self.rate)

    def complaint(self, error: BaseException) -> str:
        """Return that a step is left out."""
        return f"a step is left out: {type(error).__name__}: {error}"

    def play(
        self, rate: float = RATE, *, loop: bool = True, memory_limit: float | str | None = None
    ) -> None:
        """Go on from the step that is shown, or from the first where the last one is."""
        if isinstance(rate, bool) or not 0 < as_float(rate) < math.inf:
            raise InvalidArgumentError(f"rate must be steps per second, above 0; got {rate!r}")
        self.memory = memory_limit_bytes(memory_limit) or self.memory
        self.rate, self._loop, self.dropped = as_float(rate), bool(loop), 0
        last = len(self.series) - 1
        self._begin(0 if not loop and self.step == last else self.step)
        self.playing = last > 0

    def pause(self) -> None:
        """Stay at the step that is shown."""
        self.playing = False

    def advance(self) -> bool:
        """Show the last step that is due and ready; whether it is another one."""
        if not self.playing:
            return False
        now, n = self._clock(), len(self.series)
        self._since = now if self._since is None else self._since
        due = self._due_at(now)
        with self._lock:
            # Further back than a round the same steps come again
            places = range(due, max(self._place, due - n), -1)
            before, ready = self._place, self._ready
            self._place = next((place for place in places if place % n in ready), before)
            self.dropped += max(0, self._place - before - 1)
            self._trim()
            left = any(step not in self._broken for step in range(self._place + 1, n))
            error = self._unsaid.pop() if self._unsaid else None
        if not self._loop and due >= n - 1 and not left:
            self.pause()
        elif not self._worker.running and self._wanted() is not None:
            self._worker.put(Decoding(lambda on, _report: self._decode(on), self.device))
        if error is not None:
            raise error
        return self._place != before

    def rest(self) -> None:
        """Pause, and leave no thread; playing may begin anew."""
        self.pause()
        self._worker.clear()
        self._worker.join()
        self._ready.clear()

    def _begin(self, step: int) -> None:
        """Show a step; time goes on from it."""
        with self._lock:
            self._place = self._from = step
            self._since = None
            self._trim()

    def _due_at(self, now: float) -> int:
        """Return the place whose time has come at a moment."""
        since = now if self._since is None else self._since
        place = self._from + int((now - since) * self.rate)
        return place if self._loop else min(place, len(self.series) - 1)

    def _keep(self, step: int, vdi: VDI) -> VDI:
        with self._lock:
            self._ready[step] = vdi
            self._trim()
        return vdi

    def _trim(self) -> None:
        """Drop what memory is not enough for, first what is shown in the longest time.

        In a round that does not fit, the same steps are kept in each.
        """
        n = len(self.series)
        # A step may be shown although the next one is due already
        first = max(self._place, self._due_at(self._clock()) - 1) if self.playing else self._place
        last = sorted(self._ready, key=lambda step: (step != self.step, (step - first) % n))
        taken = sum(vdi.nbytes for vdi in self._ready.values()) * (1 + ON_DEVICE)
        while len(last) > _AHEAD + 1 and taken > self.memory:
            taken -= self._ready.pop(last.pop()).nbytes * (1 + ON_DEVICE)

    def _wanted(self) -> int | None:
        """Return the next step to be read; None where enough are."""
        n = len(self.series)
        with self._lock:
            # Where steps take longer than they are shown, those of the moment when they are ready
            first = max(self._place + 1, self._due_at(self._clock() + self._seconds))
            last = first + _AHEAD if self._loop else min(first + _AHEAD, n)
            known = self._ready.keys() | self._broken
            return next((place % n for place in range(first, last) if place % n not in known), None)

    def _decode(self, runtime: Runtime) -> bool:
        """Read what is wanted, step after step, until enough are ready."""
        for _ in range(_AHEAD):  # then a frame must have come: nobody may be looking
            step, began = self._wanted(), self._clock()
            if step is None or not self.playing:
                break
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
            self._seconds += (took - self._seconds) * (_LAST if self._seconds else 1)
            self._keep(step, vdi)
        return True
