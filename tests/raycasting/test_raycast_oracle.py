"""The device's raycaster against the float64 oracle: random VDIs from random views.

Every channel of every pixel lies within 2e-5 of the oracle's range over the ray moved by the
roundings of list coordinates (tests/support/oracle.py says why 2e-5).
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import render_vdi
from oracle import assert_explained, explain, total
from ray_scenes import generating_view, random_ends, rebuilt

#: Share of pixels that may differ by more from the unmoved ray. At half size every ray runs along
#: borders: measured, 13 % of them there and at most 0.3 % otherwise.
MAX_SHARE = {"half": 0.2}

#: VDIs per kind of view.
N_CASES = 10


def compare(runtime, cases):
    """Draw (name, VDI, camera, size) and compare with the oracle, up to the first failure."""
    results = []
    for name, vdi, camera, size in cases:
        image = render_vdi(vdi, camera, size, device=runtime)
        results.append(assert_explained(vdi, camera, size, image, name=name))
    return total(results)


@pytest.mark.every(6)
@pytest.mark.parametrize("kind", [*strategies.VIEWS[2:], *strategies.VIEWS[:2]])
def test_every_pixel_is_within_the_range_of_the_moved_ray(runtime, dealt, kind):
    def cases():
        for case in range(N_CASES):
            seed = [case, strategies.VIEWS.index(kind)]
            rng = np.random.default_rng(seed)
            vdi = strategies.random_vdi(rng)
            yield f"seed {seed}", vdi, *strategies.random_view(rng, vdi, kind)

    result = compare(runtime, cases())
    assert result.drawn > result.pixels / 10  # a comparison of nothing with nothing proves nothing
    assert result.moved <= MAX_SHARE.get(kind, 0.005) * result.pixels


@pytest.mark.parametrize("kind", ["around", "parallel", "near", "inside"])
def test_rays_end_at_opaque_depth_and_clipping_planes(runtime, dealt, kind):
    for planes in (0, 2):
        rng = np.random.default_rng([planes, 100])
        vdi = strategies.random_vdi(rng)
        camera, size = strategies.random_view(rng, vdi, kind)
        ends = random_ends(rng, vdi, camera, size, planes)
        image = render_vdi(vdi, camera, size, device=runtime, **ends)
        assert_explained(vdi, camera, size, image, name=f"{planes} planes", **ends)


#: Generating views, or "thin media": supersegments down to a few ulps of their depth.
EXTREMES = [
    "zoomed in",
    "very long lens",
    "far from origin",
    "tiny world",
    "huge world",
    "flat world",
    "eye on the bounds",
    "thin media",
]


@pytest.mark.every(3)
@pytest.mark.extremes
@pytest.mark.parametrize("extreme", EXTREMES)
def test_extremes_stay_within_the_range(runtime, dealt, extreme):
    def cases():
        for case, kind in enumerate(("same", "half", "near", "around", "behind", "inside", "axis")):
            rng = np.random.default_rng([case, 200])
            bounds, own = generating_view(rng, extreme)
            thinnest = 0.0 if extreme == "thin media" else 2e-3
            vdi = strategies.random_vdi(
                rng, max_window=(12, 9), camera=own, bounds=bounds, thinnest=thinnest
            )
            yield f"case {case}, {kind}", vdi, *strategies.random_view(rng, vdi, kind)

    result = compare(runtime, cases())
    assert result.drawn > result.pixels / 20


def test_the_comparison_sees_a_wrong_medium(runtime):
    """The oracle of a VDI whose optical depths are 0.1 % higher does not explain the image."""
    rng = np.random.default_rng([0, 400])
    vdi = strategies.random_vdi(rng)
    camera, size = strategies.random_view(rng, vdi, "near")
    image = render_vdi(vdi, camera, size, device=runtime)
    assert_explained(vdi, camera, size, image, name="right")
    wrong = rebuilt(vdi, optical_depth=vdi.optical_depth * np.float32(1.001))
    assert explain(wrong, camera, size, image, name="wrong", escalation=(0,)).failures
