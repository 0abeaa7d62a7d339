"""x y z is reproduced exactly by trilinear interpolation: samples and integrals in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from reference.compositing import composite

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
