"""What algorithms share that classify by a volume property, whose changes they follow."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm, Held, watch
from pyvista_vdi.vtk_pipeline.filters.properties import check_property, color_function
from pyvista_vdi.vtk_pipeline.vtk import vtkVolumeProperty


class Classifying(Algorithm):
    """An algorithm that is out of date when its volume property is changed."""

    def __init__(self, **ports: Any) -> None:
        super().__init__(**ports)
        self._property: Held | None = None
        self._observed: list[tuple[Held, int]] = []

    def SetVolumeProperty(self, prop: vtkVolumeProperty | None) -> None:
        """Set the volume property; later changes to it make the output out of date.

        Raises
        ------
        UnsupportedError, InvalidArgumentError
            If it cannot be honoured: see ``transfer_function_from_property``. Functions without
            points may be filled later, before the next update.
        """
        if prop is not None:
            check_property(prop, rgba=not prop.GetIndependentComponents())
        if prop is not self.GetVolumeProperty():
            self._property = None if prop is None else Held(prop)
            self._observe_property()
            self.Modified()

    def GetVolumeProperty(self) -> vtkVolumeProperty | None:
        """Return the volume property."""
        return None if self._property is None else self._property.get()

    def _observe_property(self) -> None:
        """Modify this algorithm whenever the property or one of its functions is modified."""
        for watched, tag in self._observed:
            watched.get().RemoveObserver(tag)
        self._observed = []
        prop = self.GetVolumeProperty()
        if prop is None:
            return
        functions = [color_function(prop), prop.GetScalarOpacity()]
        if prop.HasGradientOpacity():
            functions.append(prop.GetStoredGradientOpacity())

        def changed(algorithm: Classifying) -> None:
            algorithm._observe_property()  # its functions may be others now
            algorithm.Modified()

        self._observed = [(Held(prop), watch(prop, self, changed))]
        for each in functions:
            self._observed.append((Held(each), watch(each, self, Algorithm.Modified)))
