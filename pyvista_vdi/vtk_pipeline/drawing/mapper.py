"""``VDIMapper``: a real VTK volume mapper that draws a raycast VDI.

VTK does not call Python overrides of C++ methods, so nothing here overrides ``Render``. The mapper
is VTK's GPU ray caster on a proxy image of 2 x 2 x 2 voxels that has the VDI's bounds; observers
on its start and end events have the image of exactly this frame raycast and bound as a texture,
and the fragment shader that ``VDIActor`` installs looks it up.
"""

from __future__ import annotations

from typing import Any

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.drawing.driver import Driver
from pyvista_vdi.vtk_pipeline.drawing.settings import OF_MAPPERS, add_settings, refuse
from pyvista_vdi.vtk_pipeline.filters.source import VDISource, input_of
from pyvista_vdi.vtk_pipeline.vtk import vtkOpenGLGPUVolumeRayCastMapper

#: Coarsest preview by default: every fourth pixel along each edge. VTK's default is 10.
COARSEST = 4.0


class VDIMapperMethods:
    """What makes a GPU volume mapper draw a VDI; mixed into VTK's and into PyVista's."""

    #: What draws; made with the mapper, before which PyVista's constructor sets some settings.
    driver: Any = None

    def __init__(self: Any, **given: Any) -> None:
        super().__init__(**given)  # type: ignore[misc]
        self.driver: Driver = Driver()
        super().SetAutoAdjustSampleDistances(0)  # type: ignore[misc]
        super().SetImageSampleDistance(1.0)  # type: ignore[misc]
        self.SetMaximumImageSampleDistance(COARSEST)
        super().SetScalarModeToUsePointData()  # type: ignore[misc]
        super().SetInputConnection(self.driver.box.GetOutputPort())  # type: ignore[misc]
        # Methods of what does not hold the mapper, which they get from VTK
        self.AddObserver("VolumeMapperRenderStartEvent", self.driver.begin)
        self.AddObserver("VolumeMapperRenderEndEvent", self.driver.end)

    def SetSampleDistance(self, distance: float) -> None:
        """Set the length of a step, model units, from which the VDI is regenerated."""
        source = self.GetSource()
        if source is None:
            raise UnsupportedError(
                "a VDI without its volume keeps its steps: generate another from the volume"
            )
        source.SetSampleDistance(distance)

    def GetSampleDistance(self: Any) -> float:
        """Return the length of a step, model units; VTK's default where none was set."""
        source = self.GetSource()
        set_by_hand = None if source is None else source.GetSampleDistance()
        return super().GetSampleDistance() if set_by_hand is None else set_by_hand  # type: ignore[misc]

    def SetInputData(self: Any, data: Any) -> None:
        """Draw a VDI, its canonical image, a series (:attr:`VDIActor.player`) or a set of VDIs."""
        self.driver.set_input(None if data is None else input_of(data))
        self.Modified()

    SetVDI = SetInputData

    def SetInputConnection(self, *args: Any) -> None:
        """Draw what a :class:`VDISource` (or a reader of canonical images) makes."""
        self.SetInputData(args[-1])

    SetInputDataObject = SetInputConnection

    def RemoveInputConnection(self, *args: Any) -> None:
        """Draw nothing any more; RemoveAllInputConnections and RemoveAllInputs do the same."""
        self.SetInputData(None)

    RemoveAllInputConnections = RemoveAllInputs = RemoveInputConnection

    def GetDataSetInput(self) -> Any:
        """Return the volume that the VDI is made of; without one, the box of the VDI's bounds."""
        source = self.GetSource()
        volume = None if source is None else source.GetInputDataObject(0, 0)
        return self.driver.box.image if volume is None else volume

    GetInput = GetDataObjectInput = GetDataSetInput

    def GetVDI(self) -> VDI | None:
        """Return the VDI that was drawn last, or would be drawn; ``None`` before the first."""
        source = self.driver.input
        if source is None:
            return None
        return source.last if isinstance(source, VDISource) else source.vdi()

    def GetSource(self) -> VDISource | None:
        """Return the :class:`VDISource` at the input, if it is one."""
        source = self.driver.input
        return source if isinstance(source, VDISource) else None

    # VTK's own switch would draw its volume into a smaller framebuffer

    def AutoAdjustSampleDistancesOn(self: Any) -> None:
        """Draw previews."""
        self.SetAutoAdjustSampleDistances(True)

    def AutoAdjustSampleDistancesOff(self: Any) -> None:
        """Draw every frame in full."""
        self.SetAutoAdjustSampleDistances(False)


refuse(VDIMapperMethods, OF_MAPPERS)
add_settings(VDIMapperMethods)


class VDIMapper(VDIMapperMethods, vtkOpenGLGPUVolumeRayCastMapper):
    """The mapper of a :class:`VDIActor`: draws a VDI in a VTK renderer.

    The input is a :class:`VDISource` (``SetInputConnection``), a VDI in its canonical form
    (``SetInputData``) or a :class:`~pyvista_vdi.VDI` (``SetVDI``). Before each frame it brings
    the input up to date and raycasts it from the frame's view, ending rays at opaque geometry;
    an image is kept as long as view, depth and VDI stay the same. Clipping planes
    (``AddClippingPlane``), cropping (``SetCropping`` and its regions) and the opacity multiplier
    act on the next frame without another VDI. What of VTK's mapper a VDI has no place for, such as
    other blending modes and masks, is refused by the method's name.

    Notes
    -----
    A problem while drawing is reported once as a ``VDIWarning`` and the last good image stays:
    exceptions cannot pass through VTK's renderer. Where nothing is left to draw, nothing is shown.
    """

    def __init__(self) -> None:  # VTK's would set by name what is refused here
        super().__init__()
