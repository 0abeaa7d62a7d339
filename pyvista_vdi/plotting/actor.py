"""The plotter's own actor and mapper: VDIActor and VDIMapper as PyVista's classes."""

from __future__ import annotations

from typing import Any

import pyvista as pv
from pyvista.plotting.mapper import OpenGLGPUVolumeRayCastMapper
from pyvista.plotting.volume import Volume

from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods
from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapperMethods
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image
from pyvista_vdi.vtk_pipeline.filters.view import framed
from pyvista_vdi.vtk_pipeline.vtk import vtkCamera, vtkImageData


class PlotterVDIMapper(VDIMapperMethods, OpenGLGPUVolumeRayCastMapper):
    """A VDI mapper with the lookup table and scalar range that scalar bars read.

    Parameters
    ----------
    theme : pyvista.plotting.themes.Theme, optional
        The plotter's.
    """

    @property
    def dataset(self) -> Any:
        """The volume that the VDI is made of; without one, a box of the VDI's bounds."""
        return pv.wrap(self.GetDataSetInput())

    @dataset.setter
    def dataset(self, volume: Any) -> None:
        self.SetInputData(volume)

    def SetInputData(self, data: Any) -> None:  # noqa: N802
        """Draw another volume as this one, or a VDI, or its canonical image."""
        source = self.GetSource()
        if source is None or not isinstance(data, vtkImageData) or is_vdi_image(data):
            super().SetInputData(data)
        else:
            source.SetInputDataObject(data)


class PlotterVDIActor(VDIActorMethods, Volume):
    """What ``Plotter.add_vdi`` returns: a ``pyvista.Volume`` with :attr:`vdi`."""

    def __repr__(self) -> str:
        """Return what is shown, and what of it the last frame drew."""
        if self.GetMapper() is None:
            return "PlotterVDIActor(without a mapper)"
        vdi, hidden = self.GetMapper().GetVDI(), "" if self.GetVisibility() else ", hidden"
        if vdi is None:
            return f"PlotterVDIActor(a volume, of which actor.vdi makes a VDI{hidden})"
        return f"PlotterVDIActor({vdi!r}{hidden})"

    def camera_to_come(self, renderer: Any) -> Any:
        """Return the camera of a renderer's next picture."""
        return first_camera(renderer, renderer.ComputeVisiblePropBounds())


def first_camera(renderer: Any, bounds: Any) -> Any:
    """Return the camera that a renderer of these bounds has in its next picture.

    A plotter resets those that nobody has set before the first one; the renderer's stays as it is.
    """
    camera = renderer.GetActiveCamera()
    if not isinstance(renderer, pv.Renderer) or camera.is_set:
        return camera
    # Of several that share a camera, the first resets it
    first = next(each for each in renderer.parent.renderers if each.GetActiveCamera() is camera)
    if first is not renderer:
        renderer, bounds = first, first.ComputeVisiblePropBounds()
    copied = vtkCamera()
    copied.DeepCopy(camera)
    position, focal_point, up = renderer.get_default_cam_pos()
    copied.SetPosition(position)
    copied.SetFocalPoint(focal_point)
    copied.SetViewUp(up)
    return framed(copied, renderer, bounds)
