"""Image metrics against their definitions, and the standard views against their promise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyvista_vdi import InvalidArgumentError
from pyvista_vdi.model.metrics import (
    compare_images,
    over_background,
)
from pyvista_vdi.model.standard_cases import ANGLES, TRANSFER_FUNCTIONS, filling_camera


def picture(seed=0, size=(24, 32), channels=3):
    return np.random.default_rng(seed).random((*size, channels))


def test_one_pixel_off():
    image, reference = picture() * 0.9, picture() * 0.9
    image[5, 7, 1] += 10 / 255
    result = compare_images(image, reference)
    assert result.worst_pixel == 10.0
    assert result.worst_position == (7, 5)
    # PSNR = -10 log10 of the mean square over all channels
    assert result.psnr == pytest.approx(-10 * math.log10((10 / 255) ** 2 / image.size), rel=1e-12)
    assert result.mean_brightness_ratio == pytest.approx(image.mean() / reference.mean(), rel=1e-12)


def test_special_pictures():
    """Equal ones, those of values to be clipped, black ones and those too small for an SSIM."""
    result = compare_images(picture(), picture())
    assert (result.ssim, result.psnr, result.worst_pixel) == (1.0, math.inf, 0.0)
    assert result.mean_brightness_ratio == 1.0
    white, black = np.ones((24, 32, 3)), np.zeros((24, 32, 3))
    assert compare_images(picture() + 1.0, white).worst_pixel == 0
    assert compare_images(white - 0.1 / 255, white).worst_pixel == pytest.approx(0.1)
    assert compare_images(black, black).mean_brightness_ratio == 1.0
    assert compare_images(picture(), black).mean_brightness_ratio == math.inf
    result = compare_images(white[:10], white[:10])
    assert math.isnan(result.ssim)
    assert result.worst_pixel == 0


def test_ssim_is_that_of_wang_et_al():
    """Against the formula itself, with SciPy's Gaussian, cropped as scikit-image crops."""
    from scipy.ndimage import gaussian_filter

    a, b = picture(1), np.clip(picture(1) + 0.1 * (picture(2) - 0.5), 0, 1)

    def blurred(image):
        return gaussian_filter(image, sigma=(1.5, 1.5, 0), truncate=3.5)

    mean_a, mean_b = blurred(a), blurred(b)
    var_a, var_b = blurred(a * a) - mean_a**2, blurred(b * b) - mean_b**2
    covariance = blurred(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    ssim = ((2 * mean_a * mean_b + c1) * (2 * covariance + c2)) / (
        (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
    )
    assert compare_images(a, b).ssim == pytest.approx(ssim[5:-5, 5:-5].mean(), abs=1e-9)


def test_premultiplied_images_are_blended_over_the_background():
    image = np.zeros((12, 12, 4), np.float32)
    image[...] = (0.2, 0.1, 0.0, 0.5)
    assert np.allclose(over_background(image, (1.0, 0.0, 0.5)), (0.7, 0.1, 0.25), atol=1e-7)
    flat = np.broadcast_to(np.float32([0.2, 0.1, 0.0]), (12, 12, 3))
    assert compare_images(image, flat).worst_pixel == 0
    assert compare_images(image, flat, background=(1, 1, 1)).worst_pixel == pytest.approx(127.5)


def test_a_pixel_that_is_not_finite_is_named():
    image = picture()
    image[3, 4, 0] = np.nan
    with pytest.raises(InvalidArgumentError, match=r"not finite: pixel \(column 4, row 3\)"):
        compare_images(image, picture())


def test_the_transfer_functions_are_the_designs():
    assert {n: dict(a) for n, a in TRANSFER_FUNCTIONS.items()} == {
        "soft": {"cmap": "bone", "opacity": "linear"},
        "steep": {"cmap": "viridis", "opacity": "sigmoid_10"},
        "nearly-opaque": {"cmap": "inferno", "opacity": (0, 0, 0.02, 0.9, 1.0)},
    }
    assert ANGLES == (0, 5, 30)


@given(
    edges=st.tuples(*[st.floats(1e-3, 1e3)] * 3),
    centre=st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    size=st.tuples(st.integers(1, 2000), st.integers(1, 2000)),
    azimuth=st.floats(-400, 400),
    elevation=st.floats(-89, 89),
    view_angle=st.floats(1, 150),
)
def test_the_bounds_just_fill_the_view(edges, centre, size, azimuth, elevation, view_angle):
    half = np.array(edges) / 2
    bounds = np.stack([np.array(centre) - half, np.array(centre) + half], axis=1).ravel()
    camera = filling_camera(bounds, size, azimuth, elevation, view_angle)
    corners = np.array(np.meshgrid(*bounds.reshape(3, 2))).reshape(3, -1)
    x, y, z = camera.view_matrix[:3, :3] @ (corners - np.reshape(camera.position, (3, 1)))
    t_x, t_y = camera.half_extent(size)
    assert (z > 0).all()
    reach = max(np.abs(x / (z * t_x)).max(), np.abs(y / (z * t_y)).max())
    # A margin of 1e-4 half viewports; float64 of coordinates up to 1e3 with edges from 1e-3
    assert 1 - 1.2e-4 < reach < 1 - 0.8e-4
    assert np.allclose(camera.focal_point, centre, rtol=0, atol=1e-9)
    up = np.subtract(camera.position, centre)
    assert math.degrees(math.asin(up[2] / np.linalg.norm(up))) == pytest.approx(elevation, abs=1e-5)


def test_turning_is_vtks_azimuth_about_the_centre():
    first = filling_camera((0, 2, 0, 2, 0, 2), (100, 100))
    turned = filling_camera((0, 2, 0, 2, 0, 2), (100, 100), azimuth=90)
    # A cube looks the same from all four sides, so the distance is the same
    assert np.allclose(first.azimuth(90).position, turned.position, atol=1e-12)
    assert first.position[1] < 0  # from the -y side
    assert turned.position[0] > 2  # counter-clockwise seen from above
