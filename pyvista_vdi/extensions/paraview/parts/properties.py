"""The properties that the plugin's filters and readers have in common, in ParaView's XML."""

from __future__ import annotations

import math

from pyvista_vdi.model.checks import Number
from pyvista_vdi.model.options import Deferral, GenerationOptions, declared

#: Value of the property View that means the camera properties.
CAMERA = 1

#: Camera properties of our filters and of ParaView's render views alike: kind, default, domain.
CAMERA_PROPERTIES = {
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
    for name, (kind, default, domain) in CAMERA_PROPERTIES.items()
)

#: What decides a view: our two filters have it in common. {default} is what View = 0 means, {size}
#: the default window.
VIEW_XML = f"""
<IntVectorProperty name="WindowSize" command="SetSize" number_of_elements="2"
                   default_values="{{size}}">
  <IntRangeDomain name="range" min="{{least}} {{least}}" />
  <Documentation>Width and height in pixels. {{note}}</Documentation>
</IntVectorProperty>
<IntVectorProperty name="View" command="SetView" number_of_elements="1" default_values="0">
  <EnumerationDomain name="enum">
    <Entry value="0" text="{{default}}" /><Entry value="{CAMERA}" text="Camera" />
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

DEVICE_XML = """
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
_DECLARED = declared(GenerationOptions, Deferral)


def _sentence(option: str, more: str = "") -> str:
    what = _DECLARED[option].what
    return f"{what[0].upper()}{what[1:]}{more}."


def _number(option: str, more: str = "") -> str:
    """Return the property of an option that is a number; 0 stands for ``None``."""
    default, check = _DECLARED[option].default, _DECLARED[option].check
    kind, name = "Int" if isinstance(default, int) else "Double", option.title().replace("_", "")
    panel = "default" if option == "max_supersegments" else "advanced"
    bounds = 'min="0"'
    if isinstance(check, Number) and math.isfinite(check.high):
        bounds = f'min="{check.low:g}" max="{check.high:g}"'
    return f"""
<{kind}VectorProperty name="{name}" command="Set{_COMMANDS.get(name, name)}" number_of_elements="1"
                      default_values="{default or 0:g}" panel_visibility="{panel}">
  <{kind}RangeDomain name="range" {bounds} />
  <Documentation>{_sentence(option, more)}</Documentation>
</{kind}VectorProperty>"""


#: Setters that take 0 for the default.
_COMMANDS = {"SampleDistance": "Step"}

#: Where opacities hold.
UNIT_DISTANCE_XML = """
<DoubleVectorProperty name="ScalarOpacityUnitDistance" command="SetUnitDistance"
                      number_of_elements="1" default_values="0">
  <DoubleRangeDomain name="range" min="0" />
  <Documentation>Length over which the opacity function's opacities are reached, in the volume's
  units. 0: the diagonal over the mean number of points along an edge, or, of a VDI that keeps
  values, of its volume's.</Documentation>
</DoubleVectorProperty>
"""

#: What a volume, or values that are kept, are classified by; {default} says by which otherwise.
FUNCTIONS_XML = f"""
<ProxyProperty name="ColorFunction" command="SetColorFunction">
  <ProxyGroupDomain name="groups"><Group name="lookup_tables" /></ProxyGroupDomain>
  <Documentation>Colours of scalars; by default {{default}}.</Documentation>
</ProxyProperty>
<ProxyProperty name="OpacityFunction" command="SetOpacityFunction">
  <ProxyGroupDomain name="groups"><Group name="piecewise_functions" /></ProxyGroupDomain>
  <Documentation>Opacities of scalars; by default {{default}}.</Documentation>
</ProxyProperty>
{UNIT_DISTANCE_XML}"""

_WHERE_DEFERRED = _WITH_CAMERA.replace("View", "Classification")

SOURCE_XML = f"""
<StringVectorProperty name="Scalars" command="SetArray" number_of_elements="5"
                      element_types="0 0 0 0 2" animateable="0">
  <ArrayListDomain name="array_list" attribute_type="Scalars">
    <RequiredProperties><Property name="Input" function="Input" /></RequiredProperties>
  </ArrayListDomain>
  <Documentation>The array that is classified.</Documentation>
</StringVectorProperty>
{FUNCTIONS_XML.format(default="ramps over the scalars' range")}
<Property name="TakeTransferFunctions" label="Take the array's colours and opacities"
          command="TakeTransferFunctions" panel_widget="command_button">
  <Documentation>Use the transfer functions that ParaView has for this array, and follow their
  changes. Client and server must be one process.</Documentation>
</Property>
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
<IntVectorProperty name="Classification" command="SetClassification" number_of_elements="1"
                   default_values="0">
  <EnumerationDomain name="enum">
    <Entry value="0" text="baked" /><Entry value="1" text="deferred" />
  </EnumerationDomain>
  <Documentation>{_sentence("classification")}</Documentation>
</IntVectorProperty>
<DoubleVectorProperty name="ValueRange" command="SetValueRange" number_of_elements="2"
                      default_values="0 0">
  <Documentation>{_sentence("value_range", ". 0 0: all")}</Documentation>{_WHERE_DEFERRED}
</DoubleVectorProperty>
<DoubleVectorProperty name="Importance" command="AddImportance" clean_command="ClearImportance"
                      repeat_command="1" repeatable="1" number_of_elements="0"
                      number_of_elements_per_command="2" panel_visibility="advanced">
  <Documentation>{_sentence("importance", ": pairs of a scalar and a weight")}</Documentation>
  {_WHERE_DEFERRED}
</DoubleVectorProperty>
{_number("max_supersegments")}
{_number("sample_distance", ". 0: the default")}
{_number("tolerance")}
{_number("view_cone")}
<StringVectorProperty name="Coverage" command="SetCoverage" number_of_elements="1"
                      default_values="view">
  <StringListDomain name="list"><String value="view" /><String value="bounds" /></StringListDomain>
  <Documentation>view: the VDI covers the window. bounds: the whole volume, whatever part of it the
  window shows.</Documentation>
</StringVectorProperty>
"""


#: The times that an algorithm announces, for ParaView's animation.
TIMES_XML = """
<DoubleVectorProperty name="TimestepValues" repeatable="1" information_only="1"
                      si_class="vtkSITimeStepsProperty">
  <TimeStepsInformationHelper />
</DoubleVectorProperty>
"""
