"""ParaView's plugin: VDI Source, VDI To Image, a reader and a writer.

ParaView loads this file by its path (``pyvista-vdi paraview`` prints it): Tools > Manage
Plugins, ``paraview.simple.LoadPlugin`` or ``PV_PLUGIN_PATH``. Nothing else imports it. It declares
ParaView's properties over VTK algorithms that know nothing of ParaView.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy
from vtkmodules.vtkCommonDataModel import vtkDataObject
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
from pyvista_vdi.extensions.paraview.parts.client import (
    Client,
    manager_of_proxies,
    require_one_process,
    say,
)
from pyvista_vdi.extensions.paraview.parts.functions import Functions, Looking
from pyvista_vdi.extensions.paraview.parts.properties import (
    FUNCTIONS_XML,
    SOURCE_XML,
    TIMES_XML,
    properties,
    view_xml,
)
from pyvista_vdi.model.standard_cases import ELEVATION, filling_camera
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.vtk_pipeline.filters.algorithm import accessors, watch
from pyvista_vdi.vtk_pipeline.filters.convert import require_image, scalars_of

require_one_process(vtkMultiProcessController.GetGlobalController())

#: What ParaView's plugin manager shows.
paraview_plugin_name = "VDI"
paraview_plugin_version = __version__


def _of_looks(setter: str) -> Any:
    """Return a method that sets what a setter of the source's volume property sets."""

    def set_it(self: Any, value: Any) -> None:
        getattr(self.looks, setter)(value)
        self.Modified()

    return set_it


@smproxy.filter(name="VDISource", label="VDI Source", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" />')
@smproperty.xml(SOURCE_XML + view_xml("The volume fills the window", "1280 720", 1))
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDISourceFilter(Looking, Functions, vtk_pipeline.VDISource):
    """Generates a volume's VDI, by default of a view and with a ramp of its own.

    See :class:`pyvista_vdi.VDISource`.
    """

    SetAzimuth, GetAzimuth = accessors("azimuth", "by how much the view is turned, degrees", 0.0)
    SetElevation, GetElevation = accessors("elevation", "by how much it is lifted, degrees", 0.0)
    SetInterpolation = _of_looks("SetInterpolationType")
    SetShade = _of_looks("SetShade")
    SetAmbient = _of_looks("SetAmbient")
    SetDiffuse = _of_looks("SetDiffuse")
    SetSpecular = _of_looks("SetSpecular")
    SetSpecularPower = _of_looks("SetSpecularPower")

    def SetArray(self, index: int, port: int, connection: int, kind: int, name: str) -> None:
        """Choose the array, as ``SetInputArrayToProcess``: kind 0 is at points, 1 at cells."""
        self.SetScalars(name or None, "cell" if kind == 1 else "point")

    def SetOcclusion(self, occluded: int) -> None:
        """Choose whether what is hidden from the light around it is darkened."""
        self.SetAmbientOcclusion(bool(occluded))

    def SetStep(self, distance: float) -> None:
        """Set the length of a step along a ray; 0 is the default one."""
        self.SetSampleDistance(distance or None)

    def _execute(self, inputs: Any, outputs: Any) -> None:
        # A script may connect what ParaView's menus do not offer
        image = require_image(vtkDataObject.GetData(inputs[0], 0))
        view, turn, lift = self._given_camera(), self.GetAzimuth(), self.GetElevation()
        if view is None:
            size = self.GetWindowSize() or (1, 1)
            view = filling_camera(image.GetBounds(), size, turn, ELEVATION + lift)
        else:
            view = view.azimuth(turn).elevation(lift)
        self.SetCamera(view)
        # Bring the volume property up to date with what is given, and with defaults
        ends = scalars_of(image, *self.GetScalars()).GetFiniteRange()
        volume = self._read(image)
        self.take_looks(volume.name, ends, volume.default_unit_distance)
        self.SetVolumeProperty(self.looks)
        super()._execute(inputs, outputs)


@smproxy.filter(name="VDIToImage", label="VDI To Image", support_reload=False)
@smhint.xml('<ShowInMenu category="VDI" /><RepresentationType view="RenderView" type="Slice" />')
@smproperty.xml(
    view_xml("The VDI's own", "0 0", 0, "0: that of the VDI's pictures.") + FUNCTIONS_XML
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIToImageFilter(Looking, Functions, vtk_pipeline.VDIToImage):
    """A picture of a VDI: :class:`pyvista_vdi.vtk_pipeline.VDIToImage`."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: set[str] = set()
        self._watching = False

    def _execute(self, inputs: Any, outputs: Any) -> None:
        self.SetCamera(self._given_camera())
        super()._execute(inputs, outputs)
        if not self._watching and (manager := manager_of_proxies()):
            watch(manager, self, VDIToImageFilter._show_as_it_is, "RegisterEvent")
            self._watching = True

    def _classified(self, vdi: VDI | DeferredVDI) -> VDI:
        """Classify values by the given functions, or else by those of the array, in one process."""
        if isinstance(vdi, DeferredVDI):
            name = str(vdi.metadata.get("scalars") or "values")
            self.take_looks(name, vdi.value_range, vdi.unit_distance)
            self.SetVolumeProperty(self.looks)
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


@smproxy.reader(
    name="VDIReader",
    label="VDI Reader",
    extensions="vdi exr vdis",
    file_description="Volumetric Depth Image",
    support_reload=False,
)
@smproperty.xml(
    """<StringVectorProperty name="FileName" command="SetFileName" number_of_elements="1"
                             animateable="0" panel_visibility="never">
         <FileListDomain name="files" />
       </StringVectorProperty>"""
    + TIMES_XML
)
class VDIFileReader(vtk_pipeline.VDIReader):
    """A VDI, or the steps of a series: :class:`pyvista_vdi.vtk_pipeline.VDIReader`."""


@smproxy.writer(
    name="VDIWriter",
    label="VDI Writer",
    extensions="vdi exr",
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
usual: as of the VDI. An .exr has float32.
Compression:SetCompressionName!  String usual  [usual|lz4|zstd|deflate|none]  usual: lz4 of .vdi \
(zstd is smaller); an .exr has no other.
""")
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class VDIFileWriter(vtk_pipeline.VDIWriter):
    """Writes a VDI to a file: :class:`pyvista_vdi.vtk_pipeline.VDIWriter`."""

    def SetPrecisionName(self, name: str) -> None:
        """Set what a supersegment takes; "usual" is that of the VDI."""
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
