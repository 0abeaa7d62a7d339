"""What rays have taken, and by that which draws the better picture in time: VDI or volume."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

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
#: Share of that which is expected of a GPU: whole pictures of the paper's volumes took 1.6 to 4.1
#: times as long at 30 degrees there (docs/decisions/gpu.md).
_ON_GPU = 0.07
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
    """What a picture takes, by the last frames of both ways, and which way was chosen last.

    That is ``fixed + rays * each`` seconds. The volume's rays take the same from everywhere, and
    theirs is the picture that a VDI approaches. ``vdi`` is what a VDI's take at its generating
    view, where they are cheapest: from others :meth:`rise` times as much, which starts with what is
    expected of the device's kind and follows what frames take.
    """

    volume: float | None = None
    vdi: float | None = None
    way: RenderMode = "vdi"
    fixed: float = 5e-4
    slope: float | None = None  # of the rise with the angle, over the typical one of CPUs

    def took(
        self, way: RenderMode, angle: float, pixels: float, seconds: float, *, gpu: bool
    ) -> Costs:
        """Note what a picture's rays have taken, through a VDI so many degrees from its view."""
        if not (pixels >= 1 and seconds > 0):
            return self
        own = replace(self, slope=self.slope or (_ON_GPU if gpu else 1.0))
        rise, each = (own.rise(angle), self.vdi) if way == "vdi" else (1.0, self.volume)
        if each is None:
            found: Any = {way: max(seconds - self.fixed, seconds / 2) / (pixels * rise)}
            return replace(own, **found)
        # Divide the relative error among a ray, its rise and what is fixed, by their parts
        rays = pixels * rise * each
        total = rays + self.fixed
        parts = np.array([rays, rays * (1 - 1 / rise), self.fixed]) / total
        error = _NEWEST * math.log(seconds / total)
        ray, slope, fixed = np.exp(error * parts / (parts @ parts)).tolist()
        found = {way: each * ray, "slope": own.slope * slope, "fixed": self.fixed * fixed}
        return replace(own, **found)

    def rise(self, angle: float) -> float:
        """Return what a ray takes through a VDI, over one at its view, so many degrees away."""
        return 1 + (self.slope or 1.0) * (float(np.interp(angle, _ANGLES, _RISE)) - 1)

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
        each = {"vdi": self.vdi * self.rise(angle), "volume": self.volume}
        times = {way: self.fixed + max(pixels, 1.0) * ray for way, ray in each.items()}
        other: RenderMode = "volume" if self.way == "vdi" else "vdi"
        if seconds is None:
            changes = times[other] < (1 - _SAVING) * times[self.way]
        else:
            room = max(seconds - self.fixed, 1e-9)
            losses = {way: _loss_of_pixels((t - self.fixed) / room) for way, t in times.items()}
            losses["vdi"] += own
            changes = losses[other] < losses[self.way] - _GAIN
        return other if changes else self.way


def _loss_of_pixels(too_long: float) -> float:
    """Return the SSIM lost by as few pixels as it takes to be this many times faster."""
    step = max(1.0, too_long) ** 0.5
    beyond = max(0.0, step - _STEPS[-1]) * (_LOST[-1] - _LOST[-2])
    return float(np.interp(step, _STEPS, _LOST)) + beyond
