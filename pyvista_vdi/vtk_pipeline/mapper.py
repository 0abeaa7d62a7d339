"""``VDIMapper``: a real VTK volume mapper that draws a raycast VDI.

VTK does not call Python overrides of C++ methods, so nothing here overrides ``Render``. The mapper
is VTK's GPU ray caster on a proxy image of 2 x 2 x 2 voxels that has the VDI's bounds; observers
on its start and end events have the image of exactly this frame raycast and bound as a texture,
and the fragment shader that ``VDIActor`` installs looks it up.
"""

from __future__ import annotations

from typing import Any, NoReturn

from vtkmodules.vtkRenderingVolumeOpenGL2 import vtkOpenGLGPUVolumeRayCastMapper

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.vdi import VDI
from pyvista_vdi.vtk_pipeline.inputs import Input, SourceInput, input_of, input_of_port
from pyvista_vdi.vtk_pipeline.painter import Painter
from pyvista_vdi.vtk_pipeline.source import VDISource


def _on_start(mapper: Any, event: str) -> None:
    mapper.painter.begin(mapper)


def _on_end(mapper: Any, event: str) -> None:
    mapper.painter.end()


class VDIMapperMethods:
    """What makes a GPU volume mapper draw a VDI; mixed into VTK's and into PyVista's."""

    _painter: Painter | None = None

    def _become_vdi_mapper(self: Any) -> None:
        """Install proxy and observers; to be called once, from ``__init__``."""
        self._painter = Painter()
        self.AutoAdjustSampleDistancesOff()  # or VTK draws into a smaller framebuffer
        self.SetImageSampleDistance(1.0)
        super().SetInputDataObject(self._painter.proxy)  # type: ignore[misc]
        # Plain functions: they get the mapper from VTK and hold nothing
        self.AddObserver("VolumeMapperRenderStartEvent", _on_start)
        self.AddObserver("VolumeMapperRenderEndEvent", _on_end)

    @property
    def painter(self) -> Painter:
        """What draws; made with the mapper."""
        assert self._painter is not None
        return self._painter

    # -- input -----------------------------------------------------------------------------------

    def SetInputConnection(self, *args: Any) -> None:
        """Draw what a :class:`VDISource` (or a reader of canonical images) makes."""
        port = args[-1]
        self._set_input(None if port is None else input_of_port(port))

    def SetInputDataObject(self, *args: Any) -> None:
        """Draw a VDI in its canonical form."""
        self.SetInputData(args[-1])

    def SetInputData(self, data: Any) -> None:
        """Draw a VDI, or its canonical image."""
        self._set_input(None if data is None else input_of(data))

    def SetVDI(self, vdi: VDI) -> None:
        """Draw this VDI."""
        self._set_input(input_of(vdi))

    def GetVDI(self) -> VDI | None:
        """Return the VDI that was drawn last, or would be drawn; ``None`` before the first."""
        source = self.painter.input
        if source is None:
            return None
        return source.last() if isinstance(source, SourceInput) else source.vdi()

    def GetSource(self) -> VDISource | None:
        """Return the :class:`VDISource` at the input, if it is one."""
        source = self.painter.input
        return source.source if isinstance(source, SourceInput) else None

    def SetDevice(self, device: Any) -> None:
        """Choose the OpenCL device that raycasts; ``None`` is the default one."""
        self.painter.device = device

    def GetDevice(self) -> Any:
        """Return the device as it was set."""
        return self.painter.device

    def SetAutomaticView(self, automatic: bool) -> None:
        """Give a source without camera the view of the first frame (on by default)."""
        self.painter.automatic_view = bool(automatic)

    def GetAutomaticView(self) -> bool:
        """Whether a source without camera gets the view of the first frame."""
        return self.painter.automatic_view

    def _set_input(self: Any, source: Input | None) -> None:
        self.painter.set_input(source)
        self.Modified()

    # -- what a VDI cannot honour ----------------------------------------------------------------

    def SetBlendMode(self: Any, mode: int) -> None:
        """Accept composite blending only."""
        if mode != self.COMPOSITE_BLEND:
            _refuse_blending()

    def SetBlendModeToMaximumIntensity(self) -> NoReturn:
        """Refuse."""
        _refuse_blending()

    def SetBlendModeToMinimumIntensity(self) -> NoReturn:
        """Refuse."""
        _refuse_blending()

    def SetBlendModeToAverageIntensity(self) -> NoReturn:
        """Refuse."""
        _refuse_blending()

    def SetBlendModeToAdditive(self) -> NoReturn:
        """Refuse."""
        _refuse_blending()

    def SetBlendModeToIsoSurface(self) -> NoReturn:
        """Refuse."""
        _refuse_blending()

    def SetBlendModeToSlice(self) -> NoReturn:
        """Refuse."""
        _refuse_blending()

    def SetCropping(self, on: int) -> None:
        """Refuse to crop; ``SetCropping(0)`` is accepted."""
        if on:
            self.CroppingOn()

    def CroppingOn(self) -> NoReturn:
        """Refuse."""
        raise UnsupportedError("a VDI cannot be cropped: use clipping planes (AddClippingPlane)")

    def SetMaskInput(self, mask: Any) -> None:
        """Refuse a mask; ``SetMaskInput(None)`` is accepted."""
        if mask is not None:
            raise UnsupportedError(
                "a VDI cannot be masked when it is drawn: set masked voxels to a transparent "
                "value before it is generated"
            )


def _refuse_blending() -> NoReturn:
    raise UnsupportedError(
        "a VDI stores what is composited along a ray, so only composite blending is supported"
    )


class VDIMapper(VDIMapperMethods, vtkOpenGLGPUVolumeRayCastMapper):
    """Draws a VDI in a VTK renderer, behind a :class:`VDIActor`.

    The input is a :class:`VDISource` (``SetInputConnection``), a VDI in its canonical form
    (``SetInputData``) or a :class:`~pyvista_vdi.VDI` (``SetVDI``). Before each frame it brings
    the input up to date and raycasts it from the frame's view, ending rays at opaque geometry;
    an image is kept as long as view, depth and VDI stay the same. Clipping planes
    (``AddClippingPlane``) are honoured; other blending modes, cropping and masks are refused.

    Notes
    -----
    A problem while drawing is reported once as a ``VDIWarning`` and the last good image stays:
    exceptions cannot pass through VTK's renderer.
    """

    def __init__(self) -> None:
        self._become_vdi_mapper()
