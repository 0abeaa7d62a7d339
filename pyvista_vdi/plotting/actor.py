"""The plotter's own actor and mapper: VDIActor and VDIMapper as PyVista's classes."""

from __future__ import annotations

from typing import Any

from pyvista.plotting.mapper import OpenGLGPUVolumeRayCastMapper
from pyvista.plotting.volume import Volume

from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods
from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapperMethods


class PlotterVDIMapper(VDIMapperMethods, OpenGLGPUVolumeRayCastMapper):
    """A VDI mapper with the lookup table and scalar range that scalar bars read.

    Parameters
    ----------
    theme : pyvista.plotting.themes.Theme, optional
        The plotter's.
    """

    def __init__(self, theme: Any = None) -> None:
        super().__init__(theme=theme)
        self._become_vdi_mapper()


class PlotterVDIActor(VDIActorMethods, Volume):
    """What ``Plotter.add_vdi`` returns: a ``pyvista.Volume`` with :attr:`vdi`."""

    _held_mapper: Any = None

    def __init__(self) -> None:
        super().__init__()
        self._become_vdi_actor()

    def SetMapper(self, mapper: Any) -> None:  # noqa: N802
        """Set the mapper, and hold it: PyVista's lose their lookup table with the last reference.

        Parameters
        ----------
        mapper : PlotterVDIMapper or None
            Of this actor alone.
        """
        super().SetMapper(mapper)
        self._held_mapper = mapper

    def copy(self, deep: bool = True) -> PlotterVDIActor:
        """Return another actor that shows the same VDI, with a mapper of its own.

        Parameters
        ----------
        deep : bool
            Copy the volume property as well. A VDI is never copied: it does not change.
        """
        other = PlotterVDIActor()
        other.ShallowCopy(self)
        mapper = PlotterVDIMapper(theme=self.mapper._theme)
        mapper.lookup_table = self.mapper.lookup_table
        mapper.scalar_range = self.mapper.scalar_range
        if self.mapper.painter.input is not None:
            mapper.painter.set_input(self.mapper.painter.input.shared())
        mapper.SetDevice(self.mapper.GetDevice())
        mapper.painter.take_settings(self.mapper.painter)
        mapper.SetCropping(self.mapper.GetCropping())
        mapper.SetCroppingRegionPlanes(self.mapper.GetCroppingRegionPlanes())
        mapper.SetCroppingRegionFlags(self.mapper.GetCroppingRegionFlags())
        other.SetMapper(mapper)
        if deep:
            prop = self.GetProperty()
            copied = type(prop)()  # an actor without its volume has a plain vtkVolumeProperty
            copied.DeepCopy(prop)
            other.SetProperty(copied)
        return other
