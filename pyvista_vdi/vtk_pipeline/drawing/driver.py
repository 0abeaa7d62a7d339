"""Draws the frames of a mapper, and answers whatever else VTK asks of it.

A frame is: VTK's event, what is seen of the scene, the plan, one raycast, a texture. What it shows
and what is made for it says :func:`pyvista_vdi.quality.plan.plan`; here that is done.
"""

from __future__ import annotations

import itertools
import logging
import math
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, Literal, TypeAlias

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import Cancelled, InvalidArgumentError, InvalidVolumeError, VDIError
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
    ssim_of,
)
from pyvista_vdi.quality.rate import reduced
from pyvista_vdi.quality.view_error import angle_from_generating_view, magnification
from pyvista_vdi.raycasting.picking import FirstHit, Pick
from pyvista_vdi.raycasting.prepared import release_from_devices
from pyvista_vdi.vtk_pipeline.drawing.background import Background, Estimators
from pyvista_vdi.vtk_pipeline.drawing.box import Box
from pyvista_vdi.vtk_pipeline.drawing.depth import OpaqueDepths
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, Matrix, consumers, viewport
from pyvista_vdi.vtk_pipeline.drawing.images import NOTHING, Drawn, Images, VolumePicture
from pyvista_vdi.vtk_pipeline.drawing.overlap import Overlaps, overlapped
from pyvista_vdi.vtk_pipeline.drawing.refused import effects_without
from pyvista_vdi.vtk_pipeline.drawing.screen import (
    ImageTexture,
    NoDepth,
    Scissor,
    place_image,
    shown_box,
)
from pyvista_vdi.vtk_pipeline.drawing.selection import Selection
from pyvista_vdi.vtk_pipeline.drawing.settings import MapperSettings
from pyvista_vdi.vtk_pipeline.filters.inputs import ROUNDING, Input, SourceInput
from pyvista_vdi.vtk_pipeline.filters.source import Request
from pyvista_vdi.vtk_pipeline.filters.view import as_array, camera_of, renderer_view, size_of
from pyvista_vdi.vtk_pipeline.interaction import browser
from pyvista_vdi.vtk_pipeline.interaction.browser import SceneAtHand
from pyvista_vdi.vtk_pipeline.interaction.status import CornerTexts, VDIStatus, Warnings
from pyvista_vdi.vtk_pipeline.interaction.timer import PERIOD, Timer
from pyvista_vdi.vtk_pipeline.interaction.window import Met, Window, now
from pyvista_vdi.vtk_pipeline.vtk import vtkWeakReference, weakly

_log = logging.getLogger(__name__)

#: What is said where another volume has the mapper.
_BEHIND_ANOTHER = (
    "VDIMapper draws only behind its own VDIActor, and is behind another volume: use VDIActor in "
    "place of vtkVolume, also for copies (VDIActor().ShallowCopy(actor))"
)
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


class Driver:
    """What happens behind a :class:`VDIMapper`; its observers call :meth:`begin` and :meth:`end`.

    It holds its actor and its windows weakly, so that nothing here keeps a scene alive.
    """

    def __init__(self) -> None:
        self.settings = MapperSettings()
        self.device: Any = None
        self.input: Input | None = None
        self.box, self.texts = Box(), CornerTexts()
        self._actor: Callable[[], Any] = lambda: None
        self._window: Callable[[], Window | None] = lambda: None  # of the last frame
        self._active = vtkWeakReference()  # which renderer is between its start and its end
        self._watched = Met()
        self._warnings = Warnings()
        self._trouble: BaseException | None = None  # for raise_trouble
        self._astray = False  # whether something else than the actor draws
        # What the last frame showed, and by what
        self._images, self._last = Images(), NOTHING
        self._stand_in = False  # whether that was a volume whose VDI is to come
        self._texture, self._no_depth, self._scissor = ImageTexture(), NoDepth(), Scissor()
        self._style: tuple[bool, bool] | None = None  # how the shader shows it, in no selection
        self._selection, self._scene_at_hand = Selection(), SceneAtHand(self._say_not_exported)
        self._view: View | None = None
        self._counted = self._generation = 0  # the VDI that was shown last, and how many were
        # What plans go by
        self._background, self._timer = Background(), Timer(self._tick)
        self._costs = Costs()
        self._forget()

    def _forget(self, *, failures: bool = True) -> None:
        """Forget all that was seen, and what is being made."""
        self._background.drop_vdi()
        self._background.drop_estimate()
        self._background.forget_volume()
        self._estimators = Estimators()
        self._volume: VolumePicture | None = None
        self._wanted: tuple[Any, Request | None, Exception | None] | None = None  # and the stamp
        self._refused: tuple[Any, str] | None = None  # a content that the device cannot draw
        self._making: Making | None = None
        self._estimate: ViewEstimate | None = None
        self._pictures, self._costs = Pictures(), Costs()
        self._seen: Seen | None = None  # the last frame that somebody watched
        self._stamp: Any = None  # of all that it depended on
        self._moved_at, self._number = -math.inf, (0, 0)  # and of what frame of which window
        self._pixels = 0.0  # of the last frame, in which the volume may be seen
        if failures:
            self._failed: tuple[Any, ...] = ()  # stamps at which a VDI could not be made

    # What is drawn, and how

    def set(self, **settings: Any) -> bool:
        """Keep what a user sets; whether it is another value."""
        before, self.settings = self.settings, replace(self.settings, **settings)
        return self.settings != before

    def set_actor(self, actor: Any) -> None:
        """Remember whose matrix and renderers count."""
        other = self._actor()
        if other is not None and other is not actor:
            raise InvalidArgumentError(
                "this VDIMapper is already behind another VDIActor: give each actor its own "
                "(the VDI itself can be shared)"
            )
        self._actor, self._style = weakly(actor), None

    def leave_actor(self, actor: Any) -> None:
        """Forget that actor, if it is this one."""
        if self._actor() is actor:
            self._actor = lambda: None

    @property
    def actor(self) -> Any:
        """The actor that this draws for, whose matrix and renderers count; ``None`` without one."""
        return self._actor()

    @property
    def window(self) -> Window:
        """That of the last frame."""
        window = self._window()
        assert window is not None
        return window

    @property
    def proxy(self) -> Any:
        """The image whose box VTK draws in place of the VDI."""
        return self.box.image

    def runtime(self) -> Runtime:
        """Return the device that raycasts."""
        return get_runtime(self.device)

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI, and show its bounds to VTK at once."""
        weak = weakref.ref(self)

        def changed(*_: Any) -> None:
            driver = weak()
            if driver is not None:
                driver.box.connect()

        if self.input is not None:
            self.input.watch(None)
            self.input.rest()
        self.input, self._last = source, NOTHING
        self._forget()
        if source is not None:
            source.watch(changed)
        self.box.show(source)

    def retry(self) -> None:
        """Try again what failed before, and give up what is being made in the background."""
        self._drop()
        self._failed = ()
        self._warnings.forget()

    def release(self) -> None:
        """Free textures, images and what devices hold, and end what goes on; a frame begins anew.

        What lit the last frame stays.
        """
        held = [] if self.input is None else self.input.on_devices()
        if self._volume is not None:
            held.append(self._volume.request.volume)
        if isinstance(self.input, SourceInput):
            self.input.keep_lights(self.renderers())
        self._timer.stop()
        if self.input is not None:
            self.input.rest()
        self._forget(failures=False)
        self._background.close()
        release_from_devices(held)
        self._texture.release()
        self._no_depth.release()
        self._selection.release()
        self._images.clear()

    @property
    def holds_images(self) -> bool:
        """Whether images are kept, or a texture."""
        return self._images.any or self._texture.there

    # A frame

    def begin(self, mapper: Any) -> None:
        """Raycast and upload the image for the frame that has just begun."""
        actor, renderer = self._actor(), self.renderer()
        # Else a copy of the actor by vtkVolume.ShallowCopy draws, in another window
        self._astray = renderer is None or not _is_drawing(renderer)
        if self._astray:
            self._warnings.warn(_BEHIND_ANOTHER)
            self.box.place((0.0,) * 6)  # nothing is seen of it
            if actor is not None:  # whose shader the copy has
                place_image(actor, 0, (0, 0), (1, 1))
            return
        origin, size = viewport(renderer)
        if min(size) == 0:  # beside the tile of a picture that is drawn
            return
        # VTK asks for four where the actor's property says that they are dependent
        components = 1 if actor.GetProperty().GetIndependentComponents() else 4
        if self.box.components != components:
            self.box.give_components(components)
        window = renderer.GetRenderWindow()
        of_window = Window.of(window)
        self._window = weakref.ref(of_window)
        if renderer.GetSelector() is not None:
            self._select(mapper, renderer)
            return
        effects = effects_without(renderer)
        for text in effects.values():
            self._warnings.warn(text)
        style = ("vtkSSAOPass" in effects, "vtkDualDepthPeelingPass" in effects)
        if style != self._style:
            self._selection.leave(actor, occluded=style[0], peeled=style[1])
            self._style = style
        with suppress(VDIError):  # which what is drawn says
            self.box.Update()
        drawn = self._last = self._guarded(self._paint, mapper, renderer) or self._last
        of_window.pace.frame.preview |= drawn.preview
        if window.GetInteractor() is not None:
            of_window.listen(window.GetInteractor())
        unit = self._texture.show(window, drawn.image, drawn.number, smooth=drawn.smooth)
        place_image(actor, unit, origin, size)
        if drawn.smooth:
            self._scissor.narrow(window, shown_box(drawn.image, origin, size))
        self._no_depth.show(window, mapper)
        self.texts.write(renderer, self.status)
        self.follow(window)

    def end(self) -> None:
        """Release the texture unit, and draw everywhere again."""
        self._scissor.end()
        if self._astray:
            self.box.Modified()  # it has its bounds again
        self._texture.let_go()
        self._no_depth.let_go()
        self._selection.texture.let_go()
        if self._seen is not None and self._seen.hand:
            self._background.pause(SETTLED)  # from now on

    def _paint(self, mapper: Any, renderer: Any) -> Drawn:
        """Return the frame's image: one that is kept, or a new one."""
        frame = self._showing(Frame.current(renderer, self._actor(), mapper))
        self._stand_in = frame is not None and frame.stand_in
        if frame is None:
            return self._last
        window, settings = self.window, self.settings
        if frame.volume is None and len(window.shown_in(renderer)) > 1:
            part = window.shared(Overlaps).part(frame)
            if part is not None:
                return part
        depth = window.shared(OpaqueDepths).read([frame])
        frame = frame if depth is None else replace(frame, depth=depth)
        drawn = self._images.get(
            frame.coarser(reduced(frame.full_size, 1 / settings.image_distance**2))
        )
        if drawn is not None:
            return drawn  # however the frame is to be: where it is there, full costs nothing
        frame = frame.coarser(self.preview_size(frame))
        drawn = self._images.get(frame) if frame.preview else None
        if drawn is not None:
            return drawn
        # Raycast, and note what that took
        began = now()
        drawn = self._images.raycast(frame, self.device)
        seconds = now() - began
        window.pace.drawn(frame.size, frame.full_size, seconds, frame.way, frame.effort)
        # A volume's first picture has kernels compiled and voxels sent to the device
        if frame.volume is None or frame.volume.pictures > 1:
            took = (frame.way, frame.angle, frame.covered, seconds)
            self._costs = self._costs.took(*took)
        return drawn

    def preview_size(self, frame: Frame) -> tuple[int, int]:
        """Return the size of this frame's image: that of the viewport, or less."""
        settings, window, renderer, share = self.settings, self.window, frame.renderer, 1.0
        if frame.full or not settings.previews:
            window.knows(renderer.GetActiveCamera())
        elif not window.takes_picture(renderer):
            each = self._costs.volume
            known = frame.volume is not None and each is not None
            share = window.pace.share(
                window.rate(settings),
                math.prod(frame.full_size),
                min(1.0, 1 / frame.mapper.GetMaximumImageSampleDistance() ** 2),
                frame.way,
                effort=frame.effort,
                expected=each * frame.covered if known else None,  # type: ignore[operator]
            )
        return reduced(frame.full_size, min(share, 1 / settings.image_distance**2))

    # What a frame shows

    def _showing(self, frame: Frame) -> Frame | None:
        """Return the frame of what is to be seen, brought up to date; ``None`` for nothing."""
        source, settings = self.input, self.settings
        window = Window.of(frame.renderer.GetRenderWindow())
        self._window = weakref.ref(window)
        volumes = window.shown_in(frame.renderer)
        for each in volumes:
            if each.mapper is frame.mapper and each.driver is None:
                self._warnings.warn(_BEHIND_ANOTHER)
        if source is None:
            return None
        renderers = self.renderers()
        source.note_scene(renderers, frame.model_transform)
        if settings.automatic_view:
            source.set_view_if_missing(*_seen_from(frame))
        if isinstance(source, SourceInput):
            # What is drawn in several views is out of date in none of them by itself
            one_view = len(renderers) == 1 and source.alone
            joint = len(volumes) > 1 and overlapped(frame)
            shown = self._planned(source, frame, joint=joint, one_view=one_view)
        else:
            shown = self._stored(source, frame)
        if shown is None:
            return None
        self.box.place(shown.bounds)
        if shown.volume is None and shown.number != self._counted:
            self._counted = shown.number
            self._generation += 1
        # A volume has the light of its VDI in a window, so that nothing jumps
        volume, view = shown.volume, frame.view
        if volume is not None:
            by_vdi = self._seen is not None and source.last() is not None
            by_vdi = by_vdi and settings.draw != "volume"
            if volume.shaded and view is not None and not by_vdi:
                shown = replace(shown, lit_from=view.camera)
            return shown
        parts = source.parts()
        if len(parts) < 2 or parts[0][0] is not shown.vdi:
            return shown
        blend = tuple((number_of(vdi), weight) for vdi, weight in parts)
        return replace(shown, parts=tuple(parts), blend=blend)

    def _stored(self, source: Input, frame: Frame) -> Frame | None:
        """Return the frame of a VDI that has no volume, and say what it lacks."""
        view, stamp = frame.view, source.stamp()
        assert view is not None
        self._view = view
        source.look(view.camera, self.device)
        if stamp is None or stamp not in self._failed:
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
                self._warnings.warn(message, cause=(cause, (vdi.camera, vdi.window_size)))
        return replace(shown, full=not self.window.previews(self.settings))

    def _planned(
        self, source: SourceInput, frame: Frame, *, joint: bool, one_view: bool
    ) -> Frame | None:
        """Plan a frame of what comes from a volume, do that, and return what the frame shows."""
        settings = self.settings
        try:
            seen, sighted = self._look(source, frame, joint=joint, one_view=one_view)
            while True:
                planned = plan(seen)
                self._costs, self._pictures = planned.costs, planned.pictures
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
                    known: dict[str, Any] = {"volume": kind, "making": self._making}
                    known["estimating"] = self._background.estimating
                    seen = replace(seen, first_look=False, **known)
        except Cancelled as error:
            if self._volume is None and source.last() is None:
                raise
            self._complain(error)
            planned, sighted, shown = Plan("vdi"), None, self._volume or source.last()
        if shown is None:
            return None
        if isinstance(shown, VolumePicture):
            found = frame.showing(shown, shown.number)
        elif sighted is not None and sighted.vdi is shown and settings is self.settings:
            found = sighted
        else:
            found = frame.showing(shown, number_of(shown))
        return replace(found, full=planned.full, stand_in=planned.stand_in)

    def _look(
        self, source: SourceInput, frame: Frame, *, joint: bool, one_view: bool
    ) -> tuple[Seen, Frame | None]:
        """Look at all that decides what the frame shows; also return the VDI as it shows it."""
        window, settings, view = self.window, self.settings, frame.view
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
        time, moving = now(), window.moving(settings)
        if view != self._view:
            self._moved_at = time
        elif not moving and first:
            self._moved_at = min(self._moved_at, time - SETTLED)
        self._view = view
        if watched and trouble is not None and stamp != self._stamp and source.last() is not None:
            self._complain(trouble)
        self._stamp = stamp
        # The VDI made last, as this view shows it
        vdi, request = source.last(), source.source.GetCurrentRequest()
        made, sighted = None, None
        if vdi is not None and request is not None:
            sighted = frame.showing(vdi, number_of(vdi))
            made = self._as_made(vdi, sighted, request)
        by_policy, failed = callable(settings.regenerate), stamp in self._failed
        asks = by_policy and first and one_view and made is not None
        asks = asks and not (watched and (self._making is not None or failed))
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
            regenerate="ask" if by_policy else settings.regenerate,  # type: ignore[arg-type]
            wish=asks and self._policy_says(),
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
            making=self._making,
            estimating=self._background.estimating,
            estimate=self._estimate,
            failed=failed,
            volume=volume,  # type: ignore[arg-type]
            late=watched and self._late,
            seconds=1 / (window.pace.headroom * window.rate(settings)) if previews else None,
            costs=self._costs,
            pictures=self._pictures,
        )
        self._seen = seen if watched else None
        if watched:
            # A hand that moves has the machine
            self._background.pause(SETTLED if seen.hand else 0)
            if made is None and wanted is not None and settings.draw != "volume":
                self._background.prepare(wanted)
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

    @property
    def _late(self) -> bool:
        """Whether the volume's own full frames of the last view miss the rate."""
        each, settings, window = self._costs.volume, self.settings, self.window
        if each is None or settings.target == 0:
            return False
        return window.pace.late(each * self._pixels, window.rate(settings))

    # What is planned is done

    def _do(self, planned: Plan, seen: Seen, source: SourceInput, frame: Frame | None) -> None:
        """Begin, or give up, what goes on in the background, and make what a frame waits for."""
        if planned.give_up:
            self._drop()
        if planned.view is not None and frame is not None:
            camera, size, matrix = _seen_from(frame)
            if planned.view == "take":
                source.take_camera(camera, matrix)
                source.take_size(size)
            else:
                source.follow_if_changed(camera, size, matrix)
        if planned.make is not None:
            self._background.drop_estimate()
            try:
                request = source.source.MakeRequest(planned.make)
            except Exception as error:  # what is shown can still be drawn
                self._fail(error)
            else:
                for_view = not (seen.stale or seen.chosen)
                self._making = Making(request.content, planned.make, for_view)
                self._background.generate(request)
        if planned.estimate == "background":
            vdi, of, made = source.last(), source.source.GetCurrentRequest(), seen.made
            assert vdi is not None and of is not None and made is not None  # noqa: PT018
            self._background.estimate(made.number, vdi, of, seen.view, made.options)
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
            self._failed = (*self._failed[-1:], source.stamp())
            raise

    def _drop(self) -> None:
        """Cancel what is being made in the background."""
        self._background.drop_vdi()
        self._background.drop_estimate()
        self._making = None
        if self.settings.draw == "vdi":
            self._volume = None  # which stood in

    def _fail(self, error: BaseException) -> None:
        """Note that a VDI cannot be made of what there is now, and say it once."""
        self._making, self._failed = None, (*self._failed[-1:], self._stamp)
        self._background.drop_estimate()
        self._complain(error)

    def _complain(self, error: BaseException) -> None:
        said = None if self.input is None else self.input.complaint(error)
        usual = (
            f"the VDI cannot be made anew: {type(error).__name__}: {error}; what was shown stays, "
            "and actor.regenerate() tries again"
        )
        self._warnings.warn(said or usual, error)

    def _policy_says(self) -> bool:
        """Return what the user's function says of the frame's view."""
        policy = self.settings.regenerate
        try:
            return callable(policy) and bool(policy(self.status()))
        except Exception as error:
            self._complain(error)
            return False

    def _judged(
        self, source: SourceInput, frame: Frame, sighted: Frame | None
    ) -> ViewEstimate | Literal[False]:
        """Estimate the error of the VDI in the frame's view now; False if it cannot be."""
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
            error = self._estimators.estimate(
                made, runtime, vdi, frame.view, options, background=background
            )
        except VDIError:  # no memory for it, say: the volume's picture is right
            _log.debug("the error of a view cannot be estimated", exc_info=True)
            return False
        return ViewEstimate(*of, ssim=error.ssim, contrast=error.contrast, options=options)

    # Between frames

    def between_frames(self) -> bool:
        """Take what was made in the background; whether there is another VDI to be drawn."""
        try:
            another = None if self.input is None else self.input.advance()
        except Exception as error:
            self._complain(error)
            return False
        if another is None:
            another = self._take_finished()
        if another:
            # Gone before the frame begins: freeing hundreds of megabytes takes its time
            self._images.clear()
        return another

    def _take_finished(self) -> bool:
        swapped = False
        for kind, made in self._background.finished():
            if isinstance(made, BaseException):
                if kind != "took":
                    self._fail(made)
            elif kind == "took":
                self._costs = self._costs.took("volume", 0.0, *made)
            elif kind == "estimate":
                self._estimate = made
            elif self._making is not None and isinstance(self.input, SourceInput):
                request = self._background.request
                assert request is not None
                self.input.source.TakeVDI(made, request)
                self._making = self._estimate = self._background.request = None
                if self.settings.draw == "vdi":
                    self._volume = None
                swapped = True
        return swapped

    def _begin_at_rest(self) -> None:
        """Begin what a view at rest is missing, though no frame asks."""
        source, seen = self.input, self._seen
        if not isinstance(source, SourceInput) or seen is None or source.stamp() != self._stamp:
            return  # what has changed is for a frame to look at
        still, moving = now() - self._moved_at >= SETTLED, self.window.moving(self.settings)
        self._seen = seen = replace(
            seen,
            hand=moving and not still,
            settled=still and not moving,
            first_look=False,
            wish=False,
            late=self._late,
            making=self._making,
            estimating=self._background.estimating,
            estimate=self._estimate,
            failed=self._stamp in self._failed,
            costs=self._costs,
        )
        planned = plan(seen)
        self._do(replace(planned, view=None, update=False), seen, source, None)

    @property
    def _goes_on(self) -> bool:
        """Whether something goes on that the event loop has to look at."""
        seen, background = self._seen, self._background
        if self._making is not None or background.estimating:
            return True
        if seen is not None and (background.preparing or now() - self._moved_at < SETTLED):
            return True
        return self.input is not None and self.input.busy

    @property
    def following(self) -> bool:
        """Whether the event loop looks at it."""
        return self._timer.running

    def follow(self, window: Any) -> None:
        """Start the event loop's timer, if something goes on and no hand moves."""
        if self._goes_on and not Window.of(window).moving(self.settings):
            period = PERIOD if self.input is None else self.input.period or PERIOD
            in_loop = browser.watches(window)
            self._timer.start(window.GetInteractor(), period, in_loop=in_loop)

    def _tick(self) -> None:
        """Look, from the event loop, at what goes on, and have shown what is new."""
        window = self._window()
        if window is None or window.drawing:
            return
        swapped = self.between_frames()
        if not swapped:
            self._begin_at_rest()
        if not self._goes_on:
            self._timer.stop()
        if swapped or self.texts.are_behind(self._background.progress):
            window.render()

    # Errors in a frame

    def _guarded(self, draw: Callable[[Any, Any], Any], mapper: Any, renderer: Any) -> Any:
        """Return what a part of drawing returns, or ``None`` and say what went wrong."""
        try:
            return draw(mapper, renderer)
        except KeyboardInterrupt as interrupt:
            self._warnings.warn(
                "generating the VDI was interrupted: what was shown stays; call "
                "actor.regenerate() to try again"
            )
            self._note(interrupt)
        except Exception as error:  # VTK would swallow it
            if isinstance(error, InvalidVolumeError):  # as VTK's mappers: there is nothing to see
                self._last = NOTHING
                with suppress(VDIError):
                    self.box.place(None if self.input is None else self.input.bounds())
            self._warnings.warn(f"the VDI cannot be drawn: {type(error).__name__}: {error}", error)
            self._note(error)
        return None

    def raise_trouble(self) -> None:
        """Raise, once, what a frame could not be drawn for: VTK's renderer lets nothing through."""
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble

    def _note(self, error: BaseException) -> None:
        """Keep the first error for :meth:`raise_trouble`, without the frames that it came from."""
        if self._trouble is None:
            self._trouble = error.with_traceback(None)
            error.__cause__ = error.__context__ = None

    # Picks, neighbours, exports and status

    def say_not_exported(self) -> None:
        """Warn once that a scene which is written for another renderer lacks the VDI.

        Not yet where trame has the scene at hand, and shows the pictures that are drawn here.
        """
        renderer = self.renderer()
        window = None if renderer is None else renderer.GetRenderWindow()
        if window is None or not self._scene_at_hand.is_all(window):
            self._say_not_exported()

    def _say_not_exported(self) -> None:
        self._warnings.warn(
            "the scene is being exported without its VDI: trame's export_html, export_vtksz and "
            "views that are rendered in the browser (client-side) get an empty box in its place; "
            "use plotter.vdi.export_html, screenshots, movies, or server-side rendering"
        )

    def status(self) -> VDIStatus:
        """Return how the last frame was drawn, and what goes on."""
        last, view, window = self._last, self._view, self._window()
        vdi = None if self.input is None else self.input.last()
        player = None if self.input is None else self.input.player
        shown = None if vdi is None or view is None else (vdi, view.camera, view.size)
        wide, high = last.full_size or (0, 0)
        number = None if vdi is None else number_of(vdi)
        return VDIStatus(
            mode="none" if last.full_size is None else "preview" if last.preview else "full",
            samples=0 if last.full_size is None else last.image.size // 4,
            full_samples=wide * high,
            fps=None if window is None else window.pace.fps,
            angle=None if shown is None else angle_from_generating_view(*shown[:2]),
            magnification=None if shown is None else magnification(*shown),
            coverage=None if shown is None else coverage(*shown),
            ssim=ssim_of(self._pictures, self._estimate, number, view),
            progress=self._background.progress,
            generation=self._generation,
            vdi=vdi,
            stand_in=self._stand_in,
            drawn=last.way,
            time=None if player is None else player.time,
        )

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
            kept = self.settings.draw == "vdi" or self._making is not None
            if source.last() is None or not kept:
                self._drop()
                if source.stamp() not in self._failed:
                    self._update(source)
        elif seen is not None and self.settings.automatic_view:
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

    def values_asked_for(self) -> DeferredVDI | None:
        """Return the values that are classified, made now if they are not.

        ``None`` where there are none, or no view to make them of.
        """
        if self.input is None:
            return None
        self._look_for_view()
        return self.input.deferred

    def _look_for_view(self) -> tuple[Any, tuple[int, int], Any] | None:
        """Look at the scene between frames; return what the next picture sees the actor by."""
        source, actor, renderer = self.input, self._actor(), self.renderer()
        if source is None or actor is None:
            return None
        matrix = as_array(actor.GetMatrix())
        source.note_scene(self.renderers(), matrix)
        if renderer is None:
            return None
        seen = actor.camera_to_come(renderer), size_of(renderer), matrix
        if isinstance(source, SourceInput):
            return seen
        source.set_view_if_missing(*seen)
        if source.last() is None:
            source.look(camera_of(seen[0], matrix), self.device)
        return seen

    def vdi_to_pick(self, frame: Frame) -> VDI | None:
        """Return a VDI that has all of what a view shows; without the volume, that which is there.

        ``None`` where no picture was drawn yet.
        """
        vdi, view = self.vdi_asked_for(), frame.view
        if vdi is None or view is None or not isinstance(self.input, SourceInput):
            return vdi
        whole = coverage(vdi, view.camera, view.size) == 1
        return vdi if whole else self._of_this_view(self.input, frame)

    def pick(self, actor: Any, renderer: Any, x: float, y: float) -> Pick | None:
        """Return what of an actor's VDI a renderer shows at a place of the window, in pixels."""
        kept = self.values_asked_for()
        return self._selection.pick(actor, renderer, x, y, self._first_hit, kept)

    @property
    def _first_hit(self) -> FirstHit:
        return FirstHit.of(self.settings.picking_opacity, self.settings.picking_accumulated)

    def _select(self, mapper: Any, renderer: Any) -> None:
        """Draw what can be picked of what the last frame showed, or the first would show."""
        actor, selection, self._style = self._actor(), self._selection, None
        selection.enter(actor, renderer.GetSelector())
        seen = None
        try:
            frame = Frame.current(renderer, actor, mapper)
            vdi = self.vdi_to_pick(frame)
            if vdi is None:
                self._last = self._paint(mapper, renderer)
                vdi = self.vdi_to_pick(frame)
            if vdi is not None:
                seen = frame.showing(vdi, number_of(vdi))
            selection.show(actor, renderer, seen, self.device, self._first_hit)
        except (Exception, KeyboardInterrupt) as error:  # VTK would swallow it
            self._warnings.warn(f"the VDI cannot be picked: {type(error).__name__}: {error}", error)
            selection.show(actor, renderer, None, self.device, self._first_hit)
        self._no_depth.show(renderer.GetRenderWindow(), mapper)

    def beside(self, mapper: Any, renderer: Any, matrix: Matrix) -> Frame | None:
        """Return the VDI as it is to be seen beside another one; ``None`` if it is not.

        Never raises. What is out of the picture is not brought up to date.
        """

        def in_picture(mapper: Any, renderer: Any) -> Frame | None:
            bounds = None if self.input is None else self.input.bounds()
            frame = Frame.current(renderer, self._actor(), mapper, matrix)
            if bounds is None or frame.rectangle(bounds) is None:
                return None
            seen = self._showing(frame)
            return None if seen is None or seen.volume is not None else seen

        return self._guarded(in_picture, mapper, renderer)  # type: ignore[no-any-return]

    def renderer(self) -> Any:
        """Return the renderer that is drawing the actor; ``None`` if it has none."""
        renderers = self.renderers()
        if len(renderers) > 1:
            for candidate in renderers:
                self._watch(candidate)
            active = self._active.Get()
            if active in renderers:
                return active
            # The first frame that shows the actor twice: tell them apart by their windows, of which
            # one is drawing, and by their viewports
            drawing = [r for r in renderers if _is_drawing(r)]
            viewports = [r for r in drawing if _is_viewport(r)]
            renderers = viewports or drawing or renderers
        return renderers[0] if renderers else None

    def renderers(self) -> list[Any]:
        """Return all renderers that show the actor, by itself or as a part of an assembly."""
        there = [each for each in consumers(self._actor()) if each.IsA("vtkRenderer")]
        return list(dict.fromkeys(there))

    def _watch(self, renderer: Any) -> None:
        """From now on, know which renderer is between its StartEvent and EndEvent."""
        if not self._watched.is_new(renderer):
            return
        active = self._active  # a VTK weak reference: no cycle through the observer
        renderer.AddObserver("StartEvent", lambda caller, _: active.Set(caller))
        renderer.AddObserver("EndEvent", lambda *_: active.Set(None))


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


def _is_drawing(renderer: Any) -> bool:
    window = renderer.GetRenderWindow()
    return window is not None and bool(window.CheckInRenderStatus())


def _is_viewport(renderer: Any) -> bool:
    width, height, x, y = [0], [0], [0], [0]
    renderer.GetTiledSizeAndOrigin(width, height, x, y)
    return viewport(renderer) == ((x[0], y[0]), (width[0], height[0]))
