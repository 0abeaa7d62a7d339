"""VTK's cameras, and the view that a renderer shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.view import View as View
from pyvista_vdi.vtk_pipeline.vtk import vtkMatrix4x4, vtkRenderer

#: Largest departure of a rotation from one, by rounding of its matrix.
_RIGID = 1e-9


def as_array(matrix: Any) -> NDArray[np.float64]:
    """Return a ``vtkMatrix4x4`` as float64 (4, 4)."""
    elements = [0.0] * 16
    matrix.DeepCopy(elements, matrix)  # GetData() gives Python an address before VTK 9.3
    return np.array(elements).reshape(4, 4)


def aim(theirs: Any, camera: Camera, matrix: NDArray[np.float64] | None = None) -> None:
    """Set a ``vtkCamera`` to a view of the model frame, which a prop's matrix, (4, 4), places.

    The model transform is in the camera: where it is rigid beside that matrix, the eye moves.
    """
    placed = camera.model_transform @ np.linalg.inv(np.eye(4) if matrix is None else matrix)
    turn = placed[:3, :3]
    rigid = np.abs(turn @ turn.T - np.eye(3)).max() <= _RIGID and np.linalg.det(turn) > 0
    back = np.linalg.inv(placed) if rigid else np.eye(4)
    position, focal_point = (
        (back @ (*point, 1))[:3] for point in (camera.position, camera.focal_point)
    )
    theirs.SetPosition(position)
    theirs.SetFocalPoint(focal_point)
    theirs.SetViewUp(back[:3, :3] @ camera.view_up)
    on_top = vtkMatrix4x4()
    on_top.DeepCopy((np.eye(4) if rigid else placed).ravel())
    theirs.SetModelTransformMatrix(on_top)
    theirs.SetUseHorizontalViewAngle(camera.use_horizontal_view_angle)
    theirs.SetViewAngle(camera.view_angle)
    theirs.SetParallelProjection(camera.parallel_projection)
    theirs.SetParallelScale(camera.parallel_scale)
    theirs.SetWindowCenter(*camera.window_center)
    if hasattr(theirs, "is_set"):  # PyVista's, which keeps this by itself
        theirs.parallel_projection, theirs.is_set = camera.parallel_projection, True


def framed(camera: Any, renderer: Any, bounds: Sequence[float]) -> Any:
    """Move a camera as the renderer's ``ResetCamera`` of these bounds would move its own."""
    scratch = vtkRenderer()
    scratch.SetActiveCamera(camera)
    scratch.SetAspect(renderer.GetTiledAspectRatio(), 1.0)
    if bounds[0] <= bounds[1]:
        scratch.ResetCamera(bounds)
    return camera


def camera_of(camera: Any, model_transform: ArrayLike | None = None) -> Camera:
    """Return a ``vtkCamera`` as a :class:`Camera` that sees a prop of this matrix, (4, 4).

    The camera's own model transform, which VTK applies to all that it sees, comes on top. Others
    than VTK's are returned as by :meth:`Camera.from_any`, whose errors it raises.
    """
    view = Camera.from_any(camera, model_transform=model_transform)
    if model_transform is None or isinstance(camera, Camera):
        return view
    on_top = as_array(camera.GetModelTransformMatrix())
    if (on_top == np.eye(4)).all():  # nearly always
        return view
    return view.replace(model_transform=on_top @ view.model_transform)


def size_of(renderer: Any) -> tuple[int, int]:
    """Return width and height of a renderer's picture in pixels, at least 1."""
    width, height = renderer.GetSize()
    return max(1, width), max(1, height)
