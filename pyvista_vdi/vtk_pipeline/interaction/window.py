"""A render window that shows VDIs: its frames, and what tells how good they are to be.

The only place besides the driver that has a clock. What is chosen by the times of frames is in
:mod:`pyvista_vdi.quality.rate`.
"""

from __future__ import annotations

import contextlib
import time
import weakref
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.quality.rate import Pace
from pyvista_vdi.vtk_pipeline.filters.view import as_array
from pyvista_vdi.vtk_pipeline.interaction import browser
from pyvista_vdi.vtk_pipeline.vtk import (
    numpy_to_vtk,
    vtkMatrix4x4,
    vtkOpenGLGL2PSHelper,
    vtkVolume,
    weakly,
)

T = TypeVar("T")

#: Cameras remembered per window; more than any scene has viewports that are turned in turn.
_KNOWN_CAMERAS = 16

_BUTTONS = ("LeftButtonPressEvent", "MiddleButtonPressEvent", "RightButtonPressEvent")
#: Styles that move actors.
_ACTOR_STYLES = ("vtkInteractorStyleTrackballActor", "vtkInteractorStyleJoystickActor")
#: Priorities of observers before and after the style's, which is 0.
_BEFORE, _AFTER = 1.0, -1.0

#: Frames per second to be kept in a window that nobody's hand moves.
_RATE = 30.0

#: By the windows' addresses.
_windows: dict[str, weakref.ref[Window]] = {}


def now() -> float:
    """Return the seconds of the clock that frames are measured by."""
    return time.perf_counter()


class Met:
    """VTK's objects that were met before, held weakly: another may have an address later."""

    def __init__(self) -> None:
        self._met: dict[str, Callable[[], Any]] = {}

    def is_new(self, thing: Any) -> bool:
        """Whether this is the first time; from now on it is not."""
        address = thing.GetAddressAsString("")
        known = self._met.get(address)
        if known is not None and known() is thing:
            return False
        self._met[address] = weakly(thing)
        return True


class ShownVolume(NamedTuple):
    """A volume that a renderer shows, and what is behind it."""

    actor: Any
    mapper: Any
    driver: Any  # of a VDI; None behind a volume of VTK's
    assemblies: tuple[Any, ...]  # that it is a part of, the outermost first
    behind: tuple[Any, ...]  # all of VTK's that may be of Python's classes

    @classmethod
    def of(cls, prop: Any, assemblies: tuple[Any, ...] = ()) -> ShownVolume:
        """Return a volume with what it has now."""
        mapper = prop.GetMapper()
        driver = getattr(mapper, "driver", None)
        own = driver if driver is not None and driver.actor is prop else None
        data = None if own is None else mapper.GetDataSetInput()
        behind = (mapper, prop.GetShaderProperty(), prop.GetProperty(), data)
        return cls(prop, mapper, own, assemblies, behind)

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


class Forgetting:
    """An observer that has volumes forgotten, which it does not keep alive.

    No function: VTK calls observers while the garbage collector deletes lists of props, and a
    function whose closure the collector has cleared before crashes.
    """

    shown: Any = staticmethod(lambda: None)  # once the collector has cleared the object's own

    def __init__(self, shown: ShownVolumes) -> None:
        self.shown = weakref.ref(shown)

    def __call__(self, *_: Any) -> None:
        shown = self.shown()
        if shown is not None:
            shown.forget()


class ShownVolumes:
    """The volumes of a renderer, those in assemblies too, in its order.

    They are held, with the objects that Python has of them and of what is behind them, from the
    first look until a list of props changes, or that. VTK holds no more than its own part of them:
    where Python has let go of an object of its own classes, each look would make another one.
    """

    def __init__(self, renderer: Any) -> None:
        self.renderer = weakly(renderer)
        self._volumes: list[ShownVolume] | None = None
        self._lists: list[tuple[Any, int]] = []  # of props, and the tags of their observers

    def __call__(self) -> list[ShownVolume]:
        """Return them."""
        if self._volumes is None:
            self._volumes = []
            self._look(self.renderer().GetViewProps(), (), Forgetting(self))
        return self._volumes

    def _look(self, props: Any, assemblies: tuple[Any, ...], changed: Callable[..., None]) -> None:
        assert self._volumes is not None
        self._lists.append((props, props.AddObserver("ModifiedEvent", changed)))
        for i in range(props.GetNumberOfItems()):
            prop = props.GetItemAsObject(i)
            if hasattr(prop, "GetParts"):
                # Not vtkRenderer.GetVolumes: an assembly that is asked for its volumes while it
                # draws its parts loses its place among them
                self._look(prop.GetParts(), (*assemblies, prop), changed)
            elif isinstance(prop, vtkVolume):
                self._volumes.append(ShownVolume.of(prop, assemblies))

    def check(self) -> None:
        """Look again where a volume has another mapper, property or data than it had."""
        for each in self._volumes or ():
            now_behind = ShownVolume.of(each.actor).behind
            if any(a is not b for a, b in zip(now_behind, each.behind, strict=True)):
                self.forget()
                return

    def forget(self) -> None:
        """Forget what was looked for."""
        lists, self._lists, self._volumes = self._lists, [], None
        for props, tag in lists:
            props.RemoveObserver(tag)


class Window:
    """The frames of one render window; VTK's window owns this object, through its observers.

    Attributes
    ----------
    number : int
        Frames of the window so far.
    pace : Pace
        What they have taken.
    of_frame : dict
        What those who draw share within a frame; empty between two.
    """

    def __init__(self, window: Any) -> None:
        self.number = 0
        self.pace = Pace()
        self.of_frame: dict[Any, Any] = {}
        self._window = weakly(window)
        self._shown: list[ShownVolumes] = []  # by each renderer that has drawn a VDI
        self._shared: dict[type, Any] = {}
        self._watched = Met()
        self._known: list[Callable[[], Any]] = []
        self._given_up: int | None = None  # the window's multisampling, in a frame without it
        self._blit: Any = None  # how the window shows its frames, in one that goes another way
        self._started: float | None = None
        self._previewed = False
        self._picture_wanted = False
        self._transparent: list[tuple[Any, Any]] = []  # point data and scalars of solid proxies
        self._foreground = contextlib.ExitStack()  # from the frame's start to its end
        window.AddObserver("StartEvent", lambda *_: self._start())
        window.AddObserver("EndEvent", lambda *_: self._end())

    @classmethod
    def of(cls, window: Any) -> Window:
        """Return that of a VTK window, made on first use."""
        address = window.GetAddressAsString("")
        known = _windows.get(address)
        found = None if known is None else known()
        if found is None or found._window() is not window:
            for gone in [key for key, each in list(_windows.items()) if each() is None]:
                _windows.pop(gone, None)
            found = cls(window)
            _windows[address] = weakref.ref(found)
        return found

    def shared(self, kind: type[T]) -> T:
        """Return what those who draw in this window share of a kind, made on first use."""
        if kind not in self._shared:
            self._shared[kind] = kind()
        return self._shared[kind]  # type: ignore[no-any-return]

    def shown_in(self, renderer: Any) -> list[ShownVolume]:
        """Return the volumes that a renderer of this window shows; called in each VDI's frame."""
        for shown in self._shown:
            if shown.renderer() is renderer:
                return shown()
        if self._watched.is_new(renderer):
            weak = weakref.ref(self)

            def camera_changed(*_: Any) -> None:
                window = weak()
                if window is not None:
                    window._camera_changed()

            renderer.AddObserver("ActiveCameraEvent", camera_changed)
        self._shown.append(ShownVolumes(renderer))
        return self._shown[-1]()

    @property
    def drivers(self) -> list[Any]:
        """Those of all VDIs in this window."""
        shown = [each.driver for volumes in self._shown for each in volumes()]
        return [each for each in dict.fromkeys(shown) if each is not None]

    def listen(self, interactor: Any) -> None:
        """Make VDIs movable by the interactor styles that move actors.

        They ask a cell picker of their own, which classifies the proxy's scalars: all transparent,
        and so a VDI is looked through. While a button goes down where a pick hits a VDI, what is in
        front of it considered, its proxy has a scalar that is opaque.
        """
        if not self._watched.is_new(interactor):
            return
        weak = weakref.ref(self)

        def pressed(caller: Any, _: str) -> None:
            window = weak()
            if window is not None:
                window._grab(caller)

        def taken(*_: Any) -> None:
            window = weak()
            if window is not None:
                window._let_go()

        for event in _BUTTONS:
            interactor.AddObserver(event, pressed, _BEFORE)
            interactor.AddObserver(event, taken, _AFTER)

    def _grab(self, interactor: Any) -> None:
        """Make the proxies of VDIs under the pointer opaque."""
        self._let_go()  # another observer may have ended the last event before it came here
        style = interactor.GetInteractorStyle()
        if style is not None and style.IsA("vtkInteractorStyleSwitch"):
            style = style.GetCurrentStyle()
        if style is None or not any(style.IsA(name) for name in _ACTOR_STYLES):
            return
        x, y = interactor.GetEventPosition()
        renderer = interactor.FindPokedRenderer(x, y)
        there = [each for each in self.drivers if renderer in each.renderers()]
        hit = [each for each in there if each.actor.pick(x, y, renderer=renderer) is not None]
        for driver in hit:  # after the picks, which draw
            data = driver.proxy.GetPointData()
            opaque = _opaque_scalar(driver.actor)
            solid = np.full((8, data.GetScalars().GetNumberOfComponents()), opaque)
            self._transparent.append((data, data.GetScalars()))
            data.SetScalars(numpy_to_vtk(solid, deep=True))

    def _let_go(self) -> None:
        """Make all transparent again."""
        for data, scalars in self._transparent:
            data.SetScalars(scalars)
        self._transparent.clear()

    @property
    def drawing(self) -> bool:
        """Whether a frame has begun and not ended."""
        return self._started is not None

    def render(self) -> None:
        """Draw the window, as from its event loop."""
        window = self._window()
        if window is not None and browser.push(window):
            return
        interactor = None if window is None else window.GetInteractor()
        if interactor is not None:
            interactor.Render()

    # What is seen of it

    def watched_behind(self, settings: Any) -> bool:
        """Whether work may go on behind the frames: somebody watches, and can move."""
        window = self._window()
        here = bool(window.GetShowWindow()) and window.GetInteractor() is not None
        return here or self._from_afar(settings)

    def _from_afar(self, settings: Any) -> bool:
        on = settings.off_screen
        return browser.watches(self._window()) if on is None else on

    def rate(self, settings: Any) -> float:
        """Return the frames per second to be kept while a hand moves, also before it does."""
        if settings.target or self.moving(settings):
            return float(settings.target or self._window().GetDesiredUpdateRate())
        interactor = self._window().GetInteractor()
        return _RATE if interactor is None else max(1.0, interactor.GetDesiredUpdateRate())

    def moving(self, settings: Any) -> bool:
        """Whether a hand moves, by VTK's convention."""
        return bool(self._window().GetDesiredUpdateRate() >= settings.update_rate)

    def previews(self, settings: Any) -> bool:
        """Whether frames may have fewer rays now: a hand moves, and somebody watches."""
        if not (settings.previews and self.moving(settings)):
            return False
        return bool(self._window().GetShowWindow()) or self._from_afar(settings)

    @property
    def whole_picture(self) -> bool:
        """Whether this frame is a whole picture by itself, and not a tile of one."""
        window = self._window()
        return window is None or tuple(window.GetTileScale()) == (1, 1)

    def takes_picture(self, renderer: Any) -> bool:
        """Whether this frame is drawn to be kept: such a frame is always full.

        A screenshot draws in tiles, or with a camera of its own; an export of vector graphics has
        a helper installed.
        """
        return self._keeps_picture() or not self.knows(renderer.GetActiveCamera())

    def _keeps_picture(self) -> bool:
        """Whether this frame is drawn to be kept, whatever its cameras are."""
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

    def _start(self) -> None:
        self._started = now()
        self.of_frame.clear()
        self.number += 1
        # Between two frames only: no frame shows two generations, nor does a picture in tiles
        window = self._window()
        for shown in list(self._shown):
            if window.HasRenderer(shown.renderer()):
                shown.check()
            else:
                self._shown.remove(shown)
                shown.forget()
        drivers = self.drivers
        if self.whole_picture:
            for driver in drivers:
                driver.between_frames()
        self._foreground.close()
        for runtime in {driver.runtime() for driver in drivers}:
            self._foreground.enter_context(runtime.foreground())
        samples = window.GetMultiSamples()
        if samples and self.pace.slow_samples and self._may_go_without():
            self._given_up, samples = samples, 0
            window.SetMultiSamples(0)
        # From 9.7 on VTK draws the whole window once more to give the screen a depth buffer, which
        # nothing reads: window.GetZbufferData reads that of VTK's own framebuffer
        if self._blit is None and _draws_depth_to_screen(window):
            self._blit = window.GetFrameBlitMode()
            window.SetFrameBlitModeToBlitToCurrent()
        self.pace.began(samples)

    def _may_go_without(self) -> bool:
        """Whether a frame may go without multisampling: all VDIs of the window let previews do."""
        shown = [
            (each.driver.settings, volumes.renderer())
            for volumes in self._shown
            for each in volumes()
            if each.driver is not None and each.visible
        ]
        cameras = [known() for known in self._known]
        return bool(shown) and all(
            settings.adjust_multi_samples
            and self.previews(settings)
            and not self._keeps_picture()
            and renderer.GetActiveCamera() in cameras
            for settings, renderer in shown
        )

    def _end(self) -> None:
        window = self._window()
        given_up, self._given_up = self._given_up, None
        if given_up is not None and not window.GetMultiSamples():  # it is as it was left here
            window.SetMultiSamples(given_up)
        blit, self._blit = self._blit, None
        if blit is not None and window.GetFrameBlitMode() == window.BlitToCurrent:
            window.SetFrameBlitMode(blit)
        self._foreground.close()
        self.of_frame.clear()
        started, self._started = self._started, None
        self._previewed = self.pace.frame.preview or given_up is not None
        seconds = None if started is None else now() - started
        moving = any(self.moving(driver.settings) for driver in self.drivers)
        self.pace.ended(seconds, moving)

    def _camera_changed(self) -> None:
        """Replace a preview on the screen by the full frame before a screenshot reads it.

        ``vtkWindowToImageFilter`` puts a copy of its own in place of each renderer's camera, and
        may then take the picture that is on the screen, as ``Plotter.screenshot`` has it.
        """
        window = self._window()
        if not self._previewed or self._started is not None or window is None:
            return
        interactor = window.GetInteractor()
        if interactor is not None and not interactor.GetEnableRender():
            return  # it is being closed
        self._picture_wanted = True
        try:
            window.Render()
        finally:
            self._picture_wanted = False


def _draws_depth_to_screen(window: Any) -> bool:
    """Whether a window of X11 copies its depth to the screen with each frame, as from VTK 9.7."""
    return (
        window.GetClassName() == "vtkXOpenGLRenderWindow"
        and hasattr(window, "BlitToCurrentWithDepth")
        and bool(window.GetShowWindow())
        and window.GetFrameBlitMode() == window.BlitToHardware
        and not window.GetStereoRender()  # whose two buffers that copy alone fills
    )


def _opaque_scalar(actor: Any) -> float:
    """Return the scalar that an actor's property makes most opaque."""
    function, node = actor.GetProperty().GetScalarOpacity(), [0.0] * 4
    best = (-1.0, 0.0)
    for i in range(function.GetSize()):
        function.GetNodeValue(i, node)
        best = max(best, (node[1], node[0]))
    return best[1]
