"""The frame rate against a simulated device whose true cost is known.

A frame is judged by its *true* time, that of the chosen samples without noise and stalls. The
target is *attainable* where its period lies between the true time at the floor and that in full.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from pyvista_vdi.quality.rate import FLOOR, FrameRate, Pace

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


def test_full_where_that_fits_and_the_floor_where_nothing_does():
    chosen, _, _ = run(lambda _: 0.5 * (PERIOD - 4e-3) / FULL)
    assert (chosen == FULL).all()
    chosen, _, _ = run(lambda _: 100 * PERIOD / FULL)
    assert (chosen[FIRST:] == math.ceil(FLOOR * FULL)).all()
    # Back in full, and once
    chosen, _, _ = run(lambda k: (2 if k < 50 else 0.5) * (PERIOD - 4e-3) / FULL)
    assert (chosen[10:50] < FULL).all()
    assert (chosen[70:] == FULL).all()


@pytest.mark.parametrize(
    ("work", "beside", "slow"), [(0.012, 0.03, True), (0.012, 0.004, False), (0.2, 0.004, False)]
)
def test_multisampling_goes_where_it_makes_frames_late(work, beside, slow):
    """Not where they are in time with it, nor where rays alone make them late."""
    pace = Pace()
    for _ in range(3):
        pace.began(4)
        pace.share(30.0, 10_000, FLOOR)
        pace.drawn((100, 100), (100, 100), work)
        pace.ended(work + beside, moving=True)
    assert pace.slow_samples == slow
