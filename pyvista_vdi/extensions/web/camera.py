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
    """Return any camera, or a dictionary of that form, as ``viewer.camera`` takes it.

    It has ``position``, ``focal_point``, ``view_up``, and ``view_angle`` (vertical, degrees) or
    ``parallel_scale``; ``window_center`` where it is not the middle. ``window_size``: of its
    picture, which turns a horizontal opening angle into a vertical one. InvalidCameraError if it is
    no camera, or has other entries or values.
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
    """Return the camera that a dictionary of the viewer's form describes; InvalidCameraError."""
    unknown = sorted(set(state) - set(_ENTRIES))
    if unknown:
        raise InvalidCameraError(
            f"a viewer's camera has {', '.join(_ENTRIES)}; got {', '.join(unknown)}"
        )
    parallel = "parallel_scale" in state
    return Camera.from_dict({**state, "parallel_projection": parallel})
