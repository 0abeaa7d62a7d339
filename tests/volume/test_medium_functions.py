"""opencl/lib/classification.cl against float64."""

from __future__ import annotations

import numpy as np
import pytest

EPS = 2.0**-24  # unit roundoff of float32
FILE = "medium_functions.cl"


def classified(call, scalars, table, low, high):
    scalars = np.asarray(scalars, np.float32)
    # As the engine computes it: a huge number where the range is a single scalar
    steps, span = len(table) - 1, float(high) - float(low)
    per_scalar = steps / span if span > 0 else np.finfo(np.float32).max * (steps > 0)
    return call(
        FILE, "classified", len(scalars), scalars, np.asarray(table, np.float32),
        np.int32(len(table)), np.float32(low), np.float32(per_scalar), call.empty(len(scalars), 4),
    )  # fmt: skip


def random_table(rng, entries):
    return rng.random((entries, 4)).astype(np.float32)


@pytest.mark.parametrize(
    ("entries", "span"), [(2, (0.0, 255.0)), (256, (-1000.0, 3095.0)), (4096, (-1e-20, 1e20))]
)
def test_linear_between_entries_and_clamped_outside(call, entries, span):
    rng = np.random.default_rng(entries)
    low, high = np.float32(span)
    wide = float(high) - float(low)
    table = random_table(rng, entries)
    scalars = np.concatenate(
        [
            low + wide * rng.uniform(-0.5, 1.5, 4000),
            [low, high, low - wide, high + 1e3 * wide],
            low + wide * np.arange(entries) / (entries - 1),
        ]
    ).astype(np.float32)
    found = classified(call, scalars, table, low, high)

    nodes = np.linspace(float(low), float(high), entries)
    exact = np.stack([np.interp(scalars.astype(np.float64), nodes, c) for c in table.T], axis=1)
    # The position carries the rounding of a difference, of per_scalar and of a product, relative
    # to at most entries - 1; entries differ by 1 at most; the interpolation rounds three times
    bound = 4 * EPS * (entries - 1) + 4 * EPS
    assert np.abs(found - exact).max() <= bound
    assert (found >= 0).all()
    assert (found <= 1 + 2 * EPS).all()


def test_step_optical_depth(call):
    rng = np.random.default_rng(7)
    below_one = 1 - 2.0**-24
    opacities = np.concatenate(
        [[0, 1e-30, 1e-7, 0.5, below_one], rng.random(500), 10.0 ** -rng.uniform(0, 12, 500)]
    ).astype(np.float32)
    opacities = np.minimum(opacities, np.float32(below_one))
    units = (10.0 ** rng.uniform(-4, 3, len(opacities))).astype(np.float32)
    found = call(FILE, "step_optical_depths", len(units), opacities, units, call.empty(len(units)))
    exact = -np.log1p(-opacities.astype(np.float64)) * units
    # OpenCL's log1p is within 2 ulp (4 EPS, relative up to 4 EPS), the product rounds once
    assert (np.abs(found - exact) <= 6 * EPS * exact).all()
    assert found[0] == 0
    assert found[4] == pytest.approx(24 * np.log(2) * units[4], rel=6 * EPS)


@pytest.mark.parametrize("lanes", [{}, {"LANES": 16}], ids=["1", "16"])
def test_opacity_of_optical_depth(call, lanes):
    """Of random numbers of every exponent, and where the polynomial's pieces meet."""
    rng = np.random.default_rng(8)
    exponents = np.repeat(np.arange(-149, 128), 512)
    tau = np.ldexp(rng.uniform(1, 2, len(exponents)), exponents).astype(np.float32)
    edges = (np.float32(np.log(2)) * (np.arange(-1, 47) + 0.5)).astype(np.float32)
    edges = [np.nextafter(edges, np.float32(0)), edges, np.nextafter(edges, np.float32(np.inf))]
    ends = [0, 1e-45, 1.1754942e-38, 1, 17, 30, 32, 1e3, 3.4e38, np.inf]
    tau = np.abs(np.concatenate([tau, *edges, ends]).astype(np.float32))
    tau = np.append(tau, np.zeros(-len(tau) % 16, np.float32))
    found = call(
        FILE, "opacities", len(tau) // lanes.get("LANES", 1), tau, call.empty(len(tau)), **lanes
    )
    exact = -np.expm1(-tau.astype(np.float64))
    # Half an ulp of the result, the polynomial's 1.4e-8 and a rounding of what it is added to:
    # .97 ulp was found among a million of each exponent. 1 - exp(-tau) would lose all of it
    ulps = np.abs(found - exact) / np.spacing(exact.astype(np.float32)).astype(np.float64)
    assert ulps.max() <= 1
    assert (found <= 1).all()
    np.testing.assert_array_equal(found[tau >= 32], 1)
