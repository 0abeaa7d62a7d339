"""ParaView's plugin: VDI Source, VDI To Image, VDI In Scene, two readers and a writer.

ParaView loads this file by its path (``pyvista-vdi paraview`` prints it): Tools > Manage
Plugins, ``paraview.simple.LoadPlugin`` or ``PV_PLUGIN_PATH``. Nothing else imports it. It declares
ParaView's properties over VTK algorithms that know nothing of ParaView.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy
from vtkmodules.vtkCommonCore import vtkWeakReference
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersSources import vtkOutlineSource
from vtkmodules.vtkParallelCore import vtkMultiProcessController

try:
    from pyvista_vdi import vtk_pipeline
    from pyvista_vdi._version import __version__
except ImportError as error:
    raise ImportError(
        f"ParaView's Python cannot import pyvista_vdi ({error}): start ParaView with PYTHONPATH="
        f"{Path(__file__).resolve().parents[4]}"
    ) from error

from pyvista_vdi.errors import VDIError
from pyvista_vdi.extensions.paraview.parts.client import Client, require_one_process, say
from pyvista_vdi.extensions.paraview.parts.functions import (
    Functions,
    Looking,
    Looks,
    functions_of_array,
    sets,
)
from pyvista_vdi.extensions.paraview.parts.properties import (
    SOURCE_XML,
    TIMES_XML,
    UNIT_DISTANCE_XML,
    functions_xml,
    properties,
    view_xml,
)
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.standard_cases import ELEVATION, filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.algorithm import announce_times, wanted_time
from pyvista_vdi.vtk_pipeline.filters.convert import (
    require_image,
    scalars_of,
    to_vtk,
    vdi_from_image,
)
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput

require_one_process(vtkMultiProcessController.GetGlobalController())

#: What ParaView's plugin manager shows.
paraview_plugin_name = "VDI"
paraview_plugin_version = __version__


def _of_looks(setter: str) -> Any:
    """Return a method that sets what a setter of the source's volume property sets."""

    def set_it(self: Any, value: Any) -> None:
        getattr(self._looks.prop, setter)(value)
        self.Modified()

    return set_it


@smproxy.filter(name="VDISource", label="VDI Source", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" />')
@smproperty.xml(SOURCE_XML + view_xml("The volume fills the window", "1280 720", 1))
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDISource(Looking, Functions, vtk_pipeline.VDISource):
    """Generates a volume's VDI, by default of a view and with a ramp of its own.

    See :class:`pyvista_vdi.VDISource`.
    """

    def __init__(self) -> None:
        super().__init__()
        self._azimuth = self._elevation = 0.0
        self._kind = "point"
        self._occluded = False
        self._occlusion_radius = 0.0
        self._looks = Looks()
        self._deferred = False
        self._value_range: tuple[float, float] | None = None
        self._importance: list[tuple[float, float]] = []

    SetAzimuth, SetElevation = sets("_azimuth"), sets("_elevation")

    def SetArray(self, index: int, port: int, connection: int, kind: int, name: str) -> None:
        """Choose the array, as ``SetInputArrayToProcess``: kind 0 is at points, 1 at cells."""
        self._kind = "cell" if kind == 1 else "point"
        self.SetScalars(name or None, self._kind)

    SetInterpolation = _of_looks("SetInterpolationType")
    SetShade = _of_looks("SetShade")
    SetAmbient = _of_looks("SetAmbient")
    SetDiffuse = _of_looks("SetDiffuse")
    SetSpecular = _of_looks("SetSpecular")
    SetSpecularPower = _of_looks("SetSpecularPower")

    SetClassification = sets("_deferred", bool)

    def _function_changed(self) -> None:
        if not self._deferred:  # else it decides nothing here
            super()._function_changed()

    # Two that are equal mean all
    SetValueRange = sets("_value_range", lambda low, high: (low, high) if low != high else None)

    def AddImportance(self, scalar: float, weight: float) -> None:
        """Append a point to the importance by which a deferred VDI is cut."""
        self._importance.append((scalar, weight))
        self.Modified()

    def ClearImportance(self) -> None:
        """Begin anew."""
        self._importance.clear()
        self.Modified()

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
        client = Client.of(self)
        name = client.values("Scalars")[4] if client else None
        if client is None or not name:
            return
        data = self.GetInputDataObject(0, 0) if self.GetNumberOfInputConnections(0) else None
        ends = data and scalars_of(data, name, self._kind).GetFiniteRange()
        functions = functions_of_array(client, name, ends)
        for prop, function in zip(("ColorFunction", "OpacityFunction"), functions, strict=True):
            client.proxy.GetProperty(prop).RemoveAllProxies()
            client.proxy.GetProperty(prop).AddProxy(function)
        client.proxy.UpdateVTKObjects()

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the output's extent, which the view decides."""
        with contextlib.suppress(VDIError):  # RequestData says it
            self._set_view()
        return int(super().RequestInformation(request, inputs, outputs))

    def _execute(self, inputs: Any, outputs: Any) -> None:
        # A script may connect what ParaView's menus do not offer
        image = require_image(vtkDataObject.GetData(inputs[0], 0))
        self._set_view()
        self._set_looks(image)
        kept = ("deferred", self._value_range, self._importance or None)
        self.SetDeferral(*kept if self._deferred else ())
        super()._execute(inputs, outputs)

    def _set_view(self) -> None:
        view, bounds, size = self._given_camera(), self._known_bounds(), self.GetWindowSize()
        if view is not None:
            view = view.azimuth(self._azimuth).elevation(self._elevation)
        elif bounds is not None and size is not None:
            view = filling_camera(bounds, size, self._azimuth, ELEVATION + self._elevation)
        self.SetCamera(view)

    def _set_looks(self, image: vtkImageData) -> None:
        """Bring the volume property up to date with what is given, and with defaults."""
        distance = self._unit_distance or self._read(image).default_unit_distance
        ends = scalars_of(image, self.GetScalars(), self._preference).GetFiniteRange()
        self._looks.copy(list(self._functions.values()), ends, distance)
        self.SetVolumeProperty(self._looks.prop)


def name_of(vdi: DeferredVDI) -> str:
    """Return the name of the array that a deferred VDI keeps, by which ParaView shows it."""
    return str(vdi.metadata.get("scalars") or "values")


@smproxy.filter(name="VDIToImage", label="VDI To Image", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" /><RepresentationType view="RenderView" type="Slice" />')
@smproperty.xml(
    view_xml("The VDI's own", "0 0", 0, "0: that of the VDI's pictures.")
    + functions_xml("those that ParaView has for the array")
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIToImage(Looking, Functions, vtk_pipeline.VDIToImage):
    """A picture of a VDI: :class:`pyvista_vdi.vtk_pipeline.VDIToImage`."""

    def __init__(self) -> None:
        super().__init__()
        self._looks = Looks()
        self._by_default: dict[str, Any] = {}
        self._shown: set[str] = set()
        self._watching = False

    def _execute(self, inputs: Any, outputs: Any) -> None:
        self.SetCamera(self._given_camera())
        super()._execute(inputs, outputs)
        if not self._watching:
            self._watching = Client.watch(self, "RegisterEvent", VDIToImage._show_as_it_is)

    def _classified(self, vdi: VDI | DeferredVDI) -> VDI:
        """Classify values by the given functions, or else by those of the array, in one process."""
        if isinstance(vdi, DeferredVDI):
            client = Client.of(self, silent=True)
            if client is not None:
                proxies = functions_of_array(client, name_of(vdi), vdi.value_range)
                for role, proxy in zip(self._functions, proxies, strict=True):
                    function, before = proxy.GetClientSideObject(), self._functions[role]
                    if before in (None, self._by_default.get(role)) and before is not function:
                        self._follow(role, function)
                        self._by_default[role] = function
            distance = self._unit_distance or vdi.unit_distance
            self._looks.copy(list(self._functions.values()), vdi.value_range, distance)
            self.SetVolumeProperty(self._looks.prop)
        return super()._classified(vdi)

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
@smproperty.xml(UNIT_DISTANCE_XML)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIInScene(Functions):
    """A VDI among the objects of render views.

    ParaView's representations are written in C++. Hence the output is the outline of the VDI's
    bounds, which ParaView shows, and a :class:`pyvista_vdi.VDIActor` joins it in each render view
    in which it is visible. Client and server must be one process.

    The outline of a VDI that keeps values has an array of their name, and ends of their range: what
    colours the outline in a view, ParaView's transfer functions of that array, classifies the
    values there.
    """

    def __init__(self) -> None:
        super().__init__(
            nInputPorts=1, inputType="vtkImageData", nOutputPorts=1, outputType="vtkPolyData"
        )
        self._vdi: Any = None
        self._actors: dict[str, Any] = {}
        self._looks: dict[str, Looks] = {}
        self._watching = False

    def _execute(self, inputs: Any, outputs: Any) -> None:
        self._vdi = vdi_from_image(vtkImageData.GetData(inputs[0], 0))
        for name, actor in self._actors.items():
            actor.GetMapper().SetInputData(self._input(name))
        outline = vtkOutlineSource()
        outline.SetBounds(self._vdi.bounds)
        outline.Update()
        output = vtkPolyData.GetData(outputs, 0)
        output.ShallowCopy(outline.GetOutput())
        if isinstance(self._vdi, DeferredVDI):
            ends = np.resize(self._vdi.value_range, output.GetNumberOfPoints())
            output.GetPointData().SetScalars(to_vtk(name_of(self._vdi), ends))
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
            self._looks[name] = Looks()
            mapper.SetInputData(self._input(name))
            actor.SetMapper(mapper)
            actor.PickableOff()  # ParaView's selections know its own props only
            self._actors[name] = actor
            _enter(view, actor, self)

    def _input(self, name: str) -> Any:
        """Return what the actor of a view draws."""
        vdi = self._vdi
        return DeferredInput(vdi, self._looks[name].prop) if isinstance(vdi, DeferredVDI) else vdi

    def shown_by(self, view: Any) -> Any:
        """Return the representation that a view shows the output by; ``None`` if it does not."""
        client = Client.of(self, silent=True)
        shown = view.GetProperty("Representations")
        proxies = [shown.GetProxy(i) for i in range(shown.GetNumberOfProxies())]
        for _, representation in client.representations() if client else ():
            if representation in proxies and representation.GetProperty("Visibility").GetElement(0):
                return representation
        return None

    def classify(self, view: Any, representation: Any) -> None:
        """Take the functions that a representation colours by, or, if by none, the array's."""
        client, vdi = Client.of(self, silent=True), self._vdi
        if client is None or not isinstance(vdi, DeferredVDI):
            return
        color, opacity = functions_of_array(client, name_of(vdi), vdi.value_range)
        table = representation.GetProperty("LookupTable")
        if table is not None and table.GetNumberOfProxies() and table.GetProxy(0) is not None:
            color = table.GetProxy(0)
            of_table = color.GetProperty("ScalarOpacityFunction")
            if of_table.GetNumberOfProxies() and of_table.GetProxy(0) is not None:
                opacity = of_table.GetProxy(0)
        functions = [each.GetClientSideObject() for each in (color, opacity)]
        distance = self._unit_distance or vdi.unit_distance
        self._looks[view.GetGlobalIDAsString()].copy(functions, vdi.value_range, distance)


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
            representation = owner.shown_by(where)
            shown.SetVisibility(representation is not None)
            if shown.GetVisibility():
                # ParaView does not where it keeps the outlines of an animation's times
                vtkAlgorithm.UpdateTimeStep(owner, where.GetProperty("ViewTime").GetElement(0))
                owner.classify(where, representation)
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
            self._set["file_name"] = self._files[min(max(int(time), 0), len(self._files) - 1)]
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
    """The steps of a series: :class:`pyvista_vdi.vtk_pipeline.VDIReader`."""


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
       </StringVectorProperty>"""
    + properties("""
Precision:SetPrecisionName       String usual  [usual|exact|8-byte]  What a supersegment takes. \
usual: 8 bytes in a .vdis; exact, 24 bytes, in a .vdi. An .exr has float32.
Compression:SetCompressionName!  String usual  [usual|lz4|zstd|deflate|none]  usual: zstd of \
.vdis, lz4 of .vdi (zstd is smaller); an .exr has no other.
""")
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIWriter(vtk_pipeline.VDIWriter):
    """Writes a VDI, or all time steps, to a file: :class:`pyvista_vdi.vtk_pipeline.VDIWriter`."""

    def SetPrecisionName(self, name: str) -> None:
        """Set the precision; "usual" is that of the file's kind."""
        self.SetPrecision(None if name == "usual" else name)

    def SetCompressionName(self, name: str) -> None:
        """Set the compression, likewise."""
        self.SetCompression(None if name == "usual" else name)

    def Write(self) -> None:
        """Write the file; ParaView's output window says what went wrong."""
        try:
            super().Write()
        except (VDIError, OSError) as error:
            say(self, error)
