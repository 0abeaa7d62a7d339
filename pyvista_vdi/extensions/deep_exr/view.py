"""OpenEXR's matrices of a view, and the view that they describe.

The standard's frames (https://openexr.com/en/latest/StandardAttributes.html): camera space has x to
the right, y up and z forward, as our view space; NDC is (0, 0) at the upper left and (1, 1) at the
lower right corner of the display window. Its matrices multiply row vectors; here they are
transposed, for columns.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.model.camera import Camera

Matrix = NDArray[np.float64]

#: How far two numbers of a foreign matrix may be from agreeing: it is made of float32, and the
#: eye's distance from the world's origin may have cost digits.
_TOLERANCE = 1e-3


def view_matrices(
    camera: Camera, window_size: tuple[int, int], depth_shift: float
) -> tuple[Matrix, Matrix]:
    """Return worldToCamera and worldToNDC for column vectors, float64 (4, 4) each.

    ``depth_shift``: world units by which the eye is moved back, for parallel projections.
    """
    to_camera = camera.view_matrix
    to_camera[2, 3] += depth_shift
    # x = (u + 1) / 2, y = (1 - v) / 2, both times the denominator d
    to_ndc = np.array([[0.5, 0, 0, 0.5], [0, -0.5, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]])
    return to_camera, to_ndc @ camera.viewport_matrix(window_size) @ to_camera


def camera_from_matrices(
    to_camera: Any, to_ndc: Any, window_size: tuple[int, int], depth: float
) -> Camera:
    """Return the view that a foreign file's matrices for column vectors describe.

    ``to_ndc`` says all of a perspective view; a parallel one needs both. ``depth`` is that of
    the focal point, about which the view is turned.
    """
    if to_ndc is None:
        raise InvalidCameraError("the attribute worldToNDC is missing")
    if not np.isfinite(to_ndc).all() or not (to_camera is None or np.isfinite(to_camera).all()):
        raise InvalidCameraError("worldToNDC or worldToCamera are not finite")
    x, y, d = to_ndc[[0, 1, 3]]
    across, upwards = 2 * x - d, d - 2 * y  # (u, v) times the denominator d
    parallel = np.linalg.norm(d[:3]) <= 1e-6 * np.linalg.norm(across[:3])
    if parallel:
        right, up, forward, eye, half, center = _parallel_view(across, upwards, d, to_camera)
    else:
        right, up, forward, eye, half, center = _perspective_view(across, upwards, d, to_camera)
    _check_axes(right, up, forward)
    aspect = window_size[0] / window_size[1]
    if not abs(half[0] / (half[1] * aspect) - 1) < _TOLERANCE:
        raise InvalidCameraError(
            f"worldToNDC has a viewport of {half[0] / half[1]:.6g} to 1, but the display window "
            f"is {window_size[0]} x {window_size[1]}: its pixels are not square"
        )
    return Camera(
        eye,
        eye + forward * (depth if depth > 0 else 1.0),
        up,
        view_angle=30.0 if parallel else 2 * math.degrees(math.atan(half[1])),
        parallel_projection=parallel,
        parallel_scale=half[1] if parallel else 1.0,
        window_center=center,
    )


def bounds_of_lists(
    camera: Camera,
    window_size: tuple[int, int],
    counts: NDArray[Any],
    nearest: NDArray[np.float64],
    farthest: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return axis-aligned bounds of everything in the lists, in the model frame; float64 (6,).

    ``nearest`` and ``farthest``: view depth of the first front and the last back of every list
    that is not empty.
    """
    width, height = window_size
    rows, columns = np.nonzero(counts)
    to_model = np.linalg.inv(camera.model_to_view)
    if len(rows) == 0:
        return np.repeat(to_model[:3, 3], 2)
    origin, direction = camera.ray_coefficients(window_size)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for right, top, depth in itertools.product((0, 1), (0, 1), (nearest, farthest)):
        u, v = 2 * (columns + right) / width - 1, 2 * (rows + top) / height - 1
        corner = np.stack([np.ones_like(u), u, v], axis=1)
        points = (corner @ origin + depth[:, None] * (corner @ direction)) @ to_model[:3, :3].T
        points += to_model[:3, 3]
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    margin = 1e-6 * np.linalg.norm(high - low)  # far above the rounding of these products
    return np.stack([low - margin, high + margin], axis=1).ravel()


def _perspective_view(
    across: Matrix, upwards: Matrix, d: Matrix, to_camera: Any
) -> tuple[Matrix, Matrix, Matrix, Matrix, tuple[float, float], tuple[float, float]]:
    """Return right, up, forward, eye, half extents and window centre.

    d is view depth but for a factor, u d is right / t_x - c_x forward, and so on: all three vanish
    at the eye.
    """
    rows = np.stack([across, upwards, d]) / np.linalg.norm(d[:3])
    if to_camera is not None and rows[2, :3] @ to_camera[2, :3] < 0:
        rows = -rows  # a projective matrix means the same with its sign changed
    try:
        eye = np.linalg.solve(rows[:, :3], -rows[:, 3])
    except np.linalg.LinAlgError as error:
        raise InvalidCameraError("worldToNDC has no eye: it flattens space") from error
    forward = rows[2, :3]
    center = (-float(rows[0, :3] @ forward), -float(rows[1, :3] @ forward))
    right, half_width = _direction(rows[0, :3] + center[0] * forward)
    up, half_height = _direction(rows[1, :3] + center[1] * forward)
    return right, up, forward, eye, (half_width, half_height), center


def _parallel_view(
    across: Matrix, upwards: Matrix, d: Matrix, to_camera: Any
) -> tuple[Matrix, Matrix, Matrix, Matrix, tuple[float, float], tuple[float, float]]:
    """Return the same; the window centre is part of the eye's place."""
    if to_camera is None:
        raise InvalidCameraError(
            "worldToNDC describes a parallel projection, whose depths only the attribute "
            "worldToCamera explains, which is missing"
        )
    if d[3] == 0:
        raise InvalidCameraError("worldToNDC has no viewport: its last column is 0")
    right, half_width = _direction(across[:3] / d[3])
    up, half_height = _direction(upwards[:3] / d[3])
    forward, _ = _direction(to_camera[2, :3])
    eye = -(
        right * (across[3] / d[3] * half_width)
        + up * (upwards[3] / d[3] * half_height)
        + forward * (to_camera[2, 3] / np.linalg.norm(to_camera[2, :3]))
    )
    return right, up, forward, eye, (half_width, half_height), (0.0, 0.0)


def _direction(gradient: Matrix) -> tuple[Matrix, float]:
    """Return the unit vector, and the length along which the coordinate grows by 1."""
    length = float(np.linalg.norm(gradient))
    if not length > 0:
        raise InvalidCameraError("worldToNDC or worldToCamera flatten space")
    return gradient / length, 1 / length


def _check_axes(right: Matrix, up: Matrix, forward: Matrix) -> None:
    if not np.allclose(np.cross(right, forward), up, atol=_TOLERANCE):
        raise InvalidCameraError(
            "worldToNDC describes no view of ours: its right, up and forward directions "
            f"{right.round(4).tolist()}, {up.round(4).tolist()} and {forward.round(4).tolist()} "
            "are not at right angles, or the picture is mirrored"
        )
