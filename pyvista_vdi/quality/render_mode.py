"""The render mode of a frame: VDI or volume, whichever is better in the time there is."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from pyvista_vdi.quality.frame_state import Costs, FrameTook, RenderMode
from pyvista_vdi.quality.records import replace

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


def took(costs: Costs, frame: FrameTook) -> Costs:
    """Note what a frame's rays have taken: a mean that forgets, for each 5 degrees of a VDI."""
    if not (frame.pixels >= 1 and frame.seconds > 0):
        return costs
    each = frame.seconds / frame.pixels
    if frame.way == "volume":
        return replace(costs, volume=_mean(costs.volume, each))
    near, known = round(frame.angle / _NEIGHBOURS), dict(costs.at_v_o)
    known[near] = _mean(known.get(near), each / rise(frame.angle))
    return replace(costs, at_v_o=tuple(known.items()))


def seconds_per_pixel(costs: Costs, way: RenderMode, angle: float) -> float | None:
    """Return what a ray is expected to take; ``None`` where no frame has told."""
    if way == "volume":
        return costs.volume
    if not costs.at_v_o:
        return None
    _, nearest = min(costs.at_v_o, key=lambda each: abs(each[0] - angle / _NEIGHBOURS))
    return nearest * rise(angle)


def choose(
    costs: Costs,
    angle: float,
    pixels: float,
    seconds: float | None,
    ssim: float | None = None,
    bound: float = 0.0,
) -> tuple[Costs, RenderMode]:
    """Choose how the next frame is to be drawn.

    A VDI's rays are cheapest at V_O and dearer from there on, the volume's take the same from
    everywhere, and theirs is the picture that a VDI approaches. Where both keep a rate with fewer
    pixels, what the missing pixels lose is weighed against what the VDI loses.

    Parameters
    ----------
    costs : Costs
        What frames have taken.
    angle : float
        Between the view and V_O, degrees.
    pixels : float
        Rays of the full frame that may meet the volume.
    seconds : float or None
        What its rays may take; ``None`` at rest, where all pixels are drawn.
    ssim : float, optional
        Estimate for the VDI from this view.
    bound : float
        Least SSIM that does at rest.

    Returns
    -------
    (Costs, {"vdi", "volume"})
        The VDI until both have told what they take; afterwards the better picture, or at rest the
        one that is there sooner. What was drawn last stays unless the other is better by more than
        predictions are wrong by.
    """
    own = _loss_of_vdi(angle, ssim)
    if seconds is None and own > 1 - bound:
        return replace(costs, way="volume"), "volume"
    vdi, volume = (seconds_per_pixel(costs, way, angle) for way in ("vdi", "volume"))  # type: ignore[arg-type]
    if vdi is None or volume is None:
        return costs, "vdi"
    other: RenderMode = "volume" if costs.way == "vdi" else "vdi"
    times = {"vdi": vdi * max(pixels, 1.0), "volume": volume * max(pixels, 1.0)}
    if seconds is None:
        changes = times[other] < (1 - _SAVING) * times[costs.way]
    else:
        losses = {way: _loss_of_pixels(time / seconds) for way, time in times.items()}
        losses["vdi"] += own
        changes = losses[other] < losses[costs.way] - _GAIN
    way = other if changes else costs.way
    return replace(costs, way=way), way


def rise(angle: float) -> float:
    """Return what a ray takes through a VDI, over one at V_O, so many degrees from there."""
    return _interpolated(angle, _ANGLES, _RISE)


def _loss_of_vdi(angle: float, ssim: float | None) -> float:
    if ssim is not None:
        return max(0.0, 1.0 - ssim)
    return _UNKNOWN_LOSS * min(1.0, angle / _NEIGHBOURS)


def _loss_of_pixels(too_long: float) -> float:
    """Return the SSIM lost by as few pixels as it takes to be this many times faster."""
    step = max(1.0, too_long) ** 0.5
    beyond = max(0.0, step - _STEPS[-1]) * (_LOST[-1] - _LOST[-2])
    return _interpolated(step, _STEPS, _LOST) + beyond


def _mean(before: float | None, new: float) -> float:
    return new if before is None else before + _NEWEST * (new - before)


def _interpolated(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """Return a broken line at x; its ends beyond them."""
    if not xs[0] < x < xs[-1]:
        return ys[0] if x <= xs[0] else ys[-1]
    i = bisect_right(xs, x) - 1
    return ys[i] + (ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i]) * (x - xs[i])
