"""Cameras as the viewer's JavaScript has them: VTK's names, and no more than it draws by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.model.camera import Camera

#: Planes that the viewer clips a VDI to (MOST_CLIPPING_PLANES of viewer/shader.js).
MOST_PLANES = 24

_ENTRIES = (
    "position", "focal_point", "view_up", "view_angle", "parallel_scale", "window_center",
)  # fmt: skip


def viewer_camera(camera: Any, window_size: Sequence[int] = (1, 1)) -> dict[str, Any]:
    """Return a camera as ``viewer.camera`` takes it.

    Parameters
    ----------
    camera : Camera or vtkCamera or pyvista.Camera or dict
        The view. Its model transform has no place there.
    window_size : (int, int)
        Width and height of its picture, which turn a horizontal opening angle into a vertical one.

    Returns
    -------
    dict
        ``position``, ``focal_point``, ``view_up`` as lists of three floats, world units, and
        ``view_angle`` (vertical, degrees) in perspective or ``parallel_scale`` (half the height,
        world units) in parallel projection; ``window_center`` where it is not the middle.

    Raises
    ------
    InvalidCameraError
        If it is no camera, or a dictionary with other entries or values.
    """
    view = camera_of(camera) if isinstance(camera, dict) else Camera.from_any(camera)
    _, half_height = view.half_extent(window_size)
    state: dict[str, Any] = {name: list(getattr(view, name)) for name in _ENTRIES[:3]}
    if any(view.window_center):
        state["window_center"] = list(view.window_center)
    if view.parallel_projection:
        return {**state, "parallel_scale": half_height}
    if not view.use_horizontal_view_angle:  # to the last bit
        return {**state, "view_angle": view.view_angle}
    return {**state, "view_angle": 2 * math.degrees(math.atan(half_height))}


def camera_of(state: dict[str, Any]) -> Camera:
    """Return the camera that a dictionary of the viewer's form describes.

    Raises
    ------
    InvalidCameraError
        If an entry is unknown, missing or out of its range.
    """
    unknown = sorted(set(state) - set(_ENTRIES))
    if unknown:
        raise InvalidCameraError(
            f"a viewer's camera has {', '.join(_ENTRIES)}; got {', '.join(unknown)}"
        )
    parallel = "parallel_scale" in state
    return Camera.from_dict({**state, "parallel_projection": parallel})
