"""Styles that move actors (trackball and joystick actor): how a hand takes hold of a VDI.

They ask a cell picker of their own, which classifies the proxy's scalars: all transparent, and so a
VDI is looked through. For the moment in which a button goes down where a pick hits a VDI, what is
in front of it considered, its proxy has a scalar that is opaque.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pyvista_vdi.vtk_pipeline.vtk import numpy_to_vtk

_STYLES = ("vtkInteractorStyleTrackballActor", "vtkInteractorStyleJoystickActor")


class Grabbing:
    """What can be taken hold of in a window: ``window.shared(Grabbing)``."""

    def __init__(self) -> None:
        self._transparent: list[tuple[Any, Any]] = []  # point data and scalars of solid proxies

    def begin(self, drivers: list[Any], interactor: Any) -> None:
        """Make the proxies of VDIs under the pointer opaque: a button is pressed.

        Their scalars become opaque ones, so that a style's picker hits them.
        """
        self.end()  # another observer may have ended the last event before it came here
        style = interactor.GetInteractorStyle()
        if style is not None and style.IsA("vtkInteractorStyleSwitch"):
            style = style.GetCurrentStyle()
        if style is None or not any(style.IsA(name) for name in _STYLES):
            return
        x, y = interactor.GetEventPosition()
        renderer = interactor.FindPokedRenderer(x, y)
        there = [p for p in drivers if renderer in p.renderers()]
        hit = [p for p in there if p.actor.pick(x, y, renderer=renderer) is not None]
        for driver in hit:  # after the picks, which draw
            data = driver.proxy.GetPointData()
            solid = np.full((8, data.GetScalars().GetNumberOfComponents()), _opaque(driver.actor))
            self._transparent.append((data, data.GetScalars()))
            data.SetScalars(numpy_to_vtk(solid, deep=True))

    def end(self) -> None:
        """Make all transparent again."""
        for data, scalars in self._transparent:
            data.SetScalars(scalars)
        self._transparent.clear()


def _opaque(actor: Any) -> float:
    """Return the scalar that an actor's property makes most opaque."""
    function, node = actor.GetProperty().GetScalarOpacity(), [0.0] * 4
    best = (-1.0, 0.0)
    for i in range(function.GetSize()):
        function.GetNodeValue(i, node)
        best = max(best, (node[1], node[0]))
    return best[1]
