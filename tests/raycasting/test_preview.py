"""The preview of the paper's section 5: what it must give whatever the number of samples."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import render_vdi

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import MAX_PREVIEW_SAMPLES
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import VDI

BOUNDS = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
COLOR = np.array([0.8, 0.5, 0.2])

#: Lengths are summed over up to 70 cells and 64 samples, and alpha = -expm1(-tau) of tau below 4
#: has slope 1: some 200 roundings of 6e-8 of what is below 4, seldom of one sign.
ROUNDING = 1e-5


def solid_vdi(camera, window=(40, 30), extinction=0.7, color=COLOR):
    """The bounds' box filled with one medium: a supersegment per list, as long as its ray."""
    width, height = window
    near, far = strategies.view_depths(camera, BOUNDS)
    _, direction = camera.ray_coefficients(window)
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    u, v = (2 * x + 1) / width - 1, (2 * y + 1) / height - 1
    rays = np.stack([np.ones_like(u), u, v], axis=-1).reshape(-1, 3) @ direction
    stretch = np.linalg.norm(rays, axis=1)  # world length per unit of view depth
    n = width * height
    return VDI(
        camera,
        window,
        np.arange(n + 1, dtype=np.uint64),
        np.zeros(n),
        np.full(n, far - near),
        np.broadcast_to(color, (n, 3)),
        extinction * stretch * (far - near),
        BOUNDS,
        depth_origin=near,
    )


def view_of_solid(parallel):
    camera = filling_camera(BOUNDS, (40, 30)).replace(view_angle=40.0)
    return camera.replace(parallel_projection=True, parallel_scale=2.5) if parallel else camera


@pytest.mark.every(4)
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("samples", [1, 2, 7, 64])
@pytest.mark.parametrize("turn", [0.0, 35.0, 90.0, 180.0])
def test_a_homogeneous_medium_is_exact_with_any_number_of_samples(runtime, parallel, samples, turn):
    """Each sample stands for the length around it, and the lengths add up to the ray's."""
    camera = view_of_solid(parallel)
    vdi = solid_vdi(camera)
    view = camera.azimuth(turn)
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

    def error(samples):
        drawn = render_vdi(vdi, view, size, preview_samples=samples, device=runtime)
        assert np.isfinite(drawn).all()
        return float(np.abs(drawn - full).mean())

    few, many = error(4), error(4096)
    # At 4096 samples one stands for less than a thousandth of the ray, and a ray of these VDIs
    # meets some tens of faces; measured: at most 2e-4
    assert many < 1e-3
    assert many <= few


def test_samples_go_where_the_supersegments_are(runtime):
    """Empty cells get none: a thin sheet in front of much empty depth is met with few samples."""
    camera = Camera((0, -10, 0), (0, 0, 0), (0, 0, 1), parallel_projection=True, parallel_scale=1)
    n, front = 32 * 32, 0.05
    vdi = VDI(
        camera,
        (32, 32),
        np.arange(n + 1, dtype=np.uint64),
        np.full(n, front),
        np.full(n, front + 2 / 64),  # one slab of 64, of a depth of 2
        np.broadcast_to(COLOR, (n, 3)),
        np.full(n, 1.0),
        BOUNDS,
        depth_origin=9.0,
    )
    drawn = render_vdi(vdi, camera, preview_samples=4, device=runtime)
    # 4 samples in the two slabs that it reaches into; spread over the depth, 63 in 64 would miss
    assert (drawn[..., 3] > 0.3).all()


def test_a_sample_stands_in_the_middle_of_its_part(runtime):
    """One is taken in the middle of three layers, which weigh as much on either side of it."""
    camera = Camera((0, -10, 0), (0, 0, 0), (0, 0, 1), parallel_projection=True, parallel_scale=1)
    n = 16 * 16
    vdi = VDI(
        camera,
        (16, 16),
        3 * np.arange(n + 1, dtype=np.uint64),
        np.tile([0.0, 0.5, 1.5], n),
        np.tile([0.5, 1.5, 2.0], n),
        np.tile(np.eye(3), (n, 1)),
        np.tile([0.1, 0.4, 0.2], n),
        BOUNDS,
        depth_origin=9.0,
    )
    opacity = -np.expm1(-0.4 * 2.0)  # of green, 0.4 a unit, all the way
    drawn = render_vdi(vdi, camera, preview_samples=1, device=runtime)
    np.testing.assert_allclose(
        drawn, np.broadcast_to([0, opacity, 0, opacity], drawn.shape), rtol=0, atol=ROUNDING
    )


def test_opaque_depth_and_clipping_planes_end_the_ray(runtime):
    camera = view_of_solid(parallel=False)
    vdi = solid_vdi(camera)
    view = camera.azimuth(20.0)
    to_centre = np.linalg.norm(np.subtract(camera.position, camera.focal_point))
    ends = np.full((30, 40), to_centre)
    planes = [[0.1, 0, 0, 1, 0.2, 0]]
    for arguments in ({"opaque_depth": ends}, {"clipping_planes": planes}):
        exact = render_vdi(vdi, view, device=runtime, **arguments)
        drawn = render_vdi(vdi, view, preview_samples=3, device=runtime, **arguments)
        assert not np.array_equal(exact, render_vdi(vdi, view, device=runtime))
        np.testing.assert_allclose(drawn, exact, rtol=0, atol=ROUNDING)


def test_an_empty_vdi_is_transparent(runtime):
    camera = view_of_solid(parallel=False)
    empty = VDI(camera, (4, 3), np.zeros(13, np.uint64), [], [], np.empty((0, 3)), [], BOUNDS)
    assert not render_vdi(empty, camera.azimuth(30), preview_samples=8, device=runtime).any()


@pytest.mark.parametrize("samples", [0, -1, 1.5, "many", float("nan"), MAX_PREVIEW_SAMPLES + 1])
def test_a_number_of_samples_that_is_none_is_refused(samples):
    vdi = solid_vdi(view_of_solid(parallel=False), window=(2, 2))
    with pytest.raises(InvalidArgumentError, match="preview_samples"):
        render_vdi(vdi, vdi.camera, preview_samples=samples)
