"""Direct volume rendering that ends early: opaque geometry, clipping planes, transparent blocks."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import strategies
from drawing import generate_vdi, raycast_volume
from ray_scenes import random_ends
from reference.raycast import HalfSpace, clip, inside_box, inside_planes, kept_parts, pixel_ray

from pyvista_vdi import Camera, Cropping, TransferFunction, Volume
from pyvista_vdi.generation import generate as generation


@pytest.mark.parametrize("regions", [None, "subvolume", "inverted_fence", 0x2A55A3C])
def test_a_constant_volume_absorbs_by_the_length_that_is_kept(runtime, regions):
    """Of cropping, a clipping plane and opaque geometry."""
    rng = np.random.default_rng(5)
    volume = Volume(np.ones((5, 6, 7), np.uint8), (0.5, 0.4, 0.3), (1.0, 2.0, -1.0))
    look = TransferFunction([[0.2, 0.5, 0.8]] * 2, [0.7, 0.7], (0, 2), unit_distance=1.0)
    box = np.reshape(volume.bounds, (3, 2))
    cuts = box[:, :1] + [[0.2, 0.75]] * (box[:, 1:] - box[:, :1])
    cropping = None if regions is None else Cropping(cuts.ravel(), regions)
    camera = strategies.camera_around(
        rng, np.array(volume.bounds), strategies.random_transform(rng)
    )
    size = (21, 17)
    ends = {} if regions is None else random_ends(rng, volume, camera, size)
    shown = {"cropping": cropping, "opacity_multiplier": 1.7, "early_termination": False, **ends}
    image = raycast_volume(
        volume, camera, size, look, sample_distance=0.05, device=runtime, **shown
    )
    expected = np.zeros(size[::-1])
    for y, x in np.ndindex(expected.shape):
        ray = pixel_ray(camera, size, x, y)
        sides = inside_box(ray, volume.bounds)
        if ends:
            sides += inside_planes(ray, camera, ends["clipping_planes"])
            depth = float(ends["opaque_depth"][size[1] - 1 - y, x])
            sides += [HalfSpace(depth, -1.0)] if depth < np.inf else []
        span = clip(sides)
        parts = [] if span is None else kept_parts(ray, *span, cropping)
        length = sum(b - a for a, b in parts) * np.linalg.norm(ray.direction)
        expected[size[1] - 1 - y, x] = -np.expm1(1.7 * np.log1p(-0.7) * length)
    # Sixty steps of three roundings; where a ray grazes an edge, its ends are as exact as that
    np.testing.assert_allclose(image[..., 3], expected, atol=2e-5)
    assert expected.max() > 0.1


@pytest.mark.parametrize(
    ("dtype", "interpolation"),
    [
        (np.uint8, "nearest"),
        (float, "linear"),
    ],
)
def test_passing_by_transparent_blocks_changes_no_bit(runtime, monkeypatch, interpolation, dtype):
    rng = np.random.default_rng(7)
    values = np.zeros((41, 35, 50))
    for _ in range(6):  # a few solid boxes in much empty space
        z, y, x = (int(rng.integers(0, n - 9)) for n in values.shape)
        values[z : z + 9, y : y + 5, x : x + 7] = rng.uniform(5, 100, (9, 5, 7))
    if np.dtype(dtype).kind == "f":
        values[:4] = np.nan
    volume = Volume(values.astype(dtype), spacing=(1.0, 0.7, 1.3), origin=(5, -3, 2))
    ramp = np.linspace(0, 1, 64)
    colors = np.stack([ramp, 1 - ramp, ramp**2], axis=1)
    opacities = np.where(ramp < 0.04, 0, 0.5 * ramp)
    table = TransferFunction(colors, opacities, (0, 100), interpolation=interpolation)
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    camera = Camera(centre + np.array([30, -80, 45]), centre, (0, 0, 1), view_angle=40)
    scene = (volume, camera, (61, 47), table)
    plain, skipping = (
        raycast_volume(*scene, skip_empty=skip, device=runtime) for skip in (False, True)
    )
    assert plain[..., 3].max() > 0.5
    np.testing.assert_array_equal(skipping, plain)

    made = generate_vdi(*scene, max_supersegments=6, device=runtime)
    without_skipping = functools.partial(generation.DeviceVolume, skip_empty=False)
    monkeypatch.setattr(generation, "DeviceVolume", without_skipping)
    assert made.n_supersegments > 0
    assert generate_vdi(*scene, max_supersegments=6, device=runtime).equals(made)
