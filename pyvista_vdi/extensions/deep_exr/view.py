"""OpenEXR's matrices of a view, and the view that they describe.

The standard's frames (https://openexr.com/en/latest/StandardAttributes.html): camera space has x to
the right, y up and z forward, as our view space; NDC is (0, 0) at the upper left and (1, 1) at the
lower right corner of the display window. Its matrices multiply row vectors.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidCameraError, VDIFileError
from pyvista_vdi.model.camera import Camera

#: How far two numbers of a matrix may be from agreeing: it is made of float32, and the eye's
#: distance from the world's origin may have cost digits.
_TOLERANCE = 1e-3


def view_matrices(
    camera: Camera, window_size: tuple[int, int], depth_shift: float
) -> dict[str, NDArray[np.float32]]:
    """Return the matrices of a view by the names of their attributes, float32 (4, 4).

    ``depth_shift``: world units by which the eye is moved back, for parallel projections.
    """
    to_camera = camera.view_matrix
    to_camera[2, 3] += depth_shift
    # x = (u + 1) / 2, y = (1 - v) / 2, both times the denominator d
    to_ndc = np.array([[0.5, 0, 0, 0.5], [0, -0.5, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]])
    to_ndc = to_ndc @ camera.viewport_matrix(window_size) @ to_camera
    matrices = {"worldToCamera": to_camera, "worldToNDC": to_ndc}
    return {name: np.ascontiguousarray(m.T, np.float32) for name, m in matrices.items()}


def camera_of(
    header: dict[str, Any], window_size: tuple[int, int], depth: float, path: Any
) -> Camera:
    """Return the view that a header's matrices describe; VDIFileError where they describe none.

    ``depth`` is that of the focal point, about which the view is turned.
    """
    try:
        to_camera, to_ndc = (np.array(header[n], float).T for n in ("worldToCamera", "worldToNDC"))
        x, y, _, d = to_ndc @ np.linalg.inv(to_camera)
        # Of camera space: (u, v) of the viewport times the denominator, depth or constant
        u, v = 2 * x - d, d - 2 * y
        parallel = bool(abs(d[2]) <= 1e-6 * abs(u[0]))
        of_d = 3 if parallel else 2
        half, axes = d[of_d] / v[1], to_camera[:3, :3]
        eye = -axes.T @ to_camera[:3, 3]
        view = Camera(
            eye,
            eye + axes[2] * (depth or 1.0),
            axes[1],
            view_angle=30.0 if parallel else 2 * math.degrees(math.atan(half)),
            parallel_projection=parallel,
            parallel_scale=half if parallel else 1.0,
            window_center=-np.array((u[of_d], v[of_d])) / d[of_d],
        )
        # A camera has right angles, no mirror and square pixels: then its matrices are the same
        made = view_matrices(view, window_size, 0.0)
        again = np.vstack([made["worldToCamera"].T[:3, :3], made["worldToNDC"].T[[0, 1, 3], :3]])
        found = np.vstack([axes, to_ndc[[0, 1, 3], :3] / d[of_d]])
        if not np.allclose(found, again, atol=_TOLERANCE * np.abs(again).max()):
            raise InvalidCameraError("they shear, scale or mirror, or pixels are not square")
    except (LookupError, ValueError, InvalidCameraError) as error:
        raise VDIFileError(
            f"{path} does not say from where its image is seen, by worldToCamera and worldToNDC "
            f"({error!r}): give the view: read(..., camera=...)"
        ) from error
    return view


def bounds_of_lists(
    camera: Camera, counts: NDArray[Any], depths: list[float]
) -> NDArray[np.float64]:
    """Return axis-aligned bounds of the lists that are not empty, in the model frame; float64 (6,).

    ``counts``: supersegments of each list, (H, W). ``depths``: view depth of the nearest front and
    the farthest back.
    """
    to_model = np.linalg.inv(camera.model_to_view)
    if not counts.any():
        return np.repeat(to_model[:3, 3], 2)
    u, v = (
        2 * (np.flatnonzero(filled)[[0, -1]] + (0, 1)) / filled.size - 1
        for filled in (counts.any(axis=0), counts.any(axis=1))
    )
    corners = np.array([(1, a, b) for a in u for b in v])
    origin, direction = camera.ray_coefficients(counts.shape[::-1])
    points = np.concatenate([corners @ origin + z * (corners @ direction) for z in depths])
    points = points @ to_model[:3, :3].T + to_model[:3, 3]
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 1e-6 * np.linalg.norm(high - low)  # far above the rounding of these products
    return np.stack([low - margin, high + margin], axis=1).ravel()
