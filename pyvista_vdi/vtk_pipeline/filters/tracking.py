"""A ``vtkCamera`` that a :class:`VDISource` follows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import ArrayLike
from vtkmodules.vtkCommonCore import vtkWeakReference

from pyvista_vdi.model.camera import Camera


class TrackedCamera:
    """A camera, and whether it has moved since it was last read.

    Parameters
    ----------
    camera : vtkCamera
        It is kept.
    model_transform : array_like, shape (4, 4), optional
        Where the volume stands in its world.
    source : VDISource
        Held weakly.
    """

    def __init__(self, camera: Any, model_transform: ArrayLike | None, source: Any) -> None:
        self.camera = camera
        self._model_transform = model_transform
        self._pose = _pose(camera)
        self._source = vtkWeakReference()
        self._source.Set(source)
        self._tag: int | None = None

    def watch(self, moved: Callable[[Any], None] | None) -> None:
        """Call ``moved(source)`` whenever the camera has moved; ``None`` ends it."""
        if self._tag is not None:
            self.camera.RemoveObserver(self._tag)
            self._tag = None
        if moved is None:
            return
        weak, seen = self._source, [_pose(self.camera)]

        def changed(camera: Any, _: str) -> None:
            pose, source = _pose(camera), weak.Get()
            # Renderers modify their cameras in every frame, by the clipping range
            if source is not None and pose != seen[0]:
                seen[0] = pose
                moved(source)

        self._tag = self.camera.AddObserver("ModifiedEvent", changed)

    @property
    def has_moved(self) -> bool:
        """Whether it stands elsewhere than it did when it was read."""
        return _pose(self.camera) != self._pose

    def read(self) -> Camera:
        """Return the view as it is now.

        Raises
        ------
        InvalidCameraError, UnsupportedError
            See :meth:`Camera.from_any`.
        """
        view = Camera.from_any(self.camera, model_transform=self._model_transform)
        self._pose = _pose(self.camera)
        return view


def _pose(camera: Any) -> tuple[Any, ...]:
    """Return everything that makes another view; not checked, a camera on its way may be none."""
    transform = camera.GetUserViewTransform()
    return (
        camera.GetPosition(),
        camera.GetFocalPoint(),
        camera.GetViewUp(),
        camera.GetViewAngle(),
        camera.GetUseHorizontalViewAngle(),
        camera.GetParallelProjection(),
        camera.GetParallelScale(),
        camera.GetWindowCenter(),
        camera.GetViewShear(),
        camera.GetUseOffAxisProjection(),
        camera.GetUseExplicitProjectionTransformMatrix(),
        tuple(camera.GetModelTransformMatrix().GetData()),
        0 if transform is None else transform.GetMTime(),
    )
