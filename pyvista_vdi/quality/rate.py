"""How many rays the frames of a window get, so that they keep a rate (paper section 5).

Whoever draws says what frames have taken, and asks; there is no clock here.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

from pyvista_vdi.quality.plan import RenderMode

#: Frames whose mean rate is reported (paper section 5), and those that the cost is estimated from:
#: with more, a quickly turning view is followed too late.
RECENT_FRAMES, _MEMORY = 5, 8
#: Fewest samples by default, as a share of the full frame: a quarter of its pixels along each edge.
FLOOR = 1 / 16
#: Relative deviation from the target within which nothing changes. Frames are to keep within twice
#: as much: the rest is room for what the mean learns too late.
_DEAD_BAND = 0.05
#: A frame this many times slower or faster than expected is believed when the next one is, too.
_STALL = 2.0
#: Share of a frame's time that the work gets where all else alone misses the rate: a blurred
#: picture that is no faster helps nobody.
_LEAST_WORK = 0.25

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
_SLOW_BESIDE = 0.25


class _Frame(NamedTuple):
    samples: int
    work: float  # seconds
    overhead: float  # seconds


@dataclass(frozen=True)
class FrameRate:
    """What frames have told, and how many samples were chosen by it: the paper's controller.

    A sample is any unit in proportion to which a frame's work grows, such as the rays of an image
    with fewer pixels. Each method returns the record that follows.

    The paper divides the mean time of the last five frames by their samples and adjusts the samples
    where that mean misses the target by more than the threshold. Here a frame's time is
    ``overhead + seconds_per_sample * samples``, whose two numbers are means of the last eight
    frames: dividing the overhead by the samples as well would make every correction too small.
    Nothing changes within a twentieth of the target. A frame that takes more than twice, or less
    than half, of what was expected is set aside, and dropped as a stall unless the next is off in
    the same sense: then the two are the new truth. Where the overhead alone misses the target, the
    work gets a quarter of the frame's time.
    """

    target_fps: float = 30.0  # to be kept
    floor: float = FLOOR  # fewest samples, as a share of the full frame
    frames: tuple[_Frame, ...] = ()  # what the estimate is made of, oldest first
    doubtful: _Frame | None = None  # set aside until the next frame
    choice: int | None = None  # None: full

    def choose(self, full: int) -> FrameRate:
        """Return the same with the samples chosen that the next frame gets, of so many."""
        if not self.frames:
            return self
        overhead, each = self._cost()
        aim = 1 / self.target_fps
        aim = overhead / (1 - _LEAST_WORK) if overhead >= aim else max(aim, 1.1 * overhead)
        band = max(_DEAD_BAND * aim, each)  # no closer than a sample
        fitting, expected = (aim - overhead) / each, overhead + each * self.chosen(full)
        if self.choice is None and expected <= aim + band:
            return self
        # Back to full where it fits with room to spare, so that it is not left again at once
        if self.choice is not None and overhead + each * full <= aim - band:
            return replace(self, choice=None)
        wanted = fitting if abs(expected - aim) > band else self.chosen(full)
        least = math.ceil(self.floor * full)
        return replace(self, choice=max(least, int(min(wanted, full - 1))))

    def chosen(self, full: int) -> int:
        """Return how many samples the next frame gets: those chosen, or ``full`` if none were."""
        return full if self.choice is None else self.choice

    def record(self, samples: int, work: float, seconds: float) -> FrameRate:
        """Return the same after a frame of so many samples: what they took, and all of it."""
        if not (work > 0 and samples >= 1):
            return self
        frame, kept, doubtful = _Frame(samples, work, max(0.0, seconds - work)), self.frames, None
        # Set a stall aside until the next frame confirms it
        if kept:
            over = self._over(frame)
            if not 1 / _STALL <= over <= _STALL:
                before, doubtful = self.doubtful, frame
                if before is None or (self._over(before) > 1) != (over > 1):
                    return replace(self, doubtful=doubtful)
                kept, doubtful = (before,), None
        return replace(self, frames=(*kept, frame)[-_MEMORY:], doubtful=doubtful)

    def _over(self, frame: _Frame) -> float:
        overhead, each = self._cost()
        return (frame.work + frame.overhead) / (overhead + each * frame.samples)

    def _cost(self) -> tuple[float, float]:
        """Return the overhead, and what a sample is expected to take, seconds."""
        overhead = statistics.fmean(frame.overhead for frame in self.frames)
        return overhead, statistics.fmean(frame.work / frame.samples for frame in self.frames)


@dataclass
class _SoFar:
    """What the VDIs of one frame have taken together."""

    share: float | None = None  # of its pixels that each is drawn with; None before one has asked
    interactive: bool = False  # whether one may be a preview
    preview: bool = False  # whether one is
    target: float = 0.0  # the highest rate that one aims at, 1/s
    rays: int = 0  # that were cast, each by its effort
    full_rays: int = 0  # those of full images
    images: int = 0  # that were raycast
    work: float = 0.0  # seconds that this took
    way: RenderMode = "vdi"  # what was raycast
    multi_samples: int = 0  # that OpenGL takes of a pixel


class Pace:
    """What the frames of a window have taken, and what is chosen by that.

    All previews of a frame are reduced by the same share, so several VDIs, the two eyes of a stereo
    pair and several viewports divide the time among them by their pixels.

    Attributes
    ----------
    seconds : float or None
        What the last frame that was raycast took, from the window's StartEvent to its EndEvent;
        ``None`` before. The time between two frames would count how long a hand rests.
    slow_samples : bool
        Whether frames with multisampling and all rays would be late.
    headroom : float
        What is aimed at, over the rate that is to be kept.
    """

    def __init__(self) -> None:
        self.frame = _SoFar()
        self.seconds: float | None = None
        self.slow_samples = False
        self.headroom = HEADROOM
        self._beside = [0.0, 0.0]  # seconds, without multisampling and with it
        self._last = _SoFar()  # of a motion
        self._recent: deque[float] = deque(maxlen=RECENT_FRAMES)  # seconds, of a motion
        self._floor = 0.0
        self._rates: dict[RenderMode, FrameRate] = {}
        self._resting: dict[RenderMode, _Frame] = {}  # what a full frame takes

    @property
    def fps(self) -> float | None:
        """Mean rate of the motion's last frames; at rest what the last frame would allow."""
        recent = self._recent or [self.seconds or 0.0]
        return len(recent) / sum(recent) if sum(recent) else None

    def late(self, seconds: float, target: float) -> bool:
        """Whether frames whose rays take so long miss a rate, and rays are what takes long."""
        # Multisampling goes first, and then no more than a quarter is left beside the rays
        beside = self._beside[0] or min(self._beside[1], _SLOW_BESIDE / target)
        return seconds > max(1 / target - beside, _LEAST_WORK / target)

    def share(
        self,
        target: float,
        pixels: int,
        floor: float,
        way: RenderMode = "vdi",
        *,
        effort: float = 1.0,
        expected: float | None = None,
    ) -> float:
        """Choose the share of its pixels, 0 to 1, that a VDI is drawn with in a frame of a motion.

        ``target`` is the rate to be kept, 1/s, ``pixels`` those of the full image, ``floor`` the
        least share, ``effort`` what a ray of this view is expected to take over one of others, and
        ``expected`` how many seconds a full image may take where no frame has told.
        """
        aim, frame = self.headroom * target, self.frame
        frame.interactive, frame.target = True, max(frame.target, aim)
        if frame.share is None:
            # The other VDIs of this frame are not known yet: count on those of the last
            full = round(pixels * effort)
            if self._last.images > 1:
                full = max(self._last.full_rays, full)
            if expected is not None and way not in self._resting:
                self._resting[way] = _Frame(full, expected, 0.0)
            rate = self._tuned(max(aim, self._last.target), floor, way).choose(full)
            self._rates[way] = rate
            frame.share = rate.chosen(full) / full
        return max(frame.share, floor)

    def drawn(
        self,
        size: tuple[int, int],
        full: tuple[int, int],
        seconds: float,
        way: RenderMode = "vdi",
        effort: float = 1.0,
    ) -> None:
        """Note a raycast of this frame: the image's size, the viewport's, its time, and of what."""
        frame = self.frame
        frame.way = way
        frame.rays += round(size[0] * size[1] * effort)
        frame.full_rays += round(full[0] * full[1] * effort)
        frame.images += 1
        frame.work += seconds

    def began(self, multi_samples: int) -> None:
        """Begin a frame."""
        self.frame = _SoFar(multi_samples=multi_samples)

    def ended(self, seconds: float | None, moving: bool) -> None:
        """End a frame that took so long, where that is known; a hand may move."""
        frame, self.frame = self.frame, _SoFar()
        if not (frame.interactive or moving):
            self._recent.clear()
        if not frame.rays:
            return
        if seconds is None:  # the first frame began before anybody looked at the clock
            seconds = frame.work
        self.seconds = seconds
        if frame.interactive:
            # A stochastic approximation of the quantile (Robbins and Monro 1951)
            late = seconds * frame.target > _LATE * self.headroom
            raised = self.headroom * math.exp(_RAISE * (late - _LATE_SHARE))
            self.headroom = min(max(HEADROOM, raised), _MOST_HEADROOM)
            if frame.way in self._rates:
                rate = self._rates[frame.way]
                self._rates[frame.way] = rate.record(frame.rays, frame.work, seconds)
            self._last = frame
            self._recent.append(seconds)
        else:
            self._resting[frame.way] = _Frame(frame.rays, frame.work, seconds - frame.work)
        # Learn whether frames of a motion go without multisampling
        smooth, now = frame.multi_samples > 0, seconds - frame.work
        before, self._beside[smooth] = self._beside[smooth], now
        if not smooth:
            return
        least = min(before, now)  # a single frame may have been held up by anything
        # Before rays are given up: with all of them, would it be late?
        whole = least + frame.work * frame.full_rays / frame.rays
        target = self._last.target
        slow = whole * target > 1 and least * target > _SLOW_BESIDE
        if slow != self.slow_samples:  # frames take less now, or more
            self.slow_samples, self._rates = slow, {}

    def _tuned(self, target: float, floor: float, way: RenderMode) -> FrameRate:
        """Return the window's frame rate, with this target and at most this floor."""
        if floor < self._floor:
            self._rates.clear()
        rate = self._rates.get(way)
        if rate is None:
            rate, self._floor = FrameRate(target, floor=floor), floor
            known = self._resting.get(way)
            if known is not None:
                # What the last full frame took, so that an interaction begins with no other
                beside = self._beside[0] if self.slow_samples else known.overhead
                rate = rate.record(known.samples, known.work, known.work + beside)
        return rate if rate.target_fps == target else replace(rate, target_fps=target)


def reduced(size: tuple[int, int], share: float) -> tuple[int, int]:
    """Return the size in whole pixels, of about the same aspect, that has this share of pixels."""
    scale = math.sqrt(min(share, 1.0))
    width, height = (max(1, round(edge * scale)) for edge in size)
    return width, height
