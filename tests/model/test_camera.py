"""The camera: frames and list coordinates, against their definitions and against VTK's own."""

from __future__ import annotations

import math

import numpy as np
import pytest
import strategies
from hypothesis import given
from strategies import GENERATORS

from pyvista_vdi import UnsupportedError
from pyvista_vdi.model.camera import Camera

WINDOW = (160, 90)

#: A few dozen float64 operations.
EXACT = 1e-10


def any_camera(rng):
    return strategies.random_camera(rng, strategies.random_bounds(rng))


def test_far_and_huge_worlds_keep_their_digits():
    """An eye 1e9 away from zero looking at what is beside it: the offset is subtracted first.

    Of 1e200, squares would overflow: axes were zeros, found by fuzzing.
    """
    far = np.array([1e9, -1e9, 1e9])
    matrix = np.eye(4)
    matrix[:3, 3] = far
    camera = Camera(np.add(far, [0, 0, 5]), far, (0, 1, 0), model_transform=matrix)
    near = Camera((0, 0, 5), (0, 0, 0), (0, 3, 1))  # view_up need not be perpendicular
    np.testing.assert_array_equal(camera.model_to_view, near.model_to_view)
    np.testing.assert_allclose(near.axes, [[1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-15)
    for scale in (1e-9, 1e9, 1e200):
        model = np.diag([scale, scale, scale, 1])
        camera = Camera((0, 0, scale), (0, 0, -scale), (0, 1, 0), model_transform=model)
        np.testing.assert_array_equal(camera.axes, near.axes)
        assert camera.model_to_view[0, 0] == scale


@pytest.mark.parametrize("parallel", [False, True])
@given(rng=GENERATORS)
def test_list_coordinates(parallel, rng):
    """u = X / (Z t_x) - c_x in perspective, X / s_x - c_x in parallel projection; v alike. Rays
    pass through theirs at every depth."""
    camera = any_camera(rng).replace(parallel_projection=parallel)
    x, y, z = np.add(rng.uniform(-1, 1, size=3), [0, 0, 3])
    (cx, cy), (width, height) = camera.window_center, WINDOW
    tangent = math.tan(math.radians(camera.view_angle) / 2)
    horizontal = camera.use_horizontal_view_angle and not parallel
    half_height = camera.parallel_scale if parallel else tangent
    half_height *= height / width if horizontal else 1
    half_width = half_height * width / height
    assert camera.half_extent(WINDOW) == pytest.approx((half_width, half_height), rel=EXACT)
    depth = 1 if parallel else z
    expected = [x / (depth * half_width) - cx, y / (depth * half_height) - cy, z]
    ud, vd, found, d = camera.viewport_matrix(WINDOW) @ [x, y, z, 1]
    np.testing.assert_allclose([ud / d, vd / d, found], expected, rtol=EXACT, atol=EXACT)
    assert d == depth
    origin, direction = camera.ray_coefficients(WINDOW)
    u, v, depth = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.5, 9)
    point = np.array([1, u, v]) @ origin + depth * (np.array([1, u, v]) @ direction)
    ud, vd, found, d = camera.viewport_matrix(WINDOW) @ [*point, 1]
    np.testing.assert_allclose([ud / d, vd / d, found], [u, v, depth], rtol=EXACT, atol=EXACT)


def vtk_camera(camera):
    pytest.importorskip("pyvista")
    from pyvista_vdi.vtk_pipeline.vtk import vtkCamera

    other = vtkCamera()
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
def test_a_vtk_camera_is_read_as_it_is(rng):
    """A world point falls on the same place of the window as VTK's projection puts it, too."""
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
    read = Camera.from_any(other, model_transform=camera.model_transform)
    for name in ("position", "focal_point", "window_center"):
        np.testing.assert_allclose(getattr(read, name), getattr(camera, name), atol=1e-12)
    np.testing.assert_allclose(read.axes, camera.axes, atol=1e-9)
    assert read.half_extent(WINDOW) == pytest.approx(camera.half_extent(WINDOW))
    assert read.parallel_projection == camera.parallel_projection
    assert Camera.from_any(other).model_transform.tolist() == np.eye(4).tolist()


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
