"""Which picture a frame shows, and what goes on behind it: a decision without side effects.

:func:`decide` knows no VTK, no device, no clock and no thread. Whoever calls it tells it what has
happened, with the time, and does what it answers (docs/window_events.md). Distances between views
are those of :meth:`pyvista_vdi.model.view.View.distance`: about radians, for a volume that fills
the picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pyvista_vdi.model.view import View
from pyvista_vdi.quality.frame_state import (
    Action,
    AskAgain,
    AskPolicy,
    Closed,
    Complain,
    Decision,
    Do,
    EstimateError,
    EstimateReady,
    Event,
    Failed,
    FrameAsked,
    FrameState,
    FrameTook,
    Generate,
    InputChanged,
    Interrupted,
    Judge,
    Making,
    Pictures,
    PlaceholderTook,
    Raise,
    RenderMode,
    Show,
    Sight,
    StoredAsked,
    StoredSeen,
    TimePassed,
    VDIAsked,
    VDIReady,
    ViewPicked,
    Warn,
)
from pyvista_vdi.quality.pictures import (
    FINE_ENOUGH,
    SIMILAR,
    deserves_vdi,
    drawn_by_volume,
    serves,
)
from pyvista_vdi.quality.records import replace
from pyvista_vdi.quality.regeneration_policy import (
    AT_HOME,
    OUT_OF_DATE,
    REGENERATE_BELOW,
    estimate_is_old,
    is_poor,
)
from pyvista_vdi.quality.render_mode import choose, took

#: Seconds between two estimates while the view moves: each takes time from the frames.
ESTIMATE_PERIOD_IN_MOTION = 0.5
#: Seconds without another view after which the view is at rest.
_SETTLED = 0.15

#: Frames per second that volumes keep until their VDI is made, where no rate is asked for: changes
#: are followed by eye.
_PLACEHOLDER_RATE = 30.0

#: Pixels as wide as one list from which on a VDI without its volume is said to be too coarse, and
#: the share of rays below which it is said to cover too little: corners of bounds are often empty.
_TOO_COARSE, _TOO_LITTLE = 2.0, 0.9

#: What a view that is far from the VDI's own, without its volume, has as a remedy.
_GO_BACK = "its own view is plotter.camera = vdi.camera.to_pyvista()"


def decide(state: FrameState, event: Event) -> Decision:
    """Return the state after an event, and what is to be done, in this order."""
    match event:
        case FrameAsked():
            return _frame(state, event)
        case StoredAsked():
            return state, _stored(state, event)
        case StoredSeen():
            return state, _lacking(event) if state.settings.regenerate == "auto" else ()
        case FrameTook():
            return replace(state, costs=took(state.costs, event)), ()
        case PlaceholderTook(pixels, seconds):
            rate = state.placeholder.record(pixels, seconds, seconds)
            return replace(state, placeholder=rate), ()
        case TimePassed():
            if state.settings.regenerate != "auto" or event.stamp != state.stamp:
                return state, ()  # what has changed is for a frame to look at
            return _regenerate(state, event.now, event.seen)
        case EstimateReady():
            if not state.estimating:
                return state, ()
            return replace(state, estimating=False, estimate=event.estimate), ()
        case VDIReady():
            if state.making is None:  # nobody waits for it any more
                return state, ()
            return replace(state, making=None, estimate=None), (Do("take"),)
        case Failed(error, stamp, in_frame):
            if in_frame:
                return replace(state, failed_in_frame=stamp), ()
            after = replace(state, making=None, estimating=False, failed=state.stamp)
            return after, (Complain(error),)
        case Interrupted(error, shown):  # the next frame asks again
            return state, (
                (Complain(error), Show("before")) if shown else (Do("forget view"), Raise(error))
            )
        case VDIAsked(there, stamp):
            # Where frames keep it up to date, or will
            if there and (state.settings.draw == "vdi" or state.behind):
                return state, ()
            state, actions = _nothing_goes_on(state)
            again = stamp != state.failed_in_frame
            return state, (*actions, Do("update")) if again else actions
        case ViewPicked(coverage):
            return state, () if coverage == 1 else (Show("this view"),)
        case InputChanged(another):
            after, actions = _nothing_goes_on(replace(state, failed_in_frame=None))
            if another:
                after = FrameState(state.settings, placeholder=state.placeholder)
                actions = (*actions, Do("forget volume"))
            return after, actions
        case Closed():
            after = FrameState(
                state.settings,
                failed=state.failed,
                failed_in_frame=state.failed_in_frame,
                placeholder=state.placeholder,
            )
            return after, (Do("drop vdi"), Do("drop estimate"), Do("forget volume"))
    raise TypeError(f"no event: {event!r}")


def busy(state: FrameState, now: float) -> bool:
    """Whether something goes on, or is to be decided, that no frame would show by itself."""
    settles = state.settings.regenerate == "auto" and not state.moving and not _rests(state, now)
    return state.making is not None or state.estimating or settles


def ssim_of(state: FrameState, vdi: int | None, view: View | None = None) -> float | None:
    """Return what was estimated for a VDI: of this very picture, or else last behind the frames."""
    for each in reversed(state.pictures.judged):
        if each.view == view:
            return each.ssim
    estimate = state.estimate
    return estimate.ssim if estimate is not None and estimate.vdi == vdi else None


def placeholder_share(state: FrameState, pixels: int) -> tuple[FrameState, float]:
    """Choose the share of its pixels, 0 to 1, of a volume that is drawn until a VDI is made."""
    rate = replace(state.placeholder, target_fps=state.settings.target or _PLACEHOLDER_RATE)
    if not rate.seconds_per_sample:
        return state, 0.0  # it is not known
    rate = rate.choose(pixels)
    return replace(state, placeholder=rate), rate.chosen(pixels) / pixels


def changed(state: FrameState, seen: Sight | None) -> bool:
    """Whether a VDI is being made because there is none, or one that is of something else."""
    if state.making is None:
        return False
    made = None if seen is None else seen.request
    return made is None or made.content != state.making.content


# A frame of what comes from a volume


def _frame(state: FrameState, f: FrameAsked) -> Decision:
    """Decide what draws a frame: the VDI or the volume, and what is made before or behind it."""
    settings = state.settings
    if f.refused:
        state = replace(state, refused=f.refused[-1])
    if f.look is None:
        # Once for both eyes of a stereo pair, and not between the tiles of a picture
        f = replace(f, look=f.whole and f.number != state.number)
        state = replace(state, number=f.number)
    if settings.draw == "volume" and not f.joint:
        state = replace(state, behind=False)
        if f.trouble is not None:
            return state, (Raise(f.trouble),)
        if _drawable(state, f, f.wanted):
            asked = replace(f, look=False)
            return state, (*_follow(state, f), Show("wanted", asked, f.wanted.content))
    state = replace(state, behind=f.watched)
    if f.watched:
        return _watched(state, f)
    if f.seen is None and (settings.draw == "vdi" or callable(settings.regenerate)):
        return state, (*_update(state, f), Show("last"))
    before: tuple[Action, ...] = ()
    if f.one_view and f.look:
        if callable(settings.regenerate) and f.answer is None:
            return state, (AskPolicy(f),)
        if f.answer:
            again = AskAgain(replace(f, answer=False))
            return state, (Do("take view"), Do("update"), again)
        before = _follow(state, f)
    if settings.draw != "vdi":
        return _faithful(state, f, before)
    return state, (*before, *_update(state, f, before), Show("last"))


def _watched(state: FrameState, f: FrameAsked) -> Decision:
    """Decide where somebody watches: VDIs are made behind the frames."""
    draw, seen = state.settings.draw, f.seen
    if seen is None and (f.joint or draw == "vdi"):
        return state, (*_update(state, f), Do("prepare"), Show("last"))
    actions: tuple[Action, ...] = ()
    if f.look or f.stamp != state.stamp:
        state, actions = _look(state, f)
        if actions and isinstance(actions[-1], AskPolicy):
            return state, actions
    again = replace(f, look=False)
    if seen is None or seen.request is None:
        # There is no VDI yet
        if f.trouble is not None:
            return state, (*actions, Raise(f.trouble))
        actions = (*actions, Do("prepare"))
        if _drawable(state, f, f.wanted):
            return state, (*actions, Show("wanted", again, f.wanted.content))
        return state, (*actions, *_update(state, f), Show("last"))
    making = state.making
    if making is not None and changed(state, seen) and _drawable(state, f, making):
        # The VDI shows what is no longer so
        return state, (*actions, Show("making", again, making.content))
    if draw == "auto" and not f.joint and _drawable(state, f, seen.request):
        # Whichever is expected to give the better picture in time
        way: RenderMode = "volume"
        if seen.coverage == 1 and (f.previews or seen.magnification <= FINE_ENOUGH):
            bound = state.settings.regenerate_below
            costs, way = choose(
                state.costs,
                seen.angle,
                seen.pixels,
                f.seconds if f.previews else None,
                ssim_of(state, seen.vdi),
                SIMILAR if bound is None else bound,
            )
            state = replace(state, costs=costs)
        if way == "volume":
            return state, (*actions, Show("made", again, seen.request.content))
    return state, (*actions, Show("last"))


def _look(state: FrameState, f: FrameAsked) -> Decision:
    """Look at the frame's view and at what the VDI was made of, and begin what is needed."""
    moved_at = f.now if f.view != state.view else state.moved_at
    if f.view == state.view and not f.moving:
        moved_at = min(moved_at, f.now - _SETTLED)  # the second frame of a view
    policy = state.settings.regenerate
    by_vdi = state.settings.draw == "vdi" or state.costs.way == "vdi"
    state = replace(state, view=f.view, moving=f.moving, moved_at=moved_at, by_vdi=by_vdi)
    actions: tuple[Action, ...] = ()
    if f.stamp != state.stamp:
        state = replace(state, stamp=f.stamp)
        if f.trouble is not None:
            actions = (Complain(f.trouble),)
        else:
            state, actions = _follow_changes(state, f)
    more: tuple[Action, ...] = ()
    if policy == "auto":
        state, more = _regenerate(state, f.now, f.seen)
    elif callable(policy):
        state, more = _drop_if_left_behind(state, f.seen)
        if state.making is None and (state.failed is None or state.failed != f.stamp):
            if f.answer is None:
                more = (*more, AskPolicy(f))
            elif f.answer and f.wanted is not None:
                state, started = _start(state, f.wanted, f.view, for_view=True)
                more = (*more, *started)
    return state, (*actions, *more)


def _follow_changes(state: FrameState, f: FrameAsked) -> Decision:
    """Begin a VDI of what has changed, or give up one that nobody wants any more."""
    wanted, making = f.wanted, state.making
    made = None if f.seen is None else f.seen.request
    begun = making is not None and making.content == wanted.content
    if made is None:
        return (state, ()) if begun else _start(state, wanted)
    if wanted.key == made.key:
        if making is not None and making.content != made.content:
            return replace(state, making=None), (Do("drop vdi"),)  # it was changed back
        return state, ()
    if wanted.screen != made.screen:  # somebody asked for that view
        return _start(state, wanted)
    if making is None or not begun:
        return _start(state, wanted, None if state.settings.regenerate == "never" else f.view)
    return replace(state, making=replace(making, for_view=False)), ()  # needed whatever is seen


def _regenerate(state: FrameState, now: float, seen: Sight | None) -> Decision:
    """Estimate the view's error, and begin a VDI of the view if it is too large."""
    state, actions = _drop_if_left_behind(state, seen)
    if state.moving and not state.by_vdi:
        # Frames of the volume have no error, and need the time
        return replace(state, estimating=False), (*actions, Do("drop estimate"))
    failed = state.failed is not None and state.failed == state.stamp
    if state.making is not None or state.estimating or failed:
        return state, actions
    view = state.view
    if seen is None or seen.request is None or view is None:
        return state, actions
    if _apart(state, seen, seen.request.screen) <= AT_HOME:
        return state, actions
    estimate, rests = state.estimate, _rests(state, now)
    if (
        estimate is None
        or estimate.vdi != seen.vdi
        or estimate_is_old(_apart(state, seen, estimate.view), moving=not rests)
    ):
        if rests or now - state.estimated_at >= ESTIMATE_PERIOD_IN_MOTION:
            state = replace(state, estimating=True, estimated_at=now)
            actions = (*actions, EstimateError(seen.vdi, view, seen.options))
        return state, actions
    given = state.settings.regenerate_below
    bound = REGENERATE_BELOW if given is None else given
    if is_poor(estimate.ssim, bound, moving=not rests):
        state, more = _start(state, seen.request, view, for_view=True)
        return state, (*actions, *more)
    return state, actions


def _start(
    state: FrameState, of: Any, screen: View | None = None, *, for_view: bool = False
) -> Decision:
    """Start a VDI of a view, or of the source's own, in place of what is being made."""
    making = Making(of.content, of.screen if screen is None else screen, for_view)
    state = replace(state, making=making, estimating=False)
    return state, (Do("drop estimate"), Generate(screen))


def _drop_if_left_behind(state: FrameState, seen: Sight | None) -> Decision:
    """Cancel a VDI that is made for a view which the hand has left behind."""
    making = state.making
    if making is None or not making.for_view or seen is None or seen.request is None:
        return state, ()
    away = _apart(state, seen, making.screen)
    if away > OUT_OF_DATE or away > _apart(state, seen, seen.request.screen):
        return replace(state, making=None), (Do("drop vdi"),)
    return state, ()


def _nothing_goes_on(state: FrameState) -> Decision:
    """Cancel what goes on, and forget what failed."""
    state = replace(state, making=None, estimating=False, failed=None)
    return state, (Do("drop vdi"), Do("drop estimate"))


def _apart(state: FrameState, seen: Sight, other: View) -> float:
    """Return the distance of the last frame's view from another one."""
    return math.inf if state.view is None else state.view.distance(other, seen.bounds)


def _rests(state: FrameState, now: float) -> bool:
    return not state.moving and now - state.moved_at >= _SETTLED


def _drawable(state: FrameState, f: FrameAsked, of: Any) -> bool:
    """Whether the device can draw that volume in one piece, as far as is known."""
    if of.content in f.refused:
        return False
    return state.refused is None or bool(state.refused != of.content)


def _follow(state: FrameState, f: FrameAsked) -> tuple[Action, ...]:
    """Ask for this frame's view, if it is a whole picture, for a VDI of what has changed."""
    follows = f.one_view and f.look and state.settings.regenerate != "never"
    return (Do("follow view"),) if follows and _other_content(state, f) else ()


def _other_content(state: FrameState, f: FrameAsked) -> bool:
    """Whether a VDI shows what is no longer so, and the source has not failed at this already."""
    made = None if f.seen is None else f.seen.request
    if made is None or f.wanted is None or f.stamp == state.failed_in_frame:
        return False
    return bool(made.content != f.wanted.content)


def _update(state: FrameState, f: FrameAsked, before: Sequence[Action] = ()) -> tuple[Action, ...]:
    """Bring the source up to date, but do not repeat what failed until something changes."""
    return () if f.stamp == state.failed_in_frame and not before else (Do("update"),)


# Pictures that are kept: told by the view, never by time


def _faithful(state: FrameState, f: FrameAsked, before: tuple[Action, ...]) -> Decision:
    """Decide for a picture that is kept: the same in every run.

    A VDI is drawn where it has all that the view shows, at its detail, and where an estimate says
    that the picture is like the volume's; beyond some degrees from V_O the volume is as fast.
    """
    if f.trouble is not None:
        return state, (*before, Raise(f.trouble))
    seen, wanted, auto = f.seen, f.wanted, state.settings.regenerate == "auto"
    if state.pictures.content != wanted.content:
        state = replace(state, pictures=Pictures(wanted.content))
    if seen is not None and seen.request is not None and seen.request.content == wanted.content:
        pictures, does = serves(state.pictures, seen, f, state.settings.regenerate_below)
        state = replace(state, pictures=pictures)
        if does is None:
            return state, (Judge(f),)
        if does:
            return state, (Show("last"),)
    by_vdi = (*before, *_update(state, f, before), Show("last"))
    if f.joint:  # merged by the lists of VDIs
        return state, (*before, Show("this view", f)) if auto else by_vdi
    if f.one_view and f.look and auto and f.own_pixels:
        if deserves_vdi(state.pictures, f.view, wanted.volume.bounds):
            return state, (Do("take view"), Do("update"), Show("last"))
        state = replace(state, pictures=drawn_by_volume(state.pictures, f.view))
    if wanted.content in f.refused:
        return state, by_vdi
    again = replace(f, look=False)
    return state, (*before, Show("wanted", again, wanted.content, in_bricks=True))


# VDIs without a volume


def _stored(state: FrameState, asked: StoredAsked) -> tuple[Action, ...]:
    """Show a VDI that has no volume, or one of a series or set.

    Update it first, unless that has failed at this stamp.
    """
    failed = asked.stamp is not None and asked.stamp == state.failed_in_frame
    return (Show("last"),) if failed else (Do("update"), Show("last"))


def _lacking(of: StoredSeen) -> tuple[Action, ...]:
    """Return warnings of what a VDI without its volume lacks where it is seen from."""
    seen, lacking = of.seen, []
    if seen.angle > of.cone:
        what = (
            f"the view is {seen.angle:.0f} degrees from the VDI's generating view, which was to "
            f"serve {of.cone:.0f}: it shows less, and less of what was hidden; {_GO_BACK}"
        )
        lacking.append(("angle", what))
    if seen.coverage < _TOO_LITTLE:
        what = (
            f"{1 - seen.coverage:.0%} of the view's rays through the volume leave what the VDI "
            f"covers: there it shows nothing; {_GO_BACK}"
        )
        lacking.append(("coverage", what))
    if seen.magnification > _TOO_COARSE:
        what = (
            f"{seen.magnification:.1f} pixels of the view are as wide as one of the VDI's lists: "
            "it shows no finer detail"
        )
        lacking.append(("magnification", what))
    end = f"{of.remedy}; regenerate='never' takes this as it is"
    return tuple(Warn(f"{what}; {end}", cause) for cause, what in lacking)
