"""Image metrics against their definitions, and the standard views against their promise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyvista_vdi.model.metrics import (
    compare_images,
)
from pyvista_vdi.model.standard_cases import filling_camera


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
