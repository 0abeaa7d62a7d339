"""The compositing laws, each exact to float64 rounding (DESIGN section 3)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import colors, optical_depths

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model import compositing
from pyvista_vdi.model.compositing import (
    Segment,
    composite,
    merge,
    opacity,
    over,
    split,
    transmittance,
)

EPS = np.finfo(np.float64).eps

#: A handful of operations, each rounded once, on values up to 1.
FEW = 16 * EPS


@st.composite
def pixels(draw):
    """Premultiplied RGBA."""
    alpha = draw(st.floats(0, 1, allow_subnormal=False))
    return np.append(draw(colors()) * alpha, alpha)


@st.composite
def segments(draw, front=0.0):
    length = draw(st.floats(1e-3, 1e3))
    return Segment(front, front + length, draw(colors()), draw(optical_depths(50)))


# -- opacity and optical depth ---------------------------------------------------------------------


@given(optical_depths())
def test_opacity_and_transmittance_add_up_to_one(tau):
    assert opacity(tau) + transmittance(tau) == pytest.approx(1, abs=FEW)


@given(st.floats(1e-300, 30))
def test_optical_depth_is_the_inverse_of_opacity(tau):
    # Where alpha is near 1 it holds tau to eps exp(tau) only
    tolerance = FEW * (tau + math.exp(tau))
    if tau < 1:
        tolerance = FEW * tau  # and where it is small, to full relative precision
    assert compositing.optical_depth(opacity(tau)) == pytest.approx(tau, abs=tolerance, rel=0)


@given(optical_depths(100), optical_depths(100))
def test_optical_depths_add_where_transmittances_multiply(first, second):
    product = transmittance(first) * transmittance(second)
    # exp has a relative error of its argument's rounding
    assert transmittance(first + second) == pytest.approx(product, rel=400 * EPS)


def test_small_and_large_optical_depths_keep_their_digits():
    assert opacity(1e-300) == 1e-300
    assert opacity(np.inf) == 1
    assert compositing.optical_depth(1.0) == np.inf
    assert compositing.optical_depth(1e-300) == 1e-300
    assert not np.signbit(compositing.optical_depth(0.0))
    np.testing.assert_array_equal(opacity([0, np.log(2)]), [0, 0.5])
    assert opacity(np.zeros((2, 3))).shape == (2, 3)


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


# -- over ------------------------------------------------------------------------------------------


@given(pixels(), pixels(), pixels())
def test_over_is_associative(a, b, c):
    np.testing.assert_allclose(over(over(a, b), c), over(a, over(b, c)), rtol=0, atol=FEW)


@given(pixels())
def test_nothing_is_the_neutral_element(a):
    nothing = np.zeros(4)
    np.testing.assert_array_equal(over(a, nothing), a)
    np.testing.assert_array_equal(over(nothing, a), a)


@given(colors(), pixels())
def test_opaque_hides_what_is_behind(color, behind):
    opaque = np.append(color, 1.0)
    np.testing.assert_array_equal(over(opaque, behind), opaque)


def test_over_works_on_images():
    rng = np.random.default_rng(1)
    front, back = rng.random((2, 3, 5, 4))
    images = over(front, back)
    np.testing.assert_array_equal(images[1, 2], over(front[1, 2], back[1, 2]))


@given(st.lists(st.tuples(colors(), optical_depths(20)), max_size=8))
def test_composite_is_repeated_over(media):
    expected = np.zeros(4)
    for color, tau in reversed(media):
        alpha = float(opacity(tau))
        expected = over(np.append(color * alpha, alpha), expected)
    result = composite(
        np.array([color for color, _ in media]).reshape(-1, 3), [t for _, t in media]
    )
    np.testing.assert_allclose(result, expected, rtol=0, atol=8 * FEW)


def test_composite_of_nothing_is_transparent():
    np.testing.assert_array_equal(composite(np.empty((0, 3)), []), np.zeros(4))


# -- split and merge -------------------------------------------------------------------------------


def seen(*parts):
    return composite([part.color for part in parts], [part.optical_depth for part in parts])


@given(segments(), st.floats(0.01, 0.99))
def test_splitting_changes_nothing_that_is_seen(segment, share):
    depth = segment.front + share * (segment.back - segment.front)
    near, far = split(segment, depth)
    assert (near.front, near.back, far.front, far.back) == (
        segment.front,
        depth,
        depth,
        segment.back,
    )
    np.testing.assert_allclose(seen(near, far), seen(segment), rtol=0, atol=FEW)


@pytest.mark.parametrize("weighting", compositing.WEIGHTINGS)
@given(segment=segments(), share=st.floats(0.01, 0.99))
def test_split_then_merge_is_the_identity(weighting, segment, share):
    depth = segment.front + share * (segment.back - segment.front)
    merged = merge(*split(segment, depth), weighting)
    assert (merged.front, merged.back) == (segment.front, segment.back)
    np.testing.assert_allclose(merged.color, segment.color, rtol=0, atol=FEW)
    assert merged.optical_depth == pytest.approx(segment.optical_depth, rel=FEW)


@given(segments(), segments(front=2e3))
def test_merging_by_transmittance_looks_the_same_along_the_ray(near, far):
    merged = merge(near, far)
    np.testing.assert_allclose(seen(merged), seen(near, far), rtol=0, atol=FEW)
    assert (merged.front, merged.back) == (near.front, far.back)


@given(segments(), segments(front=2e3))
def test_merging_by_optical_depth_does_not_depend_on_the_order(near, far):
    """Seen from behind, the same two segments make the same colour."""
    swapped = merge(
        Segment(-far.back, -far.front, far.color, far.optical_depth),
        Segment(-near.back, -near.front, near.color, near.optical_depth),
        "optical_depth",
    )
    merged = merge(near, far, "optical_depth")
    np.testing.assert_allclose(merged.color, swapped.color, rtol=0, atol=FEW)


@given(segments(), segments(front=2e3), st.floats(1e-9, 1e-4))
def test_the_two_weightings_agree_where_media_are_thin(near, far, thin):
    near = near._replace(optical_depth=near.optical_depth * thin)
    far = far._replace(optical_depth=far.optical_depth * thin)
    first, second = (merge(near, far, weighting).color for weighting in compositing.WEIGHTINGS)
    # The weights differ by factors of 1 - tau / 2 and exp(-tau): 3/2 of all the optical depth
    total = near.optical_depth + far.optical_depth
    np.testing.assert_allclose(first, second, rtol=0, atol=1.5 * total + FEW)


@given(segments(), segments(front=2e3))
def test_a_merged_color_lies_between_the_two(near, far):
    for weighting in compositing.WEIGHTINGS:
        color = merge(near, far, weighting).color
        assert (color >= np.minimum(near.color, far.color) - FEW).all()
        assert (color <= np.maximum(near.color, far.color) + FEW).all()


def test_merging_two_that_absorb_nothing_keeps_a_color():
    a, b = (Segment(k, k + 1.0, np.full(3, float(k)), 0.0) for k in (0, 1))
    np.testing.assert_array_equal(merge(a, b).color, [0.5] * 3)


# -- refusals --------------------------------------------------------------------------------------


def test_bad_arguments_are_refused_by_name():
    segment = Segment(1.0, 2.0, np.zeros(3), 1.0)
    with pytest.raises(InvalidArgumentError, match="from 1.0 to 2.0 cannot be split at 2.0"):
        split(segment, 2.0)
    with pytest.raises(InvalidArgumentError, match="must end before the farther begins"):
        merge(segment, segment)
    with pytest.raises(InvalidArgumentError, match="weighting must be one of.*got 'mean'"):
        merge(segment, segment._replace(front=2.0, back=3.0), "mean")
    with pytest.raises(InvalidArgumentError, match="opacity must lie between 0 and 1"):
        compositing.optical_depth([0.5, 1.5])
    with pytest.raises(InvalidArgumentError, match="optical_depth must not be negative or NaN"):
        opacity(-1.0)
    with pytest.raises(InvalidArgumentError, match="optical_depth must not be negative or NaN"):
        transmittance(np.nan)
    with pytest.raises(InvalidArgumentError, match="whole_length must be positive"):
        compositing.optical_depth_over_length(1.0, 1.0, 0.0)
    with pytest.raises(InvalidArgumentError, match="length must not be negative"):
        compositing.optical_depth_over_length(1.0, -1.0, 1.0)
