"""Looks at all that decides what a mapper's frames show, asks for a plan, and does what it says.

The plan itself is :func:`pyvista_vdi.quality.plan.plan`.
"""

from __future__ import annotations

import logging
import math
import weakref
from collections.abc import Callable, Hashable
from dataclasses import replace
from typing import Any

import numpy as np

from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import (
    Cancelled,
    InvalidVolumeError,
    VDIError,
    VDIWarning,
    warn_external,
)
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.options import RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View, coverage
from pyvista_vdi.quality.background import BackgroundThread, Job, vdi_job
from pyvista_vdi.quality.costs import Costs
from pyvista_vdi.quality.plan import SETTLED, Made, Making, Plan, Seen, ViewEstimate, lacking, plan
from pyvista_vdi.quality.view_error import (
    ViewErrorEstimator,
    angle_from_generating_view,
    magnification,
)
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, consumers, planes_of
from pyvista_vdi.vtk_pipeline.drawing.images import VolumePicture
from pyvista_vdi.vtk_pipeline.drawing.overlap import group_of
from pyvista_vdi.vtk_pipeline.drawing.settings import MapperSettings
from pyvista_vdi.vtk_pipeline.filters.inputs import Input
from pyvista_vdi.vtk_pipeline.filters.source import Request, VDISource
from pyvista_vdi.vtk_pipeline.filters.view import as_array, camera_of, size_of
from pyvista_vdi.vtk_pipeline.interaction.window import now

_log = logging.getLogger(__name__)

#: Views that a VDI is made to serve, degrees from its own, where its metadata do not say.
_VIEW_CONE = 60.0


class Planner:
    """What a mapper shows, and what is made for it; a :class:`Driver` draws it.

    One thing at a time is made in the background of the frames, by one thread, which knows nothing
    of VTK (:mod:`pyvista_vdi.quality.background`); the methods are for the thread that draws.

    Attributes
    ----------
    making : Making or None
        The VDI that is being made in the background.
    """

    def __init__(self) -> None:
        self.actor: Callable[[], Any] = lambda: None
        self.settings = MapperSettings()
        self.device: Any = None
        self.input: Input | None = None
        self.said: set[Hashable] = set()  # warnings, or their causes
        self.failed: tuple[Any, ...] = ()  # stamps at which a VDI could not be made
        self.worker = BackgroundThread("pyvista-vdi generation")
        # The thread knows the worker alone, so that this can be collected while it works
        weakref.finalize(self, self.worker.clear).atexit = False
        self.forget()

    def forget(self) -> None:
        """Forget all that was seen, and what is being made."""
        self._volume: VolumePicture | None = None
        self.drop()
        self.estimate: ViewEstimate | None = None
        self.costs = Costs()
        self.view: View | None = None  # of the last frame
        self.seen: Seen | None = None  # the last frame that somebody watched
        self._wanted: tuple[Any, Request | None, Exception | None] | None = None  # and the stamp
        self._refused: tuple[Any, Any] | None = None  # a content that the device cannot draw
        self._stamp: Any = None  # of all that the last frame depended on
        self._moved_at, self._number = -math.inf, (0, 0)  # and of what frame of which window

    def drop(self) -> None:
        """Cancel what is being made in the background."""
        self.worker.clear()
        self.making: Making | None = None
        self._asked: Request | None = None  # of what is being made, or its error estimated
        if self.settings.draw == "vdi":
            self._volume = None  # which stood in

    @property
    def renderers(self) -> list[Any]:
        """All renderers that show the actor, by itself or as a part of an assembly."""
        found: list[Any] = []
        for each in consumers(self.actor()):
            if each.IsA("vtkRenderer") and each not in found:
                found.append(each)
        return found

    # What a frame shows

    def showing(self, frame: Frame) -> Frame | None:
        """Return the frame of what is to be seen, brought up to date; ``None`` for nothing."""
        source, renderers = self.input, self.renderers
        if source is None:
            return None
        source.note_scene(renderers, frame.model_transform)
        source.set_view_if_missing(*frame.seen_from)
        if not isinstance(source, VDISource):
            return self._stored(source, frame)
        # What is drawn in several views is out of date in none of them by itself
        one_view = len(renderers) == 1 and source.alone
        several = len(frame.window.shown_in(frame.renderer)) > 1
        joint = several and len(group_of(frame).members) > 1
        try:
            seen = self._look(source, frame, joint=joint, one_view=one_view)
            while True:
                planned = plan(seen)
                self.costs = planned.costs
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
                    seen = replace(
                        seen,
                        first_look=False,
                        volume=kind,
                        making=self.making,
                        estimating=self._asked is not None and self.making is None,
                        failed=self._stamp in self.failed,
                    )
        except Cancelled as error:
            if self._volume is None and source.last() is None:
                raise
            self._complain(error)
            planned, shown = Plan("vdi"), self._volume or source.last()
        if shown is None:
            return None
        # A volume has the light of its VDI in a window, so that nothing jumps
        by_vdi = self.seen is not None and source.last() is not None
        own = isinstance(shown, VolumePicture) and shown.shaded
        own = own and (not by_vdi or self.settings.draw == "volume")
        known = {"full": planned.full, "stand_in": planned.stand_in}
        return frame.showing(shown, lit_from=frame.view.camera if own else None, **known)

    def _stored(self, source: Input, frame: Frame) -> Frame | None:
        """Return the frame of a VDI that has no volume, and say what it lacks."""
        stamp, self.view = source.stamp(), frame.view
        source.look(frame.view.camera, self.device)
        if stamp is None or stamp not in self.failed:
            self._update(source)
        vdi = source.last()
        if vdi is None:
            return None
        if self.settings.regenerate == "auto":
            cone = vdi.metadata.get("view_cone")
            cone = cone if isinstance(cone, int | float) else _VIEW_CONE
            for cause, message in lacking(self._as_made(vdi, frame), cone):
                # Once for all VDIs of one view, such as the steps of a series
                self.warn(message, cause=(cause, (vdi.camera, vdi.window_size)))
        parts = source.parts()
        blended = len(parts) > 1 and parts[0][0] is vdi
        full = not frame.window.previews(self.settings)
        return frame.showing(vdi, full=full, parts=tuple(parts) if blended else ())

    def _look(self, source: VDISource, frame: Frame, *, joint: bool, one_view: bool) -> Seen:
        """Look at all that decides what the frame shows."""
        window, settings, view = frame.window, self.settings, frame.view
        watched = one_view and window.watched_behind(settings)
        stamp = source.stamp()
        if self._wanted is None or self._wanted[0] != stamp or self._wanted[1] is None:
            request, trouble = None, None
            try:
                request = source.MakeRequest(None if watched or source.has_view else view)
            except (Cancelled, InvalidVolumeError):
                raise
            except Exception as error:  # what is shown can still be drawn
                trouble = error
            self._wanted = (stamp, request, trouble)
        _, wanted, trouble = self._wanted
        whole, number = window.whole_picture, (window.number, id(window))
        first = (whole and number != self._number) or (watched and stamp != self._stamp)
        if whole:
            self._number = number
        # A view is at rest in its second frame, and when nothing has moved for a moment
        time, moving = now(), window.moving
        if view != self.view:
            self._moved_at = time
        elif not moving and first:
            self._moved_at = min(self._moved_at, time - SETTLED)
        settled, self.view = time - self._moved_at >= SETTLED, view
        if watched and trouble is not None and stamp != self._stamp and source.last() is not None:
            self._complain(trouble)
        self._stamp = stamp
        vdi, made_of = source.last(), source.made_of
        known = vdi is not None and made_of is not None
        content, volume, late, each = None, "whole", False, self.costs.volume
        if wanted is not None:
            content = wanted.content
            if watched and each is not None and settings.target_fps != 0:
                seconds = each * frame.covered_by(wanted.volume.bounds) + self.costs.fixed
                late = window.pace.late(seconds, window.rate(settings))
            if self._refused is not None and content == self._refused[0]:
                volume = self._refused[1]
        previews = window.previews(settings)
        seen = Seen(
            view=view,
            content=content,
            screen=None if wanted is None else wanted.screen,
            chosen=source.view_is_chosen(wanted),
            draw=settings.draw,
            regenerate=settings.regenerate,
            bound=settings.regenerate_below,
            watched=watched,
            moving=previews,
            hand=moving and not settled,
            settled=settled and not moving,
            one_view=one_view,
            joint=joint,
            first_look=first,
            made=self._as_made(vdi, frame, made_of) if known else None,  # type: ignore[arg-type]
            volume=volume,  # type: ignore[arg-type]
            late=late,
            seconds=1 / (window.pace.headroom * window.rate(settings)) if previews else None,
            making=self.making,
            estimating=self._asked is not None and self.making is None,
            estimate=self.estimate,
            failed=stamp in self.failed,
            costs=self.costs,
        )
        self.seen = seen if watched else None
        if watched:
            # A hand that moves has the machine
            self.worker.pause(SETTLED if seen.hand else 0)
        return seen

    def _as_made(self, vdi: VDI, frame: Frame, request: Request | None = None) -> Made:
        """Return a VDI as a frame's view shows it, with what it was made of."""
        detail, covered, camera = 1.0, 1.0, frame.view.camera
        if request is None or self.settings.draw != "vdi":  # else nobody asks
            detail = magnification(vdi, frame.camera, frame.full_size)
            covered = coverage(vdi, camera, frame.view.size)
        content, screen = (None, None) if request is None else (request.content, request.screen)
        angle = angle_from_generating_view(vdi, camera)
        of = (weakref.ref(vdi), vdi.bounds, content, screen, angle, detail, covered)
        return Made(*of, frame.covered_by(vdi.bounds))

    # What is planned is done

    def _do(self, planned: Plan, seen: Seen, source: VDISource, frame: Frame) -> None:
        """Begin, or give up, what goes on in the background, and make what a frame waits for."""
        if planned.give_up:
            self.drop()
        if planned.follow:
            source.follow_if_changed(*frame.seen_from)
        if planned.make is not None:
            try:
                request = source.MakeRequest(planned.make)
            except Exception as error:  # what is shown can still be drawn
                self._fail(error)
            else:
                for_view = not (seen.stale or seen.chosen)
                self.making = Making(request.content, planned.make, for_view)
                self._asked = request
                self.worker.put(vdi_job(request, request.target))
        if planned.estimate:
            self._estimate(source, seen.view)
        if planned.update:
            self._update(source)

    def _estimate(self, source: VDISource, view: View) -> None:
        """Estimate, in the background, the error of the VDI in a view."""
        vdi, of, mapper = source.last(), source.made_of, self.actor().GetMapper()
        assert vdi is not None and of is not None  # noqa: PT018
        request, made = of, vdi
        planes = np.reshape(planes_of(mapper), (-1, 6))
        options = RenderOptions(planes, mapper, self.settings.opacity_multiplier)

        def judge(runtime: Runtime, _: Callable[[float], None]) -> ViewEstimate:
            with runtime.aside():  # loads SciPy, the first time: a quarter of a second
                from skimage.metrics import structural_similarity  # noqa: F401
            look, sampling = request.transfer_function, request.options
            by = ViewErrorEstimator(request.volume, look, sampling, device=runtime)
            error = by.estimate(made, view.camera, view.size, options)
            return ViewEstimate(weakref.ref(made), view, error.ssim)

        self._asked = request
        self.worker.put(Job(judge, request.device))

    def _shown(self, planned: Plan, source: VDISource, frame: Frame) -> VDI | VolumePicture | None:
        """Return what a plan shows, made where it has to be; VDIError is raised if it cannot be."""
        assert self._wanted is not None
        _, wanted, trouble = self._wanted
        if planned.show == "vdi":
            return source.last()
        if planned.show == "trouble":
            assert trouble is not None
            raise trouble
        if planned.show == "exact":
            return source.exact_vdi(frame.view)
        if self._volume is None or self._volume.request.content != planned.content:
            self._volume = None  # its buffers go before others are taken
            request = source.made_of
            if request is None or request.content != planned.content:
                request = wanted
            if planned.in_bricks:  # for pictures of that size
                request = source.MakeRequest(frame.view)
            assert request is not None
            self._volume = VolumePicture(request, in_bricks=planned.in_bricks)
        return self._volume

    def _update(self, source: Input) -> None:
        """Make the VDI of the source now; what fails is not repeated until something changes."""
        try:
            source.vdi()
        except (Cancelled, InvalidVolumeError):  # of one execution, or soon found again
            raise
        except BaseException:
            self.failed = (*self.failed[-1:], source.stamp())
            raise

    def _fail(self, error: BaseException) -> None:
        """Note that a VDI cannot be made of what there is now, and say it once."""
        self.drop()
        self.failed = (*self.failed[-1:], self._stamp)
        self._complain(error)

    def _complain(self, error: BaseException) -> None:
        """Say once that a VDI cannot be made."""
        said = f"another VDI cannot be made: {type(error).__name__}: {error}; what was shown stays"
        self.warn(f"{said}, and actor.regenerate() tries again", error)

    def warn(
        self, message: str, error: BaseException | None = None, cause: Hashable = None
    ) -> None:
        """Say a thing once: exceptions cannot pass through VTK's renderer. It is in the log, too.

        What has the same ``cause`` was said before.
        """
        _log.debug("%s", message, exc_info=error)
        if (cause or message) not in self.said:
            self.said.add(cause or message)
            try:
                warn_external(message)
            except VDIWarning:  # warnings are errors: the log is what is left
                _log.error(message)

    # Between frames

    def advance(self) -> bool:
        """Take what was made in the background; whether a frame has something new to look at."""
        try:
            another = None if self.input is None else self.input.advance()
        except Exception as error:
            self._complain(error)
            return False
        if another is not None or self._asked is None:
            return bool(another)
        try:
            made = self.worker.take()
        except Exception as error:
            self._fail(error)
            return False
        if made is None:
            return False
        (request, self._asked), self.making = (self._asked, None), None
        if isinstance(made, ViewEstimate):
            self.estimate = made
            return True
        assert isinstance(self.input, VDISource)
        self.input.TakeVDI(made, request)
        self.estimate = None
        if self.settings.draw == "vdi":
            self._volume = None
        return True

    @property
    def unsettled(self) -> bool:
        """Whether what the view is missing at rest is still to be begun, by another frame."""
        return self.seen is not None and not self.seen.settled

    @property
    def goes_on(self) -> bool:
        """Whether something goes on that the event loop has to look at."""
        playing = self.input is not None and self.input.playing
        return self._asked is not None or playing or self.unsettled

    # What is asked for between frames

    def vdi_asked_for(self) -> VDI | None:
        """Return the VDI, made now where there is none, or of what is no longer so.

        It is of the view that the first picture had, or that somebody chose; before the first
        picture, of the view that this would have now. ``None`` without an input, or a view.
        """
        source, seen = self.input, self._look_for_view()
        if not isinstance(source, VDISource):
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
            return source.vdi(source.view_for(*seen))
        return source.last()

    def vdi_to_pick(self, frame: Frame) -> VDI | None:
        """Return a VDI that has all of what a view shows; without a volume, the one there is."""
        vdi, view = self.vdi_asked_for(), frame.view
        if vdi is None or not isinstance(self.input, VDISource):
            return vdi
        whole = coverage(vdi, view.camera, view.size) == 1
        return vdi if whole else self.input.exact_vdi(view)

    def values_asked_for(self) -> DeferredVDI | None:
        """Return the values that are classified, made now if they are not.

        ``None`` where there are none, or no view to make them of.
        """
        self._look_for_view()
        return None if self.input is None else self.input.deferred

    def _look_for_view(self) -> tuple[Any, tuple[int, int], Any] | None:
        """Look at the scene between frames; return what the next picture sees the actor by."""
        source, actor, renderers = self.input, self.actor(), self.renderers
        if source is None or actor is None:
            return None
        matrix = as_array(actor.GetMatrix())
        source.note_scene(renderers, matrix)
        if not renderers:
            return None
        seen = actor.camera_to_come(renderers[0]), size_of(renderers[0]), matrix
        if isinstance(source, VDISource):
            return seen
        source.set_view_if_missing(*seen)
        if source.last() is None:
            source.look(camera_of(seen[0], matrix), self.device)
        return seen
