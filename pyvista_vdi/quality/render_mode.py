"""The render mode of a frame: VDI or volume, whichever is better in the time there is."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError

#: What a frame is raycast from.
RenderMode = Literal["vdi", "volume"]

#: SSIM lost by drawing every k-th pixel along each edge and interpolating linearly: medians over
#: six volumes x soft and steep, 640 x 360 pixels, 30 degrees from V_O
#: (docs/decisions/render_mode.md).
_STEPS = (1.0, 1.25, 1.5, 2.0, 3.0, 4.0)
_LOST = (0.0, 0.0105, 0.013, 0.0188, 0.0319, 0.0445)

#: Time of a ray through a VDI over that at V_O, by degrees from there: six volumes of 128^3 to
#: 256^3 voxels, 20 supersegments, middle of what was seen.
_ANGLES = (0.0, 5.0, 15.0, 30.0, 60.0, 90.0)
_RISE = (1.0, 6.4, 14.0, 24.0, 34.0, 40.0)

#: Degrees within which what VDI frames took counts for each other.
_NEIGHBOURS = 5.0
#: Weight of the newest frame in the mean of what frames took.
_NEWEST = 0.4
#: SSIM that the other way must gain, and share of the time at rest that it must save, to be taken:
#: predictions are no better than that, and nothing may flicker.
_GAIN, _SAVING = 0.004, 0.25
#: SSIM lost by a VDI away from V_O where nothing was estimated: the median at 30 degrees of
#: docs/performance.md.
_UNKNOWN_LOSS = 0.012


def checked_draw(draw: Any) -> Literal["auto", "vdi", "volume"]:
    """Return what is drawn, ``"auto"``, ``"vdi"`` or ``"volume"``; refuse anything else."""
    if draw in ("auto", "vdi", "volume"):
        return draw  # type: ignore[no-any-return]
    raise InvalidArgumentError(f"draw must be 'auto', 'vdi' or 'volume'; got {draw!r}")


class RenderModeChooser:
    """Chooses between VDI and volume for each frame, from what frames have taken before.

    A VDI's rays are cheapest at V_O and dearer from there on, the volume's take the same from
    everywhere, and theirs is the picture that a VDI approaches. Where both keep a rate with fewer
    pixels, what the missing pixels lose is weighed against what the VDI loses.
    """

    def __init__(self) -> None:
        self._at_v_o: dict[int, float] = {}  # seconds per pixel, as if at V_O, by neighbourhood
        self._volume: float | None = None  # seconds per pixel
        self._way: RenderMode = "vdi"

    @property
    def way(self) -> RenderMode:
        """What was chosen last."""
        return self._way

    def took(self, way: RenderMode, angle: float, pixels: float, seconds: float) -> None:
        """Note what a frame's rays have taken.

        ``way`` ("vdi", "volume"): what was drawn. ``angle``: between the view and V_O, degrees.
        ``pixels``: rays that may meet the volume. ``seconds``: what they took.
        """
        if not (pixels >= 1 and seconds > 0):
            return
        each = seconds / pixels
        if way == "volume":
            self._volume = _mean(self._volume, each)
        else:
            near = round(angle / _NEIGHBOURS)
            self._at_v_o[near] = _mean(self._at_v_o.get(near), each / rise(angle))

    def seconds_per_pixel(self, way: RenderMode, angle: float) -> float | None:
        """Return what a ray is expected to take; ``None`` where no frame has told."""
        if way == "volume":
            return self._volume
        if not self._at_v_o:
            return None
        nearest = min(self._at_v_o, key=lambda near: abs(near - angle / _NEIGHBOURS))
        return self._at_v_o[nearest] * rise(angle)

    def choose(
        self,
        angle: float,
        pixels: float,
        seconds: float | None,
        ssim: float | None = None,
        bound: float = 0.0,
    ) -> RenderMode:
        """Return how the next frame is to be drawn.

        ``angle``: between the view and V_O, degrees. ``pixels``: rays of the full frame that may
        meet the volume. ``seconds``: what its rays may take; ``None`` at rest, where all pixels are
        drawn. ``ssim``: estimate for the VDI from this view. ``bound``: least SSIM that does at
        rest. Returns: the VDI until both have told what they take; afterwards the
        better picture, or at rest the one that is there sooner. What was drawn last stays unless
        the other is better by more than predictions are wrong by.
        """
        own = _loss_of_vdi(angle, ssim)
        if seconds is None and own > 1 - bound:
            self._way = "volume"
            return self._way
        costs = {way: self.seconds_per_pixel(way, angle) for way in ("vdi", "volume")}  # type: ignore[arg-type]
        if None in costs.values():
            return "vdi"
        other: RenderMode = "volume" if self._way == "vdi" else "vdi"
        times = {way: cost * max(pixels, 1.0) for way, cost in costs.items() if cost is not None}
        if seconds is None:
            changes = times[other] < (1 - _SAVING) * times[self._way]
        else:
            losses = {way: _loss_of_pixels(time / seconds) for way, time in times.items()}
            losses["vdi"] += own
            changes = losses[other] < losses[self._way] - _GAIN
        if changes:
            self._way = other
        return self._way


def _mean(before: float | None, new: float) -> float:
    return new if before is None else before + _NEWEST * (new - before)


def rise(angle: float) -> float:
    """Return what a ray takes through a VDI, over one at V_O, so many degrees from there."""
    return float(np.interp(angle, _ANGLES, _RISE))


def _loss_of_vdi(angle: float, ssim: float | None) -> float:
    if ssim is not None:
        return max(0.0, 1.0 - ssim)
    return _UNKNOWN_LOSS * min(1.0, angle / _NEIGHBOURS)


def _loss_of_pixels(too_long: float) -> float:
    """Return the SSIM lost by as few pixels as it takes to be this many times faster."""
    step = max(1.0, too_long) ** 0.5
    beyond = max(0.0, step - _STEPS[-1]) * (_LOST[-1] - _LOST[-2])
    return float(np.interp(step, _STEPS, _LOST)) + beyond
