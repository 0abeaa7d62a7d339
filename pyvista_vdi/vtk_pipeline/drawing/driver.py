"""Draws the frames of a mapper, and answers whatever else VTK asks of it.

A frame is: VTK's event, what is seen of the scene, the plan, one raycast, a texture. The plan
itself is :func:`pyvista_vdi.quality.plan.plan`.
"""

from __future__ import annotations

import logging
import math
import weakref
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import (
    Cancelled,
    InvalidVolumeError,
    VDIError,
    VDIWarning,
    warn_external,
)
from pyvista_vdi.model.options import FrameRequest, RenderOptions
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.view import View, coverage
from pyvista_vdi.quality.background import BackgroundThread, Job, vdi_job
from pyvista_vdi.quality.plan import (
    SETTLED,
    Costs,
    Made,
    Making,
    Plan,
    Seen,
    ViewEstimate,
    lacking,
    plan,
)
from pyvista_vdi.quality.rate import FLOOR, reduced
from pyvista_vdi.quality.view_error import (
    ViewErrorEstimator,
    angle_from_generating_view,
    magnification,
)
from pyvista_vdi.raycasting.picking import FirstHit, Pick, pick_vdi
from pyvista_vdi.raycasting.prepared import release_from_devices
from pyvista_vdi.vtk_pipeline.drawing.frame import (
    Frame,
    Matrix,
    consumers,
    opaque_depth,
    planes_of,
    tiled,
    viewport,
)
from pyvista_vdi.vtk_pipeline.drawing.images import NOTHING, Drawn, VolumePicture, raycast
from pyvista_vdi.vtk_pipeline.drawing.overlap import group_of
from pyvista_vdi.vtk_pipeline.drawing.screen import Box, Textures, place_image
from pyvista_vdi.vtk_pipeline.drawing.settings import MapperSettings
from pyvista_vdi.vtk_pipeline.drawing.window import Timer, VDIStatus, Window, now
from pyvista_vdi.vtk_pipeline.filters.inputs import Input
from pyvista_vdi.vtk_pipeline.filters.source import Request, VDISource
from pyvista_vdi.vtk_pipeline.filters.view import as_array, camera_of, size_of

_log = logging.getLogger(__name__)

#: Views that a VDI is made to serve, degrees from its own, where its metadata do not say.
_VIEW_CONE = 60.0

#: Pictures as coarse as previews that tell what a volume's rays take, of which the fastest counts:
#: what disturbs one by milliseconds has the volume seem too slow to be drawn.
_TRIALS = 5


class Driver:
    """What happens behind a :class:`VDIMapper`, whose events call :meth:`begin` and :meth:`end`.

    It holds its actor and its windows weakly, so that nothing here keeps a scene alive. One thing
    at a time is made in the background of the frames, by one thread, which knows nothing of VTK
    (:mod:`pyvista_vdi.quality.background`); the methods are for the thread that draws.

    Attributes
    ----------
    making : Making or None
        The VDI that is being made in the background.
    """

    def __init__(self) -> None:
        self.actor: Callable[[], Any] = lambda: None
        self.settings = MapperSettings()
        self.input: Input | None = None
        self.said: set[Hashable] = set()  # warnings, or their causes
        self.failed: tuple[Any, ...] = ()  # stamps at which a VDI could not be made
        self.worker = BackgroundThread("pyvista-vdi generation")
        # The thread knows the worker alone, so that this can be collected while it works
        weakref.finalize(self, self.worker.clear).atexit = False
        self.box = Box()
        self._window: Callable[[], Window | None] = lambda: None  # of the last frame
        self.trouble: BaseException | None = None  # why a frame could not be drawn, the last time
        # What the last frame showed, and by what
        self._last, self._spare = NOTHING, NOTHING.pixels
        self._stand_in = False  # whether that was a volume whose VDI is to come
        self._textures = Textures()
        self._counted: Any = None  # the VDI that was shown last, weakly
        self._generation = 0  # how many were
        self._timer = Timer(self._tick)
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

    # What is drawn, and how

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI, and show its bounds to VTK at once."""
        if self.input is not None:
            self.input.drivers.discard(self)
            self.input.rest()
        self.input, self._last, self.failed = source, NOTHING, ()
        self.forget()
        if source is not None:
            source.drivers.add(self)
        self.box.show(source)

    def changed(self) -> None:
        """Look at what is before the input, which may be another by now, or play."""
        self.box.connect()
        self.follow()

    def release(self) -> None:
        """Free textures, images and what devices hold, and end what goes on; a frame begins anew.

        What lit the last frame stays.
        """
        held = [] if self.input is None else self.input.on_devices()
        if self._volume is not None:
            held.append(self._volume.request.volume)
        if isinstance(self.input, VDISource):
            self.input.keep_lights(self.renderers)
        self._timer.stop()
        if self.input is not None:
            self.input.rest()
        self.forget()
        self.worker.join()
        release_from_devices(held)
        self._textures.release()
        self._textures = Textures()  # they hold the image as well
        self._last, self._spare = replace(self._last, image=NOTHING.image, key=None), None

    # A frame

    def begin(self, mapper: Any, event: str) -> None:
        """Raycast and upload the image for the frame that has just begun."""
        actor, renderer, frame = self.actor(), self._renderer(), None
        if renderer is None:
            self.warn(
                "VDIMapper draws only behind its own VDIActor: use VDIActor in place of vtkVolume"
            )
        else:
            frame = self._guarded(Frame.current, renderer, actor, mapper)
        if frame is not None:  # and not beside the tile of a picture that is drawn
            self._window = weakref.ref(frame.window)
            # A selection draws numbers where the last frame showed something
            if renderer.GetSelector() is None:
                with suppress(VDIError):  # which what is drawn says
                    self.box.Update()
                self._last = self._guarded(self._paint, frame) or self._last
            drawn = self._last
            frame.window.pace.frame.preview |= drawn.preview
            # Pixels are interpolated, but not where the neighbours are another actor's
            smooth = drawn.preview and not drawn.joint
            vtk_window = renderer.GetRenderWindow()
            unit = self._textures.show(vtk_window, mapper, drawn.image, smooth=smooth)
            place_image(actor, unit, frame.origin, frame.full_size)
            self.follow(frame.window)
        self.box.begin(actor)

    def end(self, mapper: Any, event: str) -> None:
        """Release the texture units, and give the box its bounds again."""
        self.box.end()
        self._textures.let_go()
        if self.seen is not None and self.seen.hand:
            self.worker.pause(SETTLED)  # from now on

    def _paint(self, frame: Frame) -> Drawn:
        """Return the frame's image: the last one, or a new one."""
        shown = self._showing(frame)
        self._stand_in = shown is not None and shown.stand_in
        if shown is None:
            return self._last
        frame, window = shown, shown.window
        if frame.volume is None and len(window.shown_in(frame.renderer)) > 1:
            part = group_of(frame).part(frame)
            if part is not None:
                return part
        frame = replace(frame, depth=opaque_depth([frame]))
        # However the frame is to be: where it is there, full costs nothing
        share = 1 / self.settings.image_distance**2
        for size in dict.fromkeys((reduced(frame.full_size, share), self.preview_size(frame))):
            sized = frame.coarser(size)
            a, b = self._last.depth, sized.depth  # by their keys both have one, or neither has
            if self._last.key == sized.key and (a is None or b is None or np.array_equal(a, b)):
                return self._last
        # Raycast, and note what that took
        began = now()
        drawn = raycast(sized, self.settings.device, self._spare)
        seconds = now() - began
        self._spare = self._last.pixels
        window.pace.drawn(sized.size, sized.full_size, seconds, sized.way, sized.effort)
        # A volume's first picture has kernels compiled and voxels sent to the device
        gpu = not get_runtime(self.settings.device).is_cpu
        if sized.volume is None or sized.volume.pictures > 1:
            of = (sized.way, sized.angle, sized.covered_by(sized.bounds), seconds)
            self.costs = self.costs.took(*of, gpu=gpu)
        elif self.seen is not None and self.costs.volume is None:
            coarse, taken = frame.coarser(reduced(frame.full_size, FLOOR)), []
            for _ in range(_TRIALS):
                began = now()
                raycast(coarse, self.settings.device, None)
                taken.append(now() - began)
            pixels = coarse.covered_by(coarse.bounds)
            self.costs = self.costs.took("volume", 0.0, pixels, min(taken), gpu=gpu)
        return drawn

    def preview_size(self, frame: Frame) -> tuple[int, int]:
        """Return the size of this frame's image: that of the viewport, or less."""
        settings, window, renderer, share = self.settings, frame.window, frame.renderer, 1.0
        # What is kept is full: such a picture may have a camera that nothing was drawn with before
        kept = window.keeps_picture or not window.knows(renderer.GetActiveCamera())
        if settings.adjust and settings.target_fps != 0 and not (kept or frame.full):
            each, expected = self.costs.volume, None
            if frame.volume is not None and each is not None:
                expected = each * frame.covered_by(frame.bounds) + self.costs.fixed
            share = window.pace.share(
                window.rate(settings),
                math.prod(frame.full_size),
                min(1.0, 1 / frame.mapper.GetMaximumImageSampleDistance() ** 2),
                frame.way,
                effort=frame.effort,
                expected=expected,
            )
        return reduced(frame.full_size, min(share, 1 / settings.image_distance**2))

    def beside(self, mapper: Any, renderer: Any, matrix: Matrix) -> Frame | None:
        """Return the VDI as it is to be seen beside another one; ``None`` if it is not.

        Never raises. What is out of the picture is not brought up to date.
        """

        def in_picture() -> Frame | None:
            bounds = None if self.input is None else self.input.bounds()
            frame = Frame.current(renderer, self.actor(), mapper, matrix)
            if bounds is None or frame is None or frame.rectangle(bounds) is None:
                return None
            self._window = weakref.ref(frame.window)
            seen = self._showing(frame)
            return None if seen is None or seen.volume is not None else seen

        return self._guarded(in_picture)  # type: ignore[no-any-return]

    # What a frame shows

    def _showing(self, frame: Frame) -> Frame | None:
        """Return the frame of what is to be seen, brought up to date; ``None`` for nothing.

        VTK is shown its bounds.
        """
        source, renderer, matrix = self.input, frame.renderer, frame.model_transform
        if source is None:
            return None
        renderers = self.renderers
        source.note_scene(renderers, matrix)
        source.set_view_if_missing(renderer.GetActiveCamera(), size_of(renderer), matrix)
        if isinstance(source, VDISource):
            shown = self._of_volume(source, frame, renderers)
        else:
            shown = self._stored(source, frame)
        if shown is not None:
            self.box.place(shown.bounds)
            if shown.volume is None and shown.seen != self._counted:
                self._counted = shown.seen
                self._generation += 1
        return shown

    def _of_volume(self, source: VDISource, frame: Frame, renderers: list[Any]) -> Frame | None:
        """Return the frame of a volume or its VDI, as is planned by all that is seen."""
        try:
            seen = self._look(source, frame, renderers)
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
            if self._volume is None and source.last is None:
                raise
            self._complain(error)
            planned, shown = Plan("vdi"), self._volume or source.last
        if shown is None:
            return None
        # A volume has the light of its VDI in a window, so that nothing jumps
        by_vdi = self.seen is not None and source.last is not None
        lit_from = frame.view.camera if not by_vdi or self.settings.draw == "volume" else None
        return frame.showing(shown, lit_from=lit_from, full=planned.full, stand_in=planned.stand_in)

    def _stored(self, source: Input, frame: Frame) -> Frame | None:
        """Return the frame of a VDI that has no volume, and say what it lacks."""
        stamp, self.view = source.stamp(), frame.view
        source.look(frame.view.camera, self.settings.device)
        if stamp is None or stamp not in self.failed:
            self._update(source)
        vdi = source.last
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

    def _look(self, source: VDISource, frame: Frame, renderers: list[Any]) -> Seen:
        """Look at all that decides what the frame shows."""
        window, settings, view = frame.window, self.settings, frame.view
        # What is drawn in several views is out of date in none of them by itself
        one_view = len(renderers) == 1 and len(source.drivers) == 1
        joint = len(window.shown_in(frame.renderer)) > 1 and len(group_of(frame).members) > 1
        # Work may go on behind the frames where somebody watches, and can move
        vtk_window = window.vtk_window()
        here = bool(vtk_window.GetShowWindow()) and vtk_window.GetInteractor() is not None
        watched = one_view and (here or settings.off_screen)
        stamp = source.stamp()
        if self._wanted is None or self._wanted[0] != stamp or self._wanted[1] is None:
            request, trouble = None, None
            try:
                request = source.MakeRequest()
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
        if watched and trouble is not None and stamp != self._stamp and source.last is not None:
            self._complain(trouble)
        self._stamp = stamp
        vdi, made_of = source.last, source.made_of
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
            made=None if vdi is None else self._as_made(vdi, frame, made_of),
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
            seen_by, size = frame.renderer.GetActiveCamera(), size_of(frame.renderer)
            source.follow_if_changed(seen_by, size, frame.model_transform)
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
        made, request, mapper = source.last, source.made_of, self.actor().GetMapper()
        assert made is not None and request is not None  # noqa: PT018
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
            return source.last
        if planned.show == "trouble":
            assert trouble is not None
            raise trouble
        if planned.show == "exact":
            return source.exact_vdi(frame.view, frame.full_size)
        if self._volume is None or self._volume.request.content != planned.content:
            self._volume = None  # its buffers go before others are taken
            request = source.made_of
            if request is None or request.content != planned.content:
                request = wanted
            assert request is not None
            if planned.in_bricks and request.screen != frame.view:  # for pictures of that size
                request = source.MakeRequest(frame.view)
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
        if self.input is not None and self.input.playing:
            try:
                return bool(self.input.player.advance())
            except Exception as error:
                self._complain(error)
                return False
        if self._asked is None:
            return False
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
    def goes_on(self) -> bool:
        """Whether something goes on, or is to begin at rest, that the event loop has to look at."""
        playing = self.input is not None and self.input.playing
        unsettled = self.seen is not None and not self.seen.settled
        return self._asked is not None or playing or unsettled

    def follow(self, window: Window | None = None) -> None:
        """Start the event loop's timer, if something goes on and no hand moves."""
        window = self._window() if window is None else window
        if window is not None and self.goes_on and not window.moving:
            self._timer.start(window.vtk_window().GetInteractor())

    def _tick(self) -> None:
        """Look, from the event loop, at what goes on, and have shown what is new."""
        window = self._window()
        if window is None or window.started is not None:
            return
        settled = self.seen is None or self.seen.settled
        another = self.advance() or (not settled and now() - self._moved_at >= SETTLED)
        if window.moving or not (another or self.goes_on):
            self._timer.stop()
        interactor = self._timer.interactor()
        if another and interactor is not None:
            interactor.Render()

    # Errors in a frame

    def _guarded(self, draw: Callable[..., Any], *of: Any) -> Any:
        """Return what a part of drawing returns, or ``None`` and say what went wrong."""
        try:
            return draw(*of)
        except (Exception, KeyboardInterrupt) as error:  # VTK would swallow it
            if isinstance(error, InvalidVolumeError):  # as VTK's mappers: there is nothing to see
                self._last = NOTHING
                with suppress(VDIError):
                    self.box.place(None if self.input is None else self.input.bounds())
            said = f"the VDI cannot be drawn: {type(error).__name__}: {error}"
            again = isinstance(self.input, VDISource)
            self.warn(f"{said}; actor.regenerate() tries again" if again else said, error)
            # Without the frames that it came from, which hold buffers
            self.trouble = error.with_traceback(None)
            error.__cause__ = error.__context__ = None
        return None

    # What is asked for between frames

    def vdi_asked_for(self) -> VDI | None:
        """Return the VDI, made now where there is none, or of what is no longer so.

        It is of the view that the first picture had, or that somebody chose; before the first
        picture, of the view that this would have now. ``None`` without an input, or a view.
        """
        source, seen = self.input, self._look_for_view()
        if not isinstance(source, VDISource):
            if source is None or (source.last is not None and source.prop is None):
                return None if source is None else source.last
            return source.vdi()  # in the colours that its property has by now
        if source.GetCamera() is not None and source.GetWindowSize() is not None:
            # Unless frames keep it up to date, or will
            kept = self.settings.draw == "vdi" or self.making is not None
            if source.last is None or not kept:
                self.drop()
                if source.stamp() not in self.failed:
                    self._update(source)
        elif seen is not None:
            return source.vdi(source.view_for(*seen))
        return source.last

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
        if source.last is None:
            source.look(camera_of(seen[0], matrix), self.settings.device)
        return seen

    def status(self) -> VDIStatus:
        """Return how the last frame was drawn, and what goes on."""
        last, view, window = self._last, self.view, self._window()
        vdi = None if self.input is None else self.input.last
        player = None if self.input is None else self.input.player
        shown = None if vdi is None or view is None else (vdi, view.camera, view.size)
        known = None if vdi is None else self.estimate
        return VDIStatus(
            mode="none" if last.full_size is None else "preview" if last.preview else "full",
            samples=0 if last.full_size is None else last.image.size // 4,
            full_samples=math.prod(last.full_size or (0, 0)),
            fps=None if window is None else window.pace.fps,
            angle=None if shown is None else angle_from_generating_view(*shown[:2]),
            magnification=None if shown is None else magnification(*shown),
            coverage=None if shown is None else coverage(*shown),
            ssim=known.ssim if known is not None and known.vdi() is vdi else None,
            progress=self.worker.progress if self.making is not None else None,
            generation=self._generation,
            vdi=vdi,
            stand_in=self._stand_in,
            drawn=last.way,
            time=None if player is None else player.time,
        )

    def pick(self, renderer: Any, x: float, y: float, hit: FirstHit) -> Pick | None:
        """Return what of the VDI a renderer shows at a place of its window, in pixels."""
        kept, window = self.values_asked_for(), Window.of(renderer.GetRenderWindow())
        shown = [v for v in window.shown_in(renderer) if v.driver is self and v.visible]
        if not shown or not shown[0].actor.GetPickable():
            return None
        placed = shown[0]
        frame = Frame.current(renderer, placed.actor, placed.mapper, placed.matrix, drawing=False)
        vdi = None if frame is None else self.vdi_asked_for()
        if frame is None or vdi is None:
            return None
        # With a volume, of a VDI that has all of what the view shows
        view, source = frame.view, self.input
        if isinstance(source, VDISource) and coverage(vdi, view.camera, view.size) < 1:
            vdi = source.exact_vdi(view, view.size)
        seen = frame.showing(vdi)
        (left, bottom), request = seen.origin, FrameRequest(seen.camera, seen.size, seen.options)
        picked = pick_vdi(vdi, request, (int(x) - left, int(y) - bottom), hit, kept)
        # What the last frame drew there may hide it
        drawn = not renderer.GetRenderWindow().GetNeverRendered()
        z = np.array([renderer.GetZ(int(x), int(y)) if drawn else 1.0])
        if picked is None or picked.depth > seen.view_depth(z)[0]:
            return None
        # From the frame's world, whose origin is the eye, to the scene's
        px, py, pz, _ = np.linalg.solve(seen.to_view, [*picked.position, 1.0]).tolist()
        return replace(picked, position=(px, py, pz))

    # Renderers

    @property
    def renderers(self) -> list[Any]:
        """All renderers that show the actor, by itself or as a part of an assembly."""
        found: list[Any] = []
        for each in consumers(self.actor()):
            if each.IsA("vtkRenderer") and each not in found:
                found.append(each)
        return found

    def _renderer(self) -> Any:
        """Return the renderer that is drawing the actor; ``None`` if none is."""
        drawing = []
        for each in self.renderers:
            vtk_window = each.GetRenderWindow()
            if vtk_window is not None and vtk_window.CheckInRenderStatus():
                drawing.append(each)
        if len(drawing) < 2:
            return drawing[0] if drawing else None
        for each in drawing:
            window = Window.of(each.GetRenderWindow())
            window.shown_in(each)  # from now on it is known which one draws
            if window.active.Get() is each:
                return each
        # The first frame that shows the actor twice: tell them apart by their viewports
        return next((each for each in drawing if viewport(each) == tiled(each)), drawing[0])
