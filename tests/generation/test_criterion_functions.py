"""opencl/generation/criteria.cl against the float64 cuts of pyvista_vdi.reference.criteria."""

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
)

from pyvista_vdi.model import compositing
from pyvista_vdi.model.compositing import Segment
from pyvista_vdi.reference import criteria

FILE = "criterion_functions.cl"

#: The kernels' names of the criteria, and the reference of each.
CUTS = {
    "EQUAL_LENGTH": criteria.cut_at_equal_lengths,
    "EQUAL_TRANSMITTANCE": criteria.cut_at_equal_transmittance,
    "EQUAL_OPTICAL_DEPTH": criteria.cut_at_equal_optical_depths,
    "HOMOGENEITY": criteria.cut_where_unlike,
}


def cut(call, criterion, records, limit, per_reference=1.0):
    """Records (float32 (n, 8) each), cut on the device."""
    capacity = max(len(r) for r in records) + limit
    runs = np.full((len(records), capacity, 8), np.nan, np.float32)
    for target, record in zip(runs, records, strict=True):
        target[: len(record)] = record
    n = len(records)
    lengths = np.array([len(r) for r in records], np.int32)
    runs, lengths, _ = call(
        FILE, "cut", n, np.int32(limit), np.int32(capacity), np.float32(per_reference),
        call.out(runs), call.out(lengths), call.empty(n * capacity * 8),
        CRITERION=criterion,
    )  # fmt: skip
    return [r[:k] for r, k in zip(runs, lengths, strict=True)]


def exact(record):
    """A record as float64 segments: the very numbers that the device has."""
    return [
        Segment(float(r[FRONT]), float(r[BACK]), r[COLOR] / r[OPACITY], float(r[TAU]))
        for r in record.astype(np.float64)
    ]


def check_kept(before, after, limit, name):
    """The promise; nothing is dropped; and the eye of V_O sees what it saw."""
    assert 1 <= len(after) <= limit, name
    assert disjoint(after), name
    assert after[0, FRONT] == before[0, FRONT], name
    assert after[-1, BACK] == before[-1, BACK], name
    assert (after[:, [TAU, OPACITY]] > 0).all(), name
    # Each cut rounds both parts' optical depths, each merge their sum, all relative to the whole
    n = len(before) + 2 * limit
    total = before[:, TAU].astype(np.float64).sum()
    assert abs(after[:, TAU].astype(np.float64).sum() - total) <= n * EPS * total, name
    seen = [
        compositing.composite(
            r[:, COLOR].astype(float) / r[:, OPACITY, None], r[:, TAU].astype(float)
        )
        for r in (before, after)
    ]
    assert np.abs(seen[0] - seen[1]).max() <= 8 * n * EPS, name


@pytest.mark.every(4)
@pytest.mark.parametrize("limit", [1, 2, 5, 20])
@pytest.mark.parametrize("criterion", CUTS)
def test_cuts_are_the_references(call, criterion, limit):
    """As many supersegments, at the same depths, with the same optical depth in each."""
    records = [as_runs(s) for s in random_records(71, 64, 40)]
    equal = criterion != "HOMOGENEITY"
    found = cut(call, criterion, records, limit, per_reference=0.7)
    same = 0
    for k, (before, after) in enumerate(zip(records, found, strict=True)):
        check_kept(before, after, limit, k)
        expected = CUTS[criterion](exact(before), limit, *([] if equal else [0.7]))
        if not equal and len(before) <= limit:
            np.testing.assert_array_equal(after, before)
        if len(expected) != len(after):
            continue  # a cut within rounding of a face
        faces = np.array([(s.front, s.back) for s in expected])
        if not equal:
            # Whole runs are merged, so that a face is one of theirs or another choice was made:
            # the thresholds are a thousandth apart at most; a difference may lie between them
            same += (after[:, [FRONT, BACK]] == np.float32(faces)).all()
            continue
        same += 1
        # A depth moves by the rounding of the share, relative to the densest run's: measured,
        # 3e-5 of a depth of up to 100 at most; the same of its optical depth
        np.testing.assert_allclose(after[:, [FRONT, BACK]], faces, atol=2e-2, rtol=1e-5)
        total = before[:, TAU].sum()
        tau = [s.optical_depth for s in expected]
        np.testing.assert_allclose(after[:, TAU], tau, atol=1e-3 * total)
    assert same >= 0.9 * len(records), same


@pytest.mark.parametrize("criterion", list(CUTS)[:3])
def test_one_medium_is_cut_into_equal_shares(call, criterion):
    whole = Segment(2.0, 10.0, np.array([0.2, 0.5, 0.9]), 3.0)
    (after,) = cut(call, criterion, [as_runs([whole])], 8)
    assert len(after) == 8
    alpha = compositing.opacity(after[:, TAU].astype(float))
    before = np.exp(-np.concatenate([[0], np.cumsum(after[:-1, TAU].astype(float))]))
    share = {
        "EQUAL_LENGTH": after[:, BACK] - after[:, FRONT],
        "EQUAL_TRANSMITTANCE": before * alpha,
        "EQUAL_OPTICAL_DEPTH": after[:, TAU],
    }[criterion]
    # A share is the difference of two of eight roundings or so
    np.testing.assert_allclose(share, share.mean(), rtol=64 * EPS * 8)
    np.testing.assert_array_equal(after[1:, FRONT], after[:-1, BACK])
    np.testing.assert_allclose(after[:, TRANSMITTANCE], before, rtol=32 * EPS)
    np.testing.assert_allclose(
        after[:, COLOR] / after[:, OPACITY, None], np.tile(whole.color, (8, 1)), rtol=8 * EPS
    )


def test_empty_stretches_make_no_supersegment(call):
    """Two thin media far apart: of ten equal lengths only the two that hold something are left."""
    parts = [Segment(0.0, 1.0, np.ones(3), 1.0), Segment(19.5, 20.0, np.ones(3), 1.0)]
    (after,) = cut(call, "EQUAL_LENGTH", [as_runs(parts)], 10)
    np.testing.assert_array_equal(after[:, [FRONT, BACK]], [[0, 1], [19.5, 20]])


def test_homogeneity_keeps_what_differs_most(call):
    """Dense red in thin grey survives, and the threshold need not be told."""
    grey, red = np.full(3, 0.5), np.array([1.0, 0, 0])
    parts = [
        Segment(float(k), float(k + 1), red if k == 30 else grey * (1 + 1e-3 * (k % 3)), tau)
        for k, tau in enumerate(np.where(np.arange(60) == 30, 2.0, 0.01))
    ]
    (after,) = cut(call, "HOMOGENEITY", [as_runs(parts)], 3)
    np.testing.assert_array_equal(after[:, [FRONT, BACK]], [[0, 30], [30, 31], [31, 60]])


@pytest.mark.extremes
@pytest.mark.every(2)
@pytest.mark.parametrize("criterion", CUTS)
@pytest.mark.parametrize("limit", [1, 7, 39, 64])
def test_any_finite_record_is_cut(call, criterion, limit):
    """It ends, within the limit, in order, with the ends and the optical depth it had."""
    for per_reference in (1e-30, 1.0, 1e30):
        found = cut(call, criterion, list(EXTREMES.values()), limit, per_reference)
        for (name, before), after in zip(EXTREMES.items(), found, strict=True):
            assert 1 <= len(after) <= limit, name
            assert np.isfinite(after[:, [FRONT, BACK, TAU]]).all(), name
            assert after[0, FRONT] == before[0, FRONT], name
            assert after[-1, BACK] == before[-1, BACK], name
            assert (after[1:, FRONT] >= after[:-1, BACK]).all(), name
            total, tau = before[:, TAU].sum(dtype=float), after[:, TAU].sum(dtype=float)
            n = len(before) + 2 * limit
            assert tau == pytest.approx(total, rel=n * EPS, abs=1e-37), name
