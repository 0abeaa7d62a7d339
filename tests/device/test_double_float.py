"""opencl/lib/double_float.cl: numbers of two floats against float64."""

from __future__ import annotations

import numpy as np

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
        call.empty(n, 2), call.empty(n, dtype=np.int32),
    )  # fmt: skip
    larger = np.maximum(np.abs(a), np.abs(b))
    assert (np.abs(value(sums) - (a + b)) <= 2.0**-46 * larger).all()
    assert (np.abs(value(products) / (a * b) - 1) <= 2.0**-45).all()
    assert (np.abs(value(quotients) / (a / b) - 1) <= 2.0**-44).all()
    assert (less == (a < b)).all()
    # Ordered by size: the second is what the first has rounded off
    for found in (sums, products, quotients):
        assert (np.abs(found[:, 1]) <= np.spacing(np.abs(found[:, 0])) / 2).all()
