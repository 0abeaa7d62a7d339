"""The properties of a view, which two of the plugin's filters have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pyvista_vdi.extensions.paraview.parts.client import Client, say
from pyvista_vdi.extensions.paraview.parts.properties import CAMERA, CAMERA_PROPERTIES
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm


def _of_lens(name: str, kind: Callable[[Any], Any] = lambda value: value) -> Any:
    """Return a method that sets one of the camera's arguments, a number or three."""

    def set_it(self: Any, *value: Any) -> None:
        self._change("_lens", {**self._lens, name: value if len(value) > 1 else kind(value[0])})

    return set_it


class Looking(Algorithm):
    """The properties of a view: an algorithm with ``SetCamera`` gets them as a camera."""

    def __init__(self) -> None:
        super().__init__()
        self._camera_chosen = False
        self._lens: dict[str, Any] = {
            "position": (0.0, 0.0, 1.0),
            "focal_point": (0.0, 0.0, 0.0),
            "view_up": (0.0, 1.0, 0.0),
        }

    def SetView(self, which: int) -> None:
        """Choose between the default view and the camera properties."""
        self._change("_camera_chosen", which == CAMERA)

    SetCameraPosition = _of_lens("position")
    SetCameraFocalPoint = _of_lens("focal_point")
    SetCameraViewUp = _of_lens("view_up")
    SetCameraViewAngle = _of_lens("view_angle")
    SetCameraParallelProjection = _of_lens("parallel_projection", bool)
    SetCameraParallelScale = _of_lens("parallel_scale")

    def SetSize(self, width: int, height: int) -> None:
        """Set the window; 0 is the default one."""
        self.SetWindowSize((width, height) if width and height else None)

    def SetDeviceName(self, name: str | None) -> None:
        """Choose the OpenCL device; empty is the default one."""
        self.SetDevice(name or None)

    def TakeActiveView(self) -> None:
        """Copy the active view's camera and size into the properties."""
        client = Client.of(self)
        if client is None:
            return
        view = client.manager.GetSelectionModel("ActiveView").GetCurrentProxy()
        if view is None or view.GetProperty("CameraPosition") is None:
            say(self, "the active view is no render view: click into one, or type its camera in")
            return
        view.SynchronizeCameraProperties()
        client.set("View", [CAMERA])
        for name in CAMERA_PROPERTIES:
            client.set(name, client.values(name, view))
        client.set("WindowSize", client.values("ViewSize", view))
        client.set("Azimuth", [0.0])
        client.set("Elevation", [0.0])
        client.proxy.UpdateVTKObjects()

    def _given_camera(self) -> Any:
        # Made as late as this: set one at a time, the properties may pass through no camera at all
        return Camera(**self._lens) if self._camera_chosen else None
