"""``VDIMapper``: a real VTK volume mapper that draws a raycast VDI.

VTK does not call Python overrides of C++ methods, so nothing here overrides ``Render``. The mapper
is VTK's GPU ray caster on a proxy image of 2 x 2 x 2 voxels that has the VDI's bounds; observers
on its start and end events have the image of exactly this frame raycast and bound as a texture,
and the fragment shader that ``VDIActor`` installs looks it up.
"""

from __future__ import annotations

from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.cropping import checked_opacity_multiplier
from pyvista_vdi.model.render_options import (
    checked_bound,
    checked_draw,
    checked_policy,
    checked_rate,
    checked_transmittance_cutoff,
)
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.frame_state import checked_image_distance
from pyvista_vdi.raycasting.picking import checked_opacity
from pyvista_vdi.vtk_pipeline.drawing.array_choice import ArrayChoiceMethods
from pyvista_vdi.vtk_pipeline.drawing.driver import Driver
from pyvista_vdi.vtk_pipeline.drawing.refused import OF_MAPPERS, refusing
from pyvista_vdi.vtk_pipeline.filters.inputs import Input, SourceInput, input_of, input_of_port
from pyvista_vdi.vtk_pipeline.filters.source import VDISource
from pyvista_vdi.vtk_pipeline.vtk import vtkOpenGLGPUVolumeRayCastMapper

#: Coarsest preview by default: every fourth pixel along each edge. VTK's default is 10.
COARSEST = 4.0


def _on_start(mapper: Any, event: str) -> None:
    driver = mapper.driver
    driver.begin(mapper)
    driver.box.begin(driver.actor)


def _on_end(mapper: Any, event: str) -> None:
    driver = mapper.driver
    driver.end()
    driver.box.end()


@refusing(OF_MAPPERS)
class VDIMapperMethods(ArrayChoiceMethods):
    """What makes a GPU volume mapper draw a VDI; mixed into VTK's and into PyVista's."""

    _driver: Driver | None = None

    def _become_vdi_mapper(self: Any) -> None:
        """Install proxy and observers; to be called once, from ``__init__``."""
        self._driver = Driver()
        super().SetAutoAdjustSampleDistances(0)  # type: ignore[misc]
        super().SetImageSampleDistance(1.0)  # type: ignore[misc]
        self.SetMaximumImageSampleDistance(COARSEST)
        super().SetInputConnection(self._driver.box.GetOutputPort())  # type: ignore[misc]
        # Plain functions: they get the mapper from VTK and hold nothing
        self.AddObserver("VolumeMapperRenderStartEvent", _on_start)
        self.AddObserver("VolumeMapperRenderEndEvent", _on_end)

    @property
    def driver(self) -> Driver:
        """What draws; made with the mapper."""
        assert self._driver is not None
        return self._driver

    def SetInputConnection(self, *args: Any) -> None:
        """Draw what a :class:`VDISource` (or a reader of canonical images) makes."""
        _require_first_port("SetInputConnection", args)
        port = args[-1]
        self._set_input(None if port is None else input_of_port(port))

    def SetInputDataObject(self, *args: Any) -> None:
        """Draw a VDI in its canonical form."""
        _require_first_port("SetInputDataObject", args)
        self.SetInputData(args[-1])

    def SetInputData(self, data: Any) -> None:
        """Draw a VDI, or its canonical image."""
        self._set_input(None if data is None else input_of(data))

    def RemoveInputConnection(self, *args: Any) -> None:
        """Draw nothing any more; RemoveAllInputConnections and RemoveAllInputs do the same."""
        self._set_input(None)

    RemoveAllInputConnections = RemoveAllInputs = RemoveInputConnection

    def GetInputDataObject(self, *args: Any) -> Any:
        """Return the box of the VDI's bounds that VTK is given in its place, and warn.

        Nothing that draws asks for it by this method; what writes the scene for another renderer
        does, and gets an empty box.
        """
        self.driver.say_not_exported()
        return super().GetInputDataObject(*args)  # type: ignore[misc]

    def GetDataSetInput(self) -> Any:
        """Return the volume that the VDI is made of; without one, the box of the VDI's bounds."""
        source = self.GetSource()
        volume = None if source is None else source.GetInputDataObject(0, 0)
        return self.driver.proxy if volume is None else volume

    GetInput = GetDataObjectInput = GetDataSetInput

    def SetVDI(self, vdi: VDI) -> None:
        """Draw this VDI."""
        self._set_input(input_of(vdi))

    def SetSeries(self, series: VDICollection) -> None:
        """Draw a step of this series, the first one at first: see :attr:`VDIActor.time`.

        Raises
        ------
        InvalidArgumentError
            If it is none.
        """
        if not isinstance(series, VDICollection) or series.times is None:
            raise InvalidArgumentError(
                f"SetSeries takes a VDISeries; got {type(series).__name__}: VDISeries(vdis) "
                "makes one of several VDIs"
            )
        self._set_input(input_of(series))

    def GetSeries(self) -> VDICollection | None:
        """Return the series of which a step is drawn; ``None`` where there is none."""
        shown = self._collection()
        return None if shown is None or shown.times is None else shown

    def SetVDISet(self, vdi_set: VDICollection) -> None:
        """Draw a set: of each frame's view the VDI that is nearest, or a blend of several.

        Raises
        ------
        InvalidArgumentError
            If it is none.
        """
        if not isinstance(vdi_set, VDICollection) or vdi_set.times is not None:
            raise InvalidArgumentError(
                f"SetVDISet takes a VDISet; got {type(vdi_set).__name__}: VDISet(vdis) makes "
                "one of several VDIs"
            )
        self._set_input(input_of(vdi_set))

    def GetVDISet(self) -> VDICollection | None:
        """Return the set that is drawn; ``None`` where there is none."""
        shown = self._collection()
        return None if shown is None or shown.times is not None else shown

    def _collection(self) -> VDICollection | None:
        return None if self.driver.input is None else self.driver.input.collection

    def GetVDI(self) -> VDI | None:
        """Return the VDI that was drawn last, or would be drawn; ``None`` before the first."""
        source = self.driver.input
        if source is None:
            return None
        return source.last() if isinstance(source, SourceInput) else source.vdi()

    def GetSource(self) -> VDISource | None:
        """Return the :class:`VDISource` at the input, if it is one."""
        source = self.driver.input
        return source.source if isinstance(source, SourceInput) else None

    def SetDevice(self, device: Any) -> None:
        """Choose the OpenCL device; ``None`` is the default one."""
        self.driver.device = device

    def GetDevice(self) -> Any:
        """Return the device as it was set."""
        return self.driver.device

    def SetAutomaticView(self, automatic: bool) -> None:
        """Take the view of the first frame for a source without camera (on by default)."""
        self.driver.set(automatic_view=bool(automatic))

    def GetAutomaticView(self) -> bool:
        """Whether a source without camera gets the view of the first frame."""
        return self.driver.state.settings.automatic_view

    def SetOpacityMultiplier(self: Any, multiplier: float) -> None:
        """Multiply the extinction of everything that is drawn; 1 by default.

        It acts on the next frame, without another VDI: 2 is twice as dense, 0 transparent. For
        what is not opaque it is the same as dividing the volume property's scalar opacity unit
        distance by it; changing that itself makes the VDI anew. ``InvalidArgumentError`` is raised
        if it is no finite number, or below 0.
        """
        if self.driver.set(opacity_multiplier=checked_opacity_multiplier(multiplier)):
            self.Modified()

    def GetOpacityMultiplier(self) -> float:
        """Return the factor of the extinction."""
        return self.driver.state.settings.opacity_multiplier

    def SetTransmittanceCutoff(self: Any, cutoff: float) -> None:
        """End rays where less light than this is left; 10^-6 by default.

        No channel of the picture loses more than that. VTK's own volume mappers stop at about
        1/255. VDIs that overlap are merged to the default, whatever is set here.
        ``InvalidArgumentError`` is raised if it is not from 0 to below 1.
        """
        if self.driver.set(transmittance_cutoff=checked_transmittance_cutoff(cutoff)):
            self.Modified()

    def GetTransmittanceCutoff(self) -> float:
        """Return the light below which rays end."""
        return self.driver.state.settings.transmittance_cutoff

    def SetDraw(self: Any, draw: str) -> None:
        """Choose what is raycast where the volume is at hand.

        Parameters
        ----------
        draw : {"auto", "vdi", "volume"}
            ``"auto"`` (the default): in windows that somebody watches, each frame by what is
            expected to give the better picture within the frame rate, and at rest by what is there
            sooner. Elsewhere the volume, until so many pictures of nearly the same view were taken
            that a VDI of it costs less, and then that as long as its picture is like the volume's
            (``SetRegenerateBelow``): pictures depend on scene, view and the pictures before, never
            on time. ``"vdi"``: always the VDI. ``"volume"``: always the volume, by our volume
            raycaster; a VDI is made only when one is asked for. Volumes that overlap in the picture
            are drawn by VDIs, off-screen by such as are of that view. In windows, a volume that
            the device holds brick by brick is drawn by its VDI.

        Raises
        ------
        InvalidArgumentError
            If it is something else.
        """
        if self.driver.set(draw=checked_draw(draw)):
            self.Modified()

    def GetDraw(self) -> str:
        """Return what is raycast where the volume is at hand."""
        return self.driver.state.settings.draw

    def SetImageSampleDistance(self: Any, distance: float) -> None:
        """Cast a ray for every so many pixels along each edge; 1 by default.

        The picture is interpolated linearly, as by VTK's mappers. Previews have fewer rays where
        the frame rate asks for it. ``InvalidArgumentError`` is raised if it is not from 1 to 100.
        """
        if self.driver.set(image_distance=checked_image_distance(distance)):
            self.Modified()

    def GetImageSampleDistance(self) -> float:
        """Return for how many pixels along each edge a ray is cast."""
        return self.driver.state.settings.image_distance

    # In VTK's GPU mapper the following would draw VTK's own volume into a smaller framebuffer, so
    # its own switch stays off and these methods, called from Python, keep ours.

    def SetAutoAdjustSampleDistances(self, on: bool) -> None:
        """Draw previews of fewer pixels while the view moves (on by default).

        Frames in a window whose desired update rate is at least ``GetInteractiveUpdateRate()``
        are interactive: the window's interactor sets that rate while its style turns, pans or
        zooms. Frames at rest, screenshots, exports and off-screen windows are always full.
        """
        if self._driver is not None:  # PyVista's constructor turns VTK's own switch off
            self._driver.set(adjust=bool(on))

    def GetAutoAdjustSampleDistances(self) -> bool:
        """Whether previews are drawn."""
        return self.driver.state.settings.adjust

    def AutoAdjustSampleDistancesOn(self) -> None:
        """Draw previews."""
        self.SetAutoAdjustSampleDistances(True)

    def AutoAdjustSampleDistancesOff(self) -> None:
        """Draw every frame in full."""
        self.SetAutoAdjustSampleDistances(False)

    def SetAutoAdjustMultiSamples(self, on: bool) -> None:
        """Draw previews without multisampling where that makes them late (on by default).

        Where OpenGL is software, multisampling takes most of a frame, and a VDI has no edges that
        it would smooth: so it is given up before rays are. Frames at rest, screenshots, exports and
        off-screen windows have the window's ``GetMultiSamples()``, which is left as it was set.
        With several VDIs in a window all of them must allow it.
        """
        self.driver.set(adjust_multi_samples=bool(on))

    def GetAutoAdjustMultiSamples(self) -> bool:
        """Whether previews may be drawn without multisampling."""
        return self.driver.state.settings.adjust_multi_samples

    def SetInteractiveUpdateRate(self, rate: float) -> None:
        """Set the window's desired update rate from which on a frame is interactive, 1/s.

        1 by default, as in ``vtkSmartVolumeMapper``.
        """
        self.driver.set(update_rate=checked_rate("the interactive update rate", rate))

    def GetInteractiveUpdateRate(self) -> float:
        """Return the desired update rate from which on a frame is interactive, 1/s."""
        return self.driver.state.settings.update_rate

    def SetTargetFrameRate(self, rate: float | None) -> None:
        """Set the frames per second that previews keep.

        ``None``, the default, means the window's desired update rate, which the interactor gives
        (``SetDesiredUpdateRate``: 15 in VTK, 30 in PyVista); 0 means that no rate is to be kept,
        so that every frame is full. Several VDIs in a window keep the highest of their targets.
        """
        target = None if rate is None else checked_rate("the target frame rate", rate)
        self.driver.set(target=target)

    def GetTargetFrameRate(self) -> float | None:
        """Return the frames per second that previews keep, as it was set."""
        return self.driver.state.settings.target

    def SetRegenerate(self, policy: Any) -> None:
        """Choose what decides that a view needs a VDI of its own.

        Parameters
        ----------
        policy : {"auto", "never"} or callable
            ``"auto"`` (the default): an estimate of the view's error, where somebody watches the
            window. ``"never"``: only ``actor.regenerate()``. A callable gets a
            :class:`~pyvista_vdi.vtk_pipeline.VDIStatus` once per frame and says whether to
            regenerate; its ``ssim`` is ``None``, because it is asked in place of the estimate.

        Raises
        ------
        InvalidArgumentError
            If it is something else.
        """
        self.driver.set(regenerate=checked_policy(policy))

    def GetRegenerate(self) -> Any:
        """Return what decides that a view needs a VDI of its own."""
        return self.driver.state.settings.regenerate

    def SetRegenerateBelow(self, ssim: float | None) -> None:
        """Set the estimated SSIM below which a VDI does not do for a view.

        ``SetRegenerate("auto")`` makes another of a view at rest in a watched window; while the
        view moves, twice the error (1 - SSIM) is borne. ``SetDraw("auto")`` draws the volume in its
        place, where that is at hand. ``None``, the default, is 0.95 for the former; for the latter
        it is 0.98, contrast within 4 x 4 pixels that differs by a tenth at most, and lists no wider
        than 1.25 pixels.
        """
        self.driver.set(regenerate_below=None if ssim is None else checked_bound(ssim))

    def GetRegenerateBelow(self) -> float | None:
        """Return the estimated SSIM below which a VDI does not do for a view, as it was set."""
        return self.driver.state.settings.regenerate_below

    def SetInteractiveOffScreen(self, on: bool | None) -> None:
        """Treat off-screen windows as if somebody watched them, or not.

        By default, ``None``, those are that a browser shows through a remote view of trame, as in
        notebooks: previews are drawn, and VDIs are made in the background.
        """
        self.driver.set(off_screen=None if on is None else bool(on))

    def GetInteractiveOffScreen(self) -> bool | None:
        """Whether off-screen windows are treated as watched; ``None`` where trame tells."""
        return self.driver.state.settings.off_screen

    def SetPickingOpacity(self, opacity: float) -> None:
        """Set the opacity that a ray must reach in the VDI to pick it.

        At least 0 and less than 1; 0.05 by default, as in VTK's pickers for volumes. What is
        compared says ``SetPickingAccumulated``; see :func:`pyvista_vdi.pick`.
        """
        self.driver.set(picking_opacity=checked_opacity(opacity))

    def GetPickingOpacity(self) -> float:
        """Return the opacity that a ray must reach in the VDI to pick it."""
        return self.driver.state.settings.picking_opacity

    def SetPickingAccumulated(self, accumulated: bool) -> None:
        """Compare the opacity from the ray's beginning (the default), or each supersegment's."""
        self.driver.set(picking_accumulated=bool(accumulated))

    def GetPickingAccumulated(self) -> bool:
        """Whether the opacity from the ray's beginning is compared."""
        return self.driver.state.settings.picking_accumulated

    def ShallowCopy(self: Any, other: Any) -> None:
        """Draw what another :class:`VDIMapper` draws, in the same way; the source is shared.

        Raises
        ------
        InvalidArgumentError
            If it is a mapper of VTK's.
        """
        if not isinstance(other, VDIMapperMethods):
            raise InvalidArgumentError(
                f"a VDIMapper copies a VDIMapper; got {type(other).__name__}: put a VDISource "
                "between its input and this mapper (SetInputConnection)"
            )
        theirs: Any = other
        shown = other.driver.input
        self.driver.set_input(None if shown is None else shown.shared())
        self.take_array_choice(theirs)
        self.SetDevice(theirs.GetDevice())
        self.driver.set(**vars(other.driver.state.settings))
        self.SetMaximumImageSampleDistance(theirs.GetMaximumImageSampleDistance())
        self.SetCropping(theirs.GetCropping())
        self.SetCroppingRegionPlanes(theirs.GetCroppingRegionPlanes())
        self.SetCroppingRegionFlags(theirs.GetCroppingRegionFlags())
        planes = theirs.GetClippingPlanes()
        self.RemoveAllClippingPlanes()
        for i in range(0 if planes is None else planes.GetNumberOfItems()):
            self.AddClippingPlane(planes.GetItem(i))

    def NewInstance(self) -> VDIMapperMethods:
        """Return another mapper of this class, with nothing to draw yet."""
        return type(self)()

    def _set_input(self: Any, source: Input | None) -> None:
        self.driver.set_input(source)
        self._added = None
        if self.GetSource() is not None:
            self.choose_array()  # which may have been named before
        self.Modified()


def _require_first_port(method: str, args: tuple[Any, ...]) -> None:
    if len(args) > 1 and args[0] != 0:
        raise UnsupportedError(
            f"{method}({args[0]}, ...): a VDIMapper has one input, port 0: give each VDI its own "
            "VDIMapper and VDIActor"
        )


class VDIMapper(VDIMapperMethods, vtkOpenGLGPUVolumeRayCastMapper):
    """The mapper of a :class:`VDIActor`: draws a VDI in a VTK renderer.

    The input is a :class:`VDISource` (``SetInputConnection``), a VDI in its canonical form
    (``SetInputData``) or a :class:`~pyvista_vdi.VDI` (``SetVDI``). Before each frame it brings
    the input up to date and raycasts it from the frame's view, ending rays at opaque geometry;
    an image is kept as long as view, depth and VDI stay the same. Clipping planes
    (``AddClippingPlane``), cropping (``SetCropping`` and its regions) and the opacity multiplier
    act on the next frame without another VDI. What of VTK's mapper a VDI has no place for, such as
    other blending modes, masks and depth images, is refused by the method's name.

    Notes
    -----
    A problem while drawing is reported once as a ``VDIWarning`` and the last good image stays:
    exceptions cannot pass through VTK's renderer. Where nothing is left to draw, nothing is shown.
    """

    def __init__(self) -> None:
        self._become_vdi_mapper()
