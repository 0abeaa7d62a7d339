"""The baselines: world rays against the float64 oracle, and cuts of a ray at equal shares."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import strategies
from oracle import explain, total
from reference.compositing import Segment

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)
sys.path.insert(0, str(BENCHMARKS))

from baselines import CRITERIA, WorldRays, cut_runs  # noqa: E402

#: Largest difference per channel: they cut rays at t in float32, where a short stretch far from
#: t = 0 has few digits; list space keeps 2e-5 (tests/support/oracle.py).
TOLERANCE = 1e-3

N_CASES = 6

WAYS = {
    "world rays": WorldRays,
    "world rays, linear": lambda runtime, vdi: WorldRays(runtime, vdi, binary=False),
}


def cases(kind, number=N_CASES):
    for case in range(number):
        seed = [case, strategies.VIEWS.index(kind)]
        rng = np.random.default_rng(seed)
        vdi = strategies.random_vdi(rng)
        yield f"seed {seed}, view {kind!r}", vdi, *strategies.random_view(rng, vdi, kind)


@pytest.mark.parametrize(
    ("way", "kind"),
    [
        pytest.param(way, kind, marks=[pytest.mark.slow] * ((i + k) % 6 > 0))
        for i, way in enumerate(WAYS)
        for k, kind in enumerate(strategies.VIEWS)
    ],
)
def test_pictures_are_the_oracles(runtime, way, kind):
    parts = []
    for name, vdi, camera, size in cases(kind):
        image = WAYS[way](runtime, vdi).image(camera, size)
        parts.append(explain(vdi, camera, size, image, name=name, tolerance=TOLERANCE))
    result = total(parts)
    assert not result.failures, "\n".join(result.failures)
    assert result.drawn > result.pixels / 10


@pytest.mark.parametrize("criterion", CRITERIA)
def test_one_medium_is_cut_into_equal_shares(criterion):
    whole = Segment(2.0, 10.0, np.array([0.2, 0.5, 0.9]), 3.0)
    found = cut_runs([whole], criterion, 8)
    tau = np.array([part.optical_depth for part in found])
    share = {
        "length": np.array([part.back - part.front for part in found]),
        "transmittance": -np.diff(np.exp(-np.cumsum([0.0, *tau]))),
        "optical-depth": tau,
    }[criterion]
    np.testing.assert_allclose(share, np.full(8, share.sum() / 8))
    assert tau.sum() == pytest.approx(3.0)
