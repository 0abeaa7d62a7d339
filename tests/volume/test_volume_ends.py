"""Direct volume rendering that ends early: opaque geometry, clipping planes, transparent blocks."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import raycast_volume

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.generation import generate as generation
from pyvista_vdi.generation.generate import generate_vdi

SIZE = 9.0  # model units along each edge
OPACITY = 0.3
SIGMA = -np.log1p(-np.float64(np.float32(OPACITY)))
#: A sum of at most 18 steps, each rounded a few times, in float32
RTOL = 64 * 2.0**-24
CAMERA = Camera(
    (4.5, -20, 4.5), (4.5, 4.5, 4.5), (0, 0, 1), parallel_projection=True, parallel_scale=3.0
)
MEDIUM = TransferFunction(np.ones((1, 3)), [OPACITY], (0, 1), unit_distance=1.0)


def constant_volume() -> Volume:
    return Volume(np.ones((10, 10, 10), dtype=np.float32))


def opacity_over(length: float) -> float:
    return float(-np.expm1(-SIGMA * length))


@pytest.mark.parametrize("end", [-3.0, 20.0, 22.75, 29.0, 31.0, np.inf])
def test_a_ray_ends_at_opaque_geometry(runtime, end):
    """The medium lies between view depths 20 and 29."""
    depth = np.full((5, 6), end)
    image = raycast_volume(
        constant_volume(), CAMERA, (6, 5), MEDIUM, opaque_depth=depth, device=runtime
    )
    expected = opacity_over(np.clip(end - 20, 0, SIZE))
    np.testing.assert_allclose(image, expected, rtol=RTOL, atol=1e-7)


def test_opaque_geometry_ends_only_its_own_rays_top_row_first(runtime):
    depth = np.full((5, 6), np.inf)
    depth[0, 2] = 21.0
    image = raycast_volume(
        constant_volume(), CAMERA, (6, 5), MEDIUM, opaque_depth=depth, device=runtime
    )
    expected = np.full((5, 6), opacity_over(SIZE))
    expected[0, 2] = opacity_over(1.0)
    np.testing.assert_allclose(image[..., 3], expected, rtol=RTOL)


def test_clipping_planes_keep_the_side_their_normal_points_to(runtime):
    planes = [[0, 2.5, 0, 0, 1, 0], [0, 7.0, 0, 0, -2, 0]]
    image = raycast_volume(
        constant_volume(), CAMERA, (6, 5), MEDIUM, clipping_planes=planes, device=runtime
    )
    np.testing.assert_allclose(image, opacity_over(4.5), rtol=RTOL)


@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32, np.float64])
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
    transfer_function = TransferFunction(
        np.stack([ramp, 1 - ramp, ramp**2], axis=1),
        np.where(ramp < 0.04, 0, 0.5 * ramp),
        (0, 100),
        interpolation=interpolation,
    )
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    camera = Camera(centre + np.array([30, -80, 45]), centre, (0, 0, 1), view_angle=40)
    window = (61, 47)

    def draw(skip_empty: bool):
        return raycast_volume(
            volume, camera, window, transfer_function, skip_empty=skip_empty, device=runtime
        )

    plain = draw(False)
    assert plain[..., 3].max() > 0.5
    np.testing.assert_array_equal(draw(True), plain)

    def make():
        return generate_vdi(
            volume, camera, window, transfer_function, max_supersegments=6, device=runtime
        )

    skipping = make()
    monkeypatch.setattr(generation, "DeviceVolume", _without_skipping(generation.DeviceVolume))
    assert skipping.n_supersegments > 0
    assert make().equals(skipping)


def _without_skipping(device_volume):
    class LooksAtEverything(device_volume):
        def __init__(self, *arguments, **keywords):
            super().__init__(*arguments, skip_empty=False, **keywords)

    return LooksAtEverything
