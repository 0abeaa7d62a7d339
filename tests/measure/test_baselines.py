"""The paper's baselines against the float64 oracle: random VDIs, all kinds of view."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import strategies
from oracle import explain, total

from pyvista_vdi import reference
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)
sys.path.insert(0, str(BENCHMARKS))

from baselines.frusta import Frusta  # noqa: E402
from baselines.medium import Medium  # noqa: E402
from baselines.two_phase import TwoPhase  # noqa: E402
from baselines.world_rays import WorldRays  # noqa: E402

#: Largest difference per channel: they cut rays at t in float32, where a short stretch far from
#: t = 0 has few digits; list space keeps 2e-5 (tests/support/oracle.py).
TOLERANCE = 1e-3

N_CASES = 6

WAYS = {
    "world rays": WorldRays,
    "world rays, linear": lambda runtime, vdi: WorldRays(runtime, vdi, binary=False),
    "frusta": Frusta,
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


@pytest.mark.parametrize("kind", strategies.VIEWS)
def test_no_frustum_hides_an_earlier_one(kind):
    for _, vdi, camera, size in cases(kind, 3):
        rank = np.empty(vdi.n_supersegments, int)
        rank[Medium(vdi).order(camera)] = np.arange(vdi.n_supersegments)
        lists = reference.raycast.Lists(vdi)
        for y in range(size[1]):
            for line in reference.raycast.lines_of_pixel(vdi, camera, size, (y % size[0], y)):
                crossed = reference.raycast.crossings(lists, line)
                long_enough = crossed.length > 1e-6 * crossed.length.max(initial=0.0)
                met = rank[crossed.member[long_enough]]
                assert (np.diff(met) >= 0).all()


def test_two_phase_is_exact_at_v_o_alone(runtime):
    rng = np.random.default_rng(5)
    vdi = strategies.random_vdi(rng, window=(16, 12))
    cells = TwoPhase(runtime, vdi, 9)
    assert cells.nbytes == 16 * 9 * 16 * 12
    image = cells.image(vdi.camera, vdi.window_size)
    np.testing.assert_allclose(image, reference.render(vdi, vdi.camera), atol=2e-5)
    turned = vdi.camera.azimuth(20)
    exact = reference.render(vdi, turned)
    assert np.abs(cells.image(turned, vdi.window_size) - exact).max() > 0.05


def test_two_phase_resamples_a_slab_across_v_o(runtime):
    """In parallel projection a shifted view of one level is the level's picture, interpolated."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True)
    bounds = (-1, 1, -1, 1, -1, 1)
    color, tau = np.array([[1, 0, 0], [0, 0, 1]], np.float32), [0.5, 2.0]
    vdi = VDI(camera, (2, 1), [0, 1, 2], [4, 4], [6, 6], color, tau, bounds)
    moved = camera.replace(position=(0.5, 0, 5), focal_point=(0.5, 0, 0))
    size = (2, 1)
    left, right = TwoPhase(runtime, vdi, 1).image(moved, size)[0]
    own = reference.render(vdi, camera, size)[0]
    width = 2 * camera.parallel_scale * 2 / 2  # of a list
    share = 0.5 / width
    np.testing.assert_allclose(left, (1 - share) * own[0] + share * own[1], atol=1e-6)
    np.testing.assert_allclose(right, (1 - share) * own[1], atol=1e-6)


def test_frusta_have_no_more_tiles_than_their_numbers_can_tell(runtime):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    none = VDI(camera, (1, 1), [0, 0], [], [], [], [], (-1, 1, -1, 1, -1, 1))
    with pytest.raises(UnsupportedError, match="1920 x 1080 has 129600 tiles of 4 x 4 pixels"):
        Frusta(runtime, none).image(camera, (1920, 1080))


@pytest.mark.parametrize("way", WAYS)
def test_an_empty_vdi_is_empty(runtime, way):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    none = VDI(camera, (3, 2), [0] * 7, [], [], [], [], (-1, 1, -1, 1, -1, 1))
    assert not WAYS[way](runtime, none).image(camera, (3, 2)).any()
