"""Records of runs (opencl/generation/merging.cl, shorten_lists.cl and homogeneity.cl): what merging
two runs gives and costs, and the four ways of shortening a record.

The reference is float64, of docs/dev/conventions.md and the head of the kernel file: a run is a
homogeneous medium of straight colour c and optical depth tau over a length; it looks like (c f, f)
per reference length l with f = tau / (tau + l); merging costs what the sum of squares about the
mean, along the ray, grows by. Cuts are those of reference.shading.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorded_runs import (
    BACK,
    COLOR,
    EPS,
    EXTREMES,
    FRONT,
    OPACITY,
    TAU,
    TRANSMITTANCE,
    as_runs,
    disjoint,
    random_records,
    random_segments,
)
from reference import compositing
from reference.compositing import Segment
from reference.shading import cut_where_unlike

FILE = "record_functions.cl"
#: Ways of shortening a record.
WITHIN, ROOM, LIMIT, ALIKE = range(4)
ERROR_LANES = 16  # see generation/shorten_lists.cl


def merging_cost(near, far, transmittance, per_reference, hidden_weight):
    """Sum of squares about their mean of two media and the nothing between them, as it is seen."""
    ends = (near.front, near.back, far.front, far.back)
    lengths = per_reference * np.diff(ends)
    tau = np.array([near.optical_depth, 0, far.optical_depth])
    with np.errstate(invalid="ignore"):
        features = np.nan_to_num(tau / (tau + lengths))[:, None]
    features = features * [[*near.color, 1.0], [0, 0, 0, 0], [*far.color, 1.0]]
    mean = lengths @ features / lengths.sum()
    seen = hidden_weight + (1 - hidden_weight) * transmittance
    return seen * (lengths @ ((features - mean) ** 2).sum(axis=1))


def greedy(segments, limit, per_reference, hidden_weight):
    """Merge, least cost first. Returns segments and the least relative distance of a choice."""
    segments, margin = list(segments), np.inf
    while len(segments) > limit:
        before = np.exp(-np.cumsum([0.0, *(s.optical_depth for s in segments)]))
        costs = [
            merging_cost(a, b, t, per_reference, hidden_weight)
            for a, b, t in zip(segments[:-1], segments[1:], before, strict=False)
        ]
        k = int(np.argmin(costs))
        if len(costs) > 1:
            second = np.partition(costs, 1)[1]
            margin = min(margin, (second - costs[k]) / second)
        segments[k : k + 2] = [compositing.merge(segments[k], segments[k + 1])]
    return segments, margin


def shortened(call, way, records, limit, *, per_reference=1.0, hidden_weight=0.5, threshold=1e-6):
    """Records (float32 (n, 8) each) shortened on the device, and the thresholds they ended with."""
    n, capacity = len(records), max(len(r) for r in records)
    runs = np.full((n, capacity, 8), np.nan, np.float32)
    for target, record in zip(runs, records, strict=True):
        target[: len(record)] = record
    rows = -(-n // ERROR_LANES) * ERROR_LANES
    lengths = np.array([len(r) for r in records], np.int32)
    runs, lengths, thresholds, *_ = call(
        FILE, "shortened", n, np.int32(way), np.int32(limit), np.int32(capacity),
        np.float32(per_reference), np.float32(hidden_weight), call.out(runs), call.out(lengths),
        call.out(np.full(n, threshold, np.float32)), call.empty(n * capacity * 8),
        call.empty(rows * capacity),
    )  # fmt: skip
    return [r[:k] for r, k in zip(runs, lengths, strict=True)], thresholds


def composited(record):
    """What the eye of V_O sees of a record."""
    return compositing.composite(
        record[:, COLOR].astype(float) / record[:, OPACITY, None], record[:, TAU].astype(float)
    )


def check_shortened(before, after):
    """Each run that is left is a whole number of neighbours, composited; none is missing."""
    starts = np.searchsorted(before[:, FRONT], after[:, FRONT])
    np.testing.assert_array_equal(before[starts, FRONT], after[:, FRONT])
    assert starts[0] == 0
    ends = np.append(starts[1:], len(before))
    assert (ends > starts).all()
    assert disjoint(after)
    np.testing.assert_array_equal(after[:, BACK], before[ends - 1, BACK])
    np.testing.assert_array_equal(after[:, TRANSMITTANCE], before[starts, TRANSMITTANCE])
    for run, first, last in zip(after.astype(np.float64), starts, ends, strict=True):
        members = before[first:last]
        tau, n = members[:, TAU].sum(dtype=float), len(members)
        assert abs(run[TAU] - tau) <= n * EPS * tau
        # Each opacity was rounded once and each merge rounds twice, of numbers up to 1
        assert np.abs(run[4:] - composited(members)).max() <= 4 * n * EPS


def pairs(seed, n=2000):
    """Segments side by side, and both runs of each."""
    rng = np.random.default_rng(seed)
    segments = [random_segments(rng, 2, gaps=0.5, thickest=rng.uniform(0.1, 20)) for _ in range(n)]
    runs = np.array([as_runs(pair) for pair in segments])
    # The transmittance in front of the first is anything
    runs[:, 0, TRANSMITTANCE] = rng.random(n)
    return segments, np.ascontiguousarray(runs[:, 0]), np.ascontiguousarray(runs[:, 1])


def test_merged_runs_follow_the_colour_law(call):
    segments, a, b = pairs(41)
    found = call(FILE, "merged", len(a), a, b, call.empty(len(a), 8))
    np.testing.assert_array_equal(found[:, TAU], a[:, TAU] + b[:, TAU])
    np.testing.assert_array_equal(found[:, FRONT], a[:, FRONT])
    np.testing.assert_array_equal(found[:, BACK], b[:, BACK])
    np.testing.assert_array_equal(found[:, TRANSMITTANCE], a[:, TRANSMITTANCE])
    for run, (near, far) in zip(found.astype(np.float64), segments, strict=True):
        whole = compositing.merge(near, far)
        # Rounded: both runs' colours and opacities, 1 - opacity, a product and a sum
        alpha = compositing.opacity(whole.optical_depth)
        assert run[OPACITY] == pytest.approx(alpha, abs=4 * EPS, rel=4 * EPS)
        color = run[COLOR] / run[OPACITY]
        np.testing.assert_allclose(color, whole.color, rtol=0, atol=10 * EPS)


def errors(call, a, b, per_reference=1.0, hidden_weight=0.5):
    how = np.float32(per_reference), np.float32(hidden_weight)
    return call(FILE, "merge_errors", len(a), a, b, *how, call.empty(len(a)))


@pytest.mark.parametrize(("per_reference", "hidden_weight"), [(0.02, 0.5), (50.0, 0.0)])
def test_merge_error_is_the_growth_of_the_sum_of_squares(call, per_reference, hidden_weight):
    segments, a, b = pairs(44)
    found = errors(call, a, b, per_reference, hidden_weight)
    exact = np.array(
        [
            merging_cost(near, far, float(run[TRANSMITTANCE]), per_reference, hidden_weight)
            for (near, far), run in zip(segments, a, strict=True)
        ]
    )
    # Features of up to 2 in length, 12 EPS off each, are subtracted before they are squared:
    # d(x^2) = 2 x dx, with lengths of up to 2 and gaps of up to 2; the rest is relative
    bound = 64 * EPS * np.sqrt(exact * 4 * per_reference) * 2 + 16 * EPS * exact + 1e-12
    assert (np.abs(found - exact) <= bound).all()
    if hidden_weight > 0:
        unlike = exact > 1e-6
        assert unlike.mean() > 0.5
        assert (found[unlike] > 0).all()
    assert (found >= 0).all()


@pytest.mark.parametrize(("limit", "hidden_weight"), [(2, 0.5), (20, 0.0)])
def test_merge_to_limit_is_greedy(call, limit, hidden_weight):
    segments = random_records(63, 48, 45)
    records = [as_runs(s) for s in segments]
    how = {"per_reference": 0.7, "hidden_weight": hidden_weight}
    found, _ = shortened(call, LIMIT, records, limit, **how)
    clear = 0
    for given, before, after in zip(segments, records, found, strict=True):
        assert len(after) == min(limit, len(before))
        check_shortened(before, after)
        expected, margin = greedy(given, limit, 0.7, hidden_weight)
        # Two errors that agree to some 64 EPS over what they are made of may go either way
        if margin > 1e-3:
            clear += 1
            faces = np.float32([(s.front, s.back) for s in expected])
            np.testing.assert_array_equal(after[:, [FRONT, BACK]], faces)
    assert clear > len(records) / 2, clear


@pytest.mark.parametrize("limit", [2, 20])
def test_homogeneity_cuts_where_the_reference_does(call, limit):
    records = [as_runs(s) for s in random_records(71, 64, 40)]
    found, _ = shortened(call, ALIKE, records, limit, per_reference=0.7)
    same = 0
    for before, after in zip(records, found, strict=True):
        assert 1 <= len(after) <= limit
        check_shortened(before, after)
        exact = [  # the very numbers that the device has
            Segment(r[FRONT], r[BACK], r[COLOR] / r[OPACITY], r[TAU]) for r in before.astype(float)
        ]
        expected = cut_where_unlike(exact, limit, 0.7)
        # Thresholds are a thousandth apart at most; a difference may lie between them
        faces = np.float32([(s.front, s.back) for s in expected])
        same += np.array_equal(after[:, [FRONT, BACK]], faces)
    assert same >= 0.9 * len(records), same


@pytest.mark.extremes
@pytest.mark.parametrize("way", [WITHIN, ROOM, LIMIT, ALIKE])
@pytest.mark.parametrize("limit", [7])
def test_any_finite_record_is_shortened(call, way, limit):
    """It ends (pytest's timeout says so), within the limit, in order, with the ends it had.

    Errors are finite, or there would be no least one.
    """
    for per_reference in (1e-30, 1.0, 1e30):
        how = {"per_reference": per_reference, "hidden_weight": 0.25}
        found, _ = shortened(call, way, list(EXTREMES.values()), limit, **how)
        for (name, before), after in zip(EXTREMES.items(), found, strict=True):
            assert 1 <= len(after) <= (len(before) if way == WITHIN else limit), name
            assert way != LIMIT or len(after) == limit, name
            # Only places and optical depths: what is denormal may be taken for zero
            assert np.isfinite(after[:, [FRONT, BACK, TAU]]).all(), name
            assert after[0, FRONT] == before[0, FRONT], name
            assert after[-1, BACK] == before[-1, BACK], name
            assert (after[1:, FRONT] >= after[:-1, BACK]).all(), name
            starts = np.searchsorted(before[:, FRONT], after[:, FRONT])  # whole neighbours
            np.testing.assert_array_equal(after[:, FRONT], before[starts, FRONT], name)
            ends = np.append(starts[1:], len(before)) - 1
            np.testing.assert_array_equal(after[:, BACK], before[ends, BACK], name)
            total, tau = before[:, TAU].sum(dtype=float), after[:, TAU].sum(dtype=float)
            assert tau == pytest.approx(total, rel=len(before) * EPS, abs=1e-37), name
            for hidden_weight in (0.0, 0.5):
                parts = before[:-1].copy(), before[1:].copy(), per_reference, hidden_weight
                assert np.isfinite(errors(call, *parts)).all(), name
