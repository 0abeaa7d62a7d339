"""Rays as the kernels take them, against direct float64 geometry."""

from __future__ import annotations

import numpy as np
import pytest
from strategies import random_transform

from pyvista_vdi import Camera
from pyvista_vdi.model import ray_forms as rays

EPS64 = np.finfo(np.float64).eps
WINDOW = (40, 30)


def direct_pixels(camera, window, points):
    """Pixel offsets from the window's centre and view depth of model points."""
    to_window = camera.viewport_matrix(window) @ camera.model_to_view
    u, v, z, d = to_window @ np.column_stack([points, np.ones(len(points))]).T
    return u / d * window[0] / 2, v / d * window[1] / 2, z


CUBE = (-1, 1, -1, 1, -1, 1)


def points_on_rays(made, a, b, depth):
    """P(t) as PixelRays documents it."""
    pixel = np.column_stack([np.ones_like(a), a, b])
    t = (depth - made.reference_depth)[:, None]
    return pixel @ made.origin + t * (pixel @ made.direction)


def in_float32(form, a, b, t):
    """The form as the kernels evaluate it."""
    c = rays.packed([form])[0]
    a, b, t = (np.float32(v) for v in (a, b, t))
    return (c[0] + a * c[1] + b * c[2]) + t * (c[3] + a * c[4] + b * c[5])


@pytest.mark.extremes
@pytest.mark.parametrize(
    ("far", "extent", "parallel"),
    [("eye", 1e-9, False), ("eye", 1.0, True), ("data", 1e9, False), ("both", 1e-9, True)],
)
def test_a_far_eye_or_origin_costs_float32_nothing(far, extent, parallel):
    """The eye 1e7 extents away, through a long lens; or the data there, the eye beside them."""
    rng = np.random.default_rng(3)
    away = 1e7 * extent
    centre = np.array([away, -away, away]) * (far != "eye")
    bounds = np.ravel([centre - extent / 2, centre + extent / 2], order="F")
    towards = np.array([0.6, 0.64, 0.48])
    distance = 3 * extent if far == "data" else away
    camera = Camera(
        centre + towards * distance,
        centre,
        (0, 0, 1),
        view_angle=2 * np.degrees(np.arctan(extent / distance)),
        parallel_projection=parallel,
        parallel_scale=extent,
    )
    made = rays.pixel_rays(camera, WINDOW, bounds)
    low, high = np.reshape(bounds, (3, 2)).T
    points = low + rng.random((300, 3)) * (high - low)
    a, b, depth = direct_pixels(camera, WINDOW, points)
    # float64 itself knows a point 1e7 extents away to 2e-9 of an extent, and the difference of two
    # such numbers to twice that; the camera's axes turn it by a few EPS64, again of 1e7 extents
    slack = 64 * EPS64 * 1e7 * extent
    np.testing.assert_allclose(points_on_rays(made, a, b, depth), points, rtol=0, atol=slack)
    # Relative to the bounds, float32 has ten roundings of numbers of a few extents
    t = depth - made.reference_depth
    for axis, form in enumerate(made.forms(np.column_stack([np.eye(3), -low]))):
        found = in_float32(form, a, b, t)
        error = np.abs(found - (points - low)[:, axis])
        assert error.max() <= 64 * 2.0**-24 * extent + slack


@pytest.mark.extremes
@pytest.mark.parametrize("exponents", [(-9, -9, -9), (9, 9, 9), (-9, 0, 9), (9, -9, 3)])
def test_inverse_affine_of_any_scale(exponents):
    """Turned, sheared and mirrored axes of lengths 1e-9 to 1e9."""
    rng = np.random.default_rng(exponents[2] + 9)
    matrix = random_transform(rng, rng.choice(["rigid", "mirror", "shear"]))
    matrix[:3, :3] *= 10.0 ** np.array(exponents)
    matrix[:3, 3] = rng.normal(size=3) * 10.0 ** rng.integers(-9, 9)
    inverse = rays.inverse_affine(matrix)
    # Points of the unit cube of the matrix's own frame, there and back, to a few dozen roundings:
    # of the axes' lengths, and of the translation as each axis' row of the inverse scales it
    points = rng.random((50, 3))
    there = points @ matrix[:3, :3].T + matrix[:3, 3]
    back = there @ inverse[:3, :3].T + inverse[:3, 3]
    moved = np.abs(inverse[:3, :3]) @ (np.abs(there).max(axis=0) + np.abs(matrix[:3, 3]))
    assert (np.abs(back - points) <= 64 * EPS64 * (moved + 1)).all()
    np.testing.assert_array_equal(inverse[3], [0, 0, 0, 1])
    # Exact entries where rounding plays no part
    exact = np.linalg.inv(matrix[:3, :3] / 10.0 ** np.array(exponents))
    exact = exact / 10.0 ** np.array(exponents)[:, None]
    row = np.abs(exact).max(axis=1, keepdims=True)
    assert (np.abs(inverse[:3, :3] - exact) <= 1e3 * EPS64 * row).all()


def test_opaque_depth_is_relative_to_the_reference():
    camera = Camera((0, 0, 1e7), (0, 0, 0), (0, 1, 0), view_angle=1e-5)
    made = rays.pixel_rays(camera, (2, 2), CUBE)
    depth = np.array([[1e7 - 1, 1e7 + 0.125], [np.inf, -np.inf]])
    found = rays.checked_opaque_depth(depth, (2, 2), made)
    # The difference is made in float64, which knows 1e7 to 2e-9
    np.testing.assert_allclose(found, [[0, 1.125], [np.inf, -np.inf]], atol=1e-7)
    assert found.dtype == np.float32
    assert rays.checked_opaque_depth(None, (2, 2), made) is None
    # VTK and others mark "nothing" by the largest number of their own type
    found = rays.checked_opaque_depth([[np.finfo(np.float64).max]], (1, 1), made)
    assert found[0, 0] == np.inf
