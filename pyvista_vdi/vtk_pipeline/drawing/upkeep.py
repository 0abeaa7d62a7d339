"""What a frame draws: a VDI that is up to date, the volume until there is one, or the old VDI."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Literal

from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import VDIError
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.background import TRIAL_SIZE
from pyvista_vdi.quality.frame_rate import FLOOR, FrameRateController
from pyvista_vdi.quality.view_error import angle_from_generating_view
from pyvista_vdi.quality.ways import Ways
from pyvista_vdi.quality.worker import Job, Worker
from pyvista_vdi.series.player import Player
from pyvista_vdi.sets.shower import SetShower
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame
from pyvista_vdi.vtk_pipeline.drawing.stand_in import StandIn
from pyvista_vdi.vtk_pipeline.filters.inputs import Input, SeriesInput, SetInput, SourceInput
from pyvista_vdi.vtk_pipeline.filters.source import Request
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.interaction import browser
from pyvista_vdi.vtk_pipeline.interaction.regeneration import Regeneration
from pyvista_vdi.vtk_pipeline.interaction.status import CornerTexts, VDIStatus, Warnings
from pyvista_vdi.vtk_pipeline.interaction.ticker import PERIOD, LoopTicker, Ticker, period_of
from pyvista_vdi.vtk_pipeline.interaction.window_clock import Interaction, WindowClock, reduced

_log = logging.getLogger(__name__)

#: Views that a VDI is made to serve, degrees from V_O, where its metadata do not say.
_VIEW_CONE = 60.0

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
        self.ways = Ways()
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
        self._failed_at: Any = None
        self._made_at: Any = None
        self._said_far = False

    def set_input(self, source: Input | None, changed: Callable[..., Any]) -> None:
        """Keep another input; ``changed`` is called when its bounds may be others."""
        if self.input is not None:
            self.input.watch(None)
            self.input.rest()
        self.input = source
        self._failed_at = None
        self._said_far = False
        self.regeneration.cancel()
        self._forget_volume()
        if source is not None:
            source.watch(changed)

    @property
    def vdi(self) -> VDI | None:
        """The VDI made last."""
        return None if self.input is None else self.input.last()

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
        self, frame: Frame, ask: Callable[[], VDIStatus], *, only: bool
    ) -> VDI | StandIn | None:
        """Return the VDI that a frame is to draw, or what stands in for the one to come.

        ``ask`` gives the status, for a policy that is a callable; ``only`` says whether no other
        renderer shows the actor.
        """
        source = self.input
        if source is None:
            return None
        self._clock = weakref.ref(frame.clock)
        if self.automatic_view:
            source.set_view_if_missing(frame.renderer, frame.model_transform)
        if not isinstance(source, SourceInput):
            if isinstance(source, SeriesInput):
                source.player.device = frame.painter.device
            if isinstance(source, SetInput):
                self._look_around(source.shower, frame)
            vdi = self._updated(source)
            self._mind_the_angle(vdi, frame.view)
            return vdi
        if self.draw == "volume" and (volume := self._volume(source.source.MakeRequest())):
            return volume
        # Once for both eyes of a stereo pair, and not between the tiles of a picture
        now = (frame.clock.number, id(frame.clock))
        decide, self._looked_at = frame.clock.whole_picture and now != self._looked_at, now
        # A VDI that is drawn in several views is out of date in none of them by itself
        one_view = only and source.alone
        behind = one_view and self._interaction.asynchronous(frame.renderer.GetRenderWindow())
        if source.last() is None:
            vdi = self._updated(source)
            if behind:
                self._prepare(source.source.GetCurrentRequest())
            return vdi
        if behind:
            if decide or self.regeneration.unseen(source.source, source.stamp()):
                self._look(source, frame, ask)
            return self._standing_in() or self._better(source, frame) or source.last()
        if one_view and decide and self._asked_for(ask):
            source.take_camera(frame.renderer, frame.model_transform)
            source.take_size(frame.renderer)
        elif one_view and decide:
            self._follow_changes(source, frame)
        return self._updated(source)

    def _look_around(self, shower: SetShower, frame: Frame) -> None:
        """Have a set show the frame's view, and grow where nobody turns and the picture lacks."""
        window = frame.renderer.GetRenderWindow()
        shower.device = frame.painter.device
        shower.look(frame.view.camera)
        if self._interaction.moving(window):
            shower.stop_growing()
        elif self._interaction.asynchronous(window) and self.regeneration.policy == "auto":
            shower.grow()

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

    def _better(self, source: SourceInput, frame: Frame) -> StandIn | None:
        """Return the volume where it is expected to give the better frame; None: the VDI does."""
        vdi, made = source.last(), source.source.GetCurrentRequest()
        if self.draw != "auto" or not frame.clock.single or vdi is None or made is None:
            return None
        window = frame.renderer.GetRenderWindow()
        moves = self._interaction.wants_preview(window)
        way = self.ways.choose(
            angle_from_generating_view(vdi, frame.view.camera),
            frame.covered(vdi.bounds),
            1 / frame.clock.aim(self._interaction) if moves else None,
            self.regeneration.ssim(vdi),
            self.regeneration.bound,
        )
        return self._volume(made) if way == "volume" else None

    def _volume(self, request: Request) -> StandIn | None:
        """Return the volume of a request, to be drawn for its own sake; None if it cannot be."""
        if self._lasting is not None and self._lasting.request.content != request.content:
            self._lasting = None  # its buffers go before others are taken
        if self._lasting is None:
            self._lasting = self._drawn_itself(request, lasting=True)
        return self._lasting

    def _drawn_itself(self, request: Request, *, lasting: bool) -> StandIn | None:
        if request is self._refused:
            return None
        try:
            return StandIn(request, self._stand_in_rate, lasting=lasting)
        except VDIError as error:  # then the VDI is what can be drawn
            self._refused = request
            _log.debug("the volume cannot be drawn in place of its VDI", exc_info=error)
            return None

    def _forget_volume(self) -> None:
        self._stand_in = self._lasting = self._refused = None
        self.ways = Ways()

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
        assert vdi is not None
        options = frame.showing(vdi).world_options()
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

    def _mind_the_angle(self, vdi: VDI | None, view: View) -> None:
        """Say once that a VDI without its volume is seen from where it was not made for."""
        if vdi is None or self._said_far or self.regeneration.policy != "auto":
            return
        angle = angle_from_generating_view(vdi, view.camera)
        stored = vdi.metadata.get("view_cone")
        served = stored if isinstance(stored, int | float) else _VIEW_CONE
        if angle > served:
            self._said_far = True
            volumes = None if self.player is None else self.player.series.volumes
            why = (
                "without its volume it cannot be made anew, and shows less"
                if volumes is None
                else "unless actor.regenerate() makes this step anew, it shows less"
            )
            self._warnings.warn(
                f"the view is {angle:.0f} degrees from the VDI's generating view, which was to "
                f"serve {served:.0f}: {why} and less of what was hidden; regenerate='never' takes "
                "this as it is"
            )

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
