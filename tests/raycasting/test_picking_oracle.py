"""Picks against the float64 oracle, and the depth kernel against picks: random VDIs and views.

The oracle is asked twice: its compositing step is overheard for what a ray meets, and its picture
with rays that end at the pick's depth says how much lies before it.
"""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from ray_scenes import random_cropping, random_ends, reciprocal_vdi
from reference import raycast as oracle

import pyvista_vdi as pvdi
from pyvista_vdi.model.options import FrameRequest, RenderOptions
from pyvista_vdi.raycasting.picking import FirstHit
from pyvista_vdi.raycasting.raycast import render_first_hits

#: Views below are all but that at half size, in which every ray runs along borders: which of two
#: lists is met is then a matter of rounding.

#: What counts as a hit.
THRESHOLDS = [
    {"opacity_threshold": threshold, "accumulated": accumulated}
    for threshold, accumulated in ((0.0, True), (0.05, True), (0.6, True), (0.3, False))
]


def cases(kind):
    """VDIs, views of them, and every fourth of the pixels."""
    for case in range(4):
        rng = np.random.default_rng([case, strategies.VIEWS.index(kind)])
        vdi = reciprocal_vdi(rng)
        camera, size = strategies.random_view(rng, vdi, kind)
        pixels = [(i % size[0], i // size[0]) for i in range(case, size[0] * size[1], 4)]
        yield vdi, camera, size, pixels


def overheard(monkeypatch, vdi, camera, size, pixel):
    """Colours and optical depths of what the oracle composites on a pixel's ray, in order."""
    heard = [(np.empty((0, 3)), np.empty(0))]

    def composite(color, optical_depth):
        heard.append((np.asarray(color), np.asarray(optical_depth)))
        return np.zeros(4)

    with monkeypatch.context() as patch:
        patch.setattr(oracle, "composite", composite)
        reference.render_pixels(vdi, camera, size, [pixel])
    return heard[-1]


@pytest.mark.parametrize("kind", ["near", "inside"])
def test_the_hit_is_the_first_that_the_oracle_meets(kind, monkeypatch):
    hits = 0
    for vdi, camera, size, pixels in cases(kind):
        for pixel in pixels:
            color, tau = overheard(monkeypatch, vdi, camera, size, pixel)
            for options in THRESHOLDS:
                least = -np.log1p(-options["opacity_threshold"])
                met = np.cumsum(tau) if options["accumulated"] else tau
                reached = np.flatnonzero((met > 0) & (met >= least))
                hit = pvdi.pick(vdi, camera, pixel, size, **options)
                assert (hit is None) == (len(reached) == 0), (kind, pixel, options, met)
                if hit is None:
                    continue
                hits += 1
                k = reached[0]
                assert hit.color == tuple(color[k])
                # About ten operations of float64; far lists cost the oracle's ray some digits
                found = hit.optical_depth, hit.accumulated_optical_depth
                assert found == pytest.approx((tau[k], tau[: k + 1].sum()), rel=1e-6, abs=1e-12)
    assert hits > 20  # a comparison of nothing with nothing proves nothing


@pytest.mark.parametrize("kind", ["around", "behind", "axis"])
def test_the_position_lies_in_the_supersegment_and_on_the_ray(kind):
    """And before it lies what is not enough for a hit; so in what is cropped and multiplied."""
    for number, (vdi, camera, size, pixels) in enumerate(cases(kind)):
        rng, shown = np.random.default_rng(number), {}
        if number % 2:
            regions = int(rng.integers(2**27 - 1))
            shown["cropping"] = random_cropping(rng, vdi.bounds, regions)
            shown["opacity_multiplier"] = 2.0
        for x, y in pixels:
            hit = pvdi.pick(vdi, camera, (x, y), size, opacity_threshold=0.3, **shown)
            if hit is None:
                continue
            ends = np.full(size[::-1], np.inf)
            ends[size[1] - 1 - y, x] = hit.depth
            before = reference.render_pixels(
                vdi, camera, size, [(x, y)], opaque_depth=ends, **shown
            )[0, 3]
            own = hit.accumulated_optical_depth - hit.optical_depth
            assert before == pytest.approx(-np.expm1(-own), abs=1e-6)
            assert before < 0.3
            assert hit.accumulated_opacity >= 0.3
            world = np.append(hit.position, 1.0)
            # On the ray: the pixel's centre, at the depth told
            place = camera.viewport_matrix(size) @ camera.view_matrix @ world
            assert place[2] == pytest.approx(hit.depth, abs=1e-9)
            if hit.depth > 1e-6:  # at the eye itself every pixel is
                seen = (place[:2] / place[3] + 1) / 2 * size
                assert seen == pytest.approx((x + 0.5, y + 0.5), abs=1e-5)
            # In the supersegment: its list's cell of V_O's window, between its two faces
            model = np.linalg.solve(camera.model_transform, world)
            to_lists = vdi.camera.viewport_matrix(vdi.window_size) @ vdi.camera.model_to_view
            ud, vd, z, d = to_lists @ model
            within = (np.array([ud, vd]) / d + 1) / 2 * vdi.window_size - hit.list
            assert (within >= -1e-6).all()
            assert (within <= 1 + 1e-6).all()
            assert vdi.list_at(*hit.list).start + hit.index == hit.supersegment
            front = float(vdi.front[hit.supersegment]) + vdi.depth_origin
            back = float(vdi.back[hit.supersegment]) + vdi.depth_origin
            slack = 1e-9 * max(abs(front), abs(back))
            assert front - slack <= z <= back + slack


@pytest.mark.parametrize("kind", ["same", "beside", "parallel", "far"])
def test_the_kernel_sees_the_same_depth(runtime, kind):
    """Within 2e-5 of the depth: roundings of list coordinates, 5e-7 seen outside the bounds and
    7e-6 where the eye is inside them. A share of 0.5 % of the pixels may differ by more, where a
    ray runs along a border or the threshold is met within rounding; none was seen."""
    different = total = hits = 0
    for vdi, camera, size, pixels in cases(kind):
        for options in THRESHOLDS:
            depth = pvdi.render_depth(vdi, camera, size, device=runtime, **options)
            request = FrameRequest(camera, size, RenderOptions(skip_empty=False), device=runtime)
            hit = FirstHit(**options)
            assert np.array_equal(depth, render_first_hits(vdi, request, hit))
            for x, y in pixels:
                hit = pvdi.pick(vdi, camera, (x, y), size, **options)
                expected = np.inf if hit is None else hit.depth
                drawn = depth[size[1] - 1 - y, x]
                total += 1
                hits += hit is not None
                slack = 2e-5 * max(abs(expected), 1e-3)
                different += not (drawn == expected or abs(drawn - expected) <= slack)
    assert hits > 20
    assert different <= 0.005 * total


def test_options_reach_the_kernel(runtime):
    """Clipping planes, the ends of rays and cropping, as the pick takes them."""
    rng = np.random.default_rng(5)
    compared = 0
    for _ in range(6):
        vdi = reciprocal_vdi(rng)
        camera, size = strategies.random_view(rng, vdi, "around")
        ends = random_ends(rng, vdi, camera, size)
        ends["cropping"] = random_cropping(rng, vdi.bounds, int(rng.integers(2**27 - 1)))
        depth = pvdi.render_depth(vdi, camera, size, device=runtime, **ends)
        for row, x in np.ndindex(depth.shape):
            shown = {**ends, "opaque_depth": ends["opaque_depth"][row, x]}
            hit = pvdi.pick(vdi, camera, (x, size[1] - 1 - row), size, **shown)
            expected = np.inf if hit is None else hit.depth
            assert depth[row, x] == pytest.approx(expected, rel=2e-5)
            compared += hit is not None
    assert compared > 10
