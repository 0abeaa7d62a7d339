"""What a frame shows and what is made for it: each row of docs/dev/window_events.md."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.plan import Costs, Made, Making, Plan, Seen, ViewEstimate, plan

BOUNDS = (-1.0, 1.0) * 3
HOME = View(Camera((0, 0, 9), (0, 0, 0), (0, 1, 0)), (320, 180))


def turned(degrees):
    return View(HOME.camera.azimuth(degrees), HOME.size)


MADE = Made(1, BOUNDS, "a", HOME, pixels=1e4)
#: A frame that somebody watches, at rest, of a volume whose VDI is that of this view.
SEEN = Seen(HOME, "a", HOME, watched=True, made=MADE, seconds=0.03)
AWAY = replace(SEEN, view=turned(40), made=replace(MADE, angle=40.0))
POOR = replace(AWAY, estimate=ViewEstimate(1, turned(40), 0.5))


def of(seen=SEEN, **changes):
    return plan(replace(seen, **changes))


@pytest.mark.parametrize("asked", [{}, {"late": True}, {"volume": "bricks"}, {"draw": "vdi"}])
def test_the_first_vdi_is_made_where_frames_are_late_or_somebody_asks(asked):
    found = of(made=None, **asked)
    if asked.keys() & {"draw", "volume"}:
        assert (found.show, found.update) == ("vdi", True)
        return
    assert found.make == (HOME if asked else None)
    assert (found.show, found.full) == ("volume", True)
    moves = of(made=None, hand=True, moving=True, **asked)
    assert moves.make is None


def test_the_first_vdi_is_of_the_view_at_hand_or_of_the_one_that_was_chosen():
    assert of(made=None, late=True, view=turned(9)).make == turned(9)
    assert of(made=None, late=True, view=turned(9), chosen=True).make == HOME
    assert of(made=None, late=True, view=turned(9), regenerate="never").make == HOME


@pytest.mark.parametrize("draw", ["auto", "vdi"])
def test_a_change_is_shown_by_the_volume_and_its_vdi_made_at_rest(draw):
    changed = replace(SEEN, content="b", draw=draw, late=True, view=turned(9))
    found = plan(changed)
    assert (found.show, found.content, found.stand_in) == ("volume", "b", True)
    assert (found.full, found.make) == (False, turned(9))
    assert of(changed, regenerate="never").make == HOME
    making = Making("b", turned(9), for_view=False)
    goes_on = of(changed, making=making)
    assert (goes_on.make, goes_on.give_up) == (None, False)
    again = of(changed, making=making, content="c")
    assert (again.give_up, again.content, again.make) == (True, "c", turned(9))
    back = of(changed, making=making, content="a")
    assert (back.give_up, back.make) == (True, None)
    assert of(changed, failed=True).make is None
    assert of(changed, volume="none").show == "vdi"


def test_a_moving_hand_has_the_machine():
    """Whatever is seen, nothing is begun, and what serves waits."""
    for seen, regenerate, late, draw in product(
        (SEEN, AWAY, POOR, replace(SEEN, content="b"), replace(SEEN, made=None)),
        ("auto", "never"),
        (True, False),
        ("auto", "vdi", "volume"),
    ):
        known = {"regenerate": regenerate, "late": late, "draw": draw}
        found = of(seen, hand=True, moving=True, settled=False, **known)
        assert (found.make, found.estimate) == (None, False)
    waits = of(POOR, hand=True, moving=True, making=Making("a", HOME, for_view=True), draw="vdi")
    assert not waits.give_up


def test_a_view_at_rest_is_estimated_and_gets_a_vdi_if_it_is_poor():
    assert of(SEEN).estimate is False, "at home there is nothing to tell"
    assert of(AWAY, settled=False).estimate is False
    assert of(AWAY, draw="vdi").estimate
    assert of(AWAY, regenerate="never").estimate is False
    assert of(POOR, draw="vdi").make == turned(40)
    assert of(POOR).make is None, "the volume's own frames keep the rate"
    assert of(POOR, late=True).make == turned(40)
    assert of(POOR, draw="vdi", bound=0.4).make is None
    good = replace(POOR, estimate=ViewEstimate(1, turned(40), 0.97), draw="vdi")
    assert (plan(good).make, plan(good).estimate) == (None, False)
    assert of(good, view=turned(43)).estimate, "it was of another view"


def test_vdi_or_volume_whichever_is_better_in_time():
    assert of(costs=Costs(volume=1e-9)).show == "vdi", "until both have told"
    costs = Costs(volume=1e-7, vdi=1e-6)
    assert of(costs=costs).show == "volume"
    assert of(costs=Costs(volume=1e-7, vdi=0.9e-7)).show == "vdi"
    # What was drawn last stays where it makes no difference
    assert of(costs=Costs(volume=1e-7, vdi=0.9e-7, way="volume")).show == "volume"
    # In a motion both may have fewer pixels, and the VDI's own error counts
    slow = Costs(volume=1e-3, vdi=1e-6)
    assert of(moving=True, costs=slow).show == "vdi"
    assert of(moving=True, costs=replace(slow, volume=1e-6)).show == "vdi"
    assert of(POOR, moving=True, costs=replace(slow, volume=1e-6)).show == "volume"
    assert of(POOR, costs=slow).show == "volume", "it does not do at rest"
    assert of(made=replace(MADE, coverage=0.9), costs=slow).show == "volume"
    assert of(made=replace(MADE, magnification=1.5), costs=slow).show == "volume"
    assert of(joint=True, costs=costs).show == "vdi", "merged by lists"
    assert of(volume="bricks", costs=costs).show == "vdi"


@pytest.mark.parametrize(("gpu", "slope"), [(True, 0.03), (True, 0.13), (False, 0.7), (False, 1.4)])
def test_what_a_picture_takes_is_learned_by_rays_and_angle(gpu, slope):
    """To a fifth (here .1) after some turns, of a VDI with few rays and many, near and far."""
    costs, rng, true = Costs(), np.random.default_rng(1), Costs(vdi=2e-9, slope=slope, fixed=1e-3)

    def time_of(costs, angle, pixels):
        return costs.fixed + pixels * costs.vdi * costs.rise(angle)

    for turn in range(800):
        angle, pixels = 30 + 30 * np.sin(turn / 9), 9e5 / rng.choice([1, 4, 16])
        costs = costs.took("vdi", angle, pixels, time_of(true, angle, pixels), gpu=gpu)
        if turn == 0:
            first = costs.rise(30)
            assert 2 < first < 4 if gpu else first > 20, "what is expected of the device's kind"
    for case in ((0, 9e5), (5, 9e5), (30, 1e5), (60, 9e5)):
        assert time_of(costs, *case) == pytest.approx(time_of(true, *case), rel=0.2)
    assert of(KEPT, costs=costs).show == of(KEPT).show, "kept pictures are not chosen by time"


def test_what_cannot_be_made_is_said_and_what_was_shown_stays():
    assert of(content=None).show == "vdi"
    assert of(content=None, made=None).show == "trouble"
    assert of(content=None, watched=False).show == "trouble"
    assert of(content=None, draw="volume").show == "trouble"


# Pictures that are kept

KEPT = replace(SEEN, watched=False)


def test_one_picture_is_the_volumes_and_no_vdi_is_made():
    found = of(KEPT, made=None)
    assert (found.show, found.update, found.in_bricks, found.full) == ("volume", False, True, True)
    assert of(KEPT, made=None, volume="none").update
    assert of(KEPT, made=None, draw="vdi").update
    assert not of(KEPT, made=None, draw="vdi", failed=True).update


def test_pictures_in_which_volumes_overlap_are_drawn_by_vdis():
    assert of(KEPT, joint=True, made=None).show == "exact"
    assert of(KEPT, joint=True).show == "vdi"
    for poor in ({"view": turned(3)}, {"content": "b"}):
        assert of(KEPT, joint=True, **poor).show == "exact"
    never = of(KEPT, joint=True, made=None, regenerate="never")
    assert (never.show, never.update) == ("vdi", True)


def test_whatever_is_seen_is_planned_without_fail():
    """All combinations; who is watched waits for nothing but a first VDI."""
    kinds = {
        "draw": ("auto", "vdi", "volume"),
        "regenerate": ("auto", "never"),
        "watched": (False, True),
        "moving": (False, True),
        "joint": (False, True),
        "made": (None, MADE, replace(MADE, content="b", angle=30.0)),
        "making": (None, Making("a", turned(9), for_view=True)),
        "failed": (False, True),
        "volume": ("whole", "bricks", "none"),
        "late": (False, True),
        "content": ("a", None),
    }
    for values in product(*kinds.values()):
        seen = replace(SEEN, **dict(zip(kinds, values, strict=True)))
        found = plan(seen)
        assert isinstance(found, Plan)
        assert (found.content is not None) or found.show != "volume"
        assert found.make is None or not (seen.failed or found.update)
        if seen.watched and seen.made is not None:
            assert not found.update
