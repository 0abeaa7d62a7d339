"""ParaView's plugin: VDI Source, VDI To Image, VDI In Scene, two readers and a writer.

ParaView loads this file by its path (``pyvista-vdi paraview`` prints it): Tools > Manage
Plugins, ``paraview.simple.LoadPlugin`` or ``PV_PLUGIN_PATH``. Nothing else imports it. It declares
ParaView's properties over VTK algorithms that know nothing of ParaView.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy
from vtkmodules.vtkCommonCore import vtkWeakReference
from vtkmodules.vtkCommonDataModel import (
    vtkDataObject,
    vtkImageData,
    vtkPiecewiseFunction,
    vtkPolyData,
)
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersSources import vtkOutlineSource
from vtkmodules.vtkRenderingCore import vtkColorTransferFunction, vtkVolumeProperty

try:
    from pyvista_vdi import vtk_pipeline
    from pyvista_vdi._version import __version__
except ImportError as error:
    raise ImportError(
        f"ParaView's Python cannot import pyvista_vdi ({error}): start ParaView with PYTHONPATH="
        f"{Path(__file__).resolve().parents[4]}"
    ) from error

from pyvista_vdi.errors import VDIError
from pyvista_vdi.extensions.large.on_mpi import together
from pyvista_vdi.extensions.large.vtk_ranks import RanksVDISource, communicator, is_first_rank
from pyvista_vdi.extensions.paraview.parts.client import Client, say
from pyvista_vdi.extensions.paraview.parts.looking import Looking
from pyvista_vdi.extensions.paraview.parts.properties import (
    DEVICE_XML,
    SOURCE_XML,
    TIMES_XML,
    VIEW_XML,
)
from pyvista_vdi.io.files import holds
from pyvista_vdi.model.standard_cases import ELEVATION, filling_camera
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm, announce_times, wanted_time, watch
from pyvista_vdi.vtk_pipeline.filters.convert import require_image, scalars_of, vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.temporal import steps_and_times

#: What ParaView's plugin manager shows.
paraview_plugin_name = "VDI"
paraview_plugin_version = __version__


def _of_looks(setter: str) -> Any:
    """Return a method that sets what a setter of the source's volume property sets."""

    def set_it(self: Any, value: Any) -> None:
        getattr(self._looks, setter)(value)
        self.Modified()

    return set_it


@smproxy.filter(name="VDISource", label="VDI Source", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" />')
@smproperty.xml(
    SOURCE_XML
    + VIEW_XML.format(default="The volume fills the window", size="1280 720", least=1, note="")
    + DEVICE_XML
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDISource(Looking, RanksVDISource):
    """Generates a volume's VDI, by default of a view and with a ramp of its own.

    See :class:`pyvista_vdi.VDISource`.
    """

    def __init__(self) -> None:
        super().__init__()
        self._azimuth = self._elevation = 0.0
        self._kind = "point"
        self._occluded = False
        self._occlusion_radius = 0.0
        self._unit_distance: float | None = None
        self._functions: dict[str, Any] = {}
        self._observers: dict[str, int] = {}
        self._looks = vtkVolumeProperty()
        self._looks.SetColor(vtkColorTransferFunction())
        self._looks.SetScalarOpacity(vtkPiecewiseFunction())

    def SetAzimuth(self, degrees: float) -> None:
        """Turn the generating view."""
        self._change("_azimuth", degrees)

    def SetElevation(self, degrees: float) -> None:
        """Lift the generating view."""
        self._change("_elevation", degrees)

    def SetArray(self, index: int, port: int, connection: int, kind: int, name: str) -> None:
        """Choose the array, as ``SetInputArrayToProcess``: kind 0 is at points, 1 at cells."""
        self._kind = "cell" if kind == 1 else "point"
        self.SetScalars(name or None, self._kind)

    def SetColorFunction(self, function: Any) -> None:
        """Set ParaView's colour transfer function, or ``None`` for the default."""
        self._follow("color", function)

    def SetOpacityFunction(self, function: Any) -> None:
        """Set ParaView's opacity transfer function, or ``None`` for the default."""
        self._follow("opacity", function)

    def SetUnitDistance(self, distance: float) -> None:
        """Set the scalar opacity unit distance; 0 is the default one."""
        self._change("_unit_distance", distance or None)

    SetInterpolation = _of_looks("SetInterpolationType")
    SetShade = _of_looks("SetShade")
    SetAmbient = _of_looks("SetAmbient")
    SetDiffuse = _of_looks("SetDiffuse")
    SetSpecular = _of_looks("SetSpecular")
    SetSpecularPower = _of_looks("SetSpecularPower")

    def SetOcclusion(self, occluded: int) -> None:
        """Choose whether what is hidden from the light around it is darkened."""
        self._occluded = bool(occluded)
        self.SetOcclusionRadius(self._occlusion_radius)

    def SetOcclusionRadius(self, radius: float) -> None:
        """Set how far around a point that is looked for; 0 is the default radius."""
        self._occlusion_radius = radius
        self.SetAmbientOcclusion((radius or True) if self._occluded else None)

    def SetStep(self, distance: float) -> None:
        """Set the length of a step along a ray; 0 is the default one."""
        self.SetSampleDistance(distance or None)

    def TakeTransferFunctions(self) -> None:
        """Use the transfer functions that ParaView has for the array."""
        from paraview.modules.vtkRemotingViews import (
            vtkSMTransferFunctionManager,
            vtkSMTransferFunctionProxy,
        )

        client = Client.of(self)
        name = client.values("Scalars")[4] if client else None
        if client is None or not name:
            return
        functions = vtkSMTransferFunctionManager()
        color = functions.GetColorTransferFunction(name, client.manager)
        opacity = functions.GetOpacityTransferFunction(name, client.manager)
        data = self.GetInputDataObject(0, 0) if self.GetNumberOfInputConnections(0) else None
        if data is not None and not client.values("ScalarRangeInitialized", color)[0]:
            low, high = scalars_of(data, name, self._kind).GetFiniteRange()
            for function in (color, opacity):
                vtkSMTransferFunctionProxy.RescaleTransferFunction(function, low, high)
        for prop, function in (("ColorFunction", color), ("OpacityFunction", opacity)):
            client.proxy.GetProperty(prop).RemoveAllProxies()
            client.proxy.GetProperty(prop).AddProxy(function)
        client.proxy.UpdateVTKObjects()

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the output's extent, which the view decides."""
        with contextlib.suppress(VDIError):  # RequestData says it
            self._set_view()
        return int(super().RequestInformation(request, inputs, outputs))

    def _execute_here(self, inputs: Any, outputs: Any) -> None:
        # A script may connect what ParaView's menus do not offer
        image = require_image(vtkDataObject.GetData(inputs[0], 0))
        self._set_view()
        self._set_looks(image)
        super()._execute_here(inputs, outputs)

    def _set_view(self) -> None:
        view, bounds, size = self._given_camera(), self._known_bounds(), self.GetWindowSize()
        if view is not None:
            view = view.azimuth(self._azimuth).elevation(self._elevation)
        elif bounds is not None and size is not None:
            view = filling_camera(bounds, size, self._azimuth, ELEVATION + self._elevation)
        self.SetCamera(view)

    def _set_looks(self, image: vtkImageData) -> None:
        """Bring the volume property up to date with what is given, and with defaults."""
        prop = self._looks
        low, high = self._scalar_range(image)
        color, opacity = vtkColorTransferFunction(), vtkPiecewiseFunction()
        for x, share in ((low, 0.0), (high, 1.0)):
            color.AddRGBPoint(x, share, share, share)
            opacity.AddPoint(x, share)
        # A plain copy, not ParaView's object: that one gives as few colours as its table holds,
        # which its volumes do not show either
        prop.GetRGBTransferFunction().DeepCopy(self._functions.get("color") or color)
        prop.GetScalarOpacity().DeepCopy(self._functions.get("opacity") or opacity)
        distance = self._unit_distance
        if distance is None:
            distance = self._default_unit_distance(image)
        prop.SetScalarOpacityUnitDistance(distance)
        self.SetVolumeProperty(prop)

    def _follow(self, role: str, function: Any) -> None:
        """Be out of date whenever a transfer function changes."""
        before = self._functions.pop(role, None)
        if before is not None:
            before.RemoveObserver(self._observers.pop(role))
        if function is not None:
            self._functions[role] = function
            self._observers[role] = watch(function, self, Algorithm.Modified)
        self.Modified()


@smproxy.filter(name="VDIToImage", label="VDI To Image", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" /><RepresentationType view="RenderView" type="Slice" />')
@smproperty.xml(
    VIEW_XML.format(
        default="The VDI's own", size="0 0", least=0, note="0: that of the VDI's pictures."
    )
    + DEVICE_XML
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIToImage(Looking, vtk_pipeline.VDIToImage):
    """A picture of a VDI: :class:`pyvista_vdi.vtk_pipeline.VDIToImage`."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: set[str] = set()
        self._watching = False

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if not is_first_rank():  # one picture is enough
            vtkImageData.GetData(outputs, 0).Initialize()
            return
        self.SetCamera(self._given_camera())
        super()._execute(inputs, outputs)
        if not self._watching:
            self._watching = Client.watch(self, "RegisterEvent", VDIToImage._show_as_it_is)

    def _show_as_it_is(self) -> None:
        """Turn off *Map Scalars*, once, wherever the picture has just been shown."""
        client = Client.of(self, silent=True)
        for name, representation in client.representations() if client else ():
            mapped = representation.GetProperty("MapScalars")
            if name not in self._shown and mapped is not None:
                self._shown.add(name)
                mapped.SetElement(0, 0)
                representation.UpdateVTKObjects()


@smproxy.filter(name="VDIInScene", label="VDI In Scene", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" />')
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIInScene(Algorithm):
    """A VDI among the objects of render views.

    ParaView's representations are written in C++. Hence the output is the outline of the VDI's
    bounds, which ParaView shows, and a :class:`pyvista_vdi.VDIActor` joins it in each render view
    in which it is visible. Client and server must be one process.
    """

    def __init__(self) -> None:
        super().__init__(
            nInputPorts=1, inputType="vtkImageData", nOutputPorts=1, outputType="vtkPolyData"
        )
        self._vdi: Any = None
        self._actors: dict[str, Any] = {}
        self._watching = False

    def _execute(self, inputs: Any, outputs: Any) -> None:
        self._vdi = vdi_from_image(vtkImageData.GetData(inputs[0], 0))
        for actor in self._actors.values():
            actor.vdi = self._vdi
        outline = vtkOutlineSource()
        outline.SetBounds(self._vdi.bounds)
        outline.Update()
        vtkPolyData.GetData(outputs, 0).ShallowCopy(outline.GetOutput())
        if not self._watching and Client.of(self) is not None:
            self._watching = Client.watch(self, "RegisterEvent", VDIInScene._join_views)
        self._join_views()

    def _join_views(self) -> None:
        """Put an actor into each render view that has none; its frames decide if it is seen."""
        client = Client.of(self, silent=True)
        for view in client.views() if client else ():
            name = view.GetGlobalIDAsString()
            if self._vdi is None or name in self._actors:
                continue
            mapper, actor = vtk_pipeline.VDIMapper(), vtk_pipeline.VDIActor()
            mapper.SetVDI(self._vdi)
            actor.SetMapper(mapper)
            actor.PickableOff()  # ParaView's selections know its own props only
            self._actors[name] = actor
            _enter(view, actor, self)

    def visible_in(self, view: Any) -> bool:
        """Whether a view shows the output."""
        client = Client.of(self, silent=True)
        shown = view.GetProperty("Representations")
        proxies = [shown.GetProxy(i) for i in range(shown.GetNumberOfProxies())]
        return client is not None and any(
            representation in proxies and representation.GetProperty("Visibility").GetElement(0)
            for _, representation in client.representations()
        )


def _enter(view: Any, actor: Any, algorithm: VDIInScene) -> None:
    """Add an actor to a view, which is seen with the algorithm's output and leaves with it."""
    weak_view, weak_algorithm = vtkWeakReference(), vtkWeakReference()
    weak_view.Set(view)
    weak_algorithm.Set(algorithm)
    weak_actor = vtkWeakReference()
    weak_actor.Set(actor)

    def started(renderer: Any, event: str) -> None:
        shown, owner, where = weak_actor.Get(), weak_algorithm.Get(), weak_view.Get()
        if shown is None:
            return
        if owner is None or where is None:
            renderer.RemoveViewProp(shown)
        else:
            shown.SetVisibility(owner.visible_in(where))
            if shown.GetVisibility():
                # ParaView does not where it keeps the outlines of an animation's times
                vtkAlgorithm.UpdateTimeStep(owner, where.GetProperty("ViewTime").GetElement(0))
                renderer.SetUseDepthPeelingForVolumes(False)  # else wrong beside the translucent

    renderer = view.GetClientSideObject().GetRenderer()
    renderer.AddViewProp(actor)
    renderer.AddObserver("StartEvent", started)


@smproxy.reader(
    name="VDIReader",
    label="VDI Reader",
    extensions="vdi exr",
    file_description="Volumetric Depth Image",
    support_reload=False,
)
@smproperty.xml(
    """<StringVectorProperty name="FileName" command="AddFileName" repeat_command="1"
                             clean_command="ClearFileNames" number_of_elements="0"
                             animateable="0" panel_visibility="never">
         <FileListDomain name="files" />
         <Hints><FileChooser extensions="vdi exr" file_description="Volumetric Depth Image" />
         </Hints>
       </StringVectorProperty>"""
    + TIMES_XML
)
class VDIReader(vtk_pipeline.VDIReader):
    """VDIs from files, one per time step: :class:`pyvista_vdi.vtk_pipeline.VDIReader`."""

    def __init__(self) -> None:
        super().__init__()
        self._files: list[str] = []

    def AddFileName(self, path: str) -> None:
        """Append a file, the next time step."""
        self._files.append(path)
        self.SetFileName(self._files[0])
        self.Modified()

    def ClearFileNames(self) -> None:
        """Begin anew."""
        self._files.clear()
        self.SetFileName(None)

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the extent, and the time of each file: its place among them."""
        done = super().RequestInformation(request, inputs, outputs)
        if len(self._files) > 1:
            announce_times(outputs, [float(i) for i in range(len(self._files))])
        return done

    def _execute(self, inputs: Any, outputs: Any) -> None:
        time = wanted_time(outputs.GetInformationObject(0)) or 0.0
        if self._files:  # the last file that is not after the time
            self._path = self._files[min(max(int(time), 0), len(self._files) - 1)]
        super()._execute(inputs, outputs)
        if len(self._files) > 1:
            image = vtkImageData.GetData(outputs, 0)
            image.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), time)


@smproxy.reader(
    name="VDISeriesReader",
    label="VDI Series Reader",
    extensions="vdis",
    file_description="Series of Volumetric Depth Images",
    support_reload=False,
)
@smhint.xml('<ReloadFiles property="Refresh" />')
@smproperty.xml(
    """<StringVectorProperty name="FileName" command="SetFileName" number_of_elements="1"
                             animateable="0" panel_visibility="never">
         <FileListDomain name="files" />
       </StringVectorProperty>
       <Property name="Refresh" command="Modified" panel_visibility="never" />"""
    + TIMES_XML
)
class VDISeriesReader(vtk_pipeline.VDIReader):
    """The steps of a series, from one file: :class:`pyvista_vdi.vtk_pipeline.VDIReader`."""


@smproxy.writer(
    name="VDIWriter",
    label="VDI Writer",
    extensions="vdi exr vdis",
    file_description="Volumetric Depth Image",
    supports_parallel="1",
    support_reload=False,
)
@smproperty.xml(
    """<StringVectorProperty name="FileName" command="SetFileName" number_of_elements="1"
                             panel_visibility="never"><FileListDomain name="files" />
       </StringVectorProperty>
       <StringVectorProperty name="Precision" command="SetPrecisionName" number_of_elements="1"
                             default_values="usual">
         <StringListDomain name="list">
           <String value="usual" /><String value="exact" />
           <String value="16-byte" /><String value="8-byte" />
         </StringListDomain>
         <Documentation>What a supersegment takes. usual: 8 bytes in a .vdis, a seventh of the exact
         file at an SSIM of .9999; exact, 24 bytes, in a .vdi. An .exr is exact.</Documentation>
       </StringVectorProperty>
       <StringVectorProperty name="Compression" command="SetCompressionName" number_of_elements="1"
                             default_values="usual" panel_visibility="advanced">
         <StringListDomain name="list">
           <String value="usual" /><String value="lz4" /><String value="zstd" />
           <String value="deflate" /><String value="zips" /><String value="none" />
         </StringListDomain>
         <Documentation>usual: zstd of .vdis, lz4 of .vdi (zstd is smaller), zips of .exr, which
         has none beside it.</Documentation>
       </StringVectorProperty>
       <DoubleVectorProperty name="Tolerance" command="SetTolerance" number_of_elements="1"
                             default_values="0" panel_visibility="advanced">
         <DoubleRangeDomain name="range" min="0" max="1" />
         <Documentation>Of a .vdis: what opacities, and colours times opacity, may differ by where
         that saves bytes.</Documentation>
       </DoubleVectorProperty>"""
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIWriter(vtk_pipeline.VDIWriter):
    """Writes a VDI, or all time steps, to a file: :class:`pyvista_vdi.vtk_pipeline.VDIWriter`."""

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if is_first_rank():  # all have the VDI
            super()._execute(inputs, outputs)

    def SetPrecisionName(self, name: str) -> None:
        """Set the precision; "usual" is that of the file's kind."""
        self.SetPrecision(None if name == "usual" else name)

    def SetCompressionName(self, name: str) -> None:
        """Set the compression, likewise."""
        self.SetCompression(None if name == "usual" else name)

    def Write(self) -> None:
        """Write the file; ParaView's output window says what went wrong."""
        comm = communicator()
        try:
            if comm is None or holds(self.GetFileName()) != "series":
                super().Write()
                return
            with together(comm, "writing the series"):
                if comm.rank == 0:
                    super().Write()
                    return
                images, _ = steps_and_times(self.GetInputAlgorithm(0, 0))
                for _ in images:  # which the first rank needs the others for
                    pass
        except (VDIError, OSError) as error:
            say(self, error)
