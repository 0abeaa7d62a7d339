"""The timer by which the thread that draws a window looks at what goes on behind it."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

from pyvista_vdi.vtk_pipeline.vtk import VTK_INT, calldata_type, weakly

#: Milliseconds between two looks: few, so that a series is played at whatever rate a screen has.
PERIOD = 10

#: Before other observers, whose default priority is 0: see below.
_PRIORITY = 1.0


class Timer:
    """Calls something again and again from the event loop, while it runs and no hand moves.

    Worker threads never call VTK. Where an interactor runs no event loop (off-screen), nothing is
    called; what was done in the background is seen at the next frame then.

    Parameters
    ----------
    tick : bound method
        Held weakly.

    Attributes
    ----------
    interactor : callable
        Returns the interactor, or ``None`` where there is none any more.

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
        self.interactor: Callable[[], Any] = lambda: None
        self._timer = 0
        self._observers: tuple[int, ...] = ()

    def start(self, interactor: Any) -> None:
        """Tick, if it does not already, in this interactor."""
        if interactor is not self.interactor() or interactor is None:
            self.stop()
        if interactor is None or self._timer > 0:
            return
        if not self._observers:
            self._observe(interactor)
        self._timer = interactor.CreateRepeatingTimer(PERIOD)

    def stop(self) -> None:
        """End: nothing is left at the interactor."""
        self._pause()
        interactor = self.interactor()
        if interactor is not None:
            for observer in self._observers:
                interactor.RemoveObserver(observer)
        self._observers = ()

    def _pause(self) -> None:
        interactor = self.interactor()
        if interactor is not None and self._timer > 0:
            interactor.DestroyTimer(self._timer)
        self._timer = 0

    def _observe(self, interactor: Any) -> None:
        weak = weakref.ref(self)

        @calldata_type(VTK_INT)  # type: ignore[misc]
        def on_timer(caller: Any, _event: str, number: int) -> None:
            timer = weak()
            if timer is None:
                return
            if number == timer._timer and timer._observers:
                caller.GetCommand(timer._observers[0]).SetAbortFlag(1)
            tick = timer._tick()
            if tick is not None:
                tick()

        def on_interaction(*_: Any) -> None:
            timer = weak()
            if timer is not None:
                timer._pause()

        ticks = interactor.AddObserver("TimerEvent", on_timer, _PRIORITY)
        interaction = interactor.AddObserver("StartInteractionEvent", on_interaction)
        # Or a style that has taken all events would keep it from us
        interactor.GetCommand(interaction).PassiveObserverOn()
        self.interactor = weakly(interactor)
        self._observers = (ticks, interaction)
