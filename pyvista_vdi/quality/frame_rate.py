"""Keeps a frame rate by giving up samples (paper section 5); pure Python, no device.

The controller knows nothing of what a sample is: any unit in proportion to which a frame's work
grows will do, such as the rays of an image with fewer pixels, or the samples along each ray.
"""

import math
import statistics
from dataclasses import dataclass
from typing import Any, NamedTuple

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.quality.records import replace

#: Frames whose mean rate is reported, and the fewest that show a trend (paper section 5).
RECENT_FRAMES = 5
#: Fewest samples by default, as a share of the full frame: a quarter of its pixels along each edge.
FLOOR = 1 / 16

#: Frames that the cost is estimated from. With five, noise of 10 % changes the choice in 22 % of
#: the frames, with eight in 12 %; with more, a quickly turning view is followed too late (measured
#: on the simulated devices of the tests).
_MEMORY = 8
#: Share of the threshold within which nothing changes. The rest is room for what the mean of five
#: frames learns too late, so that frames keep within the threshold while the cost drifts.
_DEAD_BAND = 0.5
#: A frame this many times slower or faster than expected is believed when the next one is, too.
_STALL = 2.0
#: Standard errors from which the slope of the cost counts as a trend of the view.
_TREND = 2.0
#: Durations that are believed, seconds; what is outside comes from a clock at fault.
_DURATIONS = (1e-9, 1e6)
#: Frames within which a return to full quality has failed if it is left again.
_TRIAL = 2 * RECENT_FRAMES


class _FrameTimes(NamedTuple):
    samples: int
    work: float  # seconds
    overhead: float  # seconds

    @property
    def seconds(self) -> float:
        return self.work + self.overhead


class _Cost(NamedTuple):
    """A frame's time as a straight line: the overhead, and the work in proportion to samples."""

    overhead: float  # seconds
    per_sample: float  # seconds
    error: float = 0.0  # standard error of per_sample, seconds

    def of(self, samples: float) -> float:
        return self.overhead + self.per_sample * samples


@dataclass(frozen=True)
class FrameRate:
    """What frames have told, and how many samples were chosen by it.

    See :class:`FrameRateController`, whose arguments it has unchecked.
    """

    target_fps: float = 30.0
    threshold: float = 0.1
    floor: float = FLOOR
    durations: tuple[float, ...] = ()  # seconds, stalls included
    frames: tuple[_FrameTimes, ...] = ()  # what the estimate is made of, oldest first
    doubtful: _FrameTimes | None = None  # set aside until the next frame
    choice: int | None = None  # None: full
    full_excess: float = 1.0  # cost of a full frame's sample over that of a reduced one's
    cost_before_full: float = math.inf  # per sample, seconds, when full quality was last taken
    trial: int = 0  # frames for which a return to full quality is still on trial

    @property
    def fps(self) -> float:
        """Mean rate of the last five frames of this interaction; 0 before the first."""
        return len(self.durations) / sum(self.durations) if self.durations else 0.0

    @property
    def seconds_per_sample(self) -> float:
        """What a sample is expected to cost, seconds; 0 before the first frame."""
        return self.cost().per_sample if self.frames else 0.0

    def choose(self, full: int) -> "FrameRate":
        """Return the same with the samples chosen that the next frame gets."""
        if not self.frames:
            return self
        cost = self.cost()
        aim = self._aim(cost)
        if self.choice is None:
            # Leave full quality if it misses the aim
            if cost.of(full) <= aim + self._slack(cost, full):
                return self
            excess, trial = self.full_excess, self.trial
            if trial:
                # It had seemed to fit. Each failure raises the bar, so that there are few
                raised = excess * (1 + _DEAD_BAND * self.threshold)
                excess, trial = max(raised, cost.per_sample / self.cost_before_full), 0
            return replace(self, choice=self._reduced(cost, full), full_excess=excess, trial=trial)
        # Go back to full quality if it fits; change a reduced choice if it misses the aim
        dear = full * self.full_excess
        if cost.of(dear) + cost.error * dear <= aim:
            return replace(self, choice=None, trial=_TRIAL, cost_before_full=cost.per_sample)
        if abs(cost.of(self.choice) - aim) > self._slack(cost, self.choice):
            return replace(self, choice=self._reduced(cost, full))
        return replace(self, choice=self._within(self.choice, full))

    def chosen(self, full: int) -> int:
        """Return how many samples the next frame gets: those chosen, or ``full`` if none were."""
        return full if self.choice is None else self.choice

    def record(self, samples: int, work: float, seconds: float) -> "FrameRate":
        """Return the same after a frame of so many samples, which took so many seconds."""
        least, most = _DURATIONS
        if not (least <= work <= most and least <= seconds <= most):
            return self
        durations = (*self.durations, max(work, seconds))[-RECENT_FRAMES:]
        after = replace(self, durations=durations, trial=max(0, self.trial - 1))
        frame = _FrameTimes(samples, work, max(0.0, seconds - work))
        # Set a stall aside until the next frame confirms it
        if self.frames:
            expected = self.cost().of(samples)
            if not 1 / _STALL <= frame.seconds / expected <= _STALL:
                before = self.doubtful
                after = replace(after, doubtful=frame)
                if before is None or (before.seconds > expected) != (frame.seconds > expected):
                    return after
                after = replace(after, frames=(before,))
        return replace(after, doubtful=None, frames=(*after.frames, frame)[-_MEMORY:])

    def rest(self) -> "FrameRate":
        """Return the same after the end of an interaction."""
        return replace(self, durations=(), doubtful=None, full_excess=1.0, trial=0)

    def cost(self) -> _Cost:
        """Return what the next frame is expected to cost: a line's next point if there is one."""
        n = len(self.frames)
        overhead = statistics.fmean(frame.overhead for frame in self.frames)
        costs = [frame.work / frame.samples for frame in self.frames]
        mean = statistics.fmean(costs)
        if n < RECENT_FRAMES:
            return _Cost(overhead, mean)
        # Least squares; times are in frames from the mean time
        times = [i - (n - 1) / 2 for i in range(n)]
        squares = sum(t * t for t in times)
        slope = sum(t * c for t, c in zip(times, costs, strict=True)) / squares
        residuals = [c - mean - slope * t for t, c in zip(times, costs, strict=True)]
        deviation = math.sqrt(sum(r * r for r in residuals) / (n - 2))
        error = deviation / math.sqrt(n)
        if abs(slope) * math.sqrt(squares) <= _TREND * deviation:
            return _Cost(overhead, mean, error)
        # A falling line ends above zero. One frame on, the standard error of a line is about twice
        # that of the mean.
        ahead = mean + slope * (n + 1) / 2
        return _Cost(overhead, max(ahead, mean / _STALL), 2 * error)

    def _aim(self, cost: _Cost) -> float:
        """Return the time that the next frame shall take, seconds."""
        return max(1 / self.target_fps, (1 + self.threshold) * cost.overhead)

    def _slack(self, cost: _Cost, samples: float) -> float:
        """Return by how much the time may miss the aim before something changes, seconds."""
        # Whole samples come no closer than one of them
        band = max(_DEAD_BAND * self.threshold * self._aim(cost), cost.per_sample)
        return band + cost.error * samples

    def _reduced(self, cost: _Cost, full: int) -> int:
        """Return the samples that meet the aim, fewer than a full frame's."""
        return self._within((self._aim(cost) - cost.overhead) / cost.per_sample, full)

    def _within(self, samples: float, full: int) -> int:
        return max(math.ceil(self.floor * full), int(min(samples, full - 1)))


class FrameRateController:
    """Chooses how many samples the next frame gets, so that a target frame rate is kept.

    Call :meth:`choose` before each frame of an interaction, :meth:`record` after it, and
    :meth:`rest` when the interaction ends.

    Parameters
    ----------
    target_fps : float
        Frames per second to be kept.
    threshold : float
        Relative deviation from the target, between 0 and 1, that frames should keep within.
    floor : float
        Fewest samples, as a share of the full frame, above 0 and at most 1.

    Raises
    ------
    InvalidArgumentError
        If an argument is out of its range.

    Notes
    -----
    The paper divides the mean time of the last five frames by their samples and adjusts the
    samples where that mean misses the target by more than the threshold. This is the same with
    these differences:

    - A frame's time is ``overhead + seconds_per_sample * samples``. The overhead, what a frame
      takes beside the work, is measured; dividing it by the samples as well would make every
      correction too small.
    - The time compared with the target is that expected for the present choice, which is the mean
      of the last frames once they were drawn with it. Frames drawn with another choice tell
      the cost per sample, and do not call for a second correction.
    - Three more frames count, against noise. Where the cost per sample follows a line over these
      eight, as while the camera turns, the line is continued to the next frame.
    - A frame that takes more than twice, or less than half, of what was expected is set aside. It
      is dropped as a stall if the next frame is as expected. If the next is off in the same sense
      the two are the new truth and all older ones are forgotten. So a stall changes nothing, and a
      step of the cost is followed after two frames.
    - Nothing changes within half the threshold and the estimate's own standard error. The other
      half is left for what the mean learns late.
    - Full quality is taken as soon as it is expected to fit the target, and left when it misses it
      by half the threshold. If it is left within ten frames, a full sample is taken to cost more
      than others (as where another kernel draws reduced frames), by as much as was measured and by
      more with each failure, until the interaction ends: so there are few returns in vain.
    - **A target may be out of reach.** Where the overhead takes all of the target's period, giving
      up samples buys nothing. The work therefore always gets at least ``threshold * overhead``
      seconds: without it, the frame would be faster by no more than the threshold. Where the work
      at the floor is too slow, the floor it is.
    """

    def __init__(
        self, target_fps: float = 30.0, *, threshold: float = 0.1, floor: float = FLOOR
    ) -> None:
        share = as_float(floor)
        if not 0 < share <= 1:
            raise InvalidArgumentError(
                f"floor must be a share of the full frame, above 0 and at most 1; got {floor!r}"
            )
        self._rate = FrameRate(floor=share)
        self.target_fps = target_fps
        self.threshold = threshold

    @property
    def target_fps(self) -> float:
        """Frames per second to be kept; what was learned stays when it is set."""
        return self._rate.target_fps

    @target_fps.setter
    def target_fps(self, value: float) -> None:
        rate = as_float(value)
        if not (math.isfinite(rate) and rate > 0):
            raise InvalidArgumentError(
                f"target_fps must be a number of frames per second above 0; got {value!r}"
            )
        self._rate = replace(self._rate, target_fps=rate)

    @property
    def threshold(self) -> float:
        """Relative deviation from the target that frames should keep within."""
        return self._rate.threshold

    @threshold.setter
    def threshold(self, value: float) -> None:
        share = as_float(value)
        if not 0 < share < 1:
            raise InvalidArgumentError(
                "threshold must be a relative deviation between 0 and 1, both excluded, such as "
                f"0.1; got {value!r}"
            )
        self._rate = replace(self._rate, threshold=share)

    @property
    def fps(self) -> float:
        """Mean rate of the last five frames of this interaction; 0 before the first."""
        return self._rate.fps

    @property
    def seconds_per_sample(self) -> float:
        """What a sample is expected to cost, seconds; 0 before the first frame."""
        return self._rate.seconds_per_sample

    def choose(self, full: int) -> int:
        """Return how many samples the next frame gets: at least ``floor * full``, at most `full`.

        `full` are those of a frame in full quality, at least 1 (InvalidArgumentError); it may
        change from frame to frame, as with the window's size. Returned while no frame was recorded.
        """
        full = _samples("full", full)
        self._rate = self._rate.choose(full)
        return self._rate.chosen(full)

    def record(self, samples: int, work_seconds: float, frame_seconds: float) -> None:
        """Take note of a frame of the interaction: its samples, which need not be the ones chosen.

        ``work_seconds`` is what they took, ``frame_seconds`` what the whole frame took: the work,
        other actors, copies; not the wait for the next event. It is taken as no less than the work.
        A frame whose duration is zero, negative, infinite or NaN is ignored: a clock's fault shall
        not end an interaction. The frame drawn before the first interaction may be recorded as
        well; then that interaction need not begin with a frame in full quality.
        InvalidArgumentError if `samples` is not at least 1.
        """
        samples = _samples("samples", samples)
        self._rate = self._rate.record(samples, as_float(work_seconds), as_float(frame_seconds))

    def rest(self) -> None:
        """End the interaction: its rate is forgotten, what samples cost and the choice are not."""
        self._rate = self._rate.rest()


def _samples(name: str, value: Any) -> int:
    count = as_float(value)
    if not 1 <= count < math.inf:
        raise InvalidArgumentError(f"{name} must be a count of at least 1; got {value!r}")
    return int(count)
