"""The camera: frames and list coordinates, against their definitions and against VTK's own."""

from __future__ import annotations

import math
import pickle
import re

import numpy as np
import pytest
import strategies
from hypothesis import given
from strategies import GENERATORS

from pyvista_vdi.errors import InvalidArgumentError, InvalidCameraError, UnsupportedError
from pyvista_vdi.model.camera import MAX_WINDOW_EDGE, Camera, check_window_size

WINDOW = (160, 90)

#: A few dozen float64 operations.
EXACT = 1e-10


def any_camera(rng):
    return strategies.random_camera(rng, strategies.random_bounds(rng))


# -- frames ----------------------------------------------------------------------------------------


def test_axes_are_vtk_s():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 3, 1))  # view_up need not be perpendicular
    np.testing.assert_allclose(camera.axes, [[1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-15)


@given(GENERATORS)
def test_axes_are_orthonormal_and_z_points_forward(rng):
    camera = any_camera(rng)
    right, up, forward = camera.axes
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(right, forward), up, atol=1e-12)
    assert up @ camera.view_up > 0
    arm = np.subtract(camera.focal_point, camera.position)
    np.testing.assert_allclose(forward, arm / np.linalg.norm(arm), atol=1e-12)


@given(GENERATORS)
def test_model_to_view_is_the_view_after_the_model_transform(rng):
    camera = any_camera(rng)
    product = camera.view_matrix @ camera.model_transform
    np.testing.assert_allclose(camera.model_to_view, product, atol=1e-9)
    eye = camera.view_matrix @ [*camera.position, 1]
    np.testing.assert_allclose(eye, [0, 0, 0, 1], atol=1e-9)


def test_a_model_far_from_the_origin_keeps_its_digits():
    """An eye 1e9 away from zero looking at what is beside it: the offset is subtracted first."""
    far = np.array([1e9, -1e9, 1e9])
    matrix = np.eye(4)
    matrix[:3, 3] = far
    camera = Camera(np.add(far, [0, 0, 5]), far, (0, 1, 0), model_transform=matrix)
    near = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    np.testing.assert_array_equal(camera.model_to_view, near.model_to_view)


# -- list coordinates ------------------------------------------------------------------------------


@pytest.mark.parametrize("parallel", [False, True])
@given(rng=GENERATORS)
def test_list_coordinates_are_the_design_s(parallel, rng):
    """u = X / (Z t_x) - c_x in perspective, X / s_x - c_x in parallel projection; v alike."""
    camera = any_camera(rng).replace(parallel_projection=parallel)
    x, y, z = np.add(rng.uniform(-1, 1, size=3), [0, 0, 3])
    (cx, cy), (width, height) = camera.window_center, WINDOW
    if parallel:
        half_height, half_width = camera.parallel_scale, camera.parallel_scale * width / height
        expected = [x / half_width - cx, y / half_height - cy, z]
    else:
        tangent = math.tan(math.radians(camera.view_angle) / 2)
        horizontal = camera.use_horizontal_view_angle
        tx = tangent if horizontal else tangent * width / height
        ty = tangent * height / width if horizontal else tangent
        expected = [x / (z * tx) - cx, y / (z * ty) - cy, z]
    ud, vd, depth, d = camera.viewport_matrix(WINDOW) @ [x, y, z, 1]
    np.testing.assert_allclose([ud / d, vd / d, depth], expected, rtol=EXACT, atol=EXACT)
    assert d == (1 if parallel else z)


@given(GENERATORS)
def test_rays_pass_through_their_list_coordinates_at_every_depth(rng):
    camera = any_camera(rng)
    origin, direction = camera.ray_coefficients(WINDOW)
    u, v, depth = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.5, 9)
    point = np.array([1, u, v]) @ origin + depth * (np.array([1, u, v]) @ direction)
    ud, vd, z, d = camera.viewport_matrix(WINDOW) @ [*point, 1]
    np.testing.assert_allclose([ud / d, vd / d, z], [u, v, depth], rtol=EXACT, atol=EXACT)


def test_half_extent_takes_the_aspect_from_the_window():
    camera = Camera((0, 0, 1), (0, 0, 0), (0, 1, 0), view_angle=90, parallel_scale=3)
    np.testing.assert_allclose(camera.half_extent((200, 100)), (2, 1))
    sideways = camera.replace(use_horizontal_view_angle=True)
    np.testing.assert_allclose(sideways.half_extent((200, 100)), (1, 0.5))
    flat = camera.replace(parallel_projection=True)
    np.testing.assert_allclose(flat.half_extent((200, 100)), (6, 3))


@given(rng=GENERATORS)
def test_a_tile_s_rays_are_those_of_its_pixels(rng):
    """Window, tile and pixel at random, also beyond the window's border."""
    camera = any_camera(rng)
    window, tile = rng.integers(1, 400, size=(2, 2))
    corner = rng.integers(-50, 400, size=2)
    pixel = rng.integers(0, tile)

    def ray(view, size, place):
        u, v = (2 * (place + 0.5) / size - 1) * (1, -1)
        return np.array([[1, u, v] @ part for part in view.ray_coefficients(size)])

    expected = ray(camera, window, corner + pixel)
    found = ray(camera.tile(window, corner, tile), tile, pixel)
    # Absolute in units of half the viewport
    scale = max(camera.half_extent(window))
    np.testing.assert_allclose(found, expected, rtol=EXACT, atol=EXACT * scale)


def test_the_whole_window_is_a_tile_of_itself():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), window_center=(0.1, -0.2))
    whole = camera.tile(WINDOW, (0, 0), WINDOW)
    assert whole.view_angle == pytest.approx(camera.view_angle)
    assert whole.window_center == pytest.approx(camera.window_center)
    assert whole.replace(view_angle=30, window_center=(0.1, -0.2)) == camera


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 9), (0, 0), (5, 5)), "window_size must be between 1 and"),
        ((WINDOW, (0, 0), (5, 0)), "tile_size must be between 1 and"),
        (
            (WINDOW, (0.5, 0), (5, 5)),
            r"corner must be \(column, row\), two whole numbers of pixels",
        ),
        ((WINDOW, (1, 2, 3), (5, 5)), r"corner must be .*; got \(1, 2, 3\)"),
    ],
)
def test_impossible_tiles_are_refused(arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        Camera((0, 0, 5), (0, 0, 0), (0, 1, 0)).tile(*arguments)


def test_axes_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        Camera((0, 0, 5), (0, 0, 0), (0, 1, 0)).axes[0, 0] = 2


# -- VTK -------------------------------------------------------------------------------------------


def vtk_camera(camera):
    vtk_rendering = pytest.importorskip("vtkmodules.vtkRenderingCore")
    other = vtk_rendering.vtkCamera()
    other.SetPosition(camera.position)
    other.SetFocalPoint(camera.focal_point)
    other.SetViewUp(camera.view_up)
    other.SetViewAngle(camera.view_angle)
    other.SetUseHorizontalViewAngle(camera.use_horizontal_view_angle)
    other.SetParallelProjection(camera.parallel_projection)
    other.SetParallelScale(camera.parallel_scale)
    other.SetWindowCenter(*camera.window_center)
    return other


def vtk_matrix(matrix):
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


@given(GENERATORS)
def test_the_viewport_is_vtk_s(rng):
    """A world point falls on the same place of the window as VTK's projection puts it."""
    camera = any_camera(rng)
    other = vtk_camera(camera)
    other.SetClippingRange(0.5, 100)
    projection = vtk_matrix(
        other.GetCompositeProjectionTransformMatrix(WINDOW[0] / WINDOW[1], -1, 1)
    )
    right, up, forward = camera.axes
    point = camera.position + 3 * forward + rng.uniform(-1, 1) * right + rng.uniform(-1, 1) * up
    theirs = projection @ [*point, 1]
    ours = camera.viewport_matrix(WINDOW) @ camera.view_matrix @ [*point, 1]
    np.testing.assert_allclose(ours[:2] / ours[3], theirs[:2] / theirs[3], rtol=1e-6, atol=1e-6)


@given(GENERATORS)
def test_a_vtk_camera_is_read_as_it_is(rng):
    camera = any_camera(rng)
    read = Camera.from_any(vtk_camera(camera), model_transform=camera.model_transform)
    for name in ("position", "focal_point", "window_center"):
        np.testing.assert_allclose(getattr(read, name), getattr(camera, name), atol=1e-12)
    np.testing.assert_allclose(read.axes, camera.axes, atol=1e-9)
    assert read.half_extent(WINDOW) == pytest.approx(camera.half_extent(WINDOW))
    assert read.parallel_projection == camera.parallel_projection
    assert Camera.from_any(vtk_camera(camera)).model_transform.tolist() == np.eye(4).tolist()


@pytest.mark.parametrize(("method", "turn"), [("azimuth", "Azimuth"), ("elevation", "Elevation")])
def test_turning_is_vtk_s(method, turn):
    camera = Camera((3, 1, 5), (0.5, 0, 0), (0, 1, 0))
    other = vtk_camera(camera)
    getattr(other, turn)(30)
    turned = getattr(camera, method)(30)
    np.testing.assert_allclose(turned.position, other.GetPosition(), atol=1e-12)
    np.testing.assert_allclose(turned.view_up, other.GetViewUp(), atol=1e-12)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda camera: camera.SetViewShear(0.1, 0, 1), "view shear"),
        (
            lambda camera: camera.SetUseExplicitProjectionTransformMatrix(True),
            "explicit projection",
        ),
        (lambda camera: camera.SetUseOffAxisProjection(True), "off-axis projection"),
    ],
)
def test_projections_that_cannot_be_honoured_are_refused_by_name(change, word):
    other = vtk_camera(Camera((0, 0, 5), (0, 0, 0), (0, 1, 0)))
    change(other)
    with pytest.raises(UnsupportedError, match=word):
        Camera.from_any(other)


# -- a value ---------------------------------------------------------------------------------------


@given(GENERATORS)
def test_a_camera_survives_its_description_pickling_and_comparison(rng):
    camera = any_camera(rng)
    for copy in (
        Camera.from_dict(camera.to_dict()),
        pickle.loads(pickle.dumps(camera)),
        camera.replace(),
        Camera.from_any(camera),
    ):
        assert copy == camera
        assert hash(copy) == hash(camera)
    assert camera.replace(view_angle=camera.view_angle / 2) != camera
    assert camera.replace(model_transform=2 * np.diag([1, 1, 1, 0.5])) != camera
    assert camera != "camera"


def test_a_camera_cannot_be_changed():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    with pytest.raises(AttributeError, match=re.escape("use replace()")):
        camera.view_angle = 3
    with pytest.raises(ValueError, match="read-only"):
        camera.model_transform[0, 0] = 2


def test_repr_says_the_lens():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), view_angle=42)
    assert "view_angle=42" in repr(camera)
    assert "parallel_scale=1" in repr(camera.replace(parallel_projection=True))


# -- refusals --------------------------------------------------------------------------------------

GOOD = {"position": (0, 0, 5), "focal_point": (0, 0, 0), "view_up": (0, 1, 0)}
FLAT = np.diag([1.0, 1.0, 0.0, 1.0])
PROJECTIVE = np.eye(4) + np.diag([0, 0, 1], -1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"focal_point": (0, 0, 5)},
            r"position and focal point are the same point \(0.0, 0.0, 5.0\)",
        ),
        ({"view_up": (0, 0, 0)}, "view_up is the zero vector"),
        ({"view_up": (0, 0, 7)}, "view_up .* is parallel to the direction of projection"),
        ({"position": (0, 0, np.nan)}, "position must be 3 finite numbers"),
        ({"position": "here"}, "position must be 3 finite numbers; got 'here'"),
        ({"focal_point": (0, 0)}, "focal_point must be 3 finite numbers"),
        ({"view_angle": 0}, "view_angle .* got 0"),
        ({"view_angle": 180}, "view_angle .* got 180"),
        ({"view_angle": np.nan}, "view_angle .* got nan"),
        ({"parallel_scale": 0}, "parallel_scale .* got 0"),
        ({"parallel_scale": np.inf}, "parallel_scale .* got inf"),
        ({"window_center": (0, 0, 0)}, "window_center must be 2 finite numbers"),
        ({"model_transform": np.eye(3)}, "model_transform must be 4 x 4"),
        ({"model_transform": FLAT}, "model_transform cannot be inverted"),
        ({"model_transform": PROJECTIVE}, "model_transform must be affine"),
        ({"model_transform": np.full((4, 4), np.nan)}, "model_transform must be 4 x 4 finite"),
        # Found by fuzzing: errors of NumPy and Python came out
        ({"model_transform": [[1, 2], [3]]}, "model_transform must be 4 x 4 finite"),
        ({"position": (10**400, 0, 0)}, "position must be 3 finite numbers"),
        ({"view_angle": "wide"}, "view_angle must lie between"),
        ({"position": (1e308, 0, 0), "focal_point": (-1e308, 0, 0)}, "too far apart"),
        ({"view_angle": np.nan, "parallel_projection": True}, "view_angle must lie between"),
        ({"parallel_scale": [1]}, "parallel_scale .* got nan"),
    ],
)
def test_a_camera_that_defines_no_view_is_refused(changes, message):
    with pytest.raises(InvalidCameraError, match=message):
        Camera(**{**GOOD, **changes})
    with pytest.raises(InvalidCameraError, match=message):
        Camera(**GOOD).replace(**changes)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_a_tiny_or_huge_model_transform_is_none_the_worse(scale):
    camera = Camera(**GOOD, model_transform=np.diag([scale, scale, scale, 1]))
    assert camera.model_to_view[0, 0] == scale


def test_squares_of_huge_distances_do_not_overflow():
    """Found by fuzzing: a warning, and axes of zeros."""
    far = Camera(
        (0, 0, 1e200), (0, 0, -1e200), (0, 1, 0), model_transform=np.diag([1e200] * 3 + [1])
    )
    np.testing.assert_array_equal(far.axes, Camera((0, 0, 1), (0, 0, -1), (0, 1, 0)).axes)


def test_what_is_no_camera_is_refused_by_its_type():
    with pytest.raises(InvalidCameraError, match="got dict"):
        Camera.from_any({})
    with pytest.raises(InvalidCameraError, match="has no zoom"):
        Camera(**GOOD).replace(zoom=2)
    with pytest.raises(
        InvalidCameraError, match="unknown entries \\['zoom'\\], lacks \\['view_up'\\]"
    ):
        Camera.from_dict({"position": (0, 0, 1), "focal_point": (0, 0, 0), "zoom": 2})
    with pytest.raises(InvalidCameraError, match="description is a dictionary; got list"):
        Camera.from_dict([1])
    for angle in (np.inf, "far"):
        with pytest.raises(InvalidCameraError, match="turned by a finite angle; got"):
            Camera(**GOOD).azimuth(angle)


@pytest.mark.parametrize("size", [(1, 1), (MAX_WINDOW_EDGE, 1), (np.int64(7), 3.0), [4, 5]])
def test_window_sizes_come_back_as_ints(size):
    checked = check_window_size(size)
    assert checked == tuple(int(edge) for edge in size)
    assert all(type(edge) is int for edge in checked)


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((0, 5), "between 1 and 65536 pixels along each edge; got 0 x 5"),
        ((5, MAX_WINDOW_EDGE + 1), "got 5 x 65537"),
        ((-1, 5), "got -1 x 5"),
        ((2.5, 5), r"two whole numbers of pixels; got \(2.5, 5\)"),
        ((np.nan, 5), "two whole numbers"),
        ((np.inf, 5), "two whole numbers"),
        ((5,), "two whole numbers"),
        (5, "two whole numbers of pixels; got 5"),
        ("ab", "two whole numbers"),
    ],
)
def test_impossible_window_sizes_are_refused(size, message):
    with pytest.raises(InvalidArgumentError, match=message):
        check_window_size(size)
