"""Direct volume rendering that ends early: opaque geometry, clipping planes, transparent blocks."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.generation import generate as generation

OPACITY = 0.3
SIGMA = -np.log1p(-np.float64(np.float32(OPACITY)))
#: A sum of at most 18 steps, each rounded a few times, in float32
RTOL = 64 * 2.0**-24
CAMERA = Camera(
    (4.5, -20, 4.5), (4.5, 4.5, 4.5), (0, 0, 1), parallel_projection=True, parallel_scale=3.0
)
MEDIUM = TransferFunction(np.ones((1, 3)), [OPACITY], (0, 1), unit_distance=1.0)


def opacity_over(length: float) -> float:
    return float(-np.expm1(-SIGMA * length))


@pytest.fixture
def opacity(runtime):
    """Draw the constant volume, whose medium lies between view depths 20 and 29."""

    def drawn(**options):
        volume = Volume(np.ones((10, 10, 10), dtype=np.float32))
        return raycast_volume(volume, CAMERA, (6, 5), MEDIUM, device=runtime, **options)

    return drawn


@pytest.mark.parametrize(
    ("planes", "end", "length"),
    [
        ([[0, 2.5, 0, 0, 1, 0], [0, 7.0, 0, 0, -2, 0]], np.inf, 4.5),
        ([[0, 2.5, 0, 0, 1, 0]], 24.5, 2.0),
        ([[0, 9.5, 0, 0, 1, 0]], np.inf, 0.0),
        ([[20, 0, 0, 1, 0, 0]], np.inf, 0.0),  # parallel to the rays
        ([[-20, 0, 0, 1, 0, 0]], np.inf, 9.0),
    ],
)
def test_clipping_planes_keep_the_side_their_normal_points_to(opacity, planes, end, length):
    image = opacity(clipping_planes=planes, opaque_depth=np.full((5, 6), end))
    np.testing.assert_allclose(image, opacity_over(length), rtol=RTOL)


@pytest.mark.parametrize(
    ("dtype", "interpolation"),
    [
        (np.uint8, "nearest"),
        (float, "linear"),
        pytest.param(np.int16, "linear", marks=pytest.mark.slow),
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
