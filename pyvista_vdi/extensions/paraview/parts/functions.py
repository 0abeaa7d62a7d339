"""What the plugin's filters have in common: ParaView's transfer functions, and a view."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import methodcaller
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import vtkColorTransferFunction, vtkVolumeProperty

from pyvista_vdi.extensions.paraview.parts.client import Client, say
from pyvista_vdi.extensions.paraview.parts.properties import CAMERA, CAMERA_PROPERTIES
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm, watch


class Functions(Algorithm):
    """The properties of transfer functions: the algorithm is out of date when one is changed.

    ``looks`` is a volume property with the functions that were copied into it last.
    """

    def __init__(self, **ports: Any) -> None:
        super().__init__(**ports)
        self._unit_distance: float | None = None
        self._functions: dict[str, Any] = {"color": None, "opacity": None}
        self._by_default: dict[str, Any] = {}
        self._observers: dict[str, int] = {}
        self.looks = vtkVolumeProperty()
        self.looks.SetColor(vtkColorTransferFunction())
        self.looks.SetScalarOpacity(vtkPiecewiseFunction())
        self._copied: Any = None

    def SetColorFunction(self, function: Any) -> None:
        """Set ParaView's colour transfer function, or ``None`` for the default."""
        self._follow("color", function)

    def SetOpacityFunction(self, function: Any) -> None:
        """Set ParaView's opacity transfer function, or ``None`` for the default."""
        self._follow("opacity", function)

    def SetUnitDistance(self, distance: float) -> None:
        """Set where opacities hold; 0 is the default."""
        self._unit_distance = distance or None
        self.Modified()

    def _follow(self, role: str, function: Any) -> None:
        """Be out of date whenever a transfer function changes."""
        before = self._functions[role]
        if before is not None:
            before.RemoveObserver(self._observers.pop(role))
        self._functions[role] = function
        if function is not None:
            self._observers[role] = watch(function, self, methodcaller("Modified"))
        self.Modified()

    def take_looks(self, name: str, ends: Sequence[float], unit_distance: float) -> None:
        """Take the given colours and opacities as they are now.

        By default they are those that ParaView has for the array of that ``name``, which are
        followed; with a server of its own ramps over ``ends``, the least and the largest scalar.
        What has not changed since is not copied again: it would look like another look.
        """
        client = Client.of(self, silent=True)
        if client is not None:
            proxies = functions_of_array(client, name, ends)
            for role, proxy in zip(self._functions, proxies, strict=True):
                function, before = proxy.GetClientSideObject(), self._functions[role]
                if before in (None, self._by_default.get(role)) and before is not function:
                    self._follow(role, function)
                    self._by_default[role] = function
        functions, distance = [*self._functions.values()], self._unit_distance or unit_distance
        of_functions = [f and (f.GetAddressAsString(""), f.GetMTime()) for f in functions]
        copied = (*of_functions, tuple(ends), distance)
        if copied == self._copied:
            return
        self._copied = copied
        ramp, slope = vtkColorTransferFunction(), vtkPiecewiseFunction()
        for x, share in zip(ends, (0.0, 1.0), strict=True):
            ramp.AddRGBPoint(x, share, share, share)
            slope.AddPoint(x, share)
        # A plain copy, not ParaView's object: that one gives as few colours as its table holds,
        # which its volumes do not show either
        self.looks.GetRGBTransferFunction().DeepCopy(functions[0] or ramp)
        self.looks.GetScalarOpacity().DeepCopy(functions[1] or slope)
        self.looks.SetScalarOpacityUnitDistance(distance)


def functions_of_array(client: Client, name: str, ends: Sequence[float]) -> list[Any]:
    """Return the proxies of the colours and opacities that ParaView has for an array.

    They lie over ``ends`` where ParaView has shown the array nowhere yet.
    """
    from paraview.modules.vtkRemotingViews import (
        vtkSMTransferFunctionManager,
        vtkSMTransferFunctionProxy,
    )

    functions = vtkSMTransferFunctionManager()
    color = functions.GetColorTransferFunction(name, client.manager)
    opacity = functions.GetOpacityTransferFunction(name, client.manager)
    if not client.values("ScalarRangeInitialized", color)[0]:
        for function in (color, opacity):
            vtkSMTransferFunctionProxy.RescaleTransferFunction(function, *ends)
    return [color, opacity]


def _of_lens(name: str, read: Callable[..., Any] = lambda *value: value) -> Any:
    """Return a method that sets one of the camera's arguments, a number or three."""

    def setter(self: Any, *value: Any) -> None:
        self._lens[name] = read(*value)
        self.Modified()

    return setter


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

    SetCameraPosition = _of_lens("position")
    SetCameraFocalPoint = _of_lens("focal_point")
    SetCameraViewUp = _of_lens("view_up")
    SetCameraViewAngle = _of_lens("view_angle", float)
    SetCameraParallelProjection = _of_lens("parallel_projection", bool)
    SetCameraParallelScale = _of_lens("parallel_scale", float)

    def SetView(self, which: int) -> None:
        """Choose the camera of the properties, or the default view."""
        self._camera_chosen = which == CAMERA
        self.Modified()

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
