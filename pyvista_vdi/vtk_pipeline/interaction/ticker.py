"""Timers by which the thread that draws a window looks at what goes on behind it."""

from __future__ import annotations

import asyncio
import weakref
from collections.abc import Callable
from typing import Any

from pyvista_vdi.vtk_pipeline.vtk import VTK_INT, calldata_type, vtkWeakReference

#: Milliseconds between two looks: a new VDI appears at most two frames of 30 per second late.
PERIOD = 50

#: Before other observers, whose default priority is 0: see below.
_PRIORITY = 1.0

#: Least milliseconds between two looks: timers of some systems are no finer.
_SHORTEST = 5


def period_of(rate: float) -> int:
    """Return the milliseconds by which what changes so often in a second is followed."""
    return int(min(max(_SHORTEST, 500 / rate), PERIOD))


class Ticker:
    """Calls something again and again from the event loop, while it runs and no hand moves.

    Worker threads never call VTK. Where an interactor runs no event loop (off-screen), nothing is
    called, and what was done behind the frames is seen at the next frame.

    Parameters
    ----------
    tick : bound method
        Held weakly.

    Notes
    -----
    While a button is held, VTK's styles take all events of the interactor for themselves, and
    repeat their last motion at *any* timer event: a ``vtkInteractorStyleTrackballCamera`` would
    turn on and on. So the timer goes when an interaction starts; motion brings frames of its own,
    and after the last one the ticker is started again. Nor do others get our timer's events: a
    user's own timer callback counts its steps by them.
    """

    def __init__(self, tick: Callable[[], None]) -> None:
        self._tick = weakref.WeakMethod(tick)
        self._interactor = vtkWeakReference()
        self._timer = 0
        self._period = PERIOD
        self._observers: tuple[int, ...] = ()

    @property
    def running(self) -> bool:
        """Whether it ticks."""
        return self._timer > 0

    def start(self, interactor: Any, period: int = PERIOD) -> None:
        """Tick every so many milliseconds, if it does not already, in this interactor."""
        if interactor is not self._interactor.Get() or interactor is None:
            self.stop()
        if interactor is None or (self.running and period == self._period):
            return
        if not self._observers:
            self._observe(interactor)
        self.pause()
        self._timer, self._period = interactor.CreateRepeatingTimer(period), period

    def pause(self) -> None:
        """Take the timer away."""
        interactor = self._interactor.Get()
        if interactor is not None and self.running:
            interactor.DestroyTimer(self._timer)
        self._timer = 0

    def stop(self) -> None:
        """End: nothing is left at the interactor."""
        self.pause()
        interactor = self._interactor.Get()
        if interactor is not None:
            for observer in self._observers:
                interactor.RemoveObserver(observer)
        self._observers = ()

    def _observe(self, interactor: Any) -> None:
        weak = weakref.ref(self)

        @calldata_type(VTK_INT)  # type: ignore[misc]
        def on_timer(_caller: Any, _event: str, timer: int) -> None:
            ticker = weak()
            if ticker is not None:
                ticker._on_timer(timer)

        def on_interaction(*_: Any) -> None:
            ticker = weak()
            if ticker is not None:
                ticker.pause()

        ticks = interactor.AddObserver("TimerEvent", on_timer, _PRIORITY)
        interaction = interactor.AddObserver("StartInteractionEvent", on_interaction)
        # Or a style that has taken all events would keep it from us
        interactor.GetCommand(interaction).PassiveObserverOn()
        self._interactor.Set(interactor)
        self._observers = (ticks, interaction)

    def _on_timer(self, timer: int) -> None:
        interactor = self._interactor.Get()
        if timer == self._timer and interactor is not None and self._observers:
            interactor.GetCommand(self._observers[0]).SetAbortFlag(1)
        tick = self._tick()
        if tick is not None:
            tick()


class LoopTicker:
    """Does the same from the asyncio loop that a frame is drawn in, for windows without events.

    Parameters
    ----------
    tick : bound method
        Held weakly.
    """

    def __init__(self, tick: Callable[[], None]) -> None:
        self._tick = weakref.WeakMethod(tick)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._handle: asyncio.TimerHandle | None = None
        self._period = PERIOD

    def start(self, period: int = PERIOD) -> None:
        """Tick every so many milliseconds in the loop that runs in this thread, if one does."""
        self._period = period
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            return
        if self._handle is None or loop is not self._loop:
            self.stop()
            self._loop, self._handle = loop, loop.call_later(period / 1000, self._on_timer)

    def stop(self) -> None:
        """End: nothing is left in the loop."""
        if self._handle is not None:
            self._handle.cancel()
        self._handle = None

    def _on_timer(self) -> None:
        self._handle = None
        tick = self._tick()
        if tick is not None:
            self.start(self._period)
            tick()
