"""The timer by which the thread that draws a window looks at what goes on behind it."""

from __future__ import annotations

import asyncio
import weakref
from collections.abc import Callable
from typing import Any

from pyvista_vdi.vtk_pipeline.vtk import VTK_INT, calldata_type, weakly

#: Milliseconds between two looks: a new VDI appears at most two frames of 30 per second late.
PERIOD = 50

#: Before other observers, whose default priority is 0: see below.
_PRIORITY = 1.0

#: Least milliseconds between two looks: timers of some systems are no finer.
_SHORTEST = 5


def period_of(rate: float) -> int:
    """Return the milliseconds by which what changes so often in a second is followed."""
    return int(min(max(_SHORTEST, 500 / rate), PERIOD))


class Timer:
    """Calls something again and again from the event loop, while it runs and no hand moves.

    Worker threads never call VTK. Where an interactor runs no event loop (off-screen), nothing is
    called, unless a browser watches the window from an asyncio loop; what was done behind the
    frames is seen at the next frame then.

    Parameters
    ----------
    tick : bound method
        Held weakly.

    Notes
    -----
    While a button is held, VTK's styles take all events of the interactor for themselves, and
    repeat their last motion at *any* timer event: a ``vtkInteractorStyleTrackballCamera`` would
    turn on and on. So the timer goes when an interaction starts; motion brings frames of its own,
    and after the last one the timer is started again. Nor do others get our timer's events: a
    user's own timer callback counts its steps by them.
    """

    def __init__(self, tick: Callable[[], None]) -> None:
        self._tick = weakref.WeakMethod(tick)
        self._interactor: Callable[[], Any] = lambda: None
        self._timer = 0
        self._period = PERIOD
        self._observers: tuple[int, ...] = ()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._handle: asyncio.TimerHandle | None = None

    @property
    def running(self) -> bool:
        """Whether the interactor calls."""
        return self._timer > 0

    def start(self, interactor: Any, period: int = PERIOD, *, in_loop: bool = False) -> None:
        """Tick every so many milliseconds, if it does not already, in this interactor.

        Also, ``in_loop``, in the asyncio loop that runs in this thread, if one does.
        """
        if interactor is not self._interactor() or interactor is None:
            self._leave()
        if interactor is not None and not (self.running and period == self._period):
            if not self._observers:
                self._observe(interactor)
            self.pause()
            self._timer = interactor.CreateRepeatingTimer(period)
        self._period = period
        if in_loop:
            self._start_loop()

    def pause(self) -> None:
        """Take the interactor's timer away."""
        interactor = self._interactor()
        if interactor is not None and self.running:
            interactor.DestroyTimer(self._timer)
        self._timer = 0

    def stop(self) -> None:
        """End: nothing is left at the interactor, or in the loop."""
        self._leave()
        self._leave_loop()

    def _leave(self) -> None:
        self.pause()
        interactor = self._interactor()
        if interactor is not None:
            for observer in self._observers:
                interactor.RemoveObserver(observer)
        self._observers = ()

    def _leave_loop(self) -> None:
        if self._handle is not None:
            self._handle.cancel()
        self._handle = None

    def _observe(self, interactor: Any) -> None:
        weak = weakref.ref(self)

        @calldata_type(VTK_INT)  # type: ignore[misc]
        def on_timer(_caller: Any, _event: str, number: int) -> None:
            timer = weak()
            if timer is not None:
                timer._on_timer(number)

        def on_interaction(*_: Any) -> None:
            timer = weak()
            if timer is not None:
                timer.pause()

        ticks = interactor.AddObserver("TimerEvent", on_timer, _PRIORITY)
        interaction = interactor.AddObserver("StartInteractionEvent", on_interaction)
        # Or a style that has taken all events would keep it from us
        interactor.GetCommand(interaction).PassiveObserverOn()
        self._interactor = weakly(interactor)
        self._observers = (ticks, interaction)

    def _on_timer(self, number: int) -> None:
        interactor = self._interactor()
        if number == self._timer and interactor is not None and self._observers:
            interactor.GetCommand(self._observers[0]).SetAbortFlag(1)
        tick = self._tick()
        if tick is not None:
            tick()

    def _start_loop(self) -> None:
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            return
        if self._handle is None or loop is not self._loop:
            self._leave_loop()
            self._loop = loop
            self._handle = loop.call_later(self._period / 1000, self._in_loop)

    def _in_loop(self) -> None:
        self._handle = None
        tick = self._tick()
        if tick is not None:
            self._start_loop()
            tick()
