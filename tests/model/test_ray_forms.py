"""Rays as the kernels take them, against direct float64 geometry."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from strategies import camera_around, random_bounds, random_transform, world_corners

from pyvista_vdi import Camera
from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.render_options import RenderOptions

EPS64 = np.finfo(np.float64).eps
SEEDS = range(6)
WINDOW = (40, 30)


def scene(seed):
    """Random bounds and a view of them: rays, points inside, and where these are in the window."""
    rng = np.random.default_rng(seed)
    bounds = random_bounds(rng)
    camera = camera_around(rng, bounds, random_transform(rng))
    low, high = np.reshape(bounds, (3, 2)).T
    points = low + rng.random((200, 3)) * (high - low)
    made = rays.pixel_rays(camera, WINDOW, bounds)
    return rng, bounds, camera, made, points


def direct_pixels(camera, window, points):
    """Pixel offsets from the window's centre and view depth of model points."""
    width, height = window
    forward = np.subtract(camera.focal_point, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.view_up)
    right = right / np.linalg.norm(right)
    up = np.cross(right, forward)
    world = points @ camera.model_transform[:3, :3].T
    world = world + (camera.model_transform[:3, 3] - camera.position)
    x, y, z = world @ right, world @ up, world @ forward
    if camera.parallel_projection:
        half = camera.parallel_scale * np.array([width / height, 1])
        x, y = x / half[0], y / half[1]
    else:
        tangent = np.tan(np.radians(camera.view_angle) / 2)
        if camera.use_horizontal_view_angle:
            half = tangent * np.array([1, height / width])
        else:
            half = tangent * np.array([width / height, 1])
        x, y = x / (z * half[0]), y / (z * half[1])
    u, v = x - camera.window_center[0], y - camera.window_center[1]
    return u * width / 2, v * height / 2, z


CUBE = (-1, 1, -1, 1, -1, 1)
AT_TEN = Camera((0, 0, 10), (0, 0, 0), (0, 1, 0))


def points_on_rays(made, a, b, depth):
    """P(t) as PixelRays documents it."""
    pixel = np.column_stack([np.ones_like(a), a, b])
    t = (depth - made.reference_depth)[:, None]
    return pixel @ made.origin + t * (pixel @ made.direction)


@pytest.mark.parametrize("seed", SEEDS)
def test_depth_range_is_that_of_the_corners(seed):
    _, bounds, camera, *_ = scene(seed)
    corners = rays.bounds_corners(bounds)
    sides = np.reshape(bounds, (3, 2))
    assert {tuple(c) for c in corners} == set(itertools.product(*sides))
    depths = direct_pixels(camera, WINDOW, corners)[2]
    # A dozen operations on numbers no larger than the corners' distance from the eye
    scale = np.abs(world_corners(bounds, camera.model_transform) - camera.position).max()
    low, high = rays.depth_range(camera, bounds)
    assert low == pytest.approx(depths.min(), abs=64 * EPS64 * scale)
    assert high == pytest.approx(depths.max(), abs=64 * EPS64 * scale)


@pytest.mark.parametrize(
    ("distance", "parallel", "expected"),
    [
        (10, False, 9),  # in front: the near depth
        (1, False, 0),  # on the near face
        (0.5, False, 0),  # the eye inside
        (-10, False, 0),  # behind the eye: nothing is seen
        (10, True, 9),
        (0.5, True, -0.5),  # parallel rays begin anywhere
        (-10, True, -11),
    ],
)
def test_reference_depth_and_eye_plane(distance, parallel, expected):
    place = {"position": (0, 0, -distance), "focal_point": (0, 0, 1 - distance)}
    camera = AT_TEN.replace(parallel_projection=parallel, **place)
    assert rays.reference_depth(camera, CUBE) == pytest.approx(expected, abs=1e-15)
    made = rays.pixel_rays(camera, WINDOW, CUBE)
    forms = rays.eye_plane(camera, made)
    assert len(forms) == (0 if parallel else 1)
    for form in forms:  # where depth is zero
        for depth in (-1.0, 0.25, 3.0):
            assert value_at(form, 3.5, -2.5, depth - made.reference_depth) == pytest.approx(depth)


@pytest.mark.parametrize("seed", SEEDS)
def test_rays_pass_through_what_the_pixel_shows(seed):
    rng, bounds, camera, made, points = scene(seed)
    a, b, depth = direct_pixels(camera, WINDOW, points)
    assert made.reference_depth == rays.reference_depth(camera, bounds)
    # A few dozen float64 operations; the inverse of the model transform has a condition of at
    # most some 30 here (scales between 1/2 and 2, a shear of 1/2)
    scale = np.abs(points).max() + np.abs(depth).max()
    np.testing.assert_allclose(
        points_on_rays(made, a, b, depth), points, rtol=0, atol=1e4 * EPS64 * scale
    )
    # A form is the affine function along the ray, anywhere
    normal, offset = rng.normal(size=3), rng.normal()
    a, b, t = rng.normal(size=(3, 50)) * 10
    values = value_at(made.form(normal, offset), a, b, t)
    at = points_on_rays(made, a, b, t + made.reference_depth)
    scale = np.abs(made.origin).sum() * 20 + np.abs(made.direction).sum() * 400
    np.testing.assert_allclose(values, at @ normal + offset, rtol=0, atol=64 * EPS64 * scale)


def in_float32(form, a, b, t):
    """The form as the kernels evaluate it."""
    c = rays.packed([form])[0]
    a, b, t = (np.float32(v) for v in (a, b, t))
    return (c[0] + a * c[1] + b * c[2]) + t * (c[3] + a * c[4] + b * c[5])


@pytest.mark.extremes
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("extent", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("far", ["eye", "data", "both"])
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
    for axis in range(3):
        found = in_float32(made.form(np.eye(3)[axis], -low[axis]), a, b, t)
        error = np.abs(found - (points - low)[:, axis])
        assert error.max() <= 64 * 2.0**-24 * extent + slack


@pytest.mark.extremes
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("exponents", [(-9, -9, -9), (9, 9, 9), (-9, 0, 9), (9, -9, 3)])
def test_inverse_affine_of_any_scale(seed, exponents):
    """Turned, sheared and mirrored axes of lengths 1e-9 to 1e9."""
    rng = np.random.default_rng(seed)
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


def value_at(form, a, b, t):
    return form[0] + a * form[1] + b * form[2] + t * (form[3] + a * form[4] + b * form[5])


@pytest.mark.parametrize("seed", SEEDS)
def test_user_planes_are_in_world_coordinates(seed):
    rng, _, camera, made, points = scene(seed)
    a, b, depth = direct_pixels(camera, WINDOW, points)
    world = points @ camera.model_transform[:3, :3].T + camera.model_transform[:3, 3]
    planes = np.column_stack([world[:5] + rng.normal(size=(5, 3)) * 0.1, rng.normal(size=(5, 3))])
    forms = rays.user_planes(camera, made, planes)
    assert len(forms) == 5
    kept = set()
    for plane, form in zip(planes, forms, strict=True):
        distance = (world - plane[:3]) @ plane[3:] / np.linalg.norm(plane[3:])
        found = value_at(form, a, b, depth - made.reference_depth)
        clear = np.abs(distance) > 1e-9
        np.testing.assert_array_equal(found[clear] > 0, distance[clear] > 0)
        kept |= set((distance > 0).tolist())
    assert kept == {True, False}
    for none in (None, [], np.empty((0, 6))):
        assert rays.user_planes(camera, made, RenderOptions(none).clipping_planes) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_box_planes_keep_what_is_inside(seed):
    rng, bounds, camera, made, _ = scene(seed)
    low, high = np.reshape(bounds, (3, 2)).T
    points = low + rng.uniform(-0.5, 1.5, (400, 3)) * (high - low)
    points = points[direct_pixels(camera, WINDOW, points)[2] > 0.05]
    a, b, depth = direct_pixels(camera, WINDOW, points)
    forms = rays.box_planes(made, bounds)
    assert len(forms) == 6
    values = np.array([value_at(f, a, b, depth - made.reference_depth) for f in forms])
    np.testing.assert_array_equal(
        (values >= 0).all(axis=0), ((points >= low) & (points <= high)).all(axis=1)
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_pixels_of_points_hold_what_the_points_surround(seed):
    rng, bounds, camera, *_ = scene(seed)
    points = rays.bounds_corners(bounds)
    part = rays.pixels_of_points(camera, WINDOW, points)
    inside = np.dot(rng.dirichlet(np.ones(8), 200), points)
    a, b, _ = direct_pixels(camera, WINDOW, np.vstack([points, inside]))
    x, y = a + WINDOW[0] / 2, b + WINDOW[1] / 2  # from the window's corner
    low = np.clip([x.min(), y.min()], 0, WINDOW)
    high = np.clip([x.max(), y.max()], 0, WINDOW)
    first, last = (part.x0, part.y0), (part.x1, part.y1)
    # Two pixels more, and whole ones
    assert ((low - first >= 0) & (low - first <= 3)).all()
    assert ((last - high >= 0) & (last - high <= 3)).all()


def test_pixels_of_points_that_are_not_all_in_front():
    whole = (0, WINDOW[0], 0, WINDOW[1])
    for z in (10.0, 11.0):  # at the eye, and behind it
        points = np.array([[0.0, 0, 0], [0, 0, z]])
        assert rays.pixels_of_points(AT_TEN, WINDOW, points) == whole
    parallel = AT_TEN.replace(parallel_projection=True, parallel_scale=100)
    assert rays.pixels_of_points(parallel, WINDOW, points) == (18, 22, 13, 17)
    assert rays.pixels_of_points(AT_TEN, WINDOW, np.empty((0, 3))).pixels == 0


def test_a_view_beyond_float32_is_refused():
    camera = Camera((0, 0, 1e40), (0, 0, 0), (0, 1, 0))
    made = rays.pixel_rays(camera, WINDOW, (-1e39, 1e39, -1, 1, -1, 1))
    with pytest.raises(InvalidCameraError, match="cannot be expressed in float32.*scale the data"):
        rays.packed([made.form((1, 0, 0), 1e39)])


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
