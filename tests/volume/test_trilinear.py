"""x y z is reproduced exactly by trilinear interpolation: samples and integrals in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from drawing import raycast_volume
from reference.compositing import composite
from reference.generate import classify

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume

SHAPE = (5, 6, 7)  # z, y, x
TOP = np.prod(np.array(SHAPE) - 1.0)


def product_volume(dtype="float64", **options):
    z, y, x = np.meshgrid(*(np.arange(n) for n in SHAPE), indexing="ij")
    return Volume((x * y * z).astype(dtype), **options)


def ramp(max_opacity=0.8, unit_distance=2.0):
    options = {"unit_distance": unit_distance, "interpolation": "linear"}
    return TransferFunction([[0, 0, 1], [1, 0.5, 0]], [0, max_opacity], (0, TOP), **options)


@pytest.mark.parametrize("seed", range(3))
def test_the_reference_image_is_the_formula_s(seed):
    rng = np.random.default_rng(seed)
    volume = product_volume(
        spacing=rng.uniform(0.3, 1.5, 3),
        origin=rng.normal(size=3),
        direction=strategies.random_rotation(rng),
    )
    camera = strategies.random_camera(rng, volume.bounds)
    image = reference.volume_image(volume, camera, (6, 5), ramp(), 0.4)
    for ray in reference.samples(volume, camera, (6, 5), ramp(), 0.4):
        x, y = ray.pixel
        share = ray.position.prod(axis=1) / TOP
        # float32(0.8) is what the table holds
        tau = -np.log(1 - share * float(np.float32(0.8))) * ray.length / 2
        color = np.stack([share, share / 2, 1 - share], axis=1)
        np.testing.assert_allclose(ray.optical_depth, tau, rtol=1e-10, atol=1e-13)
        np.testing.assert_allclose(image[4 - y, x], composite(color, tau), atol=1e-12)
        # Steps of the length asked for, the last one shorter, without gaps
        if len(ray.length):
            np.testing.assert_allclose(ray.length[:-1], 0.4, rtol=1e-9)
            assert 0 < ray.length[-1] <= 0.4 * (1 + 1e-9)
            np.testing.assert_array_equal(ray.end[:-1], ray.begin[1:])


@pytest.mark.every(2)
@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16", "int32", "float32", "float64"])
def test_the_device_samples_x_y_z(runtime, dtype):
    rng = np.random.default_rng(4)
    volume = product_volume(dtype, spacing=(0.7, 0.5, 1.1))
    camera = strategies.camera_around(rng, volume.bounds, np.eye(4))
    expected = reference.volume_image(volume, camera, (12, 9), ramp())
    drawn = raycast_volume(volume, camera, (12, 9), ramp(), device=runtime)
    # Scalars up to 120 with 9 roundings, opacity slopes of 0.8 / 120, about 40 samples in all
    np.testing.assert_allclose(drawn, expected, rtol=0, atol=5e-6)
    assert expected.max() > 0.2


def test_the_midpoint_rule_converges_with_the_square_of_the_step():
    """Along the diagonal of x y z the optical depth is an integral that is known.

    With opacity a = (s / S)^3 a_max on the diagonal and sigma = -log1p(-a) / U, the error of
    the midpoint rule falls by four when the step is halved.
    """
    volume = Volume(np.arange(5.0)[:, None, None] * np.arange(5.0)[:, None] * np.arange(5.0))
    transfer_function = TransferFunction(
        [[1, 1, 1]] * 2, [0, 0.5], (0, 64), unit_distance=1, interpolation="linear"
    )
    camera = Camera(
        (10, 10, 10), (0, 0, 0), (0, 0, 1), parallel_projection=True, parallel_scale=1e-3
    )
    s = (np.arange(20_000) + 0.5) / 20_000
    whole = np.sqrt(48) * np.mean(-np.log1p(-0.5 * s**3))
    errors = []
    for steps in (8, 16, 32):
        (ray,) = reference.samples(volume, camera, (1, 1), transfer_function, np.sqrt(48) / steps)
        assert len(ray.length) == steps
        errors.append(abs(ray.optical_depth.sum() - whole))
    ratios = np.divide(errors[:-1], errors[1:])
    assert (ratios > 3.8).all(), errors
    assert (ratios < 4.2).all(), errors


def test_classification_is_linear_between_nodes_and_constant_beyond():
    table = TransferFunction([[0, 0, 0], [1, 0, 0.5], [0, 1, 0.5]], [0, 0.5, 0.25], (10, 20))
    color, opacity = classify(table, np.array([-5.0, 10, 12.5, 15, 17.5, 20, 99, np.nan]))
    np.testing.assert_array_equal(opacity, [0, 0, 0.25, 0.5, 0.375, 0.25, 0.25, 0])
    np.testing.assert_array_equal(color[:, 0], [0, 0, 0.5, 1, 0.5, 0, 0, 0])
    # A range of one scalar steps above it, and one entry serves every scalar
    table = TransferFunction([[0, 0, 0], [1, 1, 1]], [0.25, 0.75], (5, 5))
    np.testing.assert_array_equal(classify(table, np.array([4.0, 5, 5.1]))[1], [0.25, 0.25, 0.75])
    table = TransferFunction([[0.5, 0, 0]], [0.5], (0, 1))
    np.testing.assert_array_equal(classify(table, np.array([-1.0, 0, 7]))[1], [0.5] * 3)


@pytest.mark.parametrize(
    ("budget", "weighting"),
    [(1, "transmittance"), (3, "optical_depth"), (3, "transmittance"), (20, "transmittance")],
)
def test_a_plain_vdi_keeps_its_budget_and_all_optical_depth(budget, weighting):
    rng = np.random.default_rng(budget)
    volume = strategies.random_volume(rng, "float32")
    scene = (volume, strategies.random_camera(rng, volume.bounds), (6, 5))
    table = strategies.random_transfer_function(rng, volume)
    vdi = reference.build_vdi(*scene, table, max_supersegments=budget, weighting=weighting)
    assert 0 < vdi.counts.max() <= budget
    for ray in reference.samples(*scene, table):
        part = vdi.list_at(*ray.pixel)
        np.testing.assert_allclose(
            vdi.optical_depth[part].sum(dtype=float), ray.optical_depth.sum(), rtol=1e-6
        )
    if weighting == "transmittance":
        exact = reference.volume_image(*scene, table)
        # Colours and optical depths are stored in float32; the near limit takes 1e-6 of a diagonal
        np.testing.assert_allclose(reference.render(vdi, scene[1]), exact, atol=3e-5)
