"""ParaView's transfer functions, which the plugin's filters classify by, and follow."""

from __future__ import annotations

from collections.abc import Sequence
from operator import methodcaller
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import vtkColorTransferFunction, vtkVolumeProperty

from pyvista_vdi.extensions.paraview.parts.client import Client
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm, watch


class Looks:
    """A volume property with the functions that were copied into it last."""

    def __init__(self) -> None:
        self.prop = vtkVolumeProperty()
        self.prop.SetColor(vtkColorTransferFunction())
        self.prop.SetScalarOpacity(vtkPiecewiseFunction())
        self._copied: Any = None

    def copy(
        self, functions: Sequence[Any], ends: tuple[float, float], unit_distance: float
    ) -> None:
        """Take ParaView's colours and opacities as they are now; for ``None``, ramps over ``ends``.

        What has not changed since is not copied again: it would look like another look.
        """
        color, opacity = functions
        of_functions = [f and (f.GetAddressAsString(""), f.GetMTime()) for f in functions]
        copied = (*of_functions, ends, unit_distance)
        if copied == self._copied:
            return
        self._copied = copied
        ramp, slope = vtkColorTransferFunction(), vtkPiecewiseFunction()
        for x, share in zip(ends, (0.0, 1.0), strict=True):
            ramp.AddRGBPoint(x, share, share, share)
            slope.AddPoint(x, share)
        # A plain copy, not ParaView's object: that one gives as few colours as its table holds,
        # which its volumes do not show either
        self.prop.GetRGBTransferFunction().DeepCopy(color or ramp)
        self.prop.GetScalarOpacity().DeepCopy(opacity or slope)
        self.prop.SetScalarOpacityUnitDistance(unit_distance)


class Functions(Algorithm):
    """The properties of transfer functions: the algorithm is out of date when one is changed."""

    def __init__(self, **ports: Any) -> None:
        super().__init__(**ports)
        self._unit_distance: float | None = None
        self._functions: dict[str, Any] = {"color": None, "opacity": None}
        self._observers: dict[str, int] = {}

    def SetColorFunction(self, function: Any) -> None:
        """Set ParaView's colour transfer function, or ``None`` for the default."""
        self._follow("color", function)

    def SetOpacityFunction(self, function: Any) -> None:
        """Set ParaView's opacity transfer function, or ``None`` for the default."""
        self._follow("opacity", function)

    def SetUnitDistance(self, distance: float) -> None:
        """Set the scalar opacity unit distance; 0 is the default one."""
        self._change("_unit_distance", distance or None)

    def _follow(self, role: str, function: Any) -> None:
        """Be out of date whenever a transfer function changes."""
        before = self._functions[role]
        if before is not None:
            before.RemoveObserver(self._observers.pop(role))
        self._functions[role] = function
        if function is not None:
            changed = methodcaller("_function_changed")
            self._observers[role] = watch(function, self, changed)
        self.Modified()

    def _function_changed(self) -> None:
        self.Modified()


def functions_of_array(client: Client, name: str, ends: tuple[float, float] | None) -> list[Any]:
    """Return the proxies of the colours and opacities that ParaView has for an array.

    ``ends``: the least and the largest scalar, over which they then lie where ParaView has shown
    the array nowhere yet.
    """
    from paraview.modules.vtkRemotingViews import (
        vtkSMTransferFunctionManager,
        vtkSMTransferFunctionProxy,
    )

    functions = vtkSMTransferFunctionManager()
    color = functions.GetColorTransferFunction(name, client.manager)
    opacity = functions.GetOpacityTransferFunction(name, client.manager)
    if ends is not None and not client.values("ScalarRangeInitialized", color)[0]:
        for function in (color, opacity):
            vtkSMTransferFunctionProxy.RescaleTransferFunction(function, *ends)
    return [color, opacity]
