"""What rays have taken, and by that which draws the better picture in time: VDI or volume."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

#: What can be raycast for a frame.
RenderMode: TypeAlias = Literal["vdi", "volume"]

#: SSIM lost by drawing every k-th pixel along each edge and interpolating linearly: medians over
#: six volumes x soft and steep, 640 x 360 pixels, 30 degrees from the generating view
#: (docs/decisions/render_mode.md).
_STEPS = (1.0, 1.25, 1.5, 2.0, 3.0, 4.0)
_LOST = (0.0, 0.0105, 0.013, 0.0188, 0.0319, 0.0445)
#: Time of a ray through a VDI over that at its generating view, by degrees from there: six volumes
#: of 128^3 to 256^3 voxels, 20 supersegments, middle of what was seen.
_ANGLES = (0.0, 5.0, 15.0, 30.0, 60.0, 90.0)
_RISE = (1.0, 6.4, 14.0, 24.0, 34.0, 40.0)
#: Weight of the newest frame in the mean of what frames took.
_NEWEST = 0.4
#: SSIM that the other way must gain, and share of the time at rest that it must save, to be taken:
#: predictions are no better than that, and nothing may flicker.
_GAIN, _SAVING = 0.004, 0.25
#: SSIM lost by a VDI so many degrees from its view, and farther, where nothing was estimated: the
#: median at 30 degrees of docs/performance.md.
_UNKNOWN_LOSS, _LOST_FROM = 0.012, 5.0


@dataclass(frozen=True)
class Costs:
    """Seconds that a ray takes, by frames' means that forget, and which way was chosen last.

    Those of a VDI are as if at its generating view: there rays are cheapest (:func:`rise`). The
    volume's take the same from everywhere, and theirs is the picture that a VDI approaches.
    """

    volume: float | None = None
    vdi: float | None = None
    way: RenderMode = "vdi"

    def took(self, way: RenderMode, angle: float, pixels: float, seconds: float) -> Costs:
        """Note what a frame's rays have taken, through a VDI so many degrees from its view."""
        if not (pixels >= 1 and seconds > 0):
            return self
        each = seconds / pixels / (1.0 if way == "volume" else rise(angle))
        before = getattr(self, way)
        mean = each if before is None else before + _NEWEST * (each - before)
        return replace(self, volume=mean) if way == "volume" else replace(self, vdi=mean)

    def better(
        self, angle: float, pixels: float, seconds: float | None, ssim: float | None, bound: float
    ) -> RenderMode:
        """Choose how the next frame is to be drawn.

        Where both keep a rate with fewer pixels, what the missing pixels lose is weighed against
        what the VDI loses. Until both have told what they take it is the VDI, and what was drawn
        last stays unless the other is better by more than predictions are wrong by.

        The view is ``angle`` degrees from the generating view, ``pixels`` rays of the full frame
        may meet the volume, and they may take ``seconds``, ``None`` at rest, where all are drawn.
        ``ssim`` is the VDI's estimate for this view, and ``bound`` the least that does at rest.
        """
        own = _UNKNOWN_LOSS * min(1.0, angle / _LOST_FROM) if ssim is None else max(0.0, 1 - ssim)
        if seconds is None and own > 1 - bound:
            return "volume"
        if self.volume is None or self.vdi is None:
            return "vdi"
        times = {"vdi": self.vdi * rise(angle), "volume": self.volume}
        other: RenderMode = "volume" if self.way == "vdi" else "vdi"
        if seconds is None:
            changes = times[other] < (1 - _SAVING) * times[self.way]
        else:
            losses = {
                way: _loss_of_pixels(t * max(pixels, 1.0) / seconds) for way, t in times.items()
            }
            losses["vdi"] += own
            changes = losses[other] < losses[self.way] - _GAIN
        return other if changes else self.way


def rise(angle: float) -> float:
    """Return what a ray takes through a VDI, over one at its view, so many degrees from there."""
    return float(np.interp(angle, _ANGLES, _RISE))


def _loss_of_pixels(too_long: float) -> float:
    """Return the SSIM lost by as few pixels as it takes to be this many times faster."""
    step = max(1.0, too_long) ** 0.5
    beyond = max(0.0, step - _STEPS[-1]) * (_LOST[-1] - _LOST[-2])
    return float(np.interp(step, _STEPS, _LOST)) + beyond
