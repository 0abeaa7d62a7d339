"""Image metrics against their definitions, and the standard views against their promise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera


def picture(seed=0, size=(24, 32), channels=3):
    return np.random.default_rng(seed).random((*size, channels))


def test_one_pixel_off():
    image, reference = picture() * 0.9, picture() * 0.9
    image[5, 7, 1] += 10 / 255
    result = compare_images(image, reference)
    assert result.worst_pixel == 10.0
    # PSNR = -10 log10 of the mean square over all channels
    assert result.psnr == pytest.approx(-10 * math.log10((10 / 255) ** 2 / image.size), rel=1e-12)
    assert result.mean_brightness_ratio == pytest.approx(image.mean() / reference.mean(), rel=1e-12)


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


def test_a_box_just_fills_the_standard_view():
    camera = filling_camera(
        (0, 2, 1, 4, -1, 5), (160, 90), azimuth=30, elevation=-40, view_angle=50
    )
    corners = np.array(np.meshgrid((0, 2), (1, 4), (-1, 5), 1)).reshape(4, -1)
    x, y, z = camera.view_matrix[:3] @ corners
    t_x, t_y = camera.half_extent((160, 90))
    reach = max(np.abs(x / (z * t_x)).max(), np.abs(y / (z * t_y)).max())
    assert z.min() > 0
    assert reach == pytest.approx(1 - 1e-4, abs=1e-6)  # but for the margin
    assert camera.focal_point == (1, 2.5, 2)
    towards = np.subtract(camera.position, camera.focal_point) / math.dist(
        camera.position, (1, 2.5, 2)
    )
    turn, lift = math.radians(30), math.radians(-40)
    assert towards == pytest.approx(
        [math.sin(turn) * math.cos(lift), -math.cos(turn) * math.cos(lift), math.sin(lift)]
    )
