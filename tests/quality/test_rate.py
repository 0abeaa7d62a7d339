"""The frame rate against a simulated device whose true cost is known.

A frame is judged by its *true* time, that of the chosen samples without noise and stalls. The
target is *attainable* where its period lies between the true time at the floor and that in full.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyvista_vdi.quality.costs import Costs, rise
from pyvista_vdi.quality.rate import FLOOR, HEADROOM, FrameRate, Pace, reduced

FULL, TARGET, THRESHOLD = 1280 * 720, 30.0, 0.1
PERIOD = 1 / TARGET
#: Frames after which the cost is known.
FIRST = 10


def run(cost, frames=200, *, overhead=4e-3, noise=0.0, stalls=0.0, rate=None, seed=0):
    """Return the choices and the true times, seconds, of an interaction.

    ``cost``: seconds per sample, by the frame.
    """
    rng = np.random.default_rng(seed)
    rate = FrameRate(TARGET) if rate is None else rate
    chosen, true = [], []
    for k in range(frames):
        rate = rate.choose(FULL)
        samples = rate.chosen(FULL)
        work = cost(k) * samples
        chosen.append(samples)
        true.append(work + overhead)
        measured = work * (1 + noise * rng.standard_normal())
        if rng.random() < stalls:
            measured += 0.3
        rate = rate.record(samples, measured, measured + overhead)
    return np.array(chosen), np.array(true), rate


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("share", [0.1, 0.4, 0.9])
def test_keeps_the_rate_where_it_is_attainable(share, noise):
    each = (PERIOD - 4e-3) / (share * FULL)
    _, true, _ = run(lambda _: each, noise=noise)
    assert np.mean(np.abs(true[FIRST:] / PERIOD - 1) <= THRESHOLD) > 0.95


def test_a_cost_that_drifts_or_jumps_is_followed():
    each = (PERIOD - 4e-3) / (0.4 * FULL)
    _, true, _ = run(lambda k: each * (1 + 0.4 * math.sin(2 * math.pi * k / 90)))
    assert np.mean(np.abs(true[FIRST:] / PERIOD - 1) <= 1.5 * THRESHOLD) > 0.8
    _, true, _ = run(lambda k: each * (1 if k < 100 else 3))
    assert true[100] > 2 * PERIOD
    assert (np.abs(true[104:] / PERIOD - 1) <= THRESHOLD).all(), "two frames tell, two are allowed"


def test_a_stall_changes_nothing():
    each = (PERIOD - 4e-3) / (0.4 * FULL)
    chosen, true, _ = run(lambda _: each, stalls=0.05)
    # Two that follow each other are believed, for two frames
    assert np.mean(np.abs(true[FIRST:] / PERIOD - 1) <= THRESHOLD) > 0.95
    assert len(set(chosen[FIRST:])) < 10


def test_full_where_that_fits_and_the_floor_where_nothing_does():
    chosen, _, _ = run(lambda _: 0.5 * (PERIOD - 4e-3) / FULL)
    assert (chosen == FULL).all()
    chosen, _, _ = run(lambda _: 100 * PERIOD / FULL)
    assert (chosen[FIRST:] == math.ceil(FLOOR * FULL)).all()
    # Back in full, and once
    chosen, _, _ = run(lambda k: (2 if k < 50 else 0.5) * (PERIOD - 4e-3) / FULL)
    assert (chosen[10:50] < FULL).all()
    assert (chosen[70:] == FULL).all()


def test_where_all_else_alone_misses_the_rate_the_work_gets_a_quarter_of_the_time():
    each = 0.2 / FULL
    chosen, true, _ = run(lambda _: each, overhead=0.05)
    share = chosen[FIRST:] * each / true[FIRST:]
    np.testing.assert_allclose(share, 0.25, atol=0.02)


@given(st.lists(st.tuples(st.integers(0, 10**9), *[st.floats()] * 2), max_size=30))
@settings(max_examples=60, deadline=None)
def test_no_clock_ends_an_interaction(frames):
    rate = FrameRate(TARGET)
    for samples, work, seconds in frames:
        rate = rate.record(samples, work, seconds).choose(FULL)
        assert math.ceil(FLOOR * FULL) <= rate.chosen(FULL) <= FULL
    assert rate.rest().fps == 0.0


# A window


def frame(pace, seconds, *, full=(100, 100), share=None, samples=0, beside=0.01):
    """Draw a frame whose full image takes so many seconds; returns its share of the pixels."""
    pace.began(samples)
    if share is None:
        share = pace.share(TARGET, math.prod(full), FLOOR)
    size = reduced(full, share)
    work = seconds * math.prod(size) / math.prod(full)
    pace.drawn(size, full, work)
    pace.ended(work + beside, True)
    return share


def test_a_motion_begins_with_what_the_full_frame_has_told():
    pace = Pace()
    frame(pace, 0.2, share=1.0)
    first = frame(pace, 0.2)
    assert first == pytest.approx((1 / TARGET / HEADROOM - 0.01) / 0.2, rel=0.05)
    assert pace.fps == pytest.approx(TARGET * HEADROOM, rel=0.1)


def test_all_vdis_of_a_frame_have_one_share():
    pace = Pace()
    for _ in range(4):
        pace.began(0)
        shares = [pace.share(TARGET, 10_000, FLOOR) for _ in range(2)]
        for share in shares:
            pace.drawn(reduced((100, 100), share), (100, 100), 0.1 * share)
        pace.ended(0.2 * shares[0], True)
    assert shares[0] == shares[1] == pytest.approx(1 / TARGET / HEADROOM / 0.2, rel=0.1)


def test_multisampling_is_given_up_where_it_makes_frames_late():
    pace = Pace()
    frame(pace, 0.001, share=1.0, samples=4, beside=0.04)
    assert not pace.slow_samples, "no rate was asked for"
    frame(pace, 0.001, samples=4, beside=0.04)
    frame(pace, 0.001, samples=4, beside=0.04)
    assert pace.slow_samples
    frame(pace, 0.001, samples=4, beside=0.002)
    assert not pace.slow_samples


def test_frames_are_late_where_their_rays_are():
    pace = Pace()
    frame(pace, 0.001, share=1.0)
    assert pace.late(0.03, TARGET)
    assert not pace.late(0.01, TARGET)
    frame(pace, 0.001, share=1.0, beside=0.05)
    assert not pace.late(0.005, TARGET), "an empty scene misses the rate"


def test_costs_are_known_as_if_at_the_vdis_own_view():
    costs = Costs().took("vdi", 30.0, 1000, 0.024).took("volume", 30.0, 1000, 0.01)
    assert costs.vdi == pytest.approx(1e-6)
    assert costs.volume == pytest.approx(1e-5)
    assert costs.took("vdi", 0.0, 1000, 0.002).vdi == pytest.approx(1.4e-6)
    assert costs.took("vdi", 0.0, 0, 0.002) == costs
    assert [rise(angle) for angle in (0, 5, 180)] == [1.0, 6.4, 40.0]
