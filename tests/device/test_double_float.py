"""opencl/lib/double_float.cl: numbers of two floats, and rays from far away, against float64."""

from __future__ import annotations

import numpy as np
import pytest

EPS = 2.0**-24  # unit roundoff of float32
FILE = "double_float.cl"


def pairs(values):
    """float64 numbers as the sum of two float32, (..., 2)."""
    high = values.astype(np.float32)
    return np.stack([high, (values - high).astype(np.float32)], axis=-1)


def value(of_pairs):
    return of_pairs.astype(np.float64).sum(axis=-1)


def test_sum_product_and_quotient(call):
    rng = np.random.default_rng(1)
    n = 8192
    a, b = rng.normal(size=(2, n)) * 10.0 ** rng.uniform(-6, 6, (2, n))
    b[::3] = -a[::3] * (1 + rng.uniform(-1, 1, n)[::3] * 2.0 ** -rng.integers(1, 40, n)[::3])
    first, second = pairs(a), pairs(b)
    a, b = value(first), value(second)
    sums, products, quotients, less = call(
        FILE, "arithmetic", n, first, second, call.empty(n, 2), call.empty(n, 2),
        call.empty(n, 2), call.empty(n, dtype=np.int32), DOUBLE_FLOAT_RAYS=1,
    )  # fmt: skip
    larger = np.maximum(np.abs(a), np.abs(b))
    assert (np.abs(value(sums) - (a + b)) <= 2.0**-46 * larger).all()
    assert (np.abs(value(products) / (a * b) - 1) <= 2.0**-45).all()
    assert (np.abs(value(quotients) / (a / b) - 1) <= 2.0**-44).all()
    assert (less == (a < b)).all()
    # Ordered by size: the second is what the first has rounded off
    for found in (sums, products, quotients):
        assert (np.abs(found[:, 1]) <= np.spacing(np.abs(found[:, 0])) / 2).all()


def test_a_quotient_beyond_float32_is_infinite_and_no_nan(call):
    a = np.array([[1e30, 0], [-1e30, 1e20], [1e30, 0]], np.float32)
    b = np.array([[1e-30, 0], [1e-30, 0], [-1e-38, 0]], np.float32)
    found = call(
        FILE, "arithmetic", 3, a, b, call.empty(3, 2), call.empty(3, 2), call.empty(3, 2),
        call.empty(3, dtype=np.int32), DOUBLE_FLOAT_RAYS=1,
    )[2]  # fmt: skip
    np.testing.assert_array_equal(found, [[np.inf, 0], [-np.inf, 0], [-np.inf, 0]])


@pytest.mark.parametrize("far", [1.0, 1e3, 1e6])
def test_entries_that_are_far_away(call, far):
    """A slab of thickness 1 that rays meet at some angle, `far` from where they are formed."""
    rng = np.random.default_rng(int(far))
    n = 2048
    offsets = (rng.integers(-400, 400, (n, 2)) / 2).astype(np.float32)
    near = rng.normal(size=(n, 6)) * [1, 1e-3, 1e-3, 1, 1e-5, 1e-5] * far
    near[:, 3] += 2 * np.sign(near[:, 3]) * far
    exact_near = value(pairs(near))
    exact_far = -exact_near + [1, 0, 0, 0, 0, 0]
    forms = np.stack([exact_near, exact_far], axis=1)
    packed = np.concatenate([pairs(forms)[..., 0], pairs(forms)[..., 1]], axis=-1)
    entry, rest, left = call(
        FILE, "entries", n, packed, np.int32(2), offsets, np.float32(np.inf), call.empty(n, 2),
        call.empty(n, 2), call.empty(n, dtype=np.int32), DOUBLE_FLOAT_RAYS=1,
    )  # fmt: skip
    assert left.all()
    pixel = np.column_stack([np.ones(n), offsets.astype(np.float64)])
    at, slope = (np.einsum("nc,nc->n", exact_near[:, k : k + 3], pixel) for k in (0, 3))
    ends = np.sort(np.stack([-at / slope, (1 - at) / slope]), axis=0)
    # Some sums and products of pairs, of numbers of the size of `far`
    slack = 2.0**-40 * far / np.abs(slope) * (1 + np.abs(at / slope))
    assert (np.abs(value(entry) - ends[0]) <= slack).all()
    length = ends[1] - ends[0]
    assert (np.abs(rest[:, 0] - length) <= 2 * slack + EPS * length).all()
    where = np.where(slope > 0, 0, 1)
    assert (np.abs(rest[:, 1] - where) <= slack * np.abs(slope) + EPS).all()
