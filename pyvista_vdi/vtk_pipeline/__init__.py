"""VDIs in VTK pipelines: source, mapper, actor and converters; the only importers of vtk."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActor as VDIActor
    from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapper as VDIMapper
    from pyvista_vdi.vtk_pipeline.drawing.window import VDIStatus as VDIStatus
    from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image as vdi_from_image
    from pyvista_vdi.vtk_pipeline.filters.convert import vdi_to_image as vdi_to_image
    from pyvista_vdi.vtk_pipeline.filters.convert import volume_from_vtk as volume_from_vtk
    from pyvista_vdi.vtk_pipeline.filters.files import VDIReader as VDIReader
    from pyvista_vdi.vtk_pipeline.filters.files import VDIWriter as VDIWriter
    from pyvista_vdi.vtk_pipeline.filters.image import VDIToImage as VDIToImage
    from pyvista_vdi.vtk_pipeline.filters.properties import (
        transfer_function_from_property as transfer_function_from_property,
    )
    from pyvista_vdi.vtk_pipeline.filters.source import VDISource as VDISource

#: Public name to module. Loaded when asked for: converters must not load VTK's OpenGL modules.
_MODULES = {
    "VDIActor": "drawing.actor",
    "VDIMapper": "drawing.mapper",
    "VDIReader": "filters.files",
    "VDISource": "filters.source",
    "VDIStatus": "drawing.window",
    "VDIToImage": "filters.image",
    "VDIWriter": "filters.files",
    "transfer_function_from_property": "filters.properties",
    "vdi_from_image": "filters.convert",
    "vdi_to_image": "filters.convert",
    "volume_from_vtk": "filters.convert",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
