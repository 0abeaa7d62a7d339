"""What decides a frame, by itself: tables of single steps, and random sequences of events."""

from __future__ import annotations

import ast
import os
import sys
from dataclasses import FrozenInstanceError, dataclass, is_dataclass, replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyvista_vdi.quality.decide import busy, decide, placeholder_share
from pyvista_vdi.quality.frame_state import (
    AskAgain,
    AskPolicy,
    Closed,
    Complain,
    Do,
    Estimate,
    EstimateError,
    EstimateReady,
    Failed,
    FrameAsked,
    FrameState,
    FrameTook,
    Generate,
    InputChanged,
    Interrupted,
    Judge,
    PlaceholderTook,
    Raise,
    Settings,
    Show,
    Sight,
    StoredAsked,
    StoredSeen,
    TimePassed,
    VDIAsked,
    VDIReady,
    ViewPicked,
)
from pyvista_vdi.quality.records import replace as replaced

pytestmark = pytest.mark.fast

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])
BOUNDS = (-1.0, 1.0) * 3
#: Runs of random sequences: of every day, and of the nightly tests.
EXAMPLES, MANY = 300, 10_000


@dataclass(frozen=True)
class Seen:
    """A view so many degrees from the first one."""

    degrees: float

    def distance(self, other, bounds):
        return abs(self.degrees - other.degrees) * 0.0175


@dataclass(frozen=True)
class Volume:
    bounds: tuple = BOUNDS


@dataclass(frozen=True)
class Request:
    content: int
    screen: Seen
    volume: Volume = Volume()

    @property
    def key(self):
        return self.content, self.screen


class World:
    """A window, its source and its workers, which do what is decided, as little as that is."""

    def __init__(self, *, watched=True, **chosen):
        self.state = FrameState(Settings(**chosen))
        self.watched, self.closed, self.joint = watched, False, False
        self.now, self.frames, self.content, self.angle = 10.0, 0, 0, 0.0
        self.moving = self.shown_look = False
        self.own = Seen(0)  # that the source makes its VDIs of
        self.vdi = None  # (number, request)
        self.making = self.estimating = None
        self.made = self.failing = 0
        self.can_draw, self.ssim, self.answer = True, 0.5, False
        self.log = []

    @property
    def stamp(self):
        return self.content, self.own, self.made

    def sight(self):
        if self.vdi is None:
            return None
        number, request = self.vdi
        return Sight(number, BOUNDS, request, angle=abs(self.angle), pixels=1e4)

    def ask(self):
        return FrameAsked(
            self.now,
            self.frames,
            Seen(self.angle),
            self.stamp,
            Request(self.content, self.own),
            None,
            self.sight(),
            watched=self.watched,
            joint=self.joint,
            moving=self.moving,
            previews=self.moving and self.watched,
            seconds=1 / 30,
        )

    def frame(self):
        """Draw a frame; the content that it shows, and how."""
        self.now += 0.03
        self.frames += 1
        self.closed = False
        self.between()
        return self.tell(self.ask())

    def between(self):
        if self.state.behind:
            self.tell(TimePassed(self.now, self.sight(), self.stamp))

    def tell(self, event):
        shown = None
        for _ in range(20):
            self.state, actions = decide(self.state, event)
            event = None
            for action in actions:
                assert event is None, "what is asked again comes last"
                assert not self.closed or isinstance(action, Do), action
                self.log.append(action)
                if isinstance(action, Show):
                    shown, event = self.show(action)
                else:
                    event = self.do(action)
            if event is None:
                return shown
        raise AssertionError("it asks and asks")

    def show(self, action):
        what = action.what
        if what in ("last", "before"):
            return (None if self.vdi is None else ("vdi", self.vdi[1].content)), None
        if what == "this view":
            self.make(Request(self.content, Seen(self.angle)))
            return ("vdi", self.content), None
        if not self.can_draw:
            return None, replace(action.asked, refused=(*action.asked.refused, action.content))
        return ("volume", action.content), None

    def make(self, request):
        self.made += 1
        self.vdi, self.own = (self.made, request), request.screen

    def do(self, action):
        match action:
            case Generate(screen):
                assert self.state.making is not None
                self.making = Request(self.content, self.own if screen is None else screen)
                assert self.making.content == self.state.making.content
                assert self.making.screen == self.state.making.screen
            case EstimateError(number, seen, _):
                assert self.estimating is None
                self.estimating = Estimate(number, seen, self.ssim)
            case AskPolicy(asked):
                return replace(asked, answer=self.answer)
            case Judge(asked):
                number = asked.seen.vdi
                return replace(asked, judged=Estimate(number, asked.view, self.ssim))
            case AskAgain(asked):
                return replace(self.ask(), look=asked.look, answer=asked.answer)
            case Do("take"):
                self.make(self.making)
                self.making = None
            case Do("drop vdi"):
                self.making = None
            case Do("drop estimate"):
                self.estimating = None
            case Do("update"):
                if self.vdi is None or self.vdi[1].key != (self.content, self.own):
                    self.make(Request(self.content, self.own))
            case Do("take view") | Do("follow view"):
                self.own = Seen(self.angle)
        return None

    def finish(self):
        """Let the workers finish what they do."""
        if self.making is not None and self.failing:
            self.failing -= 1
            self.making = None
            self.tell(Failed(RuntimeError("no more")))
        elif self.making is not None:
            self.tell(VDIReady())
        if self.estimating is not None:
            estimate, self.estimating = self.estimating, None
            self.tell(EstimateReady(estimate))

    def close(self):
        self.tell(Closed())
        self.making = self.estimating = None
        self.closed = True


#: Things that can happen to a world.
EVENTS = {
    "frame": lambda w, _: w.frame(),
    "tick": lambda w, _: w.between(),
    "change": lambda w, n: setattr(w, "content", n % 3),
    "turn": lambda w, n: setattr(w, "angle", 10.0 * n),
    "move": lambda w, n: setattr(w, "moving", n % 2 == 0),
    "rest": lambda w, n: (setattr(w, "moving", False), setattr(w, "now", w.now + 1)),
    "finish": lambda w, _: w.finish(),
    "fail": lambda w, _: setattr(w, "failing", 1),
    "room": lambda w, n: setattr(w, "can_draw", n % 3 > 0),
    "ssim": lambda w, n: setattr(w, "ssim", n / 18),
    "answer": lambda w, n: setattr(w, "answer", n % 2 == 0),
    "overlap": lambda w, n: setattr(w, "joint", n % 2 == 0),
    "watch": lambda w, n: setattr(w, "watched", n % 2 == 0),
    "took": lambda w, n: w.tell(FrameTook("volume" if n % 2 else "vdi", n, 1e4, 1e-3 * n)),
    "ask": lambda w, _: w.tell(VDIAsked(w.vdi is not None, w.stamp)),
    "retry": lambda w, _: w.tell(InputChanged(another=False)),
    "close": lambda w, _: w.close(),
}
STEPS = st.lists(st.tuples(st.sampled_from(sorted(EVENTS)), st.integers(0, 18)), max_size=40)
CHOSEN = st.fixed_dictionaries(
    {
        "draw": st.sampled_from(["auto", "vdi", "volume"]),
        "regenerate": st.sampled_from(["auto", "never", bool]),
    }
)


def run(steps, watched, chosen):
    world = World(watched=watched, **chosen)
    for name, number in steps:
        before = len(world.log)
        EVENTS[name](world, number)
        # Never two VDIs in the making, and what is said to be made is made
        assert (world.state.making is None) == (world.making is None), (name, world.log[before:])
        assert world.state.estimating == (world.estimating is not None), name
        if world.closed:
            assert not busy(world.state, world.now + 1)
    return world


def shows_each_change_at_the_latest_two_frames_after(steps, watched, chosen):
    world = run(steps, watched, chosen)
    world.can_draw, world.failing = True, 0
    world.tell(InputChanged(another=False))
    for content in (7, 8):
        world.content = content
        world.frame()
        way, shown = world.frame()
        stays = world.joint and world.watched and way == "vdi"  # merged by the lists that are there
        assert shown == content or stays or world.state.refused == content
        world.joint = False
        assert world.frame()[1] == content or world.state.refused == content


@given(STEPS, st.booleans(), CHOSEN)
@settings(max_examples=EXAMPLES, deadline=None)
def test_random_sequences(steps, watched, chosen):
    shows_each_change_at_the_latest_two_frames_after(steps, watched, chosen)


@pytest.mark.slow
@given(STEPS, st.booleans(), CHOSEN)
@settings(max_examples=MANY, deadline=None)
def test_many_random_sequences(steps, watched, chosen):
    shows_each_change_at_the_latest_two_frames_after(steps, watched, chosen)


@given(STEPS, CHOSEN, st.floats(1e-3, 1e3))
@settings(max_examples=EXAMPLES // 3, deadline=None)
def test_off_screen_time_decides_nothing(steps, chosen, slower):
    """The same pictures, however long frames take."""
    steps = [each for each in steps if each[0] != "watch"]
    shown = []
    for factor in (1.0, slower):
        world = World(watched=False, **chosen)
        shown.append([])
        for name, number in steps:
            if name == "took":
                world.tell(FrameTook("volume", 0.0, 1e4, 1e-3 * factor * (1 + number)))
            elif name == "frame":
                world.now += factor
                shown[-1].append(world.frame())
            else:
                EVENTS[name](world, number)
        assert not any(isinstance(each, Generate | EstimateError) for each in world.log)
    assert shown[0] == shown[1]


def test_a_closed_window_takes_nothing_that_was_made_for_it():
    world = World()
    world.frame()
    assert world.making is not None
    world.close()
    for late in (
        VDIReady(),
        EstimateReady(Estimate(1, Seen(0), 0.1)),
        TimePassed(99.0, None, None),
    ):
        assert decide(world.state, late) == (world.state, ())
    assert world.frame() == ("volume", 0), "another frame begins anew"


def at_rest(world, degrees):
    """Turn, and draw frames until the view counts as one at rest."""
    world.angle = degrees
    world.frame()
    world.now += 1
    world.frame()
    return world.log


def with_vdi(**chosen):
    world = World(**chosen)
    world.frame()
    world.finish()
    world.frame()
    assert world.state.making is None
    world.log.clear()
    return world


def test_a_view_gets_a_vdi_where_the_estimate_is_poor_and_one_at_a_time():
    world = with_vdi(draw="vdi")
    world.ssim = 0.96
    asked = [each for each in at_rest(world, 30) if isinstance(each, EstimateError)]
    assert len(asked) == 1
    world.frame()
    world.between()
    assert sum(isinstance(each, EstimateError) for each in world.log) == 1, "it is being made"
    world.finish()
    world.frame()
    assert world.making is None, "it does"
    world.ssim = 0.94
    at_rest(world, 31)
    world.finish()
    world.frame()
    assert world.making.screen == Seen(31)
    world.angle = 70
    world.frame()
    assert world.making is not None, "still nearer to it than to the old one"
    world.angle = 2
    world.frame()
    assert world.making is None, "the view has come back"


def test_the_event_loop_is_needed_until_the_view_rests():
    world = with_vdi(draw="vdi")
    world.ssim = 0.99
    at_rest(world, 30)
    world.finish()
    world.frame()
    world.angle = 30.1  # too little for another estimate
    world.frame()
    assert busy(world.state, world.now)
    assert not busy(world.state, world.now + 0.2)


def test_in_motion_more_is_borne_and_less_is_asked():
    world = with_vdi(draw="vdi")
    world.moving, world.ssim, world.angle = True, 0.92, 30.0
    world.frame()
    world.finish()
    world.frame()
    assert world.making is None
    world.angle = 80.0
    world.frame()
    assert world.estimating is None, "the last one was asked for just now"
    world.now += 0.6
    world.frame()
    assert world.estimating is not None


def test_what_failed_is_tried_again_when_something_changes():
    world = with_vdi(draw="vdi")
    world.content, world.failing = 1, 1
    world.frame()
    world.finish()
    assert any(isinstance(each, Complain) for each in world.log)
    world.frame()
    assert world.making is None
    world.content = 2
    world.frame()
    assert world.making.content == 2


@pytest.mark.parametrize("policy", ["auto", bool])
def test_a_view_whose_vdi_failed_is_not_tried_again(policy):
    world = with_vdi(draw="vdi", regenerate=policy)
    world.answer, world.ssim = True, 0.5
    at_rest(world, 30)
    world.finish()
    world.frame()
    if policy == "auto":
        assert world.making is not None
        world.failing = 1
        world.finish()
    else:
        world.tell(Failed(RuntimeError("no more")))
        world.making = None
    for _ in range(3):
        world.now += 1
        world.frame()
        assert world.making is None


@pytest.mark.parametrize(("policy", "degrees"), [("auto", 30), ("never", 0), (bool, 30)])
def test_a_change_is_made_for_the_view_of_the_moment_or_as_before(policy, degrees):
    world = with_vdi(draw="vdi", regenerate=policy)
    world.angle = 30.0
    world.frame()
    world.content = 1
    assert world.frame() == ("volume", 1)
    assert world.making.screen == Seen(degrees)
    world.content = 0
    assert world.frame() == ("vdi", 0), "taken back"
    assert world.making is None


def test_a_policy_is_asked_once_for_both_eyes_of_a_frame():
    world = with_vdi(draw="vdi", regenerate=bool)
    world.frame()
    world.tell(world.ask())
    assert sum(isinstance(each, AskPolicy) for each in world.log) == 1


def test_off_screen_a_film_of_nearly_one_view_gets_a_vdi():
    world, ways = World(watched=False), []
    world.ssim = 0.99
    for number in range(20):
        world.angle = 0.1 * number
        ways.append(world.frame()[0])
    assert ways == ["volume"] * 12 + ["vdi"] * 8
    assert world.made == 1


def test_what_overlaps_is_drawn_by_vdis_whatever_was_chosen():
    world = World(watched=False, draw="volume")
    assert world.frame()[0] == "volume"
    world.joint = True
    assert world.frame()[0] == "vdi"


def test_what_the_device_cannot_draw_is_tried_once_for_each_content():
    world = with_vdi(draw="vdi")
    world.can_draw, world.content = False, 1
    assert world.frame() == ("vdi", 0)
    tried = sum(isinstance(each, Show) and each.what == "making" for each in world.log)
    world.frame()
    again = sum(isinstance(each, Show) and each.what == "making" for each in world.log)
    assert (tried, again) == (1, 1)


def test_an_abort_shows_what_was_shown_or_waits_for_another_Seen():
    state, error = FrameState(), ValueError()
    _, (complaint, show) = decide(state, Interrupted(error, shown=True))
    assert (complaint, show) == (Complain(error), Show("before"))
    _, actions = decide(state, Interrupted(error, shown=False))
    assert actions == (Do("forget view"), Raise(error))


def test_what_cannot_be_honoured_is_said_where_there_is_something_to_show():
    world, error = with_vdi(draw="vdi"), ValueError("2D")
    asked = replace(world.ask(), number=99, stamp=99, wanted=None, trouble=error)
    assert decide(world.state, asked)[1] == (Complain(error), Show("last"))
    asked = replace(asked, seen=None, watched=False)
    assert decide(FrameState(), asked)[1] == (Raise(error),)


def test_placeholders_have_few_rays_until_their_cost_is_known():
    state = FrameState()
    assert placeholder_share(state, 10_000)[1] == 0.0
    state, _ = decide(state, PlaceholderTook(1000, 1 / 30))
    assert placeholder_share(state, 10_000)[1] == pytest.approx(0.1, abs=0.01)
    with pytest.raises(FrozenInstanceError):
        state.making = None


def test_a_stored_vdi_that_failed_is_tried_again_when_another_is_due():
    state, _ = decide(FrameState(), Failed(ValueError(), 1, in_frame=True))
    assert decide(state, StoredAsked(1))[1] == (Show("last"),)
    assert decide(state, StoredAsked(2))[1] == (Do("update"), Show("last"))


def test_what_is_asked_for_is_made_unless_it_is_there():
    state = FrameState(behind=True)
    assert decide(state, VDIAsked(True, 1)) == (state, ())
    assert decide(state, VDIAsked(False, 1))[1][-1] == Do("update")
    assert decide(replace(state, failed_in_frame=1), VDIAsked(False, 1))[1][-1] != Do("update")
    assert decide(state, ViewPicked(1.0))[1] == ()
    assert decide(state, ViewPicked(0.5))[1] == (Show("this view"),)


def test_another_input_begins_with_nothing_known():
    known = replace(FrameState(Settings(draw="vdi")), refused=1, estimate=Estimate(1, Seen(0), 0.5))
    assert decide(known, InputChanged())[0] == FrameState(Settings(draw="vdi"))
    assert decide(known, InputChanged(another=False))[0] == known


@pytest.mark.parametrize(
    ("seen", "cause"),
    [({"angle": 61}, "angle"), ({"coverage": 0.8}, "coverage"), ({"magnification": 3}, "magni")],
)
def test_what_a_stored_vdi_lacks_is_said(seen, cause):
    told = StoredSeen(Sight(1, BOUNDS, **seen), 60.0, "no remedy")
    (warning,) = decide(FrameState(), told)[1]
    assert warning.cause.startswith(cause)
    assert "no remedy" in warning.message
    assert decide(FrameState(Settings(regenerate="never")), told)[1] == ()


def frozen(thing):
    """Whether a record is of frozen records, tuples and plain values, all the way down."""
    if is_dataclass(thing):
        names = thing.__dataclass_fields__
        return thing.__dataclass_params__.frozen and all(frozen(getattr(thing, n)) for n in names)
    if isinstance(thing, tuple):
        return all(map(frozen, thing))
    return thing is None or callable(thing) or isinstance(thing, bool | int | float | str)


@given(STEPS, st.booleans(), CHOSEN)
@settings(max_examples=EXAMPLES // 10, deadline=None)
def test_a_state_is_frozen_all_the_way_down(steps, watched, chosen):
    assert frozen(run(steps, watched, chosen).state)


PURE = ("decide", "frame_state", "frame_rate", "pace", "pictures", "records", "regeneration_policy")


def test_a_record_is_replaced_as_by_dataclasses():
    state = FrameState(number=1)
    assert replaced(state, number=2, by_vdi=False) == replace(state, number=2, by_vdi=False)
    assert state == FrameState(number=1)
    with pytest.raises(TypeError, match="none_such"):
        replaced(state, none_such=2)


@pytest.mark.parametrize("name", [*PURE, "render_mode"])
def test_what_decides_imports_the_standard_library_and_the_model(name):
    """No VTK, no device, no clock, no thread, and no weak reference."""
    path = CHECKOUT / "pyvista_vdi" / "quality" / f"{name}.py"
    here = {f"pyvista_vdi.quality.{each}" for each in (*PURE, "render_mode")}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [str(node.module)]
        elif isinstance(node, ast.Import):
            names = [each.name for each in node.names]
        for each in names:
            top = each.partition(".")[0]
            assert top not in ("time", "threading", "weakref", "asyncio", "random", "os"), each
            pure = each.startswith(("pyvista_vdi.model.", "pyvista_vdi.errors")) or each in here
            assert pure or top in sys.stdlib_module_names, each
