"""Dominance among noisy figures: an order without circles that never empties a front."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.tradeoff import Figure, dominates, find_dominated, front
from pyvista_vdi.measure.tradeoff.findings import told_apart

#: What does not count in the exact figures below, whose values are whole numbers.
NOTHING = 0.25


def exact(*values, tolerance=NOTHING):
    return tuple(Figure(float(value), tolerance) for value in values)


def timed(seconds, tolerance=0.05):
    return Figure.of_times(seconds, tolerance)


@st.composite
def noisy_settings(draw):
    """Settings with an exact figure whose differences may not count, and two timed ones."""
    count = draw(st.integers(1, 8))
    repeats = draw(st.integers(4, 7))
    seconds = st.floats(0.5, 2.0)
    settings = {}
    for i in range(count):
        loss = draw(st.floats(0, 2, allow_subnormal=False))
        times = [draw(st.lists(seconds, min_size=repeats, max_size=repeats)) for _ in range(2)]
        settings[str(i)] = (Figure(loss, 0.3), *(timed(t, 0.2) for t in times))
    return settings


@given(st.lists(st.tuples(*[st.integers(0, 4)] * 3), min_size=1, max_size=12))
def test_without_noise_it_is_paretos(points):
    settings = {str(i): exact(*point) for i, point in enumerate(points)}
    expected = {
        str(i)
        for i, mine in enumerate(points)
        if any(
            all(a <= b for a, b in zip(other, mine, strict=True)) and other != mine
            for other in points
        )
    }
    assert set(find_dominated(settings)) == expected


@given(noisy_settings())
def test_a_front_is_never_empty_and_dominates_the_rest(settings):
    kept, dominated = front(settings), find_dominated(settings)
    assert kept
    assert set(kept) | set(dominated) == set(settings)
    assert not set(kept) & set(dominated)
    assert all(by and set(by) <= set(kept) for by in dominated.values())
    for one in kept:
        assert not any(dominates(settings[other], settings[one]) for other in kept)


@given(noisy_settings(), st.randoms(use_true_random=False))
def test_the_order_of_settings_does_not_matter(settings, random):
    names = list(settings)
    random.shuffle(names)
    shuffled = {name: settings[name] for name in names}
    assert set(front(shuffled)) == set(front(settings))
    assert {n: set(by) for n, by in find_dominated(shuffled).items()} == {
        n: set(by) for n, by in find_dominated(settings).items()
    }


@given(noisy_settings())
def test_what_is_told_apart_differs_and_the_rest_does_not(settings):
    def differ(one, other):
        pairs = zip(settings[one], settings[other], strict=True)
        return any(a.is_better(b) or b.is_better(a) for a, b in pairs)

    names = list(settings)
    kept = told_apart(names, settings)
    assert kept[0] == names[0]
    for name in names:
        before = [one for one in kept if names.index(one) < names.index(name)]
        assert (name in kept) == all(differ(one, name) for one in before)


@given(noisy_settings())
def test_what_dominates_is_nowhere_worse_and_somewhere_better(settings):
    for name, by in find_dominated(settings).items():
        for one in by:
            pairs = list(zip(settings[one], settings[name], strict=True))
            assert all(a.value <= b.value + b.tolerance for a, b in pairs)
            assert any(a.value + a.tolerance < b.value for a, b in pairs)


@given(noisy_settings())
def test_a_setting_that_becomes_worse_stays_dominated(settings):
    for name in find_dominated(settings):
        first, *rest = settings[name]
        worse = {**settings, name: (Figure(first.value + 1, first.tolerance), *rest)}
        assert name in find_dominated(worse)


@given(st.lists(st.floats(0.01, 100), min_size=4, max_size=8), st.floats(0.1, 10))
def test_only_ratios_of_times_count(seconds, factor):
    """The median of logarithms of scaled times is that of the times, and a constant."""
    a, b = timed(seconds), timed([factor * s for s in seconds])
    assert math.isclose(b.value - a.value, math.log(factor), abs_tol=1e-9)


def test_noise_is_not_taken_for_dominance():
    steady, hiccup = [1.0, 1.01, 0.99, 1.0, 1.02], [0.4, 0.41, 2.0, 0.4, 0.39]
    slow = (Figure(0.02, 0.0005), timed(steady))
    # Much faster but for one frame, and less accurate: neither dominates
    fast = (Figure(0.05, 0.0005), timed(hiccup))
    assert not dominates(slow, fast)
    assert not dominates(fast, slow)
    # As accurate, and faster in the median but not beyond the noise
    noisy = (Figure(0.02, 0.0005), timed([0.9, 1.3, 0.6, 1.4, 0.85]))
    assert noisy[1].value < slow[1].value - 0.05
    assert not dominates(noisy, slow)
    # As accurate and faster in every frame
    faster = (Figure(0.0201, 0.0005), timed([0.8 * s for s in steady]))
    assert dominates(faster, slow)
    assert not dominates(slow, faster)


def test_too_few_repetitions_show_nothing():
    # Four and four lie apart by chance in one of 35 cases, five and five in one of 126
    for repeats, shown in ((4, False), (5, True)):
        one, other = (timed([s] * repeats) for s in (1.0, 2.0))
        assert one.is_better(other) is shown


def test_gains_must_outweigh_losses():
    # Better by 1.1 of what does not count in one figure, worse by 0.9 in each of two
    other = exact(1.1, 0, 0, tolerance=1.0)
    assert not dominates(exact(0, 0.9, 0.9, tolerance=1.0), other)
    assert dominates(exact(0, 0.5, 0.5, tolerance=1.0), other)


@pytest.mark.parametrize(
    ("settings", "kept", "by"),
    [
        pytest.param([(1, 2), (1, 2)], [0, 1], {}, id="equal"),
        pytest.param([], [], {}, id="none"),
        pytest.param([(12, 12), (8, 8), (4, 4)], [2], {0: [2], 1: [2]}, id="named by the front"),
        # Each is better than the next by what counts in one figure, and nowhere worse by it
        pytest.param(
            [(0, 0.5, 1.1), (1.1, 0, 0.5), (0.5, 1.1, 0)], [0, 1, 2], {}, id="in a circle"
        ),
        # Each has much of one figure for a little of another; the ends are far apart
        pytest.param(
            [(-2 * i, 0.9 * i) for i in range(5)], [0, 2, 4], {1: [2], 3: [4]}, id="in a chain"
        ),
    ],
)
def test_a_front_and_what_it_dominates(settings, kept, by):
    named = {str(i): exact(*values, tolerance=1.0) for i, values in enumerate(settings)}
    assert front(named) == [str(i) for i in kept]
    assert find_dominated(named) == {str(i): [str(one) for one in ones] for i, ones in by.items()}


@pytest.mark.parametrize(("value", "tolerance"), [(math.nan, 1), (math.inf, 1), (1, 0), (1, -1)])
def test_figures_are_checked(value, tolerance):
    with pytest.raises(InvalidArgumentError, match="a finite value and a tolerance above 0"):
        Figure(value, tolerance)
