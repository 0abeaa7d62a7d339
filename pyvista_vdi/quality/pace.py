"""How many rays the frames of a window get, so that they keep a rate: without side effects.

All previews of a frame are reduced by the same share, so several VDIs, the two eyes of a stereo
pair and several viewports divide the time among them by their pixels. Whoever draws says what
frames have taken, and asks; there is no clock here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from pyvista_vdi.quality.frame_rate import FrameRate
from pyvista_vdi.quality.frame_state import RenderMode
from pyvista_vdi.quality.records import replace

#: What a ray's cost is known by: the render mode, or a VDI of every second list.
Cost: TypeAlias = RenderMode | Literal["few lists"]

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


@dataclass(frozen=True)
class FrameSoFar:
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


@dataclass(frozen=True)
class Resting:
    """What a full frame has taken, or is expected to take."""

    rays: int
    work: float
    seconds: float


@dataclass(frozen=True)
class Pace:
    """What the frames of a window have taken, and what is chosen by that.

    Attributes
    ----------
    seconds : float or None
        What the last frame that was raycast took, from the window's StartEvent to its EndEvent;
        ``None`` before. The time between two frames would count how long a hand rests.
    dear_samples : bool
        Whether frames with multisampling and all rays would be late.
    few_lists : bool
        Whether previews had better have fewer lists.
    beside : (float, float)
        Seconds beside the rays, of the last frame without multisampling and with it.
    """

    frame: FrameSoFar = field(default_factory=FrameSoFar)
    seconds: float | None = None
    dear_samples: bool = False
    few_lists: bool = False
    beside: tuple[float, float] = (0.0, 0.0)
    interacting: bool = False
    cost: Cost = "vdi"  # of the last frame
    headroom: float = HEADROOM
    floor: float = 0.0
    target: float = 0.0
    full_rays: int = 0  # of the last frame of a motion, and its images
    images: int = 0
    rates: tuple[tuple[Cost, FrameRate], ...] = ()
    resting: tuple[tuple[Cost, Resting], ...] = ()

    @property
    def fps(self) -> float | None:
        """Mean rate of the motion's last frames; at rest what the last frame would allow."""
        rate = dict(self.rates).get(self.cost)
        if self.interacting and rate is not None and rate.fps > 0:
            return rate.fps
        return 1 / self.seconds if self.seconds else None

    def share(
        self,
        target: float,
        pixels: int,
        floor: float,
        cost: Cost = "vdi",
        *,
        effort: float = 1.0,
        expected: float | None = None,
    ) -> tuple[Pace, float]:
        """Choose the share of its pixels, 0 to 1, that a VDI is drawn with in a frame of a motion.

        ``target`` is the rate to be kept, 1/s, ``pixels`` those of the full image, ``floor`` the
        least share, ``cost`` says what is drawn, ``effort`` what a ray of this view is expected to
        take over one of others, and ``expected`` how many seconds a full image may take where no
        frame has told.
        """
        aim = self.headroom * target
        frame = replace(self.frame, interactive=True, target=max(self.frame.target, aim))
        pace = replace(self, frame=frame)
        if frame.share is None:
            # The other VDIs of this frame are not known yet: count on those of the last
            full = round(pixels * effort)
            if self.images > 1:
                full = max(self.full_rays, full)
            if expected is not None and cost not in dict(self.resting):
                known = Resting(full, expected, expected)
                pace = replace(pace, resting=(*self.resting, (cost, known)))
            pace, rate = pace._tuned(max(aim, self.target), floor, cost)
            rate = rate.choose(full)
            share = rate.chosen(full) / full
            if cost == "few lists":
                # With more pixels the next frame takes all lists; what a full frame shows is exact
                share = min(share, _FEW_ABOVE)
            pace = replace(pace._with(cost, rate), frame=replace(frame, share=share))
        assert pace.frame.share is not None
        return pace, max(pace.frame.share, floor)

    def drawn(
        self,
        size: tuple[int, int],
        full: tuple[int, int],
        seconds: float,
        cost: Cost = "vdi",
        effort: float = 1.0,
    ) -> Pace:
        """Note a raycast of this frame: the image's size, the viewport's, its time, and of what."""
        frame = self.frame
        after = replace(
            frame,
            cost=cost,
            rays=frame.rays + round(size[0] * size[1] * effort),
            full_rays=frame.full_rays + round(full[0] * full[1] * effort),
            images=frame.images + 1,
            work=frame.work + seconds,
        )
        return replace(self, frame=after)

    def showed(self, preview: bool) -> Pace:
        """Note that a VDI of this frame is a preview, or not."""
        preview = preview or self.frame.preview
        return replace(self, frame=replace(self.frame, preview=preview))

    def began(self, multi_samples: int) -> Pace:
        """Begin a frame."""
        return replace(self, frame=FrameSoFar(multi_samples=multi_samples))

    def ended(self, seconds: float | None, moving: bool) -> Pace:
        """End a frame that took so long, where that is known; a hand may move."""
        frame, pace = self.frame, replace(self, frame=FrameSoFar())
        if frame.rays:
            # The first frame began before anybody looked at the clock: its work is known
            pace = pace._recorded(frame, frame.work if seconds is None else seconds)
        if pace.interacting and not frame.interactive and not moving:
            rested = tuple((cost, rate.rest()) for cost, rate in pace.rates)
            pace = replace(pace, interacting=False, rates=rested)
        return pace

    def _recorded(self, frame: FrameSoFar, seconds: float) -> Pace:
        """Note a whole frame."""
        pace = replace(self, seconds=seconds, cost=frame.cost)
        resting = dict(self.resting)
        if not frame.interactive:
            resting[frame.cost] = Resting(frame.rays, frame.work, seconds)
            return replace(pace, resting=tuple(resting.items()))._judged(frame, seconds)
        # A stochastic approximation of the quantile (Robbins and Monro 1951)
        late = seconds * frame.target > _LATE * self.headroom
        raised = self.headroom * math.exp(_RAISE * (late - _LATE_SHARE))
        rates = dict(self.rates)
        if frame.cost in rates:
            rates[frame.cost] = rates[frame.cost].record(frame.rays, frame.work, seconds)
        if frame.cost in _OTHER_LISTS:
            # Half the lists are expected to take half the time
            other, factor = _OTHER_LISTS[frame.cost]
            work = frame.work * factor
            resting[other] = Resting(frame.rays, work, seconds - frame.work + work)
            rates.pop(other, None)  # what it knew was of another view
        few_lists = self.few_lists
        if frame.cost != "volume" and frame.share is not None:
            few_lists = frame.share < (_FEW_ABOVE if frame.cost == "few lists" else _FEW_BELOW)
        pace = replace(
            pace,
            interacting=True,
            target=frame.target,
            headroom=min(max(HEADROOM, raised), _MOST_HEADROOM),
            full_rays=frame.full_rays,
            images=frame.images,
            rates=tuple(rates.items()),
            resting=tuple(resting.items()),
            few_lists=few_lists,
        )
        return pace._judged(frame, seconds)

    def _judged(self, frame: FrameSoFar, seconds: float) -> Pace:
        """Learn from a frame whether those of a motion go without multisampling."""
        smooth, now = frame.multi_samples > 0, seconds - frame.work
        before = self.beside[smooth]
        beside = (self.beside[0], now) if smooth else (now, self.beside[1])
        pace = replace(self, beside=beside)
        if not smooth:
            return pace
        least = min(before, now)  # a single frame may have been held up by anything
        # Before rays are given up: with all of them, would it be late?
        whole = least + frame.work * frame.full_rays / frame.rays
        dear = whole * self.target > 1 and least * self.target > _DEAR_BESIDE
        if dear == self.dear_samples:
            return pace
        # Frames are cheaper now, or dearer
        return replace(pace, dear_samples=dear, few_lists=False, rates=())

    def _tuned(self, target: float, floor: float, cost: Cost) -> tuple[Pace, FrameRate]:
        """Return the window's frame rate, with this target and at most this floor."""
        pace = replace(self, rates=()) if floor < self.floor else self
        rate = dict(pace.rates).get(cost)
        if rate is None:
            rate, pace = FrameRate(target, floor=floor), replace(pace, floor=floor)
            known = dict(self.resting).get(cost)
            if known is not None:
                # What the last full frame took, so that an interaction does not begin with another
                seconds = known.work + self.beside[0] if self.dear_samples else known.seconds
                rate = rate.record(known.rays, known.work, seconds)
        return pace, replace(rate, target_fps=target)

    def _with(self, cost: Cost, rate: FrameRate) -> Pace:
        return replace(self, rates=tuple({**dict(self.rates), cost: rate}.items()))


def reduced(size: tuple[int, int], share: float) -> tuple[int, int]:
    """Return the size in whole pixels, of about the same aspect, that has this share of pixels."""
    if share >= 1:
        return size
    scale = math.sqrt(share)
    width, height = (max(1, round(edge * scale)) for edge in size)
    return width, height
