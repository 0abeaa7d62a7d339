"""Keeps what decides a mapper's frames, tells it what has happened, and does what follows.

:func:`pyvista_vdi.quality.decide.decide` decides; here its actions are done, by the source that the
VDI comes from, the workers behind the frames and the user's own functions.
"""

from __future__ import annotations

import itertools
import logging
import math
import weakref
from collections.abc import Callable
from functools import partial
from typing import Any, Literal, TypeAlias

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import Cancelled, InvalidVolumeError, VDIError
from pyvista_vdi.model.coverage import coverage
from pyvista_vdi.model.render_options import RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality import frame_state as fs
from pyvista_vdi.quality.decide import busy, decide
from pyvista_vdi.quality.records import replace
from pyvista_vdi.quality.view_error import angle_from_generating_view, magnification
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame
from pyvista_vdi.vtk_pipeline.drawing.volume_picture import (
    VolumePicture,
    VolumePictures,
    prepared,
)
from pyvista_vdi.vtk_pipeline.filters.inputs import ROUNDING, Input, SourceInput
from pyvista_vdi.vtk_pipeline.filters.source import Request
from pyvista_vdi.vtk_pipeline.filters.view import View, size_of
from pyvista_vdi.vtk_pipeline.interaction import browser
from pyvista_vdi.vtk_pipeline.interaction.behind import Behind, Estimators
from pyvista_vdi.vtk_pipeline.interaction.status import CornerTexts, VDIStatus, Warnings
from pyvista_vdi.vtk_pipeline.interaction.timer import PERIOD, Timer
from pyvista_vdi.vtk_pipeline.interaction.window import Window, now

_log = logging.getLogger(__name__)

#: Views that a VDI is made to serve, degrees from V_O, where its metadata do not say.
_VIEW_CONE = 60.0


#: By which VDIs are known: no other one has had the number.
_numbers: weakref.WeakKeyDictionary[VDI, int] = weakref.WeakKeyDictionary()
_next_number = itertools.count(1)

#: What a frame can show.
Shown: TypeAlias = VDI | VolumePicture | None


def number_of(vdi: VDI) -> int:
    """Return the number that a VDI is known by."""
    return _numbers.get(vdi) or _numbers.setdefault(vdi, next(_next_number))


class Deciding:
    """What a :class:`Driver` decides by, and does between frames."""

    def __init__(self) -> None:
        self.state = fs.FrameState()
        self.device: Any = None
        self.input: Input | None = None
        self.texts = CornerTexts()
        self._warnings = Warnings()
        self._window: Callable[[], Window | None] = lambda: None  # of the last frame
        self._volumes = VolumePictures()
        self._request: tuple[Any, Request] | None = None  # what the next VDI is made of, and when
        self._options = RenderOptions()  # how the last frame's VDI is drawn
        self._sighted: Frame | None = None  # the VDI made last, in the frame that is decided
        self._behind, self._estimators = Behind(), Estimators()
        self._swapped = False
        self._timer = Timer(self._tick)

    def set(self, **settings: Any) -> bool:
        """Keep what a user sets; whether it is another value."""
        after = replace(self.state.settings, **settings)
        other = after != self.state.settings
        self.state = replace(self.state, settings=after)
        return other

    @property
    def window(self) -> Window:
        """That of the last frame."""
        window = self._window()
        assert window is not None
        return window

    def runtime(self) -> Runtime:
        """Return the device that raycasts."""
        return get_runtime(self.device)

    renderers: Callable[[], list[Any]]  # that show the actor
    status: Callable[[], VDIStatus]

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI."""
        if self.input is not None:
            self.input.watch(None)
            self.input.rest()
        self.input, self._request = source, None
        self.tell(fs.InputChanged())

    def retry(self) -> None:
        """Try again what failed before, and give up what is being made in the background."""
        self.tell(fs.InputChanged(another=False))
        self._warnings.forget()

    def release(self) -> None:
        """End what goes on; a frame begins anew."""
        self._timer.stop()
        if self.input is not None:
            self.input.rest()
        self.tell(fs.Closed())
        self._behind.close()

    # What a frame shows

    def decided(self, frame: Frame, *, joint: bool) -> Frame | None:
        """Return the frame of what it is to show: the VDI, brought up to date, or the volume."""
        source, settings = self.input, self.state.settings
        if source is None:
            return None
        source.note_scene(self.renderers(), frame.model_transform)
        if settings.automatic_view:
            source.set_view_if_missing(*_seen_from(frame))
        try:
            if isinstance(source, SourceInput):
                seen = self.tell(self._asked(source, frame, joint=joint), frame)
            else:
                seen = self._stored(source, frame)
        except Cancelled as error:
            shown = self._volumes.lasting is not None or source.last() is not None
            seen = self.tell(fs.Interrupted(error, shown), frame)
        finally:  # it holds the renderer
            sighted, self._sighted = self._sighted, None
        if seen is None or isinstance(seen, VolumePicture):
            return None if seen is None else frame.showing(seen, seen.number)
        if sighted is not None and sighted.vdi is seen and settings is self.state.settings:
            return sighted
        return frame.showing(seen, number_of(seen))

    def _asked(self, source: SourceInput, frame: Frame, *, joint: bool) -> fs.FrameAsked:
        """Look at all that decides what the frame of a volume shows."""
        window, settings, view = self.window, self.state.settings, frame.view
        assert view is not None
        # What is drawn in several views is out of date in none of them by itself
        one_view = len(self.renderers()) == 1 and source.alone
        moving, previews = window.moving(settings), window.previews(settings)
        stamp, watched = source.stamp(), one_view and window.watched_behind(settings)
        wanted, trouble = self._wanted(source, stamp, None if watched else view)
        return fs.FrameAsked(
            now(),
            (window.number, id(window)),
            view,
            stamp,
            wanted,
            trouble,
            self._sight(source, frame),
            watched,
            one_view,
            joint,
            window.whole_picture,
            frame.full_size == view.size,
            moving,
            previews,
            1 / (window.pace.headroom * window.rate(settings)) if previews else math.inf,
        )

    def _wanted(
        self, source: SourceInput, stamp: Any, view: View | None
    ) -> tuple[Request | None, Exception | None]:
        """Return what the next VDI would be made of, read again when something has changed.

        ``view`` is for a source that has none.
        """
        if self._request is not None:
            of, known = self._request
            if of == stamp:
                return known, None
        try:
            request = source.source.MakeRequest(None if source.has_view else view)
        except (Cancelled, InvalidVolumeError):
            raise
        except Exception as error:  # what is shown can still be drawn
            return None, error
        self._request = stamp, request
        return request, None

    def _sight(self, source: SourceInput, frame: Frame) -> fs.Sight | None:
        """Return the VDI made last as the frame's view shows it."""
        vdi, made = source.last(), source.source.GetCurrentRequest()
        if vdi is None or made is None or frame.view is None:
            return None
        number = number_of(vdi)
        shown, view = frame.showing(vdi, number), frame.view
        self._options, self._sighted = shown.world_options(), shown
        detail = covered = 1.0
        if self.state.settings.draw != "vdi":  # else nobody asks
            detail = magnification(vdi, frame.camera, frame.full_size)
            covered = coverage(vdi, view.camera, view.size)
        of = (shown.angle, detail, covered, shown.covered, self._options)
        return fs.Sight(number, vdi.bounds, made, *of)

    def _stored(self, source: Input, frame: Frame) -> VDI | None:
        """Return the VDI of a frame that has no volume, and say what it lacks."""
        view = frame.view
        assert view is not None
        source.look(view.camera, self.device)
        vdi = self.tell(fs.StoredAsked(source.stamp()), frame)
        if isinstance(vdi, VDI):
            cone = vdi.metadata.get("view_cone")
            seen = fs.Sight(
                number_of(vdi),
                vdi.bounds,
                angle=angle_from_generating_view(vdi, view.camera),
                magnification=magnification(vdi, frame.camera, frame.full_size),
                coverage=coverage(vdi, view.camera, view.size),
            )
            cone = cone if isinstance(cone, int | float) else _VIEW_CONE
            self.tell(fs.StoredSeen(seen, cone, source.remedy), frame)
        return vdi  # type: ignore[return-value]

    def tell(self, event: fs.Event | None, frame: Frame | None = None) -> Shown:
        """Decide what follows from an event, and do it; return what a frame is to show."""
        shown: Shown = None
        while event is not None:
            self.state, actions = decide(self.state, event)
            event = None
            for action in actions:
                match action:
                    case fs.Show():
                        try:
                            shown = self._shown(action, frame)
                        except VDIError as unable:
                            if action.asked is None or action.what in ("last", "this view"):
                                raise
                            _log.debug("the volume cannot be drawn itself", exc_info=unable)
                            refused = (*action.asked.refused, action.content)
                            event = replace(action.asked, refused=refused)
                    case fs.Do(what):
                        self._do(what, frame)
                    case fs.Generate(screen):
                        self._generate(screen)
                    case fs.EstimateError(number, view, options):
                        vdi, made = self._made()
                        if vdi is not None and made is not None:
                            self._behind.estimate(number, vdi, made, view, options)
                    case fs.AskPolicy(asked):
                        event = replace(asked, answer=self._policy_says())
                    case fs.Judge(asked):
                        event = replace(asked, judged=self._judged(frame))
                    case fs.AskAgain(asked):
                        assert frame is not None
                        assert isinstance(self.input, SourceInput)
                        again = self._asked(self.input, frame, joint=asked.joint)
                        event = replace(again, look=asked.look, answer=asked.answer)
                    case fs.Warn(message, cause):
                        vdi = None if self.input is None else self.input.last()
                        # Once for all VDIs of one V_O, such as the steps of a series
                        of = None if vdi is None else (vdi.camera, vdi.window_size)
                        self._warnings.warn(message, cause=(cause, of))
                    case fs.Complain(error):
                        self._complain(error)
                    case fs.Raise(error):
                        raise error
        return shown

    # What is done

    def _made(self) -> tuple[VDI | None, Request | None]:
        """Return the VDI made last, and of what."""
        if not isinstance(self.input, SourceInput):
            return None, None
        return self.input.last(), self.input.source.GetCurrentRequest()

    def _shown(self, show: fs.Show, frame: Frame | None) -> Shown:
        """Return what is to be shown, made where it has to be; VDIError is raised if it cannot."""
        source = self.input
        assert source is not None
        if show.what == "last":
            return source.last()
        if show.what == "before":
            return self._volumes.lasting or source.last()
        assert isinstance(source, SourceInput)
        making, made = self._behind.request, source.source.GetCurrentRequest()
        if show.what == "making" and making is not None:
            return self._volumes.wait_by(making)
        if show.what == "this view" and frame is not None:
            return self._of_this_view(source, frame)

        def wanted() -> Request:
            if show.what == "made" and made is not None:
                return made
            if show.in_bricks and frame is not None:  # for pictures of that size
                return source.source.MakeRequest(frame.view)
            return self._request[1] if self._request is not None else source.source.MakeRequest()

        return self._volumes.get(show.content, wanted, in_bricks=show.in_bricks)

    def _of_this_view(self, source: SourceInput, frame: Frame) -> VDI:
        """Make and return a VDI of exactly the frame's view.

        The source keeps it unless the frame is a tile.
        """
        assert frame.view is not None
        whole = frame.full_size == frame.view.size
        tile = None if whole else (frame.camera, frame.size)
        wanted = source.exact_request(frame.view, tile)
        vdi = source.source.MakeVDI(wanted)
        if whole:
            source.source.TakeVDI(vdi, wanted)
        return vdi

    def _do(self, what: str, frame: Frame | None) -> None:
        source = self.input
        match what:
            case "drop vdi":
                self._behind.drop_vdi()
                self._volumes.placeholder = None
            case "drop estimate":
                self._behind.drop_estimate()
            case "forget volume":
                self._volumes = VolumePictures()
                self._estimators = Estimators()
                self._behind.forget_volume()
            case "update" if source is not None:
                try:
                    source.vdi()
                except Cancelled:  # of one execution
                    raise
                except InvalidVolumeError:  # soon found again
                    if not source.has_what_it_had():
                        raise  # else as VTK's mappers, which draw the data that are there
                except BaseException as error:
                    self.tell(fs.Failed(error, source.stamp(), in_frame=True))
                    raise
            case "forget view" if source is not None:
                source.forget_view()
            case "take view" if isinstance(source, SourceInput) and frame is not None:
                source.take_camera(frame.renderer.GetActiveCamera(), frame.model_transform)
                source.take_size(size_of(frame.renderer))
            case "follow view" if isinstance(source, SourceInput) and frame is not None:
                source.follow_if_changed(*_seen_from(frame))
            case "take" if isinstance(source, SourceInput):
                vdi, request = self._behind.vdi, self._behind.request
                if vdi is not None and request is not None:
                    source.source.TakeVDI(vdi, request)
                    self._volumes.placeholder, self._swapped = None, True
            case "prepare":  # what the first change would wait for
                made = self._made()[1] or (None if self._request is None else self._request[1])
                time = self.state.settings.draw == "auto"
                if made is not None:
                    self._behind.prepare(made, partial(prepared, request=made, time=time))

    def _generate(self, screen: Any) -> None:
        assert isinstance(self.input, SourceInput)
        try:
            self._behind.generate(self.input.source.MakeRequest(screen))
        except Exception as error:  # what is shown can still be drawn
            self.tell(fs.Failed(error))

    def _policy_says(self) -> bool:
        """Return what the user's function says of the frame's view."""
        policy = self.state.settings.regenerate
        try:
            return callable(policy) and bool(policy(self.status()))
        except Exception as error:
            self._complain(error)
            return False

    def _judged(self, frame: Frame | None) -> fs.Estimate | Literal[False]:
        """Estimate the error of the VDI in the frame's view now; False if it cannot be."""
        vdi, made = self._made()
        assert vdi is not None and made is not None  # noqa: PT018
        assert frame is not None and frame.view is not None  # noqa: PT018
        of, options = (number_of(vdi), frame.view), self._options
        detail = magnification(vdi, frame.camera, frame.full_size)
        if made.screen == frame.view and detail <= 1 + ROUNDING:
            return fs.Estimate(*of, ssim=1.0, options=options)
        runtime, background = get_runtime(made.device), frame.renderer.GetBackground()
        try:
            error = self._estimators.estimate(
                made, runtime, vdi, frame.view, options, background=background
            )
        except VDIError:  # no memory for it, say: the volume's picture is right
            _log.debug("the error of a view cannot be estimated", exc_info=True)
            return False
        return fs.Estimate(*of, ssim=error.ssim, contrast=error.contrast, options=options)

    def _complain(self, error: BaseException) -> None:
        said = None if self.input is None else self.input.complaint(error)
        usual = (
            f"the VDI cannot be made anew: {type(error).__name__}: {error}; what was shown stays, "
            "and actor.regenerate() tries again"
        )
        self._warnings.warn(said or usual, error)

    # Between frames

    def between_frames(self) -> bool:
        """Take what was made behind the frames; whether there is another VDI to be drawn."""
        self._swapped = False
        try:
            another = None if self.input is None else self.input.advance()
        except Exception as error:
            self._complain(error)
            return False
        if another is not None:
            return another
        for event in self._behind.finished():
            self.tell(event)
        vdi, made = self._made()
        if not self._swapped and self.state.behind and self.input is not None:
            of = None if vdi is None or made is None else (number_of(vdi), vdi.bounds, made)
            seen = None if of is None else fs.Sight(*of, options=self._options)
            self.tell(fs.TimePassed(now(), seen, self.input.stamp()))
        return self._swapped

    @property
    def _goes_on(self) -> bool:
        """Whether something goes on that the event loop has to look at."""
        return busy(self.state, now()) or (self.input is not None and self.input.busy)

    @property
    def following(self) -> bool:
        """Whether the event loop looks at it."""
        return self._timer.running

    def follow(self, window: Any) -> None:
        """Start the event loop's timer, if something goes on and no hand moves."""
        if self._goes_on and not Window.of(window).moving(self.state.settings):
            period = PERIOD if self.input is None else self.input.period or PERIOD
            in_loop = browser.watches(window)
            self._timer.start(window.GetInteractor(), period, in_loop=in_loop)

    def _tick(self) -> None:
        """Look, from the event loop, at what goes on, and have shown what is new."""
        window = self._window()
        if window is None or window.drawing:
            return
        swapped = self.between_frames()
        if not self._goes_on:
            self._timer.stop()
        if swapped or self.texts.are_behind(self._behind.progress):
            window.render()


def _seen_from(frame: Frame) -> tuple[Any, tuple[int, int], Any]:
    """Return what a renderer sees an actor by: its camera, its size and the actor's matrix."""
    return frame.renderer.GetActiveCamera(), size_of(frame.renderer), frame.model_transform
