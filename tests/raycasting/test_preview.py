"""The preview of the paper's section 5: what it must give whatever the number of samples."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import render_vdi
from extreme_scenes import slabs_vdi
from ray_scenes import rebuilt
from reference.raycast import centre_ray_scale

from pyvista_vdi import Camera
from pyvista_vdi.model.standard_cases import filling_camera

BOUNDS = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
COLOR = np.array([0.8, 0.5, 0.2])

#: Lengths are summed over up to 70 cells and 64 samples, and alpha = -expm1(-tau) of tau below 4
#: has slope 1: some 200 roundings of 6e-8 of what is below 4, seldom of one sign.
ROUNDING = 1e-5

#: A view of the bounds at depths from 9 to 11.
ACROSS = Camera((0, -10, 0), (0, 0, 0), (0, 0, 1), parallel_projection=True, parallel_scale=1)


def solid_vdi(parallel=False, window=(40, 30)):
    """The bounds' box filled with one medium: a supersegment per list, as long as its ray."""
    camera = filling_camera(BOUNDS, (40, 30)).replace(view_angle=40.0)
    camera = camera.replace(parallel_projection=parallel, parallel_scale=2.5)
    near, far = strategies.view_depths(camera, BOUNDS)
    options = {"window": window, "bounds": BOUNDS, "depth_origin": near, "color": COLOR}
    solid = slabs_vdi(camera, [0, far - near], 0, **options)
    return rebuilt(solid, optical_depth=0.7 * (far - near) * centre_ray_scale(solid).ravel())


@pytest.mark.every(4)
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("samples", [1, 2, 7, 64])
def test_a_homogeneous_medium_is_exact_with_any_number_of_samples(runtime, parallel, samples):
    """Each sample stands for the length around it, and the lengths add up to the ray's."""
    vdi = solid_vdi(parallel)
    for turn in (0.0, 35.0, 90.0, 180.0):
        view = vdi.camera.azimuth(turn)
        exact = render_vdi(vdi, view, device=runtime)
        drawn = render_vdi(vdi, view, preview_samples=samples, device=runtime)
        assert exact[..., 3].max() > 0.5
        np.testing.assert_allclose(drawn, exact, rtol=0, atol=ROUNDING)


@pytest.mark.every(3)
@pytest.mark.parametrize("seed", range(6))
def test_more_samples_come_closer_to_the_full_frame(runtime, seed):
    rng = np.random.default_rng(seed)
    vdi = strategies.random_vdi(rng, max_supersegments=5, thinnest=0.05)
    view, size = strategies.random_view(rng, vdi, "near")
    full = render_vdi(vdi, view, size, device=runtime)
    few, many = (
        np.abs(render_vdi(vdi, view, size, preview_samples=n, device=runtime) - full).mean()
        for n in (4, 4096)
    )
    # At 4096 samples one stands for less than a thousandth of the ray, and a ray of these VDIs
    # meets some tens of faces; measured: at most 2e-4
    assert many < 1e-3
    assert many <= few


def test_samples_go_where_the_supersegments_are(runtime):
    """Empty cells get none: a thin sheet in front of much empty depth is met with few samples."""
    sheet = [0.05, 0.05 + 2 / 64]  # one slab of 64, of a depth of 2
    vdi = slabs_vdi(ACROSS, sheet, 1.0, window=(32, 32), bounds=BOUNDS, depth_origin=9.0)
    drawn = render_vdi(vdi, ACROSS, preview_samples=4, device=runtime)
    # 4 samples in the two slabs that it reaches into; spread over the depth, 63 in 64 would miss
    assert (drawn[..., 3] > 0.3).all()


def test_a_sample_stands_in_the_middle_of_its_part(runtime):
    """One is taken in the middle of three layers, which weigh as much on either side of it."""
    layers = [(0.0, 0.5), (0.5, 1.5), (1.5, 2.0)]
    vdi = slabs_vdi(
        ACROSS, layers, [0.1, 0.4, 0.2], window=(16, 16), bounds=BOUNDS, depth_origin=9.0,
        color=np.eye(3),
    )  # fmt: skip
    opacity = -np.expm1(-0.4 * 2.0)  # of green, 0.4 a unit, all the way
    drawn = render_vdi(vdi, ACROSS, preview_samples=1, device=runtime)
    np.testing.assert_allclose(
        drawn, np.broadcast_to([0, opacity, 0, opacity], drawn.shape), rtol=0, atol=ROUNDING
    )


def test_opaque_depth_and_clipping_planes_end_the_ray(runtime):
    vdi = solid_vdi()
    view = vdi.camera.azimuth(20.0)
    to_centre = np.linalg.norm(np.subtract(view.position, view.focal_point))
    whole = render_vdi(vdi, view, device=runtime)
    for ends in (
        {"opaque_depth": np.full((30, 40), to_centre)},
        {"clipping_planes": [[0.1, 0, 0, 1, 0.2, 0]]},
    ):
        exact = render_vdi(vdi, view, device=runtime, **ends)
        drawn = render_vdi(vdi, view, preview_samples=3, device=runtime, **ends)
        assert not np.array_equal(exact, whole)
        np.testing.assert_allclose(drawn, exact, rtol=0, atol=ROUNDING)


def test_an_empty_vdi_is_transparent(runtime):
    empty = slabs_vdi(ACROSS, [], [], window=(4, 3), bounds=BOUNDS)
    assert not render_vdi(empty, ACROSS.azimuth(30), preview_samples=8, device=runtime).any()
