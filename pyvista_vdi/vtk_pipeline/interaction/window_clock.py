"""How good a frame is to be: full at rest and in every picture, a preview while a hand moves."""

from __future__ import annotations

import contextlib
import math
import time
import weakref
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.quality.frame_rate import FrameRateController
from pyvista_vdi.quality.render_mode import RenderMode
from pyvista_vdi.vtk_pipeline.interaction import browser
from pyvista_vdi.vtk_pipeline.vtk import vtkOpenGLGL2PSHelper, vtkWeakReference

T = TypeVar("T")

#: What a ray's cost is known by: the way, or a VDI of every second list.
Cost = RenderMode | Literal["few lists"]

#: Shares of the pixels below which previews take every second list, and above which all again.
#: docs/decisions/any_view.md: at a quarter of the pixels half the lists lose .0024 of SSIM and half
#: the time; twice as many pixels with half the lists lose what half the pixels with all do.
_FEW_BELOW, _FEW_ABOVE = 0.25, 0.65

#: Least and most of what is aimed at, over the rate that is to be kept: single frames vary about
#: their mean, and an aim at the rate makes every second one late (docs/decisions/frame_rate.md).
HEADROOM, _MOST_HEADROOM = 1.15, 1.6
#: Periods of the rate from which a frame is late, and the share of frames that is aimed at: a third
#: of what is allowed, for a late one teaches only the next.
_LATE, _LATE_SHARE = 1.2, 0.01
#: By which power of e a late frame raises the headroom, about; those in time take it back.
_RAISE = 0.05
#: Share of a frame's time from which what is beside the rays may be multisampling: where OpenGL is
#: software that is most of a frame, on a GPU a millisecond or two (docs/decisions/frame_rate.md).
_DEAR_BESIDE = 0.25

#: What a VDI of all or of every second list is changed for, and what its rays take over its own.
_OTHER_LISTS: dict[Cost, tuple[Cost, float]] = {
    "vdi": ("few lists", 0.5),
    "few lists": ("vdi", 2.0),
}

#: Cameras remembered per window; more than any scene has viewports that are turned in turn.
_KNOWN_CAMERAS = 16

#: By the windows' addresses; without callbacks, as ``drawing.mapper._painters`` explains.
_clocks: dict[str, weakref.ref[WindowClock]] = {}


def checked_rate(name: str, value: Any) -> float:
    """Return a rate in frames per second; 0 or above, finite."""
    rate = as_float(value)
    if isinstance(value, bool) or not 0 <= rate < math.inf:
        raise InvalidArgumentError(
            f"{name} must be a number of frames per second, 0 or above; got {value!r}"
        )
    return rate


def checked_image_distance(value: Any) -> float:
    """Return for how many pixels along each edge a ray is cast; 1 to 100, as far as VTK goes."""
    distance = as_float(value)
    if isinstance(value, bool) or not 1 <= distance <= 100:
        raise InvalidArgumentError(
            f"the image sample distance must be a number from 1 to 100; got {value!r}"
        )
    return distance


class Met:
    """VTK's objects that were met before, held weakly: another may have an address later."""

    def __init__(self) -> None:
        self._met: dict[str, vtkWeakReference] = {}

    def is_new(self, thing: Any) -> bool:
        """Whether this is the first time; from now on it is not."""
        known = self._met.setdefault(thing.GetAddressAsString(""), vtkWeakReference())
        new = known.Get() is not thing
        known.Set(thing)
        return new


@dataclass
class Interaction:
    """What a mapper allows while a hand moves; VTK's names, and the meaning, are in the mapper."""

    adjust: bool = True
    adjust_multi_samples: bool = True
    update_rate: float = 1.0  # 1/s, as in vtkSmartVolumeMapper
    target: float | None = None  # frames per second; None: the window's desired update rate
    off_screen: bool | None = None  # whether off-screen is watched; None: where a browser does

    def watched(self, window: Any) -> bool:
        """Whether somebody looks at the window while it is drawn."""
        return bool(window.GetShowWindow()) or self._from_afar(window)

    def asynchronous(self, window: Any) -> bool:
        """Whether work may go on behind the frames: somebody watches, and can move."""
        here = bool(window.GetShowWindow()) and window.GetInteractor() is not None
        return here or self._from_afar(window)

    def _from_afar(self, window: Any) -> bool:
        return browser.watches(window) if self.off_screen is None else self.off_screen

    def rate(self, window: Any) -> float:
        """Return the frames per second to be kept while a hand moves."""
        return float(self.target or window.GetDesiredUpdateRate())

    def moving(self, window: Any) -> bool:
        """Whether a hand moves, by VTK's convention."""
        return bool(window.GetDesiredUpdateRate() >= self.update_rate)

    def wants_preview(self, window: Any) -> bool:
        """Whether frames of this window may be previews now."""
        return self.adjust and self.target != 0 and self.moving(window) and self.watched(window)


@dataclass
class _Frame:
    """What the VDIs of one frame have taken together."""

    share: float | None = None  # of its pixels that each is drawn with; None before one has asked
    interactive: bool = False  # whether one may be a preview
    preview: bool = False  # whether one is
    target: float = 0.0  # the highest rate that one aims at, 1/s
    rays: int = 0  # that were cast, each by its effort
    full_rays: int = 0  # those of full images
    images: int = 0  # that were raycast
    work: float = 0.0  # seconds that this took
    cost: Cost = "vdi"  # what was raycast
    multi_samples: int = 0  # that OpenGL takes of a pixel


class WindowClock:
    """The frames of one render window, and the rate that all VDIs in it keep together.

    All previews of a frame are reduced by the same share, so several VDIs, the two eyes of a
    stereo pair and several viewports divide the time among them by their pixels. The window owns
    this object, through its observers.

    Attributes
    ----------
    number : int
        Frames of the window so far.
    seconds : float or None
        What the last one that was raycast took, from the window's StartEvent to its EndEvent;
        ``None`` before. The time between two frames would count how long a hand rests.
    of_frame : dict
        What those who draw share within a frame; empty between two.
    """

    def __init__(self, window: Any) -> None:
        self.number = 0
        self.seconds: float | None = None
        self.of_frame: dict[Any, Any] = {}
        self._window = vtkWeakReference()
        self._window.Set(window)
        self._painters: weakref.WeakSet[Any] = weakref.WeakSet()
        self._shared: dict[type, Any] = {}
        self._watched = Met()
        self._known: list[vtkWeakReference] = []
        self._controllers: dict[Cost, FrameRateController] = {}
        self._cost: Cost = "vdi"  # of the last frame
        self._few_lists = False  # whether previews had better have fewer lists
        self._floor = 0.0
        self._target = 0.0
        self._headroom = HEADROOM
        self._dear_samples = False  # whether frames with multisampling and all rays would be late
        self._beside = {True: 0.0, False: 0.0}  # seconds, of the last frame with it and without
        self._given_up: int | None = None  # the window's setting, in a frame that goes without
        self._started: float | None = None
        self._interacting = False
        self._previewed = False
        self._picture_wanted = False
        self._full_rays_before = 0
        self._images_before = 0
        self._resting: dict[Cost, tuple[int, float, float]] = {}
        self._foreground = contextlib.ExitStack()  # from the frame's start to its end
        self._frame = _Frame()
        window.AddObserver("StartEvent", lambda *_: self._start())
        window.AddObserver("EndEvent", lambda *_: self._end())

    @classmethod
    def of(cls, window: Any) -> WindowClock:
        """Return the window's clock, made on first use."""
        address = window.GetAddressAsString("")
        known = _clocks.get(address)
        clock = None if known is None else known()
        if clock is None or clock._window.Get() is not window:
            for gone in [key for key, each in list(_clocks.items()) if each() is None]:
                _clocks.pop(gone, None)
            clock = cls(window)
            _clocks[address] = weakref.ref(clock)
        return clock

    def shared(self, kind: type[T]) -> T:
        """Return what those who draw in this window share of a kind, made on first use."""
        return self._shared.setdefault(kind, kind())

    def join(self, painter: Any, renderer: Any) -> None:
        """Note that a painter draws in this window; called in each of its frames."""
        self._painters.add(painter)
        if self._watched.is_new(renderer):
            weak = weakref.ref(self)

            def camera_changed(*_: Any) -> None:
                clock = weak()
                if clock is not None:
                    clock._camera_changed()

            renderer.AddObserver("ActiveCameraEvent", camera_changed)

    @property
    def fps(self) -> float | None:
        """Mean rate of the interaction's last frames; at rest what the last frame would allow."""
        controller = self._controllers.get(self._cost)
        if self._interacting and controller is not None and controller.fps > 0:
            return controller.fps
        return 1 / self.seconds if self.seconds else None

    @property
    def single(self) -> bool:
        """Whether no other VDI is drawn in this window."""
        return len(self._painters) <= 1

    @property
    def drawing(self) -> bool:
        """Whether a frame has begun and not ended."""
        return self._started is not None

    def render(self) -> None:
        """Have the window drawn, as from its event loop."""
        window = self._window.Get()
        if window is not None and browser.push(window):
            return
        interactor = None if window is None else window.GetInteractor()
        if interactor is not None:
            interactor.Render()

    @property
    def whole_picture(self) -> bool:
        """Whether this frame is a whole picture by itself, and not a tile of one."""
        window = self._window.Get()
        return window is None or tuple(window.GetTileScale()) == (1, 1)

    def aim(self, interaction: Interaction) -> float:
        """Return the frames per second to aim at, so that few are late for the rate to be kept."""
        return self._headroom * interaction.rate(self._window.Get())

    def share(
        self,
        renderer: Any,
        interaction: Interaction,
        pixels: int,
        floor: float,
        cost: Cost = "vdi",
        *,
        effort: float = 1.0,
        expected: float | None = None,
    ) -> float:
        """Return the share of its pixels, 0 to 1, that a VDI is drawn with in this frame.

        ``interaction`` is what its mapper allows, ``pixels`` those of the full image, ``floor``
        the least share, ``cost`` says what is drawn, ``effort`` what a ray of this view is
        expected to take over one of others, and ``expected`` how many seconds a full image may
        take where no frame has told.
        """
        window = self._window.Get()
        if not interaction.wants_preview(window):
            self._know(renderer.GetActiveCamera())
            return 1.0
        if self.takes_picture(renderer):
            return 1.0
        frame = self._frame
        frame.interactive = True
        target = self.aim(interaction)
        frame.target = max(frame.target, target)
        if frame.share is None:
            # The other VDIs of this frame are not known yet: count on those of the last
            full = round(pixels * effort)
            if self._images_before > 1:
                full = max(self._full_rays_before, full)
            if expected is not None:
                self._resting.setdefault(cost, (full, expected, expected))
            controller = self._tuned(max(target, self._target), floor, cost)
            frame.share = controller.choose(full) / full
            if cost == "few lists":
                # With more pixels the next frame takes all lists; what a full frame shows is exact
                frame.share = min(frame.share, _FEW_ABOVE)
        return max(frame.share, floor)

    def few_lists(self, interaction: Interaction) -> bool:
        """Whether a preview of this frame had better be drawn with fewer lists."""
        preview = self._few_lists and interaction.wants_preview(self._window.Get())
        return preview and self.single

    def drawn(
        self,
        size: tuple[int, int],
        full: tuple[int, int],
        seconds: float,
        cost: Cost = "vdi",
        effort: float = 1.0,
    ) -> None:
        """Note a raycast of this frame: the image's size, the viewport's, its time, and of what."""
        self._frame.cost = cost
        self._frame.rays += round(size[0] * size[1] * effort)
        self._frame.full_rays += round(full[0] * full[1] * effort)
        self._frame.images += 1
        self._frame.work += seconds

    def showed(self, preview: bool) -> None:
        """Note that a VDI of this frame is a preview, or not."""
        self._frame.preview = self._frame.preview or preview

    def _start(self) -> None:
        self._started = time.perf_counter()
        self._frame = _Frame()
        self.of_frame.clear()
        self.number += 1
        # Between two frames only: no frame shows two generations, nor does a picture in tiles
        painters = list(self._painters)
        if self.whole_picture:
            for painter in painters:
                painter.before_frame()
        self._foreground.close()
        for runtime in {painter.runtime() for painter in painters}:
            self._foreground.enter_context(runtime.foreground())
        window = self._window.Get()
        samples = window.GetMultiSamples()
        if samples and self._dear_samples and self._may_go_without(window, painters):
            self._given_up, samples = samples, 0
            window.SetMultiSamples(0)
        self._frame.multi_samples = samples

    def _may_go_without(self, window: Any, painters: list[Any]) -> bool:
        """Whether a frame may go without multisampling: all VDIs of the window let previews do."""
        shown = [
            (painter.interaction, renderer)
            for painter in painters
            for renderer in painter.renderers()
            if renderer.GetRenderWindow() is window and painter.actor.GetVisibility()
        ]
        return bool(shown) and all(
            interaction.adjust_multi_samples
            and interaction.wants_preview(window)
            and not self._keeps_picture()
            and self._knows(renderer.GetActiveCamera())
            for interaction, renderer in shown
        )

    def _end(self) -> None:
        window = self._window.Get()
        given_up, self._given_up = self._given_up, None
        if given_up is not None and not window.GetMultiSamples():  # it is as it was left here
            window.SetMultiSamples(given_up)
        self._foreground.close()
        self.of_frame.clear()
        started, self._started = self._started, None
        frame, self._frame = self._frame, _Frame()
        self._previewed = frame.preview or given_up is not None
        if frame.rays:
            # The first frame began before anybody looked at the clock: its work is known
            seconds = frame.work if started is None else time.perf_counter() - started
            self._record(frame, seconds)
        moving = any(painter.interaction.moving(window) for painter in self._painters)
        if self._interacting and not frame.interactive and not moving:
            self._interacting = False
            for controller in self._controllers.values():
                controller.rest()

    def _record(self, frame: _Frame, seconds: float) -> None:
        self.seconds = seconds
        self._cost = frame.cost
        if not frame.interactive:
            self._resting[frame.cost] = (frame.rays, frame.work, seconds)
            self._judge_samples(frame, seconds)
            return
        self._interacting = True
        self._target = frame.target
        # A stochastic approximation of the quantile (Robbins and Monro 1951)
        late = seconds * frame.target > _LATE * self._headroom
        raised = self._headroom * math.exp(_RAISE * (late - _LATE_SHARE))
        self._headroom = min(max(HEADROOM, raised), _MOST_HEADROOM)
        self._full_rays_before, self._images_before = frame.full_rays, frame.images
        if frame.cost in self._controllers:
            self._controllers[frame.cost].record(frame.rays, frame.work, seconds)
        if frame.cost in _OTHER_LISTS:
            # Half the lists are expected to take half the time
            other, factor = _OTHER_LISTS[frame.cost]
            work = frame.work * factor
            self._resting[other] = (frame.rays, work, seconds - frame.work + work)
            self._controllers.pop(other, None)  # what it knew was of another view
        if frame.cost != "volume" and frame.share is not None:
            bound = _FEW_ABOVE if frame.cost == "few lists" else _FEW_BELOW
            self._few_lists = frame.share < bound
        self._judge_samples(frame, seconds)

    def _judge_samples(self, frame: _Frame, seconds: float) -> None:
        """Learn from a frame whether those of a motion go without multisampling."""
        smooth = frame.multi_samples > 0
        before, now = self._beside[smooth], seconds - frame.work
        self._beside[smooth] = now
        if not smooth:
            return
        beside = min(before, now)  # a single frame may have been held up by anything
        # Before rays are given up: with all of them, would it be late?
        whole = beside + frame.work * frame.full_rays / frame.rays
        dear = whole * self._target > 1 and beside * self._target > _DEAR_BESIDE
        if dear != self._dear_samples:
            self._dear_samples, self._few_lists = dear, False
            self._controllers.clear()  # frames are cheaper now, or dearer

    def _tuned(self, target: float, floor: float, cost: Cost) -> FrameRateController:
        """Return the window's controller, with this target and at most this floor."""
        if floor < self._floor:
            self._controllers.clear()
        if cost not in self._controllers:
            controller = self._controllers[cost] = FrameRateController(target, floor=floor)
            self._floor = floor
            if cost in self._resting:
                # What the last full frame took, so that an interaction does not begin with another
                rays, work, seconds = self._resting[cost]
                if self._dear_samples:
                    seconds = work + self._beside[False]
                controller.record(rays, work, seconds)
        self._controllers[cost].target_fps = target
        return self._controllers[cost]

    def takes_picture(self, renderer: Any) -> bool:
        """Whether this frame is drawn to be kept: such a frame is always full.

        A screenshot draws in tiles, or with a camera of its own; an export of vector graphics has
        a helper installed.
        """
        if self._keeps_picture():
            return True
        camera = renderer.GetActiveCamera()
        new = not self._knows(camera)
        if new:
            self._know(camera)
        return new

    def _keeps_picture(self) -> bool:
        """Whether this frame is drawn to be kept, whatever its cameras are."""
        exported = vtkOpenGLGL2PSHelper.GetInstance() is not None
        return self._picture_wanted or not self.whole_picture or exported

    def _knows(self, camera: Any) -> bool:
        """Whether something was drawn with this camera before."""
        return any(known.Get() is camera for known in self._known)

    def _know(self, camera: Any) -> None:
        """Remember a camera as one that frames are drawn with."""
        known = [k for k in self._known if k.Get() is not None and k.Get() is not camera]
        weak = vtkWeakReference()
        weak.Set(camera)
        self._known = [*known[1 - _KNOWN_CAMERAS :], weak]

    def _camera_changed(self) -> None:
        """Replace a preview on the screen by the full frame before a screenshot reads it.

        ``vtkWindowToImageFilter`` puts a copy of its own in place of each renderer's camera, and
        may then take the picture that is on the screen, as ``Plotter.screenshot`` has it.
        """
        window = self._window.Get()
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


def reduced(size: tuple[int, int], share: float) -> tuple[int, int]:
    """Return the size in whole pixels, of about the same aspect, that has this share of pixels."""
    if share >= 1:
        return size
    scale = math.sqrt(share)
    width, height = (max(1, round(edge * scale)) for edge in size)
    return width, height
