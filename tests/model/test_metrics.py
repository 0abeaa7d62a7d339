"""Image metrics against their definitions, and the standard views against their promise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pyvista_vdi.model.metrics import (
    compare_images,
)


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
