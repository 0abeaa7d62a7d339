"""When a VDI on the screen is made anew, and how: in the background, while the old one is drawn."""

from __future__ import annotations

import math
import time
import weakref
from collections.abc import Callable
from typing import Any, Literal, TypeAlias

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.render_options import RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.background import BackgroundGeneration
from pyvista_vdi.quality.regeneration_policy import (
    AT_HOME,
    OUT_OF_DATE,
    REGENERATE_BELOW,
    estimate_is_old,
    is_poor,
)
from pyvista_vdi.vtk_pipeline.filters.source import Request, VDISource
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.interaction.estimation import Estimate, Estimation
from pyvista_vdi.vtk_pipeline.interaction.status import VDIStatus

Policy: TypeAlias = "Literal['auto', 'never'] | Callable[[VDIStatus], object]"

#: Seconds between two estimates while the view moves: each takes time from the frames.
_ESTIMATE_PERIOD_IN_MOTION = 0.5
#: Seconds without another view after which the view is at rest.
_SETTLED = 0.15


def checked_policy(policy: Any) -> Policy:
    """Return ``"auto"``, ``"never"`` or a callable; refuse anything else."""
    if policy in ("auto", "never") or callable(policy):
        return policy  # type: ignore[no-any-return]
    raise InvalidArgumentError(
        "regenerate must be 'auto', 'never' or a callable that takes a VDIStatus and says whether "
        f"to regenerate; got {policy!r}"
    )


class Regeneration:
    """Watches a source's VDI from frame to frame and has another made when it is time.

    Everything here runs in the thread that draws, in frames (:meth:`look`) and between them
    (:meth:`collect`); the two workers never see VTK. A new VDI is handed to the source as one
    object, so that a frame draws the old one or the new one.

    Attributes
    ----------
    policy : "auto", "never" or callable
        What decides that a view needs a VDI of its own. Changed data are always made anew.
    bound : float or None
        Estimated SSIM below which ``"auto"`` regenerates; ``None``: ``REGENERATE_BELOW``.
    """

    def __init__(self) -> None:
        self.policy: Policy = "auto"
        self.bound: float | None = None
        self._background: BackgroundGeneration | None = None
        self._device: Any = None
        self._target: Request | None = None
        self._for_view = False
        self._estimation = Estimation()
        self._estimate: Estimate | None = None
        self._source: Callable[[], VDISource | None] = lambda: None  # a weak reference
        self._stamp: Any = None
        self._failed_at: Any = None
        self._view: View | None = None
        self._options = RenderOptions()
        self._moved_at = 0.0
        self._estimated_at = -math.inf
        self._moving = False
        self._shown = True

    @property
    def progress(self) -> float | None:
        """Share done of the VDI that is being made, 0 to 1; ``None`` if none is."""
        return None if self._background is None else self._background.progress

    @property
    def busy(self) -> bool:
        """Whether something goes on, or is to be decided, that no frame would show by itself."""
        return self._target is not None or self._estimation.running or self._undecided

    @property
    def changed(self) -> Request | None:
        """What a VDI is being made of, where there is none or one that is of something else."""
        source, target = self._source(), self._target
        made = None if source is None else source.GetCurrentRequest()
        if target is None or (made is not None and target.content == made.content):
            return None
        return target

    def unseen(self, source: VDISource, stamp: Any) -> bool:
        """Whether something may have changed since the last :meth:`look`."""
        return self._source() is not source or stamp != self._stamp

    def ssim(self, vdi: VDI | None) -> float | None:
        """Return the last estimate for this VDI."""
        estimate = self._estimate
        return estimate.error.ssim if estimate is not None and estimate.vdi is vdi else None

    def look(
        self,
        source: VDISource,
        stamp: Any,
        view: View,
        *,
        moving: bool,
        shown: bool,
        ask: Callable[[], VDIStatus],
        options: RenderOptions,
    ) -> None:
        """Look at the frame's view and at what the VDI was made of, and begin what is needed.

        ``stamp`` changes whenever ``source`` may have to make another VDI, or its first one.
        ``shown`` says whether the VDI is what is drawn, and not the volume in its place. ``ask``
        gives the status for a policy that is a callable. ``options`` say how the VDI is
        drawn (clipping planes in world coordinates), for the estimate: a change of them needs no
        new VDI, and by itself no new estimate, which is of the view. VDIError is raised, once, if
        what has changed cannot be made a VDI of.
        """
        self._notice(source, view, moving)
        self._options, self._shown = options, shown
        if stamp != self._stamp:
            self._stamp = stamp
            self._follow_changes(source, view)
        if callable(self.policy):
            self._drop_if_outdated()
            if self._target is None and not self._failed and self.policy(ask()):
                self._start(source.MakeRequest(view), for_view=True)
        elif self.policy == "auto":
            self._decide(source)

    def _notice(self, source: VDISource, view: View, moving: bool) -> None:
        now = time.perf_counter()
        if self._source() is not source:
            self.cancel()
            self._source = weakref.ref(source)
            self._stamp = self._estimate = self._view = None
        if view != self._view:
            self._moved_at = now
        elif not moving:
            self._moved_at = min(self._moved_at, now - _SETTLED)  # the second frame of a view
        self._view = view
        self._moving = moving

    def _follow_changes(self, source: VDISource, view: View) -> None:
        """Begin a VDI of what has changed, or give up one that nobody wants any more."""
        made, wanted = source.GetCurrentRequest(), source.MakeRequest()
        if made is None:
            if self._target is None or self._target.content != wanted.content:
                self._start(wanted)
            return
        if wanted.key == made.key:
            if self._target is not None and self._target.content != made.content:
                self._give_up()  # what had changed was changed back
            return
        if wanted.screen != made.screen:  # somebody asked for that view
            self._start(wanted)
        elif self._target is None or self._target.content != wanted.content:
            self._start(wanted if self.policy == "never" else source.MakeRequest(view))
        else:
            self._for_view = False  # it is needed whatever the view does

    def collect(self) -> bool:
        """Take what the workers have finished, or raise why not; whether a VDI was swapped."""
        source = self._source()
        if source is None:
            self.cancel()
            return False
        try:
            self._estimate = self._estimation.take() or self._estimate
            vdi = None if self._background is None else self._background.take()
        except BaseException:
            self._target, self._failed_at = None, self._stamp
            raise
        if vdi is not None and self._target is not None:
            target, self._target = self._target, None
            self._estimate = None  # it holds the old one
            source.TakeVDI(vdi, target)
            return True
        if self.policy == "auto":
            self._decide(source)
        return False

    def _decide(self, source: VDISource) -> None:
        """Estimate the view's error, and begin a VDI of the view if it is too large."""
        self._drop_if_outdated()
        if self._moving and not self._shown:
            self._estimation.cancel()  # frames of the volume have no error, and need the time
            return
        vdi, view, made = source.GetCurrentVDI(), self._view, source.GetCurrentRequest()
        if self._target is not None or self._estimation.running or self._failed:
            return
        if vdi is None or view is None or made is None or self._apart(made.screen) <= AT_HOME:
            return
        estimate, resting = self._estimate, self._resting
        if (
            estimate is None
            or estimate.vdi is not vdi
            or estimate_is_old(self._apart(estimate.view), moving=not resting)
        ):
            now = time.perf_counter()
            if resting or now - self._estimated_at >= _ESTIMATE_PERIOD_IN_MOTION:
                self._estimated_at = now
                self._estimation.start(vdi, made, view, self._options)
            return
        bound = REGENERATE_BELOW if self.bound is None else self.bound
        if is_poor(estimate.error.ssim, bound, moving=not resting):
            self._start(source.MakeRequest(view), for_view=True)

    @property
    def _failed(self) -> bool:
        """Whether a worker has failed, and nothing has changed since."""
        return self._failed_at is not None and self._failed_at == self._stamp

    @property
    def _resting(self) -> bool:
        return not self._moving and time.perf_counter() - self._moved_at >= _SETTLED

    @property
    def _undecided(self) -> bool:
        """Whether "auto" waits for the view to have been at rest for long enough."""
        return self.policy == "auto" and not self._moving and not self._resting

    def _apart(self, other: View) -> float:
        """Distance of the view from another one."""
        source = self._source()
        bounds = None if source is None else source.GetInputBounds()
        if self._view is None or bounds is None:
            return math.inf
        return self._view.distance(other, bounds)

    def _start(self, request: Request, *, for_view: bool = False) -> None:
        """Have a VDI made: because of the view alone, or whatever the view does meanwhile."""
        self._for_view = for_view
        device = request.device
        if self._background is None or device != self._device:
            if self._background is not None:
                self._background.close()
            self._background, self._device = BackgroundGeneration(device), device
        self._estimation.cancel()
        self._target = request
        self._background.start(
            *request.arguments,
            request.options,
            key=request.key,
            dial=request.dial,
            metadata=request.metadata,
        )

    def _drop_if_outdated(self) -> None:
        """Give up a VDI that is made for a view which the hand has left behind."""
        source = self._source()
        made = None if source is None else source.GetCurrentRequest()
        if self._target is None or made is None or not self._for_view:
            return
        away = self._apart(self._target.screen)
        if away > OUT_OF_DATE or away > self._apart(made.screen):
            self._give_up()

    def _give_up(self) -> None:
        self._target = None
        if self._background is not None:
            self._background.cancel()

    def cancel(self) -> None:
        """Give up what goes on, and forget what failed."""
        self._give_up()
        self._estimation.cancel()
        self._failed_at = None

    def close(self) -> None:
        """Give up what goes on, and leave no thread."""
        self._target = None
        if self._background is not None:
            self._background.close()
            self._background = None
        self._estimation.close()
        self._estimate = self._stamp = self._view = None
        self._source = lambda: None
