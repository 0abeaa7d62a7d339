"""ParaView's plugin: VDI Source, VDI To Image, VDI In Scene, two readers and a writer.

ParaView loads this file by its path (``pyvista-vdi paraview`` prints it): Tools > Manage
Plugins, ``paraview.simple.LoadPlugin`` or ``PV_PLUGIN_PATH``. Nothing else imports it. It declares
ParaView's properties over VTK algorithms that know nothing of ParaView.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkWeakReference
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
        f"{Path(__file__).resolve().parents[3]}"
    ) from error

from pyvista_vdi.errors import VDIError
from pyvista_vdi.extensions.large.on_mpi import together
from pyvista_vdi.extensions.series.reader import is_series_file
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import MAX_SUPERSEGMENTS, GenerationOptions, declared
from pyvista_vdi.model.standard_cases import ELEVATION, filling_camera
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm, announce_times, wanted_time, watch
from pyvista_vdi.vtk_pipeline.filters.convert import (
    require_image,
    scalars_of,
    vdi_from_image,
)
from pyvista_vdi.vtk_pipeline.filters.ranks import RanksVDISource, communicator, is_first_rank
from pyvista_vdi.vtk_pipeline.filters.temporal import steps_and_times

#: What ParaView's plugin manager shows.
paraview_plugin_name = "VDI"
paraview_plugin_version = __version__

#: Value of the property View that means the camera properties.
_CAMERA = 1

#: Camera properties of our filters and of ParaView's render views alike: kind, default, domain.
_CAMERA_PROPERTIES = {
    "CameraPosition": ("Double", "0 0 1", ""),
    "CameraFocalPoint": ("Double", "0 0 0", ""),
    "CameraViewUp": ("Double", "0 1 0", ""),
    "CameraViewAngle": ("Double", "30", ""),
    "CameraParallelProjection": ("Int", "0", '<BooleanDomain name="bool" />'),
    "CameraParallelScale": ("Double", "1", ""),
}

_WITH_CAMERA = """<Hints><PropertyWidgetDecorator type="GenericDecorator" mode="visibility"
                         property="View" value="1" /></Hints>"""

_CAMERA_XML = "".join(
    f"""
<{kind}VectorProperty name="{name}" command="Set{name}" number_of_elements="{len(default.split())}"
                      default_values="{default}">{domain}{_WITH_CAMERA}</{kind}VectorProperty>"""
    for name, (kind, default, domain) in _CAMERA_PROPERTIES.items()
)

#: What decides a view: our two filters have it in common. {default} is what View = 0 means, {size}
#: the default window.
_VIEW_XML = f"""
<IntVectorProperty name="WindowSize" command="SetSize" number_of_elements="2"
                   default_values="{{size}}">
  <IntRangeDomain name="range" min="{{least}} {{least}}" />
  <Documentation>Width and height in pixels. {{note}}</Documentation>
</IntVectorProperty>
<IntVectorProperty name="View" command="SetView" number_of_elements="1" default_values="0">
  <EnumerationDomain name="enum">
    <Entry value="0" text="{{default}}" /><Entry value="{_CAMERA}" text="Camera" />
  </EnumerationDomain>
  <Documentation>Where the eye is before it is turned.</Documentation>
</IntVectorProperty>
{_CAMERA_XML}
<DoubleVectorProperty name="Azimuth" command="SetAzimuth" number_of_elements="1"
                      default_values="0">
  <DoubleRangeDomain name="range" min="-180" max="180" />
  <Documentation>Turns the view about its up direction through the focal point,
  degrees.</Documentation>
</DoubleVectorProperty>
<DoubleVectorProperty name="Elevation" command="SetElevation" number_of_elements="1"
                      default_values="0">
  <DoubleRangeDomain name="range" min="-90" max="90" />
  <Documentation>Lifts the view after turning it, degrees.</Documentation>
</DoubleVectorProperty>
<Property name="TakeActiveView" label="Take the active view" command="TakeActiveView"
          panel_widget="command_button">
  <Documentation>Copy the active render view's camera and size into these properties. Client and
  server must be one process.</Documentation>
</Property>
"""

_DEVICE_XML = """
<StringVectorProperty name="Device" command="SetDeviceName" number_of_elements="1"
                      default_values="" panel_visibility="advanced">
  <Documentation>OpenCL device; empty: the best one. `pyvista-vdi devices` lists
  them.</Documentation>
</StringVectorProperty>
"""

_REFLECTION_XML = "".join(
    f"""
<DoubleVectorProperty name="{name}" command="Set{name}" number_of_elements="1"
                      default_values="{default}" panel_visibility="advanced" />"""
    for name, default in (("Ambient", 0), ("Diffuse", 1), ("Specular", 0), ("SpecularPower", 1))
)

#: What is declared of the options of ``generate``.
_DECLARED = declared(GenerationOptions)


def _sentence(option: str, more: str = "") -> str:
    what = _DECLARED[option].what
    return f"{what[0].upper()}{what[1:]}{more}."


def _number(option: str, name: str, bounds: str, more: str = "") -> str:
    """Return the property of an option that is a number; 0 stands for ``None``."""
    default = _DECLARED[option].default
    kind = "Int" if isinstance(default, int) else "Double"
    panel = "default" if option == "max_supersegments" else "advanced"
    return f"""
<{kind}VectorProperty name="{name}" command="Set{_COMMANDS.get(name, name)}" number_of_elements="1"
                      default_values="{default or 0:g}" panel_visibility="{panel}">
  <{kind}RangeDomain name="range" {bounds} />
  <Documentation>{_sentence(option, more)}</Documentation>
</{kind}VectorProperty>"""


#: Setters that take 0 for the default.
_COMMANDS = {"SampleDistance": "Step"}

_SOURCE_XML = f"""
<StringVectorProperty name="Scalars" command="SetArray" number_of_elements="5"
                      element_types="0 0 0 0 2" animateable="0">
  <ArrayListDomain name="array_list" attribute_type="Scalars">
    <RequiredProperties><Property name="Input" function="Input" /></RequiredProperties>
  </ArrayListDomain>
  <Documentation>The array that is classified.</Documentation>
</StringVectorProperty>
<ProxyProperty name="ColorFunction" command="SetColorFunction">
  <ProxyGroupDomain name="groups"><Group name="lookup_tables" /></ProxyGroupDomain>
  <Documentation>A colour transfer function; by default black to white over the scalars'
  range.</Documentation>
</ProxyProperty>
<ProxyProperty name="OpacityFunction" command="SetOpacityFunction">
  <ProxyGroupDomain name="groups"><Group name="piecewise_functions" /></ProxyGroupDomain>
  <Documentation>An opacity transfer function; by default 0 to 1 over the scalars'
  range.</Documentation>
</ProxyProperty>
<Property name="TakeTransferFunctions" label="Take the array's colours and opacities"
          command="TakeTransferFunctions" panel_widget="command_button">
  <Documentation>Use the transfer functions that ParaView has for this array, and follow their
  changes. Client and server must be one process.</Documentation>
</Property>
<DoubleVectorProperty name="ScalarOpacityUnitDistance" command="SetUnitDistance"
                      number_of_elements="1" default_values="0">
  <DoubleRangeDomain name="range" min="0" />
  <Documentation>Length over which the opacity function's opacities are reached, in the volume's
  units. 0: the diagonal over the mean number of points along an edge.</Documentation>
</DoubleVectorProperty>
<IntVectorProperty name="InterpolationType" command="SetInterpolation" number_of_elements="1"
                   default_values="1">
  <EnumerationDomain name="enum">
    <Entry value="0" text="Nearest" /><Entry value="1" text="Linear" />
  </EnumerationDomain>
</IntVectorProperty>
<IntVectorProperty name="Shade" command="SetShade" number_of_elements="1" default_values="0">
  <BooleanDomain name="bool" />
  <Documentation>Light the volume by one headlight at the generating view.</Documentation>
</IntVectorProperty>
{_REFLECTION_XML}
<IntVectorProperty name="AmbientOcclusion" command="SetOcclusion" number_of_elements="1"
                   default_values="0">
  <BooleanDomain name="bool" />
  <Documentation>{_sentence("ambient_occlusion")}</Documentation>
</IntVectorProperty>
<DoubleVectorProperty name="AmbientOcclusionRadius" command="SetOcclusionRadius"
                      number_of_elements="1" default_values="0" panel_visibility="advanced">
  <DoubleRangeDomain name="range" min="0" />
  <Documentation>How far around it that is looked for, in the volume's units. 0: the default
  radius.</Documentation>
</DoubleVectorProperty>
{_number("max_supersegments", "MaxSupersegments", f'min="1" max="{MAX_SUPERSEGMENTS}"')}
{_number("sample_distance", "SampleDistance", 'min="0"', ". 0: half the smallest spacing")}
{_number("tolerance", "Tolerance", 'min="0"')}
{_number("view_cone", "ViewCone", 'min="0" max="90"')}
<StringVectorProperty name="Coverage" command="SetCoverage" number_of_elements="1"
                      default_values="view">
  <StringListDomain name="list"><String value="view" /><String value="bounds" /></StringListDomain>
  <Documentation>view: the VDI covers the window. bounds: the whole volume, whatever part of it the
  window shows.</Documentation>
</StringVectorProperty>
"""


#: The times that an algorithm announces, for ParaView's animation.
_TIMES_XML = """
<DoubleVectorProperty name="TimestepValues" repeatable="1" information_only="1"
                      si_class="vtkSITimeStepsProperty">
  <TimeStepsInformationHelper />
</DoubleVectorProperty>
"""


def _of_lens(name: str, kind: Callable[[Any], Any] = lambda value: value) -> Any:
    """Return a method that sets one of the camera's arguments, a number or three."""

    def set_it(self: Any, *value: Any) -> None:
        self._change("_lens", {**self._lens, name: value if len(value) > 1 else kind(value[0])})

    return set_it


def _of_looks(setter: str) -> Any:
    """Return a method that sets what a setter of the source's volume property sets."""

    def set_it(self: Any, value: Any) -> None:
        getattr(self._looks, setter)(value)
        self.Modified()

    return set_it


class _Looking(Algorithm):
    """The properties of a view: an algorithm with ``SetCamera`` gets them as a camera."""

    def __init__(self) -> None:
        super().__init__()
        self._camera_chosen = False
        self._lens: dict[str, Any] = {
            "position": (0.0, 0.0, 1.0),
            "focal_point": (0.0, 0.0, 0.0),
            "view_up": (0.0, 1.0, 0.0),
        }

    def SetView(self, which: int) -> None:
        """Choose between the default view and the camera properties."""
        self._change("_camera_chosen", which == _CAMERA)

    SetCameraPosition = _of_lens("position")
    SetCameraFocalPoint = _of_lens("focal_point")
    SetCameraViewUp = _of_lens("view_up")
    SetCameraViewAngle = _of_lens("view_angle")
    SetCameraParallelProjection = _of_lens("parallel_projection", bool)
    SetCameraParallelScale = _of_lens("parallel_scale")

    def SetSize(self, width: int, height: int) -> None:
        """Set the window; 0 is the default one."""
        self.SetWindowSize((width, height) if width and height else None)

    def SetDeviceName(self, name: str | None) -> None:
        """Choose the OpenCL device; empty is the default one."""
        self.SetDevice(name or None)

    def TakeActiveView(self) -> None:
        """Copy the active view's camera and size into the properties."""
        client = _Client.of(self)
        if client is None:
            return
        view = client.manager.GetSelectionModel("ActiveView").GetCurrentProxy()
        if view is None or view.GetProperty("CameraPosition") is None:
            _say(self, "the active view is no render view: click into one, or type its camera in")
            return
        view.SynchronizeCameraProperties()
        client.set("View", [_CAMERA])
        for name in _CAMERA_PROPERTIES:
            client.set(name, client.values(name, view))
        client.set("WindowSize", client.values("ViewSize", view))
        client.set("Azimuth", [0.0])
        client.set("Elevation", [0.0])
        client.proxy.UpdateVTKObjects()

    def _given_camera(self) -> Any:
        # Made as late as this: set one at a time, the properties may pass through no camera at all
        return Camera(**self._lens) if self._camera_chosen else None


@smproxy.filter(name="VDISource", label="VDI Source", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" />')
@smproperty.xml(
    _SOURCE_XML
    + _VIEW_XML.format(default="The volume fills the window", size="1280 720", least=1, note="")
    + _DEVICE_XML
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDISource(_Looking, RanksVDISource):
    """A volume's VDI: :class:`pyvista_vdi.VDISource`, and a view and a ramp by default."""

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

        client = _Client.of(self)
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
    _VIEW_XML.format(
        default="The VDI's own", size="0 0", least=0, note="0: that of the VDI's pictures."
    )
    + _DEVICE_XML
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIToImage(_Looking, vtk_pipeline.VDIToImage):
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
            self._watching = _Client.watch(self, "RegisterEvent", VDIToImage._show_as_it_is)

    def _show_as_it_is(self) -> None:
        """Turn off *Map Scalars*, once, wherever the picture has just been shown."""
        client = _Client.of(self, silent=True)
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
        if not self._watching and _Client.of(self) is not None:
            self._watching = _Client.watch(self, "RegisterEvent", VDIInScene._join_views)
        self._join_views()

    def _join_views(self) -> None:
        """Put an actor into each render view that has none; its frames decide if it is seen."""
        client = _Client.of(self, silent=True)
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
        client = _Client.of(self, silent=True)
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
    + _TIMES_XML
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
    + _TIMES_XML
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
    """A file of a VDI, or of all time steps: :class:`pyvista_vdi.vtk_pipeline.VDIWriter`."""

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
            if comm is None or not is_series_file(self.GetFileName()):
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
            _say(self, error)


class _Client:
    """ParaView's client side of an algorithm, where it lives in the same process."""

    def __init__(self, manager: Any, proxy: Any) -> None:
        self.manager = manager
        self.proxy = proxy

    @staticmethod
    def _manager() -> Any:
        from paraview.modules.vtkRemotingServerManager import vtkSMProxyManager

        if not vtkSMProxyManager.IsInitialized():
            return None
        return vtkSMProxyManager.GetProxyManager().GetActiveSessionProxyManager()

    @classmethod
    def of(cls, algorithm: Any, *, silent: bool = False) -> _Client | None:
        """Return the client side, or ``None`` after having said why there is none."""
        manager = cls._manager()
        for i in range(manager.GetNumberOfProxies("sources") if manager else 0):
            proxy = manager.GetProxy("sources", manager.GetProxyName("sources", i))
            if proxy.GetClientSideObject() is algorithm:
                return cls(manager, proxy)
        if not silent:
            problem = "client and server are two processes: set the properties from the client"
            _say(algorithm, problem)
        return None

    @classmethod
    def watch(cls, algorithm: Any, event: str, changed: Callable[[Any], None]) -> bool:
        """Call ``changed(algorithm)`` at an event of the manager; return whether there is one."""
        manager = cls._manager()
        return manager is not None and bool(watch(manager, algorithm, changed, event))

    def views(self) -> list[Any]:
        """Return the proxies of render views."""
        number = self.manager.GetNumberOfProxies("views")
        names = [self.manager.GetProxyName("views", i) for i in range(number)]
        views = [self.manager.GetProxy("views", name) for name in names]
        return [view for view in views if hasattr(view.GetClientSideObject(), "GetRenderer")]

    def representations(self) -> list[tuple[str, Any]]:
        """Return the names and proxies of what shows the algorithm's output in views."""
        found = []
        for i in range(self.manager.GetNumberOfProxies("representations")):
            name = self.manager.GetProxyName("representations", i)
            proxy = self.manager.GetProxy("representations", name)
            source = proxy.GetProperty("Input")
            inputs = source.GetNumberOfProxies() if source is not None else 0
            if inputs and source.GetProxy(0) is self.proxy:
                found.append((name, proxy))
        return found

    def values(self, name: str, proxy: Any = None) -> list[Any]:
        """Return a property's values, of this algorithm or of another proxy."""
        prop = (proxy or self.proxy).GetProperty(name)
        return [prop.GetElement(i) for i in range(prop.GetNumberOfElements())]

    def set(self, name: str, values: list[Any]) -> None:
        """Set a property's values; ``UpdateVTKObjects`` applies them."""
        prop = self.proxy.GetProperty(name)
        for i, value in enumerate(values):
            prop.SetElement(i, value)


def _say(algorithm: Any, problem: object) -> None:
    text = f"{type(algorithm).__name__}: {problem}\n"
    vtkOutputWindow.GetInstance().DisplayErrorText(text)
