"""What a frame shows, and what is made for it: decided by what is seen, without side effects.

Whoever draws looks, asks :func:`plan`, and does what it says; nothing here knows VTK, a device, a
clock or a thread. ``docs/dev/window_events.md`` is the specification. Distances between views are
those of :meth:`pyvista_vdi.model.view.View.distance`: about radians, where the volume fills the
picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from pyvista_vdi.model.view import View
from pyvista_vdi.quality.costs import Costs, RenderMode

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
_TOO_COARSE, _TOO_LITTLE = 2.0, 0.9
#: Least SSIM of a VDI's picture against the volume's for the VDI to be drawn where the volume is at
#: hand, and by what share the contrast within 4 x 4 pixels may differ, where nobody said otherwise.
SIMILAR, _SAME_CONTRAST = 0.98, 0.1
#: Pixels as wide as one list from which on a picture has less detail than its pixels could show.
FINE_ENOUGH = 1.25
#: Degrees from the VDI's view beyond which the volume's picture takes no longer than its own.
_FASTER_WITHIN = 10.0
#: Estimates that are remembered.
_ESTIMATES = 64
#: Rays that an estimate casts, 16 tiles of 24 x 24 by the VDI and by the volume: a VDI of no more
#: pixels takes no longer to be made.
_JUDGED = 2 * 16 * 24**2
#: An estimate holds for pictures of views as near as this to its own (about radians).
_ANOTHER_JUDGEMENT = 0.02


@dataclass(frozen=True)
class Made:
    """A VDI that is there, as a view shows it; see :mod:`pyvista_vdi.quality.view_error`."""

    number: int  # by which it is known
    bounds: tuple[float, ...]  # of the volume, model frame
    content: Any = None  # of what it was made, and for which view
    screen: Any = None
    angle: float = 0.0
    magnification: float = 1.0
    coverage: float = 1.0
    pixels: float = 0.0  # in which it may be seen
    options: Any = None  # how it is drawn (clipping planes in world coordinates), compared by ==


@dataclass(frozen=True)
class ViewEstimate:
    """What the SSIM of a VDI's picture was found to be."""

    vdi: int
    view: View
    ssim: float
    contrast: float = 1.0
    options: Any = None


@dataclass(frozen=True)
class Pictures:
    """What pictures that are kept have told; it is the same in every run."""

    vdi: int | None = None  # of which the estimates are
    judged: tuple[ViewEstimate, ...] = ()
    poor_from: float = math.inf  # degrees, of the nearest view that the VDI fails

    def serves(
        self,
        made: Made,
        view: View,
        judged: ViewEstimate | Literal[False] | None,
        bound: float | None,
        *,
        joint: bool,
        alone: bool,
    ) -> tuple[Pictures, bool | None]:
        """Return whether a VDI's picture of a view does; ``None`` where an estimate has to tell.

        ``judged`` is what that has told, ``alone`` whether a VDI of this very view would be kept.
        """
        known = self
        if known.vdi != made.number:
            known = replace(known, vdi=made.number, judged=(), poor_from=math.inf)
        if bound is None and made.magnification > FINE_ENOUGH:
            return known, False
        # What fails near the generating view fails farther away: the loss comes at once
        within = 180.0 if joint else _FASTER_WITHIN
        if made.angle > within or made.angle >= known.poor_from or made.coverage < 1:
            return known, False
        at_home = made.screen == view
        if judged is False or (joint and alone and not at_home and made.pixels <= _JUDGED):
            return known, False
        if judged is not None and judged not in known.judged:
            known = replace(known, judged=(*known.judged[1 - _ESTIMATES :], judged))
        same = [each for each in known.judged if each.options == made.options]
        apart = [view.distance(each.view, made.bounds) for each in same]
        if not apart or min(apart) > _ANOTHER_JUDGEMENT:
            return known, None
        error = same[apart.index(min(apart))]
        does = error.ssim >= (SIMILAR if bound is None else bound)
        if bound is None:
            does = does and abs(error.contrast - 1) <= _SAME_CONTRAST
        if not does and made.magnification <= FINE_ENOUGH:
            known = replace(known, poor_from=made.angle)
        return known, does


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
    own_pixels: bool = True  # whether its pixels are the view's
    # What there is
    made: Made | None = None  # the VDI made last, as the view shows it
    making: Making | None = None
    estimating: bool = False
    estimate: ViewEstimate | None = None  # the last one made in the background
    judged: ViewEstimate | Literal[False] | None = None  # of this very frame; False: none can be
    failed: bool = False  # whether making a VDI has failed, and nothing has changed since
    volume: Literal["whole", "bricks", "none"] = "whole"  # how the device can draw it
    late: bool = False  # whether the volume's own full frames miss the rate
    seconds: float | None = None  # what the rays of a frame of a motion may take
    costs: Costs = field(default_factory=Costs)
    pictures: Pictures = field(default_factory=Pictures)

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
    view: Literal["take", "follow"] | None = None  # make the next VDI of this frame's view
    update: bool = False  # make the VDI now
    give_up: bool = False  # what is being made
    make: View | None = None  # a VDI in the background, for this view
    estimate: Literal["now", "background"] | None = None  # the VDI's error; "now": and ask again
    costs: Costs = field(default_factory=Costs)
    pictures: Pictures = field(default_factory=Pictures)


def plan(seen: Seen) -> Plan:
    """Return what a frame shows, and what is made for it."""
    if seen.draw == "volume" and not seen.joint and seen.volume == "whole":
        show: Any = "trouble" if seen.content is None else "volume"
        give_up = seen.making is not None
        return _planned(seen, show, seen.content, view=_follow(seen), give_up=give_up)
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
        _other(seen, making.content) or (not seen.hand and _left(seen, making))
    )
    asked_for = asked or (seen.chosen and made is not None)
    make = None
    if not (seen.hand or serves or seen.failed) and (
        asked_for or seen.late or seen.volume != "whole"
    ):
        make = _view_to_make(seen)
    estimate: Any = "background" if make is None and not serves and _unknown(seen) else None
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
            way = _better(seen, made)
        costs = replace(seen.costs, way=way)
        return _planned(seen, way, made.content, costs=costs, **rest)
    return _planned(seen, "vdi", **rest)


def _kept(seen: Seen) -> Plan:
    """Plan a picture that is kept, the same in every run: told by the view, never by time.

    A VDI is drawn where it has all that the view shows, at its detail, and where an estimate says
    that the picture is like the volume's.
    """
    made, again = seen.made, not seen.failed
    if seen.draw == "vdi":
        view = None if made is None else _follow(seen)
        return _planned(seen, "vdi", view=view, update=again)
    if seen.content is None:
        return _planned(seen, "trouble")
    pictures = seen.pictures
    if made is not None and not seen.stale:
        pictures, does = pictures.serves(
            made,
            seen.view,
            seen.judged,
            seen.bound,
            joint=seen.joint,
            alone=seen.one_view and seen.own_pixels,
        )
        if does is None:
            return _planned(seen, "vdi", estimate="now", pictures=pictures)
        if does:
            return _planned(seen, "vdi", pictures=pictures)
    auto, follow = seen.regenerate == "auto", _follow(seen)
    by_vdi = _planned(seen, "vdi", view=follow, update=again, pictures=pictures)
    if seen.joint:  # merged by the lists of VDIs
        return _planned(seen, "exact", view=follow, pictures=pictures) if auto else by_vdi
    if seen.volume == "none":
        return by_vdi
    of = seen.content
    return _planned(seen, "volume", of, view=follow, in_bricks=True, pictures=pictures)


def _planned(seen: Seen, show: Any, content: Any = None, **more: Any) -> Plan:
    known = {"costs": seen.costs, "pictures": seen.pictures, **more}
    return Plan(show, content, full=not (seen.moving or more.get("stand_in")), **known)


def _follow(seen: Seen) -> Literal["follow"] | None:
    """Make a VDI of what has changed for this frame's view, if it is a whole picture."""
    follows = seen.one_view and seen.first_look and seen.regenerate != "never"
    return "follow" if follows and seen.made and seen.stale and not seen.failed else None


def _other(seen: Seen, content: Any) -> bool:
    return seen.content is not None and bool(content != seen.content)


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
    if known is None or known.vdi != made.number:
        return True
    return seen.view.distance(known.view, made.bounds) > _ANOTHER_ESTIMATE


def _better(seen: Seen, made: Made) -> RenderMode:
    """Choose VDI or volume, whichever is expected to give the better picture in time."""
    ssim = ssim_of(seen.pictures, seen.estimate, made.number, seen.view)
    bound = SIMILAR if seen.bound is None else seen.bound
    seconds = seen.seconds if seen.moving else None
    return seen.costs.better(made.angle, made.pixels, seconds, ssim, bound)


def ssim_of(
    pictures: Pictures, estimate: ViewEstimate | None, vdi: int | None, view: View | None
) -> float | None:
    """Return what was estimated for a VDI: of this very picture, or else last in the background."""
    for each in reversed(pictures.judged):
        if each.view == view:
            return each.ssim
    return estimate.ssim if estimate is not None and estimate.vdi == vdi else None


def lacking(seen: Made, cone: float, remedy: str) -> list[tuple[str, str]]:
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
    if seen.magnification > _TOO_COARSE:
        what = f"{seen.magnification:.1f} pixels of the view are as wide as one of the VDI's "
        found.append(("magnification", f"{what}lists: it shows no finer detail"))
    end = f"{remedy}; regenerate='never' takes this as it is"
    return [(cause, f"{what}; {end}") for cause, what in found]
