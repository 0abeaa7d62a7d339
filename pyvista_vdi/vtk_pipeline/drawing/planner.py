"""Looks at all that decides what a mapper's frames show, asks for a plan, and does what it says.

The plan itself is :func:`pyvista_vdi.quality.plan.plan`.
"""

from __future__ import annotations

import itertools
import logging
import math
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, TypeAlias

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled, InvalidVolumeError, VDIError
from pyvista_vdi.model.coverage import coverage
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.costs import Costs
from pyvista_vdi.quality.plan import (
    SETTLED,
    Made,
    Making,
    Pictures,
    Plan,
    Seen,
    ViewEstimate,
    lacking,
    plan,
)
from pyvista_vdi.quality.view_error import magnification
from pyvista_vdi.vtk_pipeline.drawing.background import Background, Estimator
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, Matrix, consumers
from pyvista_vdi.vtk_pipeline.drawing.images import VolumePicture
from pyvista_vdi.vtk_pipeline.drawing.overlap import group_of
from pyvista_vdi.vtk_pipeline.drawing.settings import MapperSettings
from pyvista_vdi.vtk_pipeline.filters.inputs import ROUNDING, Input, SourceInput
from pyvista_vdi.vtk_pipeline.filters.source import Request
from pyvista_vdi.vtk_pipeline.filters.view import as_array, camera_of, renderer_view, size_of
from pyvista_vdi.vtk_pipeline.interaction.status import Warnings
from pyvista_vdi.vtk_pipeline.interaction.window import Window, now

_log = logging.getLogger(__name__)

#: Views that a VDI is made to serve, degrees from its own, where its metadata do not say.
_VIEW_CONE = 60.0

#: By which VDIs are known: no other one has had the number.
_numbers: weakref.WeakKeyDictionary[VDI, int] = weakref.WeakKeyDictionary()
_next_number = itertools.count(1)

#: What a frame can show.
Shown: TypeAlias = VDI | VolumePicture | None


def number_of(vdi: VDI) -> int:
    """Return the number that a VDI is known by."""
    return _numbers.get(vdi) or _numbers.setdefault(vdi, next(_next_number))


class Planner:
    """What a mapper shows, and what is made for it; a :class:`Driver` draws it.

    Attributes
    ----------
    background : Background
        What is being made.
    making : Making or None
        The same, if it is a VDI.
    """

    def __init__(self) -> None:
        self._actor: Callable[[], Any] = lambda: None
        self.settings = MapperSettings()
        self.device: Any = None
        self.input: Input | None = None
        self.warnings, self.background = Warnings(), Background()
        self.failed: tuple[Any, ...] = ()  # stamps at which a VDI could not be made
        self.forget()

    def forget(self) -> None:
        """Forget all that was seen, and what is being made."""
        self.background.drop()
        self.making: Making | None = None
        self.estimate: ViewEstimate | None = None
        self.pictures, self.costs = Pictures(), Costs()
        self.view: View | None = None  # of the last frame
        self.seen: Seen | None = None  # the last frame that somebody watched
        self._estimator = Estimator()
        self._volume: VolumePicture | None = None
        self._wanted: tuple[Any, Request | None, Exception | None] | None = None  # and the stamp
        self._refused: tuple[Any, Any] | None = None  # a content that the device cannot draw
        self._stamp: Any = None  # of all that the last frame depended on
        self._moved_at, self._number = -math.inf, (0, 0)  # and of what frame of which window
        self._pixels = 0.0  # of the last frame, in which the volume may be seen

    @property
    def actor(self) -> Any:
        """The actor that this draws for, whose matrix and renderers count; ``None`` without one."""
        return self._actor()

    def renderers(self) -> list[Any]:
        """Return all renderers that show the actor, by itself or as a part of an assembly."""
        there = [each for each in consumers(self._actor()) if each.IsA("vtkRenderer")]
        return list(dict.fromkeys(there))

    # What a frame shows

    def showing(self, frame: Frame) -> Frame | None:
        """Return the frame of what is to be seen, brought up to date; ``None`` for nothing."""
        source, settings, view = self.input, self.settings, frame.view
        if source is None or view is None:
            return None
        renderers = self.renderers()
        source.note_scene(renderers, frame.model_transform)
        source.set_view_if_missing(*_seen_from(frame))
        if not isinstance(source, SourceInput):
            return self._stored(source, frame, view)
        # What is drawn in several views is out of date in none of them by itself
        one_view = len(renderers) == 1 and source.alone
        several = len(frame.window.shown_in(frame.renderer)) > 1
        joint = several and len(group_of(frame).members) > 1
        shown = self._planned(source, frame, joint=joint, one_view=one_view)
        if shown is None or shown.volume is None or not shown.volume.shaded:
            return shown
        # A volume has the light of its VDI in a window, so that nothing jumps
        by_vdi = self.seen is not None and source.last() is not None and settings.draw != "volume"
        return shown if by_vdi else replace(shown, lit_from=view.camera)

    def _stored(self, source: Input, frame: Frame, view: View) -> Frame | None:
        """Return the frame of a VDI that has no volume, and say what it lacks."""
        stamp, self.view = source.stamp(), view
        source.look(view.camera, self.device)
        if stamp is None or stamp not in self.failed:
            self._update(source)
        vdi = source.last()
        if vdi is None:
            return None
        shown = frame.showing(vdi, number_of(vdi))
        if self.settings.regenerate == "auto":
            seen = self._as_made(vdi, shown)
            cone = vdi.metadata.get("view_cone")
            cone = cone if isinstance(cone, int | float) else _VIEW_CONE
            for cause, message in lacking(seen, cone, source.remedy):
                # Once for all VDIs of one view, such as the steps of a series
                self.warnings.warn(message, cause=(cause, (vdi.camera, vdi.window_size)))
        shown = replace(shown, full=not frame.window.previews(self.settings))
        parts = source.parts()
        if len(parts) < 2 or parts[0][0] is not vdi:
            return shown
        blend = tuple((number_of(vdi), weight) for vdi, weight in parts)
        return replace(shown, parts=tuple(parts), blend=blend)

    def _planned(
        self, source: SourceInput, frame: Frame, *, joint: bool, one_view: bool
    ) -> Frame | None:
        """Plan a frame of what comes from a volume, do that, and return what the frame shows."""
        try:
            seen, sighted = self._look(source, frame, joint=joint, one_view=one_view)
            while True:
                planned = plan(seen)
                self.costs, self.pictures = planned.costs, planned.pictures
                if planned.estimate == "now":
                    judged = self._judged(source, frame, sighted)
                    seen = replace(seen, judged=judged, pictures=planned.pictures)
                    continue
                self._do(planned, seen, source, frame)
                try:
                    shown = self._shown(planned, source, frame)
                    break
                except VDIError as unable:
                    if planned.show != "volume":
                        raise
                    _log.debug("the volume cannot be drawn itself", exc_info=unable)
                    kind: Any = "none" if planned.in_bricks or seen.volume != "whole" else "bricks"
                    self._refused = (planned.content, kind)
                    seen = replace(seen, first_look=False, volume=kind, **self._going_on())
        except Cancelled as error:
            if self._volume is None and source.last() is None:
                raise
            self.complain(error)
            planned, shown = Plan("vdi"), self._volume or source.last()
        if shown is None:
            return None
        number = shown.number if isinstance(shown, VolumePicture) else number_of(shown)
        found = frame.showing(shown, number)
        return replace(found, full=planned.full, stand_in=planned.stand_in)

    def _going_on(self) -> dict[str, Any]:
        """Return what is being made, and what was, as fields of :class:`Seen`."""
        return {
            "making": self.making,
            "estimating": self.background.kind == "estimate",
            "estimate": self.estimate,
            "failed": self._stamp in self.failed,
            "costs": self.costs,
        }

    def _look(
        self, source: SourceInput, frame: Frame, *, joint: bool, one_view: bool
    ) -> tuple[Seen, Frame | None]:
        """Look at all that decides what the frame shows; also return the VDI as it shows it."""
        window, settings, view = frame.window, self.settings, frame.view
        assert view is not None
        watched = one_view and window.watched_behind(settings)
        stamp = source.stamp()
        if self._wanted is None or self._wanted[0] != stamp or self._wanted[1] is None:
            self._wanted = (stamp, *_request_of(source, None if watched else view))
        wanted, trouble = self._wanted[1:]
        number = (window.number, id(window))
        first = (window.whole_picture and number != self._number) or (
            watched and stamp != self._stamp
        )
        if window.whole_picture:
            self._number = number
        # A view is at rest in its second frame, and when nothing has moved for a moment
        time, moving = now(), window.moving
        if view != self.view:
            self._moved_at = time
        elif not moving and first:
            self._moved_at = min(self._moved_at, time - SETTLED)
        self.view = view
        if watched and trouble is not None and stamp != self._stamp and source.last() is not None:
            self.complain(trouble)
        self._stamp = stamp
        # The VDI made last, as this view shows it
        vdi, request = source.last(), source.source.GetCurrentRequest()
        made, sighted = None, None
        if vdi is not None and request is not None:
            sighted = frame.showing(vdi, number_of(vdi))
            made = self._as_made(vdi, sighted, request)
        previews = window.previews(settings)
        content, volume = None if wanted is None else wanted.content, "whole"
        bounds = () if wanted is None else wanted.volume.bounds
        self._pixels = replace(frame, bounds=bounds).covered if watched and bounds else 0.0
        if self._refused is not None and content is not None and content == self._refused[0]:
            volume = self._refused[1]
        seen = Seen(
            view=view,
            content=content,
            screen=None if wanted is None else wanted.screen,
            chosen=source.view_is_chosen(wanted, request),
            draw=settings.draw,
            regenerate=settings.regenerate,
            bound=settings.regenerate_below,
            watched=watched,
            moving=previews,
            hand=moving and time - self._moved_at < SETTLED,
            settled=not moving and time - self._moved_at >= SETTLED,
            one_view=one_view,
            joint=joint,
            first_look=first,
            own_pixels=frame.full_size == view.size,
            made=made,
            volume=volume,  # type: ignore[arg-type]
            late=watched and self._late(window),
            seconds=1 / (window.pace.headroom * window.rate(settings)) if previews else None,
            pictures=self.pictures,
            **self._going_on(),
        )
        self.seen = seen if watched else None
        if watched:
            # A hand that moves has the machine
            self.background.pause(SETTLED if seen.hand else 0)
        return seen, sighted

    def _as_made(self, vdi: VDI, shown: Frame, request: Request | None = None) -> Made:
        """Return a VDI as a frame's view shows it, with what it was made of."""
        detail = covered = 1.0
        view = shown.view
        assert view is not None
        if request is None or self.settings.draw != "vdi":  # else nobody asks
            detail = magnification(vdi, shown.camera, shown.full_size)
            covered = coverage(vdi, view.camera, view.size)
        content, screen = (None, None) if request is None else (request.content, request.screen)
        known = (number_of(vdi), vdi.bounds, content, screen, shown.angle, detail, covered)
        return Made(*known, shown.covered, shown.world_options())

    def _late(self, window: Window) -> bool:
        """Whether the volume's own full frames of the last view miss the rate."""
        each, settings = self.costs.volume, self.settings
        if each is None or settings.target == 0:
            return False
        return window.pace.late(each * self._pixels + self.costs.fixed, window.rate(settings))

    # What is planned is done

    def _do(self, planned: Plan, seen: Seen, source: SourceInput, frame: Frame | None) -> None:
        """Begin, or give up, what goes on in the background, and make what a frame waits for."""
        if planned.give_up:
            self.drop()
        if planned.view is not None and frame is not None:
            camera, size, matrix = _seen_from(frame)
            if planned.view == "take":
                source.take_camera(camera, matrix)
                source.take_size(size)
            else:
                source.follow_if_changed(camera, size, matrix)
        if planned.make is not None:
            try:
                request = source.source.MakeRequest(planned.make)
            except Exception as error:  # what is shown can still be drawn
                self._fail(error)
            else:
                for_view = not (seen.stale or seen.chosen)
                self.making = Making(request.content, planned.make, for_view)
                self.background.generate(request)
        if planned.estimate == "background":
            vdi, of, made = source.last(), source.source.GetCurrentRequest(), seen.made
            assert vdi is not None and of is not None and made is not None  # noqa: PT018
            shown = (made.number, vdi, of, seen.view, made.options)
            self.background.estimate(self._estimator, *shown)
        if planned.update:
            self._update(source)

    def _shown(self, planned: Plan, source: SourceInput, frame: Frame) -> Shown:
        """Return what a plan shows, made where it has to be; VDIError is raised if it cannot be."""
        assert self._wanted is not None
        wanted, trouble = self._wanted[1:]
        if planned.show == "vdi":
            return source.last()
        if planned.show == "trouble":
            assert trouble is not None
            raise trouble
        if planned.show == "exact":
            return self._of_this_view(source, frame)
        if self._volume is None or self._volume.request.content != planned.content:
            self._volume = None  # its buffers go before others are taken
            request = source.source.GetCurrentRequest()
            if request is None or request.content != planned.content:
                request = wanted
            if planned.in_bricks:  # for pictures of that size
                request = source.source.MakeRequest(frame.view)
            assert request is not None
            self._volume = VolumePicture(request, in_bricks=planned.in_bricks)
        return self._volume

    def _of_this_view(self, source: SourceInput, frame: Frame) -> VDI:
        """Make and return a VDI of exactly the frame's view, kept unless the frame is a tile."""
        assert frame.view is not None
        whole = frame.full_size == frame.view.size
        tile = None if whole else (frame.camera, frame.size)
        wanted = source.exact_request(frame.view, tile)
        vdi = source.source.MakeVDI(wanted)
        if whole:
            source.source.TakeVDI(vdi, wanted)
        return vdi

    def _update(self, source: Input) -> None:
        """Make the VDI of the source now; what fails is not repeated until something changes."""
        try:
            source.vdi()
        except (Cancelled, InvalidVolumeError):  # of one execution, or soon found again
            raise
        except BaseException:
            self.failed = (*self.failed[-1:], source.stamp())
            raise

    def drop(self) -> None:
        """Cancel what is being made in the background."""
        self.background.drop()
        self.making = None
        if self.settings.draw == "vdi":
            self._volume = None  # which stood in

    def _fail(self, error: BaseException) -> None:
        """Note that a VDI cannot be made of what there is now, and say it once."""
        self.making, self.failed = None, (*self.failed[-1:], self._stamp)
        self.background.drop()
        self.complain(error)

    def complain(self, error: BaseException) -> None:
        """Say once that a VDI cannot be made."""
        said = None if self.input is None else self.input.complaint(error)
        usual = (
            f"the VDI cannot be made anew: {type(error).__name__}: {error}; what was shown stays, "
            "and actor.regenerate() tries again"
        )
        self.warnings.warn(said or usual, error)

    def _judged(
        self, source: SourceInput, frame: Frame, sighted: Frame | None
    ) -> ViewEstimate | Literal[False]:
        """ViewEstimate the error of the VDI in the frame's view now; False if it cannot be."""
        made = source.source.GetCurrentRequest()
        assert sighted is not None and sighted.vdi is not None and frame.view is not None  # noqa: PT018
        assert made is not None
        vdi, options = sighted.vdi, sighted.world_options()
        of = (number_of(vdi), frame.view)
        detail = magnification(vdi, frame.camera, frame.full_size)
        if made.screen == frame.view and detail <= 1 + ROUNDING:
            return ViewEstimate(*of, ssim=1.0, options=options)
        runtime, background = get_runtime(made.device), frame.renderer.GetBackground()
        try:
            error = self._estimator.estimate(
                made, runtime, vdi, frame.view, options, background=background
            )
        except VDIError:  # no memory for it, say: the volume's picture is right
            _log.debug("the error of a view cannot be estimated", exc_info=True)
            return False
        return ViewEstimate(*of, ssim=error.ssim, contrast=error.contrast, options=options)

    # Between frames

    def advance(self) -> bool:
        """Take what was made in the background; whether there is another VDI to be drawn."""
        try:
            another = None if self.input is None else self.input.advance()
        except Exception as error:
            self.complain(error)
            return False
        done = self.background.finished() if another is None else None
        if done is None:
            return bool(another)
        kind, made, request = done
        if isinstance(made, BaseException):
            self._fail(made)
        elif kind == "estimate":
            self.estimate = made
        elif isinstance(self.input, SourceInput):
            self.input.source.TakeVDI(made, request)
            self.making = self.estimate = None
            if self.settings.draw == "vdi":
                self._volume = None
            return True
        return False

    def begin_at_rest(self, window: Window) -> None:
        """Begin what a view at rest is missing, though no frame asks."""
        source, seen = self.input, self.seen
        if not isinstance(source, SourceInput) or seen is None or source.stamp() != self._stamp:
            return  # what has changed is for a frame to look at
        still, moving = now() - self._moved_at >= SETTLED, window.moving
        self.seen = seen = replace(
            seen,
            hand=moving and not still,
            settled=still and not moving,
            first_look=False,
            late=self._late(window),
            **self._going_on(),
        )
        planned = plan(seen)
        self._do(replace(planned, view=None, update=False), seen, source, None)

    @property
    def goes_on(self) -> bool:
        """Whether something goes on that the event loop has to look at."""
        if self.background.kind is not None:
            return True
        if self.seen is not None and now() - self._moved_at < SETTLED:
            return True
        return self.input is not None and self.input.busy

    # What is asked for between frames

    def vdi_asked_for(self) -> VDI | None:
        """Return the VDI, made now where there is none, or of what is no longer so.

        It is of the view that the first picture had, or that somebody chose; before the first
        picture, of the view that this would have now. ``None`` without an input, or a view.
        """
        source, seen = self.input, self._look_for_view()
        if not isinstance(source, SourceInput):
            if source is None or (source.last() is not None and source.prop is None):
                return None if source is None else source.last()
            return source.vdi()  # in the colours that its property has by now
        if source.has_view:
            # Unless frames keep it up to date, or will
            kept = self.settings.draw == "vdi" or self.making is not None
            if source.last() is None or not kept:
                self.drop()
                if source.stamp() not in self.failed:
                    self._update(source)
        elif seen is not None:
            return source.of_view(source.view_for(*seen))
        return source.last()

    def vdi_of_view(self, renderer: Any, matrix: Matrix) -> VDI | None:
        """Return a VDI of exactly what a renderer shows of an actor of that matrix, (4, 4).

        It is made beside the one that is there; without the volume, or where nobody but
        ``actor.regenerate()`` may make another, it is that one.
        """
        source = self.input
        if not isinstance(source, SourceInput) or self.settings.regenerate == "never":
            return self.vdi_asked_for()
        source.note_scene(self.renderers(), matrix)
        wanted = source.exact_request(renderer_view(renderer, matrix))
        made = source.source.GetCurrentRequest()
        same = made is not None and made.key == wanted.key
        return source.last() if same else source.source.MakeVDI(wanted)

    def vdi_to_pick(self, frame: Frame) -> VDI | None:
        """Return a VDI that has all of what a view shows; without a volume, the one there is."""
        vdi, view = self.vdi_asked_for(), frame.view
        if vdi is None or view is None or not isinstance(self.input, SourceInput):
            return vdi
        whole = coverage(vdi, view.camera, view.size) == 1
        return vdi if whole else self._of_this_view(self.input, frame)

    def values_asked_for(self) -> DeferredVDI | None:
        """Return the values that are classified, made now if they are not.

        ``None`` where there are none, or no view to make them of.
        """
        self._look_for_view()
        return None if self.input is None else self.input.deferred

    def _look_for_view(self) -> tuple[Any, tuple[int, int], Any] | None:
        """Look at the scene between frames; return what the next picture sees the actor by."""
        source, actor, renderers = self.input, self.actor, self.renderers()
        if source is None or actor is None:
            return None
        matrix = as_array(actor.GetMatrix())
        source.note_scene(renderers, matrix)
        if not renderers:
            return None
        seen = actor.camera_to_come(renderers[0]), size_of(renderers[0]), matrix
        if isinstance(source, SourceInput):
            return seen
        source.set_view_if_missing(*seen)
        if source.last() is None:
            source.look(camera_of(seen[0], matrix), self.device)
        return seen


def _request_of(source: SourceInput, view: View | None) -> tuple[Request | None, Exception | None]:
    """Return what the next VDI would be made of, or why none can be.

    ``view`` is for a source that has none.
    """
    try:
        return source.source.MakeRequest(None if source.has_view else view), None
    except (Cancelled, InvalidVolumeError):
        raise
    except Exception as error:  # what is shown can still be drawn
        return None, error


def _seen_from(frame: Frame) -> tuple[Any, tuple[int, int], Any]:
    """Return what a renderer sees an actor by: its camera, its size and the actor's matrix."""
    return frame.renderer.GetActiveCamera(), size_of(frame.renderer), frame.model_transform
