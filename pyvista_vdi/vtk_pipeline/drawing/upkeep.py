"""What a frame draws: a VDI that is up to date, the volume until there is one, or the old VDI."""

from __future__ import annotations

import logging
import math
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, Literal

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import Cancelled, InvalidVolumeError, VDIError
from pyvista_vdi.extensions.series.player import Player
from pyvista_vdi.extensions.sets.shower import SetShower
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.background import TRIAL_SIZE
from pyvista_vdi.quality.frame_rate import FLOOR, FrameRateController
from pyvista_vdi.quality.pictures import FINE_ENOUGH, SIMILAR, Pictures
from pyvista_vdi.quality.render_mode import RenderModeChooser
from pyvista_vdi.quality.view_error import (
    ViewError,
    angle_from_generating_view,
    coverage,
    magnification,
)
from pyvista_vdi.quality.worker import Job, Worker
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame
from pyvista_vdi.vtk_pipeline.drawing.stand_in import StandIn
from pyvista_vdi.vtk_pipeline.filters.inputs import Input, SeriesInput, SetInput, SourceInput
from pyvista_vdi.vtk_pipeline.filters.source import Request
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.interaction import browser
from pyvista_vdi.vtk_pipeline.interaction.estimation import Estimators
from pyvista_vdi.vtk_pipeline.interaction.regeneration import Regeneration
from pyvista_vdi.vtk_pipeline.interaction.status import CornerTexts, VDIStatus, Warnings
from pyvista_vdi.vtk_pipeline.interaction.ticker import PERIOD, LoopTicker, Ticker, period_of
from pyvista_vdi.vtk_pipeline.interaction.window_clock import Interaction, WindowClock, reduced

_log = logging.getLogger(__name__)

#: Views that a VDI is made to serve, degrees from V_O, where its metadata do not say.
_VIEW_CONE = 60.0

#: Pixels as wide as one list from which on a VDI without its volume is said to be too coarse, and
#: the share of rays below which it is said to cover too little: corners of bounds are often empty.
_TOO_COARSE, _TOO_LITTLE = 2.0, 0.9
#: What two equal sizes of pixels differ by at most.
_ROUNDING = 1e-6

#: Pictures that tell what a volume's rays cost, of which the fastest counts: what disturbs one by
#: milliseconds has the volume seem too dear to be drawn, which no frame would ever correct.
_TRIALS = 5


class Upkeep:
    """Keeps the input of a mapper up to date.

    Where somebody watches the window, which ``interaction`` says, a change or a new view is made a
    VDI of in the background and swapped between two frames; elsewhere a frame waits for the VDI
    that belongs to it. ``texts`` may have to be drawn again though nothing else has changed.
    """

    def __init__(self, interaction: Interaction, warnings: Warnings, texts: CornerTexts) -> None:
        self.input: Input | None = None
        self.automatic_view = True
        self.regeneration = Regeneration()
        self.draw: Literal["auto", "vdi", "volume"] = "auto"
        self.ways = RenderModeChooser()
        self._pictures = Pictures()
        self._content: Any = None  # what they are of
        self._estimators = Estimators()
        self._lasting: StandIn | None = None
        self._stand_in: StandIn | None = None
        self._stand_in_rate = FrameRateController()
        self._refused: Request | None = None  # of which there can be no stand-in
        self._preparation = Worker("pyvista-vdi stand-in")
        self._interaction = interaction
        self._warnings = warnings
        self._texts = texts
        self._ticker = Ticker(self._tick)
        self._loop_ticker = LoopTicker(self._tick)
        self._clock: Callable[[], WindowClock | None] = lambda: None  # a weak reference
        self._looked_at = (0, 0)
        self._behind = False  # whether VDIs are made behind the frames
        self._failed_at: Any = None
        self._made_at: Any = None

    def set_input(self, source: Input | None, changed: Callable[..., Any]) -> None:
        """Keep another input; ``changed`` is called when what is before it may be another."""
        if self.input is not None:
            self.input.watch(None)
            self.input.rest()
        self.input = source
        self._failed_at = None
        self.regeneration.cancel()
        self._forget_volume()
        if source is not None:
            source.watch(changed)

    @property
    def vdi(self) -> VDI | None:
        """The VDI made last."""
        return None if self.input is None else self.input.last()

    def asked_for(self) -> VDI | None:
        """Return the VDI, made now where pictures have been drawn without one or of other data.

        It is of the view that the first picture had, or that somebody chose; ``None`` before.
        """
        source = self.input
        if not isinstance(source, SourceInput):
            return self.vdi
        if source.source.GetCamera() is None or source.source.GetWindowSize() is None:
            return self.vdi
        if self.vdi is None or (self.draw == "auto" and not self._behind):
            self.regeneration.cancel()
            return self._updated(source)
        return self.vdi

    def to_pick(self, frame: Frame) -> VDI | None:
        """Return a VDI that has all of what a view shows; without the volume, that which is there.

        ``None`` where no picture was drawn yet.
        """
        vdi, source, view = self.asked_for(), self.input, frame.view
        if vdi is None or coverage(vdi, view.camera, view.size) == 1:
            return vdi
        if not isinstance(source, SourceInput):
            return vdi
        return self._of_this_view(source, source.source.MakeRequest(view), frame)

    def ssim(self, view: View | None) -> float | None:
        """Return the last estimate for the VDI that there is, in this view; None without one."""
        error = None if view is None else self._pictures.error(view)
        return self.regeneration.ssim(self.vdi) if error is None else error.ssim

    @property
    def player(self) -> Player | None:
        """What shows one step of a series after the other, where a series is shown."""
        return self.input.player if isinstance(self.input, SeriesInput) else None

    @property
    def shower(self) -> SetShower | None:
        """What shows the VDIs of a set, where a set is shown."""
        return self.input.shower if isinstance(self.input, SetInput) else None

    @property
    def _busy(self) -> bool:
        """Whether something goes on that the event loop has to look at."""
        if self.shower is not None:
            return self.shower.growing
        return self.regeneration.busy or (self.player is not None and self.player.playing)

    def blended_parts(self, vdi: VDI) -> list[tuple[VDI, float]]:
        """Return the VDIs of a set that a picture is blended of, with weights; none for one."""
        parts = [] if self.shower is None else self.shower.parts()
        return parts if len(parts) > 1 and parts[0][0] is vdi else []

    def retry(self) -> None:
        """Try again what failed before, and give up what is being made in the background."""
        self.regeneration.cancel()
        self._failed_at = None
        self._warnings.forget()

    def close(self) -> None:
        """End what goes on; the next frame may begin anew."""
        self._stop_ticking()
        if self.input is not None:
            self.input.rest()
        self.regeneration.close()
        self._preparation.clear()
        self._preparation.join()
        self._forget_volume()

    def current(
        self, frame: Frame, ask: Callable[[], VDIStatus], *, only: bool, joint: bool
    ) -> VDI | StandIn | None:
        """Return the VDI that a frame is to draw, or the volume where that is drawn in its place.

        ``ask`` gives the status, for a policy that is a callable; ``only`` says whether no other
        renderer shows the actor, ``joint`` whether another one's volume overlaps it in the picture:
        what is drawn together is merged by the lists of VDIs.
        """
        source = self.input
        if source is None:
            return None
        self._clock = weakref.ref(frame.clock)
        if self.automatic_view:
            source.set_view_if_missing(frame.renderer, frame.model_transform)
        try:
            return self._current(source, frame, ask, only=only, joint=joint)
        except Cancelled as error:  # the next frame asks again
            shown = self._lasting or source.last()
            if shown is None:
                source.forget_view()
                raise
            self._complain(error)
            return shown

    def _current(
        self,
        source: Input,
        frame: Frame,
        ask: Callable[[], VDIStatus],
        *,
        only: bool,
        joint: bool,
    ) -> VDI | StandIn | None:
        if not isinstance(source, SourceInput):
            if isinstance(source, SeriesInput):
                source.player.device = frame.painter.device
            if isinstance(source, SetInput):
                self._look_around(source.shower, frame)
            vdi = self._updated(source)
            self._say_what_is_lacking(vdi, frame)
            return vdi
        if (
            self.draw == "volume"
            and not joint
            and (volume := self._volume(source.source.MakeRequest()))
        ):
            return volume
        # Once for both eyes of a stereo pair, and not between the tiles of a picture
        now = (frame.clock.number, id(frame.clock))
        decide, self._looked_at = frame.clock.whole_picture and now != self._looked_at, now
        # A VDI that is drawn in several views is out of date in none of them by itself
        one_view = only and source.alone
        window = frame.renderer.GetRenderWindow()
        self._behind = one_view and self._interaction.asynchronous(window)
        if self._behind:
            return self._watched(source, frame, ask, decide=decide, joint=joint)
        if source.last() is None and (self.draw != "auto" or callable(self.regeneration.policy)):
            return self._updated(source)
        if one_view and decide and self._asked_for(ask):
            source.take_camera(frame.renderer, frame.model_transform)
            source.take_size(frame.renderer)
            self._updated(source)
        elif one_view and decide:
            self._follow_changes(source, frame)
        if self.draw == "auto":
            return self._faithful(source, frame, one_view=one_view and decide, joint=joint)
        return self._updated(source)

    def _watched(
        self,
        source: SourceInput,
        frame: Frame,
        ask: Callable[[], VDIStatus],
        *,
        decide: bool,
        joint: bool,
    ) -> VDI | StandIn | None:
        """Return what is drawn where somebody watches: VDIs are made behind the frames."""
        source.source.GetVolume()  # raises where there is nothing to draw any more
        first = source.last() is None
        if first and (joint or self.draw == "vdi"):
            vdi = self._updated(source)
            self._prepare(source.source.GetCurrentRequest())
            return vdi
        if decide or self.regeneration.unseen(source.source, source.stamp()):
            self._look(source, frame, ask)
        if first:
            wanted = self.regeneration.changed or source.source.MakeRequest()
            self._prepare(wanted)
            return self._volume(wanted) or self._updated(source)
        return self._standing_in() or self._better(source, frame, joint) or source.last()

    def _faithful(
        self, source: SourceInput, frame: Frame, *, one_view: bool, joint: bool
    ) -> VDI | StandIn | None:
        """Return what gives a right picture of this view: the same in every run."""
        wanted = source.source.MakeRequest(frame.view)
        if self._content != wanted.content:
            self._content, self._pictures = wanted.content, Pictures()
        vdi, made = source.last(), source.source.GetCurrentRequest()
        same = made is not None and made.content == wanted.content
        if same and self._serves(vdi, made, frame, joint=joint):
            return vdi
        may_make = self.regeneration.policy == "auto"
        if joint:
            return self._of_this_view(source, wanted, frame) if may_make else self._updated(source)
        own_pixels = frame.full_size == frame.view.size
        if one_view and may_make and own_pixels:
            if self._pictures.deserves_vdi(frame.view, wanted.volume.bounds):
                source.take_camera(frame.renderer, frame.model_transform)
                source.take_size(frame.renderer)
                return self._updated(source)
            self._pictures.drawn_by_volume(frame.view)
        return self._volume(wanted, in_bricks=True) or self._updated(source)

    def _serves(self, vdi: VDI | None, made: Request | None, frame: Frame, *, joint: bool) -> bool:
        """Whether the VDI's picture of the frame's view is as good as the volume's."""
        if vdi is None or made is None:
            return False
        shown, renderer = frame.showing(vdi).world_options(), frame.renderer
        detail = magnification(vdi, frame.camera, frame.full_size)

        def estimate() -> ViewError:
            if made.screen == frame.view and detail <= 1 + _ROUNDING:
                return ViewError(1.0, 0.0, 0.0, 1.0, 0)
            return self._estimators.of(made, get_runtime(made.device)).estimate(
                vdi,
                frame.view.camera,
                frame.view.size,
                clipping_planes=shown.clipping_planes or None,
                cropping=shown.cropping,
                opacity_multiplier=shown.opacity_multiplier,
                background=renderer.GetBackground(),
            )

        try:
            return self._pictures.serves(
                vdi,
                frame.view,
                detail=detail,
                bound=self.regeneration.bound,
                options=shown,
                estimate=estimate,
                **({"within": 180.0} if joint else {}),
            )
        except VDIError:  # no memory for it, say: the volume's picture is right
            _log.debug("the error of a view cannot be estimated", exc_info=True)
            return False

    def _of_this_view(self, source: SourceInput, wanted: Request, frame: Frame) -> VDI:
        """Return a VDI of exactly this view, made now; of a tile it is not kept."""
        whole = frame.full_size == frame.view.size
        camera, size = (frame.view.camera, frame.view.size) if whole else (frame.camera, frame.size)
        generating, lists = wanted.generating
        # What covers all of a volume that is near has larger lists than the picture has pixels
        pixels = math.prod(
            high / low
            for high, low in zip(
                generating.half_extent(lists), camera.half_extent(size), strict=True
            )
        )
        if not whole or pixels * math.prod(size) > math.prod(lists) * (1 + _ROUNDING):
            wanted = replace(wanted, generating=(camera, size))
        vdi = source.source.MakeVDI(wanted)
        if whole:
            source.source.TakeVDI(vdi, wanted)
        return vdi

    def _look_around(self, shower: SetShower, frame: Frame) -> None:
        """Have a set show the frame's view, and grow where nobody turns and the picture lacks."""
        window = frame.renderer.GetRenderWindow()
        shower.device = frame.painter.device
        shower.look(frame.view.camera)
        if self._interaction.moving(window):
            shower.stop_growing()
        elif self.regeneration.policy == "auto":
            if self._interaction.asynchronous(window):
                shower.grow()
            elif self.draw == "auto":
                shower.grow_now()

    def tick(self, window: Any) -> None:
        """Have the event loop look at what goes on, if something does and no hand moves."""
        if self._busy and not self._interaction.moving(window):
            player = self.player
            period = PERIOD if player is None else period_of(player.rate)
            if browser.watches(window):
                self._loop_ticker.start(period)
            self._ticker.start(window.GetInteractor(), period)

    def _stop_ticking(self) -> None:
        self._ticker.stop()
        self._loop_ticker.stop()

    def _prepare(self, made: Request | None) -> None:
        """Have compiled, behind the frames, what the first change would wait for."""
        if made is None:
            return

        def draw_one(runtime: Runtime, _report: Callable[[float], None]) -> bool:
            camera, volume = made.screen.camera, StandIn(made, FrameRateController())
            volume.picture(FrameRequest(camera, (TRIAL_SIZE, TRIAL_SIZE)))
            if self.draw == "auto":
                # What a ray costs, by pictures of as many as a preview has at least
                trial = Frame.of(camera, reduced(made.screen.size, FLOOR))
                taken = []
                for _ in range(_TRIALS):
                    began = runtime.clock()
                    volume.picture(FrameRequest(camera, trial.size))
                    taken.append(runtime.clock() - began)
                self.ways.took("volume", 0.0, trial.covered(volume.bounds), min(taken))
            return True

        self._preparation.put(Job(draw_one, made.device))

    def _better(self, source: SourceInput, frame: Frame, joint: bool) -> StandIn | None:
        """Return the volume where it is expected to give the better frame; None: the VDI does."""
        vdi, made = source.last(), source.source.GetCurrentRequest()
        if self.draw != "auto" or joint or vdi is None or made is None:
            return None
        window, camera = frame.renderer.GetRenderWindow(), frame.view.camera
        moves = self._interaction.wants_preview(window)
        fine = moves or magnification(vdi, frame.camera, frame.full_size) <= FINE_ENOUGH
        if coverage(vdi, camera, frame.view.size) < 1 or not fine:
            return self._volume(made)
        bound = self.regeneration.bound
        way = self.ways.choose(
            angle_from_generating_view(vdi, camera),
            frame.covered(vdi.bounds),
            1 / frame.clock.aim(self._interaction) if moves else None,
            self.regeneration.ssim(vdi),
            SIMILAR if bound is None else bound,
        )
        return self._volume(made) if way == "volume" else None

    def _volume(self, request: Request, *, in_bricks: bool = False) -> StandIn | None:
        """Return the volume of a request, to be drawn for its own sake; None if it cannot be."""
        if self._lasting is not None and self._lasting.request.content != request.content:
            self._lasting = None  # its buffers go before others are taken
        if self._lasting is None:
            self._lasting = self._drawn_itself(request, lasting=True, in_bricks=in_bricks)
        return self._lasting

    def _drawn_itself(
        self, request: Request, *, lasting: bool, in_bricks: bool = False
    ) -> StandIn | None:
        refused = None if in_bricks or self._refused is None else self._refused.content
        if refused is not None and refused == request.content:
            return None
        try:
            return StandIn(request, self._stand_in_rate, lasting=lasting, in_bricks=in_bricks)
        except VDIError as error:  # then the VDI is what can be drawn
            self._refused = request
            _log.debug("the volume cannot be drawn in place of its VDI", exc_info=error)
            return None

    def _forget_volume(self) -> None:
        self._stand_in = self._lasting = self._refused = self._content = None
        self._estimators, self._pictures = Estimators(), Pictures()
        self.ways = RenderModeChooser()

    def _standing_in(self) -> StandIn | None:
        """Return what is drawn while the VDI shows what is no longer so; None if it need not be."""
        wanted = self.regeneration.changed
        if self._stand_in is not None and self._stand_in.request is not wanted:
            self._stand_in = None  # its buffers go before others are taken
        if self._stand_in is None and wanted is not None:
            self._stand_in = self._drawn_itself(wanted, lasting=False)
        return self._stand_in

    def _updated(self, source: Input) -> VDI | None:
        """Bring the input up to date, but do not repeat what failed until something changes."""
        stamp = source.stamp()
        if self._failed_at == stamp:
            return source.last()
        try:
            vdi = source.vdi()
        except Cancelled:  # of one execution
            raise
        except InvalidVolumeError:  # soon found again
            if not source.has_what_it_had():
                raise
            return source.last()  # as VTK's mappers, which draw the data that are there
        except BaseException:
            self._failed_at = source.stamp()
            raise
        self._failed_at, self._made_at = None, source.stamp()
        return vdi

    def _asked_for(self, ask: Callable[[], VDIStatus]) -> bool:
        """Whether a policy that is a callable wants a VDI of this view."""
        policy = self.regeneration.policy
        try:
            return callable(policy) and bool(policy(ask()))
        except Exception as error:
            self._complain(error)
            return False

    def _follow_changes(self, source: SourceInput, frame: Frame) -> None:
        """Have what has changed made a VDI of from the frame's view, where it may be."""
        stamp = source.stamp()
        if stamp in (self._made_at, self._failed_at) or self.regeneration.policy == "never":
            return
        with suppress(VDIError):  # which the update raises
            source.follow_if_changed(frame.renderer, frame.model_transform)

    def _look(self, source: SourceInput, frame: Frame, ask: Callable[[], VDIStatus]) -> None:
        moving = self._interaction.moving(frame.renderer.GetRenderWindow())
        vdi = source.last()
        options = RenderOptions() if vdi is None else frame.showing(vdi).world_options()
        try:
            self.regeneration.look(
                source.source,
                source.stamp(),
                frame.view,
                moving=moving,
                shown=self.draw == "vdi" or self.ways.way == "vdi",
                ask=ask,
                options=options,
            )
        except Exception as error:  # what is shown can still be drawn
            self._complain(error)

    def _say_what_is_lacking(self, vdi: VDI | None, frame: Frame) -> None:
        """Say once for each cause that a VDI without its volume is seen from where it lacks."""
        if vdi is None or self.regeneration.policy != "auto":
            return
        view, stored = frame.view, vdi.metadata.get("view_cone")
        cone = stored if isinstance(stored, int | float) else _VIEW_CONE
        angle = angle_from_generating_view(vdi, view.camera)
        covered = coverage(vdi, view.camera, view.size)
        detail = magnification(vdi, frame.camera, frame.full_size)
        volumes = None if self.player is None else self.player.series.volumes
        remedy = (
            "without its volume it cannot be made anew"
            if volumes is None
            else "actor.regenerate() makes this step anew"
        )
        lacking = {}
        if angle > cone:
            lacking["angle"] = (
                f"the view is {angle:.0f} degrees from the VDI's generating view, which was to "
                f"serve {cone:.0f}: it shows less, and less of what was hidden"
            )
        if covered < _TOO_LITTLE:
            lacking["coverage"] = (
                f"{1 - covered:.0%} of the view's rays through the volume leave what the VDI "
                "covers: there it shows nothing"
            )
        if detail > _TOO_COARSE:
            lacking["magnification"] = (
                f"{detail:.1f} pixels of the view are as wide as one of the VDI's lists: it shows "
                "no finer detail"
            )
        for cause, what in lacking.items():
            message = f"{what}; {remedy}; regenerate='never' takes this as it is"
            # Once for all VDIs of one V_O, such as the steps of a series
            self._warnings.warn(message, cause=(cause, vdi.camera, vdi.window_size))

    def collect(self) -> bool:
        """Take what was made in the background; whether there is another VDI to be drawn."""
        try:
            if self.player is not None:
                return self.player.advance()
            if self.shower is not None:
                return self.shower.advance()
            return self.regeneration.collect()
        except Exception as error:
            self._complain(error)
            return False

    def _tick(self) -> None:
        """Look, from the event loop, at what goes on, and have shown what is new."""
        clock = self._clock()
        if clock is None or clock.drawing:
            return
        swapped = self.collect()
        if not self._busy:
            self._stop_ticking()
        if swapped or self._texts.are_behind(self.regeneration.progress):
            clock.render()

    def _complain(self, error: Exception) -> None:
        if self.player is not None:
            self._warnings.warn(f"a step is left out: {type(error).__name__}: {error}", error)
            return
        self._warnings.warn(
            f"the VDI cannot be made anew: {type(error).__name__}: {error}; what was shown stays, "
            "and actor.regenerate() tries again",
            error,
        )
