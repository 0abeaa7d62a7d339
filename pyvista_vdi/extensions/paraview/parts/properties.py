"""The properties of the plugin's filters, reader and writer, in ParaView's XML."""

from __future__ import annotations

import math
import re
from typing import Any

from pyvista_vdi.model.options import GenerationOptions

#: Value of the property View that means the camera properties.
CAMERA = 1

_DECLARED = GenerationOptions.declared


def properties(lines: str) -> str:
    """Return the XML of properties that are written a line each, with two spaces between columns.

    These are a name, the kind and the defaults of its values, a domain, and the documentation. A
    name may have a setter of another name behind ``:``, and ``!`` at its end, if it is an advanced
    one. A domain is ``bool``, numbers ``0..1``, numbered texts ``(a|b)``, or texts ``[a|b]``; ``-``
    is none. Lines of XML stay as they are.
    """
    rows = lines.strip().splitlines()
    return "\n".join(
        row if row.startswith("<") else _property(*re.split(" {2,}", row, maxsplit=3))
        for row in rows
    )


def _property(name: str, values: str, domain: str, text: str = "") -> str:
    panel = ' panel_visibility="advanced"' if name.endswith("!") else ""
    name, _, command = name.removesuffix("!").partition(":")
    kind, _, defaults = values.partition(" ")
    count, texts = len(defaults.split()) or 1, domain[1:-1].split("|")
    low, _, high = domain.partition("..")
    inside = {"bool": '<BooleanDomain name="bool" />', "-": ""}.get(domain)
    if domain.startswith("("):
        entries = (f'<Entry value="{i}" text="{each}" />' for i, each in enumerate(texts))
        inside = f'<EnumerationDomain name="enum">{"".join(entries)}</EnumerationDomain>'
    elif domain.startswith("["):
        listed = "".join(f'<String value="{each}" />' for each in texts)
        inside = f'<StringListDomain name="list">{listed}</StringListDomain>'
    elif inside is None:
        ends = f'min="{" ".join([low] * count)}"' + (f' max="{high}"' if high else "")
        inside = f'<{kind}RangeDomain name="range" {ends} />'
    inside += f"<Documentation>{text}</Documentation>" if text else ""
    return (
        f'<{kind}VectorProperty name="{name}" command="{command or f"Set{name}"}" '
        f'number_of_elements="{count}" default_values="{defaults}"{panel}>{inside}'
        f"</{kind}VectorProperty>"
    )


def _button(name: str, label: str, text: str) -> str:
    told = f'name="{name}" label="{label}" command="{name}" panel_widget="command_button"'
    text += " Client and server must be one process."
    return f"<Property {told}><Documentation>{text}</Documentation></Property>"


def _sentence(option: str, more: str = "") -> str:
    what = _DECLARED[option].what
    return f"{what[:1].upper()}{what[1:]}{more}."


def _number(option: str, more: str = "") -> str:
    """Return the columns of an option that is a number; 0 stands for ``None``."""
    default = _DECLARED[option].default
    number: Any = _DECLARED[option].check
    ends = f"{number.low:g}..{number.high:g}" if math.isfinite(number.high) else "0.."
    kind = "Int" if isinstance(default, int) else "Double"
    return f"{kind} {default or 0:g}  {ends}  {_sentence(option, more)}"


#: Camera properties of our filters and of ParaView's render views alike.
_CAMERA = """
CameraPosition!            Double 0 0 1  -
CameraFocalPoint!          Double 0 0 0  -
CameraViewUp!              Double 0 1 0  -
CameraViewAngle!           Double 30     -
CameraParallelProjection!  Int 0         bool
CameraParallelScale!       Double 1      -
"""
CAMERA_PROPERTIES = re.findall("Camera[A-Z][a-zA-Z]+", _CAMERA)


def view_xml(default: str, size: str, least: int, note: str = "") -> str:
    """Return the properties of a view and of the device, which two filters have.

    ``default``: the view where no camera is given; ``size``: the default window, and the ``least``.
    """
    active = "Copy the active render view's camera and size into these properties."
    return properties(f"""
WindowSize:SetSize  Int {size}  {least}..  Width and height in pixels. {note}
View       Int 0     ({default}|Camera)  Where the eye is before it is turned.
{_CAMERA.strip()}
Azimuth    Double 0  -180..180  Turns the view about its up direction through the focal point, \
degrees.
Elevation  Double 0  -90..90    Lifts the view after turning it, degrees.
{_button("TakeActiveView", "Take the active view", active)}
Device:SetDeviceName!  String  -  OpenCL device; empty: the best one. `pyvista-vdi devices` lists \
them.
""")


def _function(name: str, what: str, group: str) -> str:
    """Return what a volume, or values, are classified by."""
    text = f"{what} of scalars; by default those that ParaView has for the array."
    return (
        f'<ProxyProperty name="{name}" command="Set{name}"><ProxyGroupDomain name="groups">'
        f'<Group name="{group}" /></ProxyGroupDomain><Documentation>{text}</Documentation>'
        "</ProxyProperty>"
    )


FUNCTIONS_XML = (
    _function("ColorFunction", "Colours", "lookup_tables")
    + _function("OpacityFunction", "Opacities", "piecewise_functions")
    + properties(
        "ScalarOpacityUnitDistance:SetUnitDistance  Double 0  0..  Length over which the opacity "
        "function's opacities are reached, in the volume's units. 0: the diagonal over the mean "
        "number of points along an edge, or, of a VDI that stores scalars, of its volume's."
    )
)

_ARRAYS = (
    '<StringVectorProperty name="Scalars" command="SetArray" number_of_elements="5" '
    'element_types="0 0 0 0 2" animateable="0">'
    '<ArrayListDomain name="array_list" attribute_type="Scalars"><RequiredProperties>'
    '<Property name="Input" function="Input" /></RequiredProperties></ArrayListDomain>'
    "<Documentation>The array that is classified.</Documentation></StringVectorProperty>"
)
SOURCE_XML = properties(f"""
{_ARRAYS}
{FUNCTIONS_XML}
InterpolationType:SetInterpolation  Int 1  (Nearest|Linear)
Shade           Int 0     bool  Light the volume by one headlight at the generating view.
Ambient!        Double 0  -
Diffuse!        Double 1  -
Specular!       Double 0  -
SpecularPower!  Double 1  -
AmbientOcclusion:SetOcclusion  Int 0  bool  {_sentence("ambient_occlusion")}
MaxSupersegments         {_number("max_supersegments")}
SampleDistance:SetStep!  {_number("sample_distance", ". 0: the default")}
Tolerance!               {_number("tolerance")}
ViewCone!                {_number("view_cone")}
Coverage  String view  [view|bounds]  view: the VDI covers the window. bounds: the whole volume, \
whatever part of it the window shows.
""")

#: The times that an algorithm announces, for ParaView's animation.
TIMES_XML = """
<DoubleVectorProperty name="TimestepValues" repeatable="1" information_only="1"
                      si_class="vtkSITimeStepsProperty">
  <TimeStepsInformationHelper />
</DoubleVectorProperty>
"""
