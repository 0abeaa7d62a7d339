"""Cropping by itself: which regions there are, and how simply they can be said."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pyvista_vdi.model.cropping import PRESETS, Cropping

BOX = (0.0, 3.0, 0.0, 3.0, 0.0, 3.0)
THIRDS = (1.0, 2.0, 1.0, 2.0, 1.0, 2.0)


def kept_by_points(cropping, bounds, n=12):
    """Which points of a grid inside the bounds are kept, bool (n, n, n); indexed x, y, z."""
    box = np.reshape(bounds, (3, 2))
    axes = [low + (np.arange(n) + 0.5) / n * (high - low) for low, high in box]
    index = [
        (x >= low).astype(int) + (x >= max(low, high)).astype(int)
        for x, (low, high) in zip(axes, np.reshape(cropping.planes, (3, 2)), strict=True)
    ]
    i, j, k = np.meshgrid(*index, indexing="ij")
    return cropping.regions >> (i + 3 * j + 9 * k) & 1 == 1


def kept_by_box(box, bounds, n=12):
    ends = np.reshape(bounds, (3, 2))
    axes = [low + (np.arange(n) + 0.5) / n * (high - low) for low, high in ends]
    inside = [
        (x >= low) & (x < high) for x, (low, high) in zip(axes, box, strict=True)
    ]  # NaN: nothing
    return inside[0][:, None, None] & inside[1][None, :, None] & inside[2][None, None, :]


def test_from_what_users_have():
    assert Cropping.from_any(None) is None
    fence = Cropping(THIRDS, "fence")
    assert Cropping.from_any(fence) is fence
    assert Cropping.from_any((THIRDS, "fence")) == fence
    assert Cropping.from_any((np.array(THIRDS), PRESETS["fence"])) == fence
    assert Cropping.from_any(THIRDS) == Cropping(THIRDS)
    assert hash(Cropping(list(THIRDS), "fence")) == hash(fence)


def test_which_croppings_are_boxes():
    np.testing.assert_array_equal(Cropping(THIRDS).within(BOX)[1], [[1, 2]] * 3)
    for name in set(PRESETS) - {"subvolume"}:
        cuts, box = Cropping(THIRDS, name).within(BOX)
        assert box is None
        np.testing.assert_array_equal(cuts, [[1, 2]] * 3)
    # Planes outside the bounds and infinite ones make no regions
    _, box = Cropping((-math.inf, 2, -5, 9, 1, math.inf), "subvolume").within(BOX)
    np.testing.assert_array_equal(box, [[0, 2], [0, 3], [1, 3]])
    # of a cross there is only its middle then
    _, box = Cropping((-1, 4, -1, 4, -1, 4), "cross").within(BOX)
    np.testing.assert_array_equal(box.ravel(), BOX)
    assert np.isnan(Cropping((5, 6, 0, 3, 0, 3)).within(BOX)[1]).all()


@given(
    st.lists(st.integers(-2, 8), min_size=6, max_size=6),
    st.one_of(
        st.integers(0, Cropping.ALL),
        # boxes of regions, which random flags never are
        st.tuples(*[st.sampled_from([(0,), (1,), (2,), (0, 1), (1, 2), (0, 1, 2), (0, 2)])] * 3),
    ),
)
def test_a_box_is_said_where_it_is_one_and_nowhere_else(halves, regions):
    if isinstance(regions, tuple):
        regions = sum(
            1 << (i + 3 * j + 9 * k) for i in regions[0] for j in regions[1] for k in regions[2]
        )
    cropping = Cropping([h / 2 for h in halves], regions)
    _, box = cropping.within(BOX)
    points = kept_by_points(cropping, BOX)
    if box is not None:
        np.testing.assert_array_equal(kept_by_box(box, BOX), points)
        return
    inside = np.argwhere(points)
    hull = tuple(
        slice(low, high + 1) for low, high in zip(inside.min(0), inside.max(0), strict=True)
    )
    assert not points[hull].all(), "it is a box"
