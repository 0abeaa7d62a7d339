"""The compositing laws, each exact to float64 rounding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import colors, optical_depths

from reference import compositing
from reference.compositing import (
    Segment,
    composite,
    merge,
    opacity,
    split,
)

EPS = np.finfo(np.float64).eps

#: A handful of operations, each rounded once, on values up to 1.
FEW = 16 * EPS


@st.composite
def segments(draw, front=0.0):
    length = draw(st.floats(1e-3, 1e3))
    return Segment(front, front + length, draw(colors()), draw(optical_depths(50)))


def test_small_and_large_optical_depths_keep_their_digits():
    assert opacity(1e-300) == 1e-300
    assert opacity(np.inf) == 1
    np.testing.assert_array_equal(opacity([0, np.log(2)]), [0, 0.5])


@given(optical_depths(50), st.floats(1e-6, 1e6), st.floats(0, 3), st.floats(0, 3))
def test_beer_lambert_over_lengths(tau, whole, first, second):
    """What two stretches of a medium let through is what their sum lets through."""
    a, b, both = (
        compositing.optical_depth_over_length(tau, share * whole, whole)
        for share in (first, second, first + second)
    )
    assert a + b == pytest.approx(float(both), rel=FEW, abs=1e-300)
    assert a == pytest.approx(tau * first, rel=FEW, abs=1e-300)
    assert compositing.optical_depth_over_length(tau, whole, whole) == tau


@given(st.lists(st.tuples(colors(), optical_depths(20)), max_size=8))
def test_composite_is_repeated_over(media):
    expected = np.zeros(4)
    for color, tau in reversed(media):
        alpha = float(opacity(tau))
        expected = np.append(color * alpha, alpha) + (1 - alpha) * expected
    result = composite(
        np.array([color for color, _ in media]).reshape(-1, 3), [t for _, t in media]
    )
    np.testing.assert_allclose(result, expected, rtol=0, atol=8 * FEW)


def seen(*parts):
    return composite([part.color for part in parts], [part.optical_depth for part in parts])


@pytest.mark.parametrize("weighting", compositing.WEIGHTINGS)
@given(segment=segments(), share=st.floats(0.01, 0.99))
def test_splitting_changes_nothing_that_is_seen_and_merging_undoes_it(weighting, segment, share):
    depth = segment.front + share * (segment.back - segment.front)
    near, far = split(segment, depth)
    assert (near.front, near.back) == (segment.front, depth)
    assert (far.front, far.back) == (depth, segment.back)
    np.testing.assert_allclose(seen(near, far), seen(segment), rtol=0, atol=FEW)
    merged = merge(near, far, weighting)
    assert (merged.front, merged.back) == (segment.front, segment.back)
    np.testing.assert_allclose(merged.color, segment.color, rtol=0, atol=FEW)
    assert merged.optical_depth == pytest.approx(segment.optical_depth, rel=FEW)


@given(segments(), segments(front=2e3), st.floats(1e-9, 1e-4))
def test_merging(near, far, thin):
    """By transmittance it looks the same along the ray; by optical depth it does not depend on the
    order: seen from behind, the same two segments make the same colour."""
    merged = merge(near, far)
    np.testing.assert_allclose(seen(merged), seen(near, far), rtol=0, atol=FEW)
    assert (merged.front, merged.back) == (near.front, far.back)
    swapped = merge(
        Segment(-far.back, -far.front, far.color, far.optical_depth),
        Segment(-near.back, -near.front, near.color, near.optical_depth),
        "optical_depth",
    )
    ahead = merge(near, far, "optical_depth")
    np.testing.assert_allclose(ahead.color, swapped.color, rtol=0, atol=FEW)
    # Either way a colour between the two
    for color in (merged.color, ahead.color):
        assert (color >= np.minimum(near.color, far.color) - FEW).all()
        assert (color <= np.maximum(near.color, far.color) + FEW).all()
    # Where media are thin, the weights differ by factors of 1 - tau / 2 and exp(-tau): 3/2 of all
    # the optical depth
    near, far = (Segment(*s[:3], s.optical_depth * thin) for s in (near, far))
    first, second = (merge(near, far, weighting).color for weighting in compositing.WEIGHTINGS)
    total = near.optical_depth + far.optical_depth
    np.testing.assert_allclose(first, second, rtol=0, atol=1.5 * total + FEW)


def test_what_absorbs_nothing():
    a, b = (Segment(k, k + 1.0, np.full(3, float(k)), 0.0) for k in (0, 1))
    np.testing.assert_array_equal(merge(a, b).color, [0.5] * 3)
    np.testing.assert_array_equal(composite(np.empty((0, 3)), []), np.zeros(4))
