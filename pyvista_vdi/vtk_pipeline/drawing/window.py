"""A render window that shows VDIs: its frames, their status, and the timer of what goes on behind.

The only place besides the driver that has a clock. What is chosen by the times of frames is in
:mod:`pyvista_vdi.quality.rate`.
"""

from __future__ import annotations

import contextlib
import time
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.plan import RenderMode
from pyvista_vdi.quality.rate import Pace
from pyvista_vdi.quality.targets import describe
from pyvista_vdi.vtk_pipeline.filters.algorithm import watch
from pyvista_vdi.vtk_pipeline.filters.view import as_array
from pyvista_vdi.vtk_pipeline.vtk import (
    VTK_INT,
    calldata_type,
    vtkMatrix4x4,
    vtkOpenGLGL2PSHelper,
    vtkVolume,
    vtkWeakReference,
    weakly,
)

#: Milliseconds between two looks: few, so that a series is played at whatever rate a screen has.
PERIOD = 10
#: Of a timer's observer, before others, whose default priority is 0: see :class:`Timer`.
_PRIORITY = 1.0

#: Cameras remembered per window; more than any scene has viewports that are turned in turn.
_KNOWN_CAMERAS = 16

#: A window's desired update rate from which on a hand moves, 1/s, as for vtkSmartVolumeMapper.
_INTERACTIVE = 1.0
#: Frames per second to be kept in a window that nobody's hand moves.
_RATE = 30.0

#: By the windows' addresses.
_windows: weakref.WeakValueDictionary[str, Window] = weakref.WeakValueDictionary()


#: The clock that frames are measured by, seconds.
now = time.perf_counter


class ShownVolume(NamedTuple):
    """A volume that a renderer shows, and what is behind it."""

    actor: Any
    mapper: Any
    driver: Any  # of a VDI; None behind a volume of VTK's
    assemblies: tuple[Any, ...]  # that it is a part of, the outermost first

    @property
    def visible(self) -> bool:
        """Whether it is drawn, with the assemblies that it is in."""
        return all(each.GetVisibility() for each in (self.actor, *self.assemblies))

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Model frame to world, (4, 4), in the order of VTK's sums; not while it is drawn."""
        placed = vtkMatrix4x4()
        for each in (*self.assemblies, self.actor):
            if each.GetMatrix() is not None:
                vtkMatrix4x4.Multiply4x4(placed, each.GetMatrix(), placed)
        return as_array(placed)


def _volumes_of(props: Any, assemblies: tuple[Any, ...] = ()) -> Iterator[ShownVolume]:
    for i in range(props.GetNumberOfItems()):
        prop = props.GetItemAsObject(i)
        if hasattr(prop, "GetParts"):
            # Not vtkRenderer.GetVolumes: an assembly that is asked for its volumes while it draws
            # its parts loses its place among them
            yield from _volumes_of(prop.GetParts(), (*assemblies, prop))
        elif isinstance(prop, vtkVolume):
            mapper = prop.GetMapper()
            driver = getattr(mapper, "driver", None)
            own = driver if driver is not None and driver.actor() is prop else None
            yield ShownVolume(prop, mapper, own, assemblies)


class Window:
    """The frames of one render window; VTK's window owns this object, through its observers.

    Attributes
    ----------
    vtk_window : callable
        Returns VTK's, or ``None`` where it is gone.
    number : int
        Frames of the window so far.
    pace : Pace
        What they have taken.
    of_frame : dict
        What those who draw share within a frame; empty between two.
    active : vtkWeakReference
        The renderer that is between its start and its end.
    started : float or None
        When the frame that is drawn began, seconds; ``None`` between two.
    """

    def __init__(self, window: Any) -> None:
        self.number = 0
        self.pace = Pace()
        self.of_frame: dict[Any, Any] = {}
        self.active = vtkWeakReference()
        self.started: float | None = None
        self.vtk_window = weakly(window)
        self._renderers: dict[str, Callable[[], Any]] = {}  # that have drawn a VDI
        self._known: list[Callable[[], Any]] = []
        self._given_up: int | None = None  # the window's multisampling, in a frame without it
        self._blit: Any = None  # how the window shows its frames, in one that goes another way
        self._previewed = False
        self._picture_wanted = False
        self._foreground = contextlib.ExitStack()  # from the frame's start to its end
        window.AddObserver("StartEvent", self._start)
        window.AddObserver("EndEvent", self._end)

    @classmethod
    def of(cls, window: Any) -> Window:
        """Return that of a VTK window, made on first use."""
        address = window.GetAddressAsString("")
        found = _windows.get(address)
        if found is None or found.vtk_window() is not window:
            found = _windows[address] = cls(window)
        return found

    def shown_in(self, renderer: Any) -> list[ShownVolume]:
        """Return the volumes that a renderer of this window shows, in its order."""
        address = renderer.GetAddressAsString("")
        key, known = ("shown", address), self._renderers.get(address)
        if key not in self.of_frame or self.started is None:
            if known is None or known() is not renderer:
                self._renderers[address] = weakly(renderer)
                active = self.active  # no renderer keeps this: it goes with VTK's window
                watch(renderer, self.vtk_window(), Window._camera_changed, "ActiveCameraEvent")
                renderer.AddObserver("StartEvent", lambda caller, _: active.Set(caller))
                renderer.AddObserver("EndEvent", lambda *_: active.Set(None))
            self.of_frame[key] = list(_volumes_of(renderer.GetViewProps()))
        return self.of_frame[key]  # type: ignore[no-any-return]

    # What is seen of it

    def rate(self, settings: Any) -> float:
        """Return the frames per second to be kept while a hand moves, also before it does."""
        if settings.target_fps or self.moving:
            return float(settings.target_fps or self.vtk_window().GetDesiredUpdateRate())
        interactor = self.vtk_window().GetInteractor()
        return _RATE if interactor is None else max(1.0, interactor.GetDesiredUpdateRate())

    @property
    def moving(self) -> bool:
        """Whether a hand moves, by VTK's convention."""
        return bool(self.vtk_window().GetDesiredUpdateRate() >= _INTERACTIVE)

    def previews(self, settings: Any) -> bool:
        """Whether frames may have fewer rays now: a hand moves, and somebody watches."""
        if not (settings.adjust and settings.target_fps != 0 and self.moving):
            return False
        return bool(self.vtk_window().GetShowWindow()) or settings.off_screen

    @property
    def whole_picture(self) -> bool:
        """Whether this frame is a whole picture by itself, and not a tile of one."""
        return tuple(self.vtk_window().GetTileScale()) == (1, 1)

    @property
    def keeps_picture(self) -> bool:
        """Whether this frame is drawn to be kept, whatever its cameras are.

        A screenshot draws in tiles, or with a camera of its own; an export of vector graphics has
        a helper installed.
        """
        exported = vtkOpenGLGL2PSHelper.GetInstance() is not None
        return self._picture_wanted or not self.whole_picture or exported

    def knows(self, camera: Any) -> bool:
        """Whether something was drawn with this camera before; from now on it was."""
        for known in self._known:
            if known() is camera:
                return True
        there = [known for known in self._known if known() is not None]
        self._known = [*there[1 - _KNOWN_CAMERAS :], weakly(camera)]
        return False

    # Its frames

    def _start(self, *_: Any) -> None:
        self.started = now()
        self.of_frame.clear()
        self.number += 1
        # Find the VDIs of this window, each with the renderer that shows it
        window, shown = self.vtk_window(), []
        for known in self._renderers.values():
            renderer = known()
            if renderer is not None and window.HasRenderer(renderer):
                shown += [(renderer, v) for v in self.shown_in(renderer) if v.driver is not None]
        # Between two frames only: no frame shows two generations, nor does a picture in tiles
        drivers = dict.fromkeys(each.driver for _, each in shown)
        if self.whole_picture:
            for driver in drivers:
                driver.advance()
        self._foreground.close()
        for runtime in {get_runtime(driver.settings.device) for driver in drivers}:
            self._foreground.enter_context(runtime.foreground())
        samples = window.GetMultiSamples()
        if samples and self.pace.slow_samples:
            # A frame goes without where all VDIs of the window let previews do
            seen = [(each.driver.settings, r) for r, each in shown if each.visible]
            cameras = [known() for known in self._known]
            if seen and all(
                self.previews(settings)
                and not self.keeps_picture
                and renderer.GetActiveCamera() in cameras
                for settings, renderer in seen
            ):
                self._given_up, samples = samples, 0
                window.SetMultiSamples(0)
        # From 9.7 on VTK draws a whole window of X11 once more to give the screen a depth buffer,
        # which nothing reads: window.GetZbufferData reads that of VTK's own framebuffer
        if (
            self._blit is None
            and window.GetClassName() == "vtkXOpenGLRenderWindow"
            and hasattr(window, "BlitToCurrentWithDepth")
            and window.GetShowWindow()
            and window.GetFrameBlitMode() == window.BlitToHardware
            and not window.GetStereoRender()  # whose two buffers that copy alone fills
        ):
            self._blit = window.GetFrameBlitMode()
            window.SetFrameBlitModeToBlitToCurrent()
        self.pace.began(samples)

    def _end(self, *_: Any) -> None:
        window = self.vtk_window()
        given_up, self._given_up = self._given_up, None
        if given_up is not None and not window.GetMultiSamples():  # it is as it was left here
            window.SetMultiSamples(given_up)
        blit, self._blit = self._blit, None
        if blit is not None and window.GetFrameBlitMode() == window.BlitToCurrent:
            window.SetFrameBlitMode(blit)
        self._foreground.close()
        started, self.started = self.started, None
        self._previewed = self.pace.frame.preview or given_up is not None
        seconds = None if started is None else now() - started
        self.pace.ended(seconds, self.moving)
        self.of_frame.clear()

    @classmethod
    def _camera_changed(cls, window: Any) -> None:
        """Replace a preview on the screen by the full frame before a screenshot reads it.

        ``vtkWindowToImageFilter`` puts a copy of its own in place of each renderer's camera, and
        may then take the picture that is on the screen, as ``Plotter.screenshot`` has it.
        """
        own = cls.of(window)
        if not own._previewed or own.started is not None:
            return
        interactor = window.GetInteractor()
        if interactor is not None and not interactor.GetEnableRender():
            return  # it is being closed
        own._picture_wanted = True
        try:
            window.Render()
        finally:
            own._picture_wanted = False


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


@dataclass(frozen=True)
class VDIStatus:
    """How a VDI was drawn in the last frame, and what goes on behind it.

    Attributes
    ----------
    mode : {"none", "full", "preview"}
        Nothing drawn yet, one ray per pixel, or fewer.
    samples : int
        Rays that were cast: pixels of the image.
    full_samples : int
        Pixels of the viewport.
    fps : float or None
        Frames per second of the window: mean of an interaction's last frames; at rest, what the
        last frame would allow. ``None`` before the first whole frame.
    angle : float or None
        Between the view and V_O, degrees; ``None`` without a VDI.
    magnification : float or None
        Pixels of the view that are as wide as one of the VDI's lists; ``None`` without a VDI.
    coverage : float or None
        Share, 0 to 1, of the view's rays through the volume that the VDI has all of; ``None``
        without a VDI.
    ssim : float or None
        Estimated SSIM of the VDI's picture of this view against volume rendering; ``None`` where
        nothing asked for it.
    progress : float or None
        Share done, 0 to 1, of the VDI that is being made in the background; ``None`` if none is.
    generation : int
        How many VDIs were shown so far, this one included.
    stand_in : bool
        Whether the volume itself was drawn, because the VDI shows what has changed since.
    drawn : {"vdi", "volume"}
        What was raycast: the VDI, or the volume itself, for whatever reason.
    vdi : VDI or None
        The one that is shown, or is to be replaced.
    time : float or None
        That of the step of a series; ``None`` where no series is shown.
    """

    mode: Literal["none", "full", "preview"]
    samples: int
    full_samples: int
    fps: float | None
    angle: float | None
    ssim: float | None
    progress: float | None
    generation: int
    vdi: VDI | None
    stand_in: bool = False
    drawn: RenderMode = "vdi"
    time: float | None = None
    magnification: float | None = None
    coverage: float | None = None

    @property
    def share(self) -> float:
        """Share of the viewport's pixels that a ray was cast for, 0 to 1."""
        return self.samples / self.full_samples if self.full_samples else 0.0

    def __str__(self) -> str:
        what = f"{self.mode}, the volume itself" if self.drawn == "volume" else self.mode
        told = [
            (self.fps, "{:.3g} frames/s"),
            (self.angle, "{:.0f}° from the generating view"),
            (self.ssim, "SSIM about {:.3f}"),
            (self.time, "time {:g}"),
            (self.generation or None, "VDI no. {}"),
            (None if self.vdi is None else describe(self.vdi.metadata), "{}"),
            (self.progress, "making the next: {:.0%}"),
        ]
        parts = [f"{what}: {self.share:.0%} of {self.full_samples} pixels"]
        return ", ".join(parts + [text.format(value) for value, text in told if value is not None])
