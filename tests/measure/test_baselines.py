"""The paper's closest baseline against the float64 oracle: random VDIs, all kinds of view."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import strategies
from oracle import explain, total

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)
sys.path.insert(0, str(BENCHMARKS))

from baselines.world_rays import WorldRays  # noqa: E402

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


@pytest.mark.every(6)
@pytest.mark.parametrize("kind", strategies.VIEWS)
@pytest.mark.parametrize("way", WAYS)
def test_pictures_are_the_oracles(runtime, way, kind):
    parts = []
    for name, vdi, camera, size in cases(kind):
        image = WAYS[way](runtime, vdi).image(camera, size)
        parts.append(explain(vdi, camera, size, image, name=name, tolerance=TOLERANCE))
    result = total(parts)
    assert not result.failures, "\n".join(result.failures)
    assert result.drawn > result.pixels / 10


@pytest.mark.parametrize("way", WAYS)
def test_an_empty_vdi_is_empty(runtime, way):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    none = VDI(camera, (3, 2), [0] * 7, [], [], [], [], (-1, 1, -1, 1, -1, 1))
    assert not WAYS[way](runtime, none).image(camera, (3, 2)).any()
