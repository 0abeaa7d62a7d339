"""Cropping and the opacity multiplier: the device against the float64 oracle, and against laws.

The bound for each channel is that of tests/support/oracle.py: crossings of cropping planes are
found with as many roundings as the ends of a ray, and the oracle's range moves the ends of every
part that cropping leaves of it.
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import raycast_volume
from reference.raycast import clip, inside_box, kept_parts, pixel_ray

from pyvista_vdi import TransferFunction, Volume
from pyvista_vdi.model.cropping import Cropping


@pytest.mark.parametrize("regions", ["subvolume", "inverted_fence", 0x2A55A3C])
def test_a_constant_volume_absorbs_by_the_length_that_is_kept(runtime, regions):
    rng = np.random.default_rng(5)
    volume = Volume(np.ones((5, 6, 7), np.uint8), (0.5, 0.4, 0.3), (1.0, 2.0, -1.0))
    look = TransferFunction([[0.2, 0.5, 0.8]] * 2, [0.7, 0.7], (0, 2), unit_distance=1.0)
    box = np.reshape(volume.bounds, (3, 2))
    planes = box[:, :1] + [[0.2, 0.75]] * (box[:, 1:] - box[:, :1])
    cropping = Cropping(planes.ravel(), regions)
    camera = strategies.camera_around(
        rng, np.array(volume.bounds), strategies.random_transform(rng)
    )
    size = (21, 17)
    shown = {"cropping": cropping, "opacity_multiplier": 1.7, "early_termination": False}
    image = raycast_volume(
        volume, camera, size, look, sample_distance=0.05, device=runtime, **shown
    )
    expected = np.zeros(size[::-1])
    for y, x in np.ndindex(expected.shape):
        ray = pixel_ray(camera, size, x, y)
        span = clip(inside_box(ray, volume.bounds))
        parts = [] if span is None else kept_parts(ray, *span, cropping)
        length = sum(b - a for a, b in parts) * np.linalg.norm(ray.direction)
        expected[size[1] - 1 - y, x] = -np.expm1(1.7 * np.log1p(-0.7) * length)
    # Sixty steps of three roundings; where a ray grazes an edge, its ends are as exact as that
    np.testing.assert_allclose(image[..., 3], expected, atol=2e-5)
    assert expected.max() > 0.1
