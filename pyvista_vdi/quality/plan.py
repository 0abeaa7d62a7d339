"""What a frame shows, and what is made for it: decided by what is seen, without side effects.

Whoever draws looks, asks :func:`plan`, and does what it says; nothing here knows VTK, a device, a
clock or a thread. ``docs/dev/window_events.md`` is the specification. By what rays have taken
:class:`Costs` tell which draws the better picture in time, VDI or volume. Distances between views
are those of :meth:`pyvista_vdi.model.view.View.distance`: about radians, where the volume fills the
picture.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from pyvista_vdi.model.view import View

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

#: Estimated SSIM below which a view at rest gets a VDI of its own. Over the measured views a VDI
#: of 20 supersegments keeps .96 to .99 when it is only turned; zooming in by two, or looking past
#: what the generating view's window covered, falls below (docs/regeneration.md).
REGENERATE_BELOW = 0.95
#: Seconds without another view after which the view is at rest, whatever a hand holds.
SETTLED = 0.15
#: Nearer to the generating view than this, a VDI of the view itself would show the same.
_AT_HOME = 0.02
#: Farther than this from the view that a VDI is being made for, it is given up.
_OUT_OF_DATE = 0.7
#: Farther than this from the last estimate's view, another one is made.
_ANOTHER_ESTIMATE = 0.005
#: Pixels as wide as one list from which on a VDI without its volume is said to be too coarse, and
#: the share of rays below which it is said to cover too little: corners of bounds are often empty.
TOO_COARSE, _TOO_LITTLE = 2.0, 0.9
#: Least SSIM of a VDI's picture against the volume's for the VDI to be drawn at rest where the
#: volume is at hand, where nobody said otherwise.
SIMILAR = 0.98
#: Pixels as wide as one list from which on a picture has less detail than its pixels could show.
FINE_ENOUGH = 1.25


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


@dataclass(frozen=True)
class Made:
    """A VDI that is there, as a view shows it; see :mod:`pyvista_vdi.quality.view_error`."""

    known: Hashable  # by what: a weak reference to it
    bounds: tuple[float, ...]  # of the volume, model frame
    content: Any = None  # of what it was made, and for which view
    screen: Any = None
    angle: float = 0.0
    magnification: float = 1.0
    coverage: float = 1.0
    pixels: float = 0.0  # in which it may be seen


@dataclass(frozen=True)
class ViewEstimate:
    """What the SSIM of a VDI's picture was found to be."""

    vdi: Any  # by what it is known
    view: View
    ssim: float


@dataclass(frozen=True)
class Making:
    """A VDI that is being made in the background: of what, for which view, and why."""

    content: Any
    screen: View
    for_view: bool  # because of the view alone, which may be left again


@dataclass(frozen=True)
class Seen:
    """All that decides what a frame of a volume shows.

    ``content`` is equal where what a VDI is made of is, the view apart; ``None`` where a VDI cannot
    be made of what there is now.
    """

    view: View  # between the eyes
    content: Any = None
    screen: View | None = None  # for which view the source would make the next VDI
    chosen: bool = False  # whether somebody has chosen that one: before the first VDI, and since
    # What the user asks for
    draw: Literal["auto", "vdi", "volume"] = "auto"
    regenerate: Literal["auto", "never"] = "auto"
    bound: float | None = None  # least SSIM that does
    # Who looks
    watched: bool = False  # whether somebody watches, so that frames wait for nothing
    moving: bool = False  # whether it may have fewer rays, as a frame of a motion
    hand: bool = False  # whether a hand moves: the machine is its own
    settled: bool = True  # whether the view stays
    one_view: bool = True  # whether no other renderer or mapper shows the VDI
    joint: bool = False  # whether another volume overlaps it in the picture
    first_look: bool = True  # whether it is a whole picture that was not looked at before
    # What there is
    made: Made | None = None  # the VDI made last, as the view shows it
    making: Making | None = None
    estimating: bool = False
    estimate: ViewEstimate | None = None  # the last one made in the background
    failed: bool = False  # whether making a VDI has failed, and nothing has changed since
    volume: Literal["whole", "bricks", "none"] = "whole"  # how the device can draw it
    late: bool = False  # whether the volume's own full frames miss the rate
    seconds: float | None = None  # what the rays of a frame of a motion may take
    costs: Costs = field(default_factory=Costs)

    @property
    def stale(self) -> bool:
        """Whether the VDI shows what is no longer so, or there is none."""
        return self.content is not None and (self.made is None or self.made.content != self.content)


@dataclass(frozen=True)
class Plan:
    """What a frame shows, and what is to be done before or beside it.

    ``show`` is ``"vdi"``, the one made last; ``"exact"``, one of exactly the frame's view;
    ``"volume"``, that of ``content``; or ``"trouble"``: say why nothing can be made.
    """

    show: Literal["vdi", "exact", "volume", "trouble"]
    content: Any = None
    in_bricks: bool = False  # whether the volume may be drawn brick by brick
    full: bool = True  # whether every pixel gets a ray
    stand_in: bool = False  # whether the volume stands in for a VDI to come
    follow: bool = False  # make the next VDI of this frame's view
    update: bool = False  # make the VDI now
    give_up: bool = False  # what is being made
    make: View | None = None  # a VDI in the background, for this view
    estimate: bool = False  # the VDI's error in the background
    costs: Costs = field(default_factory=Costs)


def plan(seen: Seen) -> Plan:
    """Return what a frame shows, and what is made for it."""
    if seen.draw == "volume" and not seen.joint and seen.volume == "whole":
        show: Any = "trouble" if seen.content is None else "volume"
        give_up = seen.making is not None
        return _planned(seen, show, seen.content, follow=_follow(seen), give_up=give_up)
    return _watched(seen) if seen.watched else _kept(seen)


def _watched(seen: Seen) -> Plan:
    """Plan a frame that somebody watches: it waits for nothing, and a moving hand has the machine.

    A VDI is made at rest, and only where the volume's own frames are late or somebody asks.
    """
    made, making = seen.made, seen.making
    asked = seen.draw == "vdi" or seen.joint
    if made is None and (asked or (seen.content is not None and seen.volume != "whole")):
        give_up = making is not None
        return _planned(seen, "vdi", update=not seen.failed, give_up=give_up)
    # Make what is missing at rest; give up what no longer serves
    serves = making is not None and not (
        (seen.content is not None and making.content != seen.content)
        or (not seen.hand and _left(seen, making))
    )
    asked_for = asked or (seen.chosen and made is not None)
    make = None
    if not (seen.hand or serves or seen.failed) and (
        asked_for or seen.late or seen.volume != "whole"
    ):
        make = _view_to_make(seen)
    estimate = make is None and not serves and _unknown(seen)
    rest: dict[str, Any] = {"give_up": making is not None and not serves, "make": make}
    rest |= {"estimate": estimate}
    # Show the volume where there is no VDI of what there is now, and else what is better in time
    if seen.stale or made is None:
        if seen.content is None:
            return _planned(seen, "trouble", **rest)
        if seen.volume == "whole":
            stands = made is not None and (asked or make is not None or serves)
            return _planned(seen, "volume", seen.content, stand_in=stands, **rest)
        return _planned(seen, "vdi", **rest)
    if seen.draw == "auto" and not seen.joint and seen.volume == "whole":
        way: RenderMode = "volume"
        if made.coverage == 1 and (seen.moving or made.magnification <= FINE_ENOUGH):
            way = better_way(seen, made)
        costs = replace(seen.costs, way=way)
        return _planned(seen, way, made.content, costs=costs, **rest)
    return _planned(seen, "vdi", **rest)


def _kept(seen: Seen) -> Plan:
    """Plan a picture that is kept, the same in every run: told by the view, never by time.

    It is the volume's, which is right from every view. Volumes that overlap are merged by the lists
    of VDIs, each of exactly the view.
    """
    made, again, follow = seen.made, not seen.failed, _follow(seen)
    if seen.draw == "vdi":
        return _planned(seen, "vdi", follow=follow, update=again)
    if seen.content is None:
        return _planned(seen, "trouble")
    if seen.joint and seen.regenerate == "auto":
        own = made is not None and not seen.stale and made.screen == seen.view
        return _planned(seen, "vdi" if own else "exact", follow=follow)
    if seen.joint or seen.volume == "none":
        return _planned(seen, "vdi", follow=follow, update=again)
    return _planned(seen, "volume", seen.content, follow=follow, in_bricks=True)


def _planned(seen: Seen, show: Any, content: Any = None, **more: Any) -> Plan:
    full = not (seen.moving or more.get("stand_in"))
    return Plan(show, content, full=full, **{"costs": seen.costs, **more})


def _follow(seen: Seen) -> bool:
    """Make a VDI of what has changed for this frame's view, if it is a whole picture."""
    follows = seen.one_view and seen.first_look and seen.regenerate != "never"
    return follows and seen.made is not None and seen.stale and not seen.failed


def _left(seen: Seen, making: Making) -> bool:
    """Whether what is made for a view was left behind by the hand."""
    if not making.for_view or seen.made is None:
        return False
    away = seen.view.distance(making.screen, seen.made.bounds)
    return away > min(_OUT_OF_DATE, seen.view.distance(seen.made.screen, seen.made.bounds))


def _view_to_make(seen: Seen) -> View | None:
    """Return the view that needs a VDI; ``None`` if none does."""
    made, own = seen.made, seen.screen
    if made is None:
        return own if seen.chosen or seen.regenerate == "never" else seen.view
    if seen.chosen:
        return own
    if seen.stale:
        return own if seen.regenerate == "never" else seen.view
    estimate, bound = seen.estimate, seen.bound
    if seen.regenerate == "never" or estimate is None or _unknown(seen) or _at_home(seen, made):
        return None
    return seen.view if estimate.ssim < (REGENERATE_BELOW if bound is None else bound) else None


def _at_home(seen: Seen, made: Made) -> bool:
    return seen.view.distance(made.screen, made.bounds) <= _AT_HOME


def _unknown(seen: Seen) -> bool:
    """Whether the error of the VDI in this view, at rest, is to be estimated."""
    made, known = seen.made, seen.estimate
    if made is None or seen.stale or seen.regenerate != "auto" or _at_home(seen, made):
        return False
    if seen.hand or not seen.settled or seen.estimating or seen.failed:
        return False
    if known is None or known.vdi != made.known:
        return True
    return seen.view.distance(known.view, made.bounds) > _ANOTHER_ESTIMATE


def better_way(seen: Seen, made: Made) -> RenderMode:
    """Choose VDI or volume, whichever is expected to give the better picture in time.

    Where both keep a rate with fewer pixels, what the missing pixels lose is weighed against what
    the VDI loses. Until both have told what they take it is the VDI, and what was drawn last stays
    unless the other is better by more than predictions are wrong by.
    """
    known, costs = seen.estimate, seen.costs
    seconds = seen.seconds if seen.moving else None  # at rest all pixels are drawn
    own = _UNKNOWN_LOSS * min(1.0, made.angle / _LOST_FROM)  # what the VDI loses
    if known is not None and known.vdi == made.known:
        own = max(0.0, 1 - known.ssim)
    if seconds is None and own > 1 - (SIMILAR if seen.bound is None else seen.bound):
        return "volume"
    if costs.volume is None or costs.vdi is None:
        return "vdi"
    each = {"vdi": costs.vdi * costs.rise(made.angle), "volume": costs.volume}
    times = {way: costs.fixed + max(made.pixels, 1.0) * ray for way, ray in each.items()}
    other: RenderMode = "volume" if costs.way == "vdi" else "vdi"
    if seconds is None:
        changes = times[other] < (1 - _SAVING) * times[costs.way]
    else:
        room = max(seconds - costs.fixed, 1e-9)
        losses = {way: _loss_of_pixels((t - costs.fixed) / room) for way, t in times.items()}
        losses["vdi"] += own
        changes = losses[other] < losses[costs.way] - _GAIN
    return other if changes else costs.way


def _loss_of_pixels(too_long: float) -> float:
    """Return the SSIM lost by as few pixels as it takes to be this many times faster."""
    step = max(1.0, too_long) ** 0.5
    beyond = max(0.0, step - _STEPS[-1]) * (_LOST[-1] - _LOST[-2])
    return float(np.interp(step, _STEPS, _LOST)) + beyond


def lacking(seen: Made, cone: float) -> list[tuple[str, str]]:
    """Return what a VDI without its volume lacks where it is seen from: causes and warnings.

    ``cone`` degrees about its generating view are what it was to serve.
    """
    back = "its own view is plotter.camera = vdi.camera.to_pyvista()"
    found = []
    if seen.angle > cone:
        what = f"the view is {seen.angle:.0f} degrees from the VDI's generating view, which was to "
        found.append(("angle", f"{what}serve {cone:.0f}: it shows less; {back}"))
    if seen.coverage < _TOO_LITTLE:
        what = f"{1 - seen.coverage:.0%} of the view's rays through the volume leave what the VDI "
        found.append(("coverage", f"{what}covers: there it shows nothing; {back}"))
    if seen.magnification > TOO_COARSE:
        what = f"{seen.magnification:.1f} pixels of the view are as wide as one of the VDI's "
        found.append(("magnification", f"{what}lists: it shows no finer detail"))
    end = "make one of this view of the volume; regenerate='never' takes this as it is"
    return [(cause, f"{what}; {end}") for cause, what in found]
