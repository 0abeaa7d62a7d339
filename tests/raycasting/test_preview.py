"""The preview of the paper's section 5: what it must give whatever the number of samples."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import render_vdi
from extreme_scenes import slabs_vdi
from ray_scenes import random_planes, rebuilt, reciprocal_vdi
from reference.raycast import centre_ray_scale

from pyvista_vdi.model.standard_cases import filling_camera

BOUNDS = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
COLOR = np.array([0.8, 0.5, 0.2])

#: Lengths are summed over up to 70 cells and 64 samples, and alpha = -expm1(-tau) of tau below 4
#: has slope 1: some 200 roundings of 6e-8 of what is below 4, seldom of one sign.
ROUNDING = 1e-5


def solid_vdi(parallel=False, window=(40, 30)):
    """The bounds' box filled with one medium: a supersegment per list, as long as its ray."""
    camera = filling_camera(BOUNDS, (40, 30)).replace(view_angle=40.0)
    camera = camera.replace(parallel_projection=parallel, parallel_scale=2.5)
    near, far = strategies.view_depths(camera, BOUNDS)
    options = {"window": window, "bounds": BOUNDS, "depth_origin": near, "color": COLOR}
    solid = slabs_vdi(camera, [0, far - near], 0, **options)
    return rebuilt(solid, optical_depth=0.7 * (far - near) * centre_ray_scale(solid).ravel())


@pytest.mark.parametrize(("parallel", "samples"), [(False, 1), (True, 64)])
def test_a_homogeneous_medium_is_exact_with_any_number_of_samples(runtime, parallel, samples):
    """Each sample stands for the length around it, and the lengths add up to the ray's."""
    vdi = solid_vdi(parallel)
    for turn in (0.0, 35.0, 90.0, 180.0):
        view = vdi.camera.azimuth(turn)
        exact = render_vdi(vdi, view, device=runtime)
        drawn = render_vdi(vdi, view, preview_samples=samples, device=runtime)
        assert exact[..., 3].max() > 0.5
        np.testing.assert_allclose(drawn, exact, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("seed", [0, 1])
def test_more_samples_come_closer_to_the_full_frame(runtime, seed):
    """Whole, and of what cropping and the opacity multiplier leave of it."""
    rng = np.random.default_rng(seed)
    vdi = reciprocal_vdi(rng, max_supersegments=5, thinnest=0.05)
    view, size = strategies.random_view(rng, vdi, "near")
    shown = {"device": runtime}
    if seed:
        shown |= {"cropping": (random_planes(rng, vdi.bounds), "fence"), "opacity_multiplier": 0.3}
    full = render_vdi(vdi, view, size, **shown)
    few, many = (
        np.abs(render_vdi(vdi, view, size, preview_samples=n, **shown) - full).mean()
        for n in (4, 4096)
    )
    assert full.any()
    # At 4096 samples one stands for less than a thousandth of the ray, and a ray of these VDIs
    # meets some tens of faces; measured: at most 2e-4
    assert many < 1e-3
    assert many <= few
